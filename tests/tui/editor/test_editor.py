"""The editor by its keys, on a study's real files."""

from __future__ import annotations

import difflib
from pathlib import Path

import pytest

from rise_engine.author.edit.edits import AddRule, AddStatement, CallForm, StatementAddress
from rise_tui.editor.act_page import ActPage
from rise_tui.editor.data_pages import DataPage, SettingsPage
from rise_tui.editor.dialogs import PickList, SaveDialog
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.rule_page import RulePage
from rise_tui.editor.study import RunningHere
from rise_tui.screens.dialog import Dialog
from tests.tui.editor.conftest import Editor, OneSession, editor


def changed_lines(before: str, after: str) -> list[str]:
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=0)
    return [line for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---")]


def act_page(it: Editor) -> ActPage:
    page = it.screen.opened
    assert isinstance(page, ActPage)
    return page


async def open_speech(it: Editor, act: str) -> None:
    """The page of an act, with the keys on the form of its first speech, on what is said."""
    await it.open("act", act)
    written = act_page(it).act
    assert written is not None
    speech = next(each for each in written.actions if each.calls[0].type == "Speech")
    act_page(it).actions.select(speech.id)
    act_page(it).draw()
    await it.press("tab")
    act_page(it).form.rows.select("0/message")


def contents(folder: Path) -> dict[Path, bytes]:
    return {each: each.read_bytes() for each in folder.rglob("*.*")}


async def welcome(it: Editor) -> None:
    """A change: one word more in what is said."""
    await open_speech(it, "R_Greeting")
    await it.press("enter", "end")
    await it.type(" Welcome.")
    await it.press("enter")
    await it.until(lambda: "Welcome." in it.draft_text)


async def save(it: Editor) -> None:
    await it.press("ctrl+o")
    await it.shows(SaveDialog)
    await it.press("enter")


@pytest.mark.slow
async def test_a_sentence_is_changed_by_keys_and_one_line_of_one_file_is_written(study: Path) -> None:
    file = study / "acts" / "greeting.xml"
    before = file.read_text()
    others = contents(study)
    async with editor(study) as it:
        await welcome(it)
        assert file.read_text() == before, "nothing is written before it is saved"
        assert "1 change unsaved" in it.screen.top.text
        await save(it)
        await it.until(lambda: file.read_text() != before)
        await it.until(lambda: "saved: acts/greeting.xml" in it.notice)
        assert len(changed_lines(before, file.read_text())) == 2
        assert {**contents(study), file: others[file]} == others
        await it.go_home()
        saved, memory = it.draft_text, lambda: it.screen.study.draft.checked.draft.memory
        await it.open("memory")
        await it.press("a")
        await it.type("score")
        await it.press("enter")
        await it.until(lambda: it.screen.page.is_typing)
        await it.type("7")
        await it.press("enter")
        await it.until(lambda: memory().get("score") == 7)
        await save(it)
        await it.until(lambda: not it.screen.study.draft.changed_files)
        await it.press("ctrl+u")  # also over a save
        await it.until(lambda: memory()["score"] == "")
        await it.press("ctrl+u")
        await it.until(lambda: it.draft_text == saved)
        assert "unsaved" in it.screen.top.text or "not saved" in it.screen.top.text
        await it.press("ctrl+r", "ctrl+r")
        await it.until(lambda: memory().get("score") == 7)


@pytest.mark.slow
async def test_what_is_wrong_is_said_while_it_is_typed_and_is_never_saved(study: Path) -> None:
    before = contents(study)
    async with editor(study) as it:
        draft = it.draft_text
        await open_speech(it, "R_Greeting")
        await it.press("enter")
        await it.type("zzz")
        await it.press("escape")
        assert not it.screen.page.is_typing
        await it.press("escape", "escape")
        await it.until(lambda: it.screen.opened is None)
        assert it.draft_text == draft, "escape leaves a field as it was"
        await open_speech(it, "R_Greeting")
        await it.press("enter", "end")
        await it.type(" {name")
        await it.until(lambda: "a `{` without its `}`" in act_page(it).form.text)
        assert "✓ no errors" in it.screen.top.text, "typing changes nothing"
        await it.press("enter")
        await it.until(lambda: "✗ 1 error" in it.screen.top.text)
        assert "acts/greeting.xml" in it.screen.findings.text
        await save(it)
        await it.until(lambda: it.pilot.app.screen is it.screen)
    assert contents(study) == before


@pytest.mark.slow
async def test_an_action_is_chosen_waits_for_others_and_is_taken_back(study: Path) -> None:
    async with editor(study) as it:
        before = it.screen.study.draft.files
        await it.open("act", "R_Greeting")
        page = act_page(it)
        assert page.act is not None
        ids, last = {each.id for each in page.act.actions}, page.act.actions[-1].id
        page.actions.select(last)
        page.draw()
        await it.press("a")
        await it.shows(PickList)
        await it.type("Wait")
        await it.press("enter")
        await it.until(lambda: page.act is not None and len(page.act.actions) == len(ids) + 1)
        new = next(each for each in page.act.actions if each.id not in ids)
        assert (new.calls[0].type, new.wait_for) == ("Wait", (last,))
        await it.until(lambda: page.is_typing, "its first value is asked for")
        await it.press("escape", "escape", "w")
        await it.shows(PickList)
        await it.press("enter", "ctrl+u")
        await it.until(lambda: it.screen.study.draft.files == before)
        await it.open("act", "R_Introduction")
        page = act_page(it)

        def waits() -> tuple[str, ...]:
            assert page.act is not None
            return next(each.wait_for for each in page.act.actions if each.id == "3")

        page.actions.select("3")
        page.draw()
        assert waits() == ("2",)
        await it.press("w")
        await it.shows(PickList)
        await it.press("space", "down", "space", "enter")  # taken in and out
        await it.until(lambda: waits() == ("1",))
        await it.open("act", "R_Smile")
        await it.press("a")
        await it.shows(PickList)
        await it.type("LookAt")
        await it.press("enter")
        await it.until(lambda: act_page(it).is_typing)
        await it.type("2")  # replaces what it began with
        await it.press("tab")
        await it.until(lambda: "<pointx>2</pointx>" in it.draft_text)
        await it.type("3")
        await it.press("enter")
        await it.until(lambda: "<pointy>3</pointy>" in it.draft_text)
        await it.go_home()
        await it.press("a")
        await it.type("R_Wave")
        await it.press("enter")
        await it.until(lambda: isinstance(it.screen.opened, ActPage))
        await it.press("escape")
        assert it.screen.home.current == ("act", "R_Wave"), "the cursor is on the act that was made"
        choices = [FieldChoice("SocialExpression", "SocialExpression"), FieldChoice("Speech", "Speech")]
        found: list[str] = []
        it.screen.choose("Which?", choices, found.append)
        await it.shows(PickList)
        await it.type("Spe")
        await it.press("enter")
        await it.until(lambda: found == ["Speech"], "a name that begins so comes before one in whose words it stands")


@pytest.mark.slow
async def test_a_key_of_the_keyboard_is_made_changed_and_renamed(study: Path) -> None:
    async with editor(study) as it:
        await it.open("keys")
        page = it.screen.opened
        assert isinstance(page, DataPage)

        async def add(key: str, does: str) -> None:
            await it.press("a")
            await it.type(key)
            await it.press("enter")
            await it.shows(PickList)
            await it.type(does)
            await it.press("enter")
            await it.until(lambda: not isinstance(it.pilot.app.screen, PickList))

        await add("z", "wave now")
        await it.until(lambda: "write an act, a rule" in it.notice, "what is nothing is said")
        await add("z", "set person_x = 3")
        await it.until(lambda: 'set = "person_x = 3"' in it.draft_text)
        await add("7", "set person_name = 'Kim'")
        await it.until(lambda: "person_name = 'Kim'" in it.draft_text, "it goes before what only speaks of it")
        await add("0", "R_Greeting")
        await it.until(lambda: 'act = "R_Greeting"' in it.draft_text)
        await it.press("v")
        await it.type("hello")
        await it.press("enter")
        await it.until(lambda: 'label = "hello"' in it.draft_text)
        await it.press("r")
        await it.press("backspace")
        await it.type("k")
        await it.press("enter")
        await it.until(lambda: any(each.id == "k" for each in page.make_fields()))
        assert all(each.id != "0" for each in page.make_fields())


@pytest.mark.slow
async def test_how_an_act_is_treated_is_set_and_a_robot_is_chosen(study: Path) -> None:
    async with editor(study) as it:
        await it.send_together("slash", *"set", "enter", "enter")  # what else there is is found by its name
        await it.until(lambda: it.screen.opened is not None)
        page = it.screen.opened
        assert isinstance(page, SettingsPage)
        await it.press("a")
        await it.shows(PickList)
        await it.type("R_Greeting hold")
        await it.press("enter")
        await it.until(lambda: it.screen.study.draft.checked.scenario is not None)
        await it.until(lambda: it.screen.study.draft.checked.scenario.settings_of("R_Greeting").hold)
        page.go_to("scenario.toml\0robot")
        await it.press("enter")
        await it.shows(PickList)
        await it.type("nao")
        await it.press("enter")
        await it.until(lambda: it.screen.study.draft.checked.robot.name == "nao")
        await it.open("memory")
        await it.press("a")
        await it.type("read")  # letters are no commands while something is typed
        await it.press("enter")
        await it.until(lambda: "read" in it.screen.study.draft.checked.draft.memory)


@pytest.mark.slow
async def test_every_page_is_reached_by_keys_alone_and_left_again(study: Path) -> None:
    async with editor(study, (80, 24)) as it:
        rows = it.screen.home.rows
        for size in ((80, 24), (120, 40), (200, 50)):
            await it.pilot.resize_terminal(*size)
            for kind in ("memory", "keys", "settings", "tables", "act"):
                row = next(at for at in range(rows.count) if rows.row_at(at).id.startswith(f"{kind}\0"))
                while rows.cursor != row:
                    await it.press("down" if rows.cursor < row else "up")
                await it.press("enter")
                await it.until(lambda kind=kind: it.screen.opened is not None and kind == it.screen.opened.KIND)  # type: ignore[misc]
                assert it.screen.home.display is (size[0] >= 110)
                await it.press("escape")
                await it.until(lambda: it.screen.opened is None)
                assert rows.has_focus


@pytest.mark.slow
async def test_what_somebody_else_writes_is_taken_in_or_asked_about_and_own_changes_stay(study: Path) -> None:
    memory = study / "memory.json"
    async with editor(study) as it:
        await welcome(it)
        memory.write_text('{"from_outside": 1}')
        await it.until(lambda: "changed on the disk: read again" in it.notice)
        assert "from_outside" in it.draft_text
        assert "Welcome." in it.draft_text
        assert memory.read_text() == '{"from_outside": 1}'
        (file,) = it.screen.study.draft.changed_files
        for key in ("escape", "o"):
            text = (study / file).read_text() + f"<!-- theirs {key} -->"
            (study / file).write_text(text)
            it.screen.check_disk_changes()
            await it.shows(Dialog)
            assert "Welcome." in it.draft_text and "theirs" not in it.draft_text
            await it.press(key)
            await it.until(lambda: it.pilot.app.screen is it.screen)
            if key == "o":
                await it.until(lambda: "theirs" in it.draft_text and "Welcome." not in it.draft_text)
                it.screen.action_do("edit.undo")
            await it.until(lambda: "Welcome." in it.draft_text and "theirs" not in it.draft_text)
            assert (study / file).read_text() == text


@pytest.mark.slow
async def test_a_draft_that_was_not_saved_is_offered_again(study: Path) -> None:
    async with editor(study) as it:
        await welcome(it)
    async with editor(study) as again:
        await again.shows(Dialog)
        assert "Welcome." not in again.draft_text
        await again.press("t")
        await again.until(lambda: "Welcome." in again.draft_text)


@pytest.mark.slow
async def test_f9_stops_a_session_of_this_study_and_the_banner_says_that_one_runs(study: Path) -> None:
    sessions = OneSession(RunningHere("/tmp/a.sock", "P07"))
    async with editor(study, sessions=sessions) as it:
        it.screen.check_disk_changes()
        await it.until(lambda: "a session with P07 runs on its own copy" in it.screen.banner.text)
        assert "STOP" in it.screen.hints.text
        await it.open("act", "R_Greeting")
        await it.press("enter", "enter", "f9")
        await it.until(lambda: sessions.stopped == 1)
        await it.until(lambda: "STOPPED" in it.notice)
        await it.press("escape", "escape", "e")
        await it.until(lambda: "the stop key must work" in it.notice)


@pytest.mark.slow
async def test_keys_that_come_in_one_piece_go_to_what_the_one_before_opens(study: Path) -> None:
    async with editor(study) as it:
        rows = it.screen.home.rows
        await it.send_together("x", *"arc")
        assert it.pilot.app.screen is it.screen, "letters of a paste are no row of commands"
        await it.send_together("a", *"R_New")
        assert it.pilot.app.screen is not it.screen, "the first one counts"
        await it.press("escape")
        await it.send_together("slash", *"R_Introd", "enter", "enter")
        await it.until(lambda: it.screen.opened is not None)
        assert it.screen.opened is not None and it.screen.opened.shown_name == "R_Introduction"
        await it.press("escape")
        await it.send_together("a", *"R_Aa", "enter", "a", *"Speech", "enter", *"Welcome", "enter")
        await it.until(lambda: ">Welcome<" in it.draft_text)
        assert 'R_Aa"' in it.draft_text
        await it.go_home()
        before = rows.count
        await it.press("slash")
        await it.type("R_Greeting")
        await it.until(lambda: rows.count < before)
        assert "R_Greeting" in rows.text
        await it.press("enter", "escape")
        await it.until(lambda: rows.count == before)
        rows.select("act\0R_Greeting")
        await it.press("r", "end")
        await it.type("2")
        await it.press("enter")
        await it.until(lambda: it.screen.study.draft.outline.act("R_Greeting2"))
        assert not it.screen.study.draft.checked.errors, "a rename follows every use"
        assert it.screen.home.current == ("act", "R_Greeting2")
        assert "rules" in " ".join(it.screen.study.draft.changed_files)


async def test_a_way_out_of_a_state_that_starts_an_act_begins_with_its_end(study: Path) -> None:
    async with editor(study) as found:
        entry = StatementAddress("Course", "Start", "onEntry", path=(0,))
        nod = AddStatement(entry, CallForm("startCommunicationRobotAct", "R_Nod"))
        found.screen.make(AddRule("Course", "Start"), nod)
        await found.until(lambda: "Course" in found.draft_text)
        await found.open("rule", "Course")
        page = found.screen.opened
        assert isinstance(page, RulePage)
        await found.press("a")
        await found.until(lambda: page.editor.panel.is_open)
        form = page.editor.panel.form
        assert form is not None and (form.value("trigger"), form.value("act")) == ("ended", "R_Nod")
        await found.press("right")
        form = page.editor.panel.form
        assert form is not None and form.value("trigger") == "event", "the choices are a ring"


async def test_uses_lead_to_the_place_that_uses_it(study: Path) -> None:
    async with editor(study) as it:
        it.screen.home.rows.select("act\0R_Greeting")
        await it.press("u")
        used = await it.shows(PickList)
        assert "enter goes there" in str(used.query_one("#box").border_subtitle)
        await it.press("enter")
        await it.until(lambda: it.screen.opened is not None and it.screen.opened.KIND == "rule")
