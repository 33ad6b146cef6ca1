"""The page of texts by its keys, on LabLinking's real files."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from textual import events

from rise_tui.editor.act_page import ActPage
from rise_tui.editor.dialogs import AskText, PickList, SaveDialog
from rise_tui.editor.model.text_rows import TextsView, languages_of
from rise_tui.editor.study import RunningHere
from rise_tui.editor.texts_page import TextsPage
from tests.tui.editor.conftest import Editor, OneSession, editor
from tests.tui.editor.texts_study import LABLINKING, MISSING, STALE, copy_lablinking

pytestmark = pytest.mark.slow


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)
    return copy_lablinking(tmp_path / "lab")


def page_of(it: Editor) -> TextsPage:
    page = it.screen.opened
    assert isinstance(page, TextsPage)
    return page


def german(it: Editor) -> str:
    return it.screen.study.draft.files["texts/de.toml"].decode()


async def open_at(it: Editor, id: str, language: str = "de") -> TextsPage:
    await it.open("texts", TextsView(language, id).name)
    page = page_of(it)
    await it.until(lambda: page.entry is not None and page.entry.text.id == id)
    return page


async def test_a_translation_is_changed_and_one_line_of_one_file_is_written(lab: Path) -> None:
    file = lab / "texts" / "de.toml"
    before = file.read_text("utf-8")
    async with editor(lab) as it:
        page, was = await open_at(it, "R_Praise/2/2"), german(it)
        for text in ("Eins", "Zwei"):
            await it.until(lambda: it.screen.page.is_typing) if text == "Zwei" else await it.press("enter")
            page.field.select_all()
            await it.type(text)
            await it.press("tab")  # takes it and goes on
            await it.until(lambda text=text: f'"{text}"' in german(it))  # type: ignore[misc]
        await it.until(lambda: it.screen.page.is_typing)
        assert page.entry is not None and page.entry.text.id == MISSING and page.field.text == ""
        await it.press("escape")
        assert not it.screen.page.is_typing
        await it.press("ctrl+u", "ctrl+u")
        await it.until(lambda: german(it) == was)
        page = await open_at(it, "R_Praise/2/2")
        await it.press("enter", "end", *["backspace"] * 12)
        await it.type("Prima")
        await it.press("enter")
        await it.until(lambda: "Prima" in german(it))
        assert page.rows.has_focus and "Prima" in page.rows.text and "1 change unsaved" in it.screen.top.text
        await it.press("ctrl+o")
        await it.shows(SaveDialog)
        await it.press("enter")
        await it.until(lambda: file.read_text("utf-8") != before)
        now = file.read_text("utf-8").splitlines()
        differ = [(was, is_now) for was, is_now in zip(before.splitlines(), now, strict=True) if was != is_now]
        assert differ == [('"2/2" = { text = "Gut gemacht!", of = "Well done!" }',
                           '"2/2" = { text = "Prima", of = "Well done!" }')]  # fmt: skip
        file.write_text(file.read_text("utf-8").replace("Sehr gut!", "Hervorragend!"), "utf-8")
        it.screen.check_disk_changes()
        await it.until(lambda: "Hervorragend!" in page.rows.text, "what somebody else writes is taken in")


async def test_the_original_is_changed_and_what_lacks_something_is_shown_and_taken_away(lab: Path) -> None:
    async with editor(lab) as it:
        files = it.screen.study.draft.files
        page = await open_at(it, "R_Praise/2/2")
        await it.press("tab", "enter")
        assert page.field.text == "Well done!"
        await it.type(" Really.")
        await it.until(lambda: "the text will have changed since its translation into de" in page.remarks.text)
        await it.press("enter")
        await it.until(lambda: "Well done! Really." in it.draft_text)
        assert page.entry is not None and page.entry.state == "stale"
        assert "It was “Well done!”" in page.detail.text
        await it.take_back(files)
        page = await open_at(it, STALE)
        await it.press("left", "delete")
        assert "del removes only translations here" in it.notice
        await it.press("right", "delete")
        await it.until(lambda: "Sehr gut!" not in german(it))
        assert page.entry is not None and page.entry.state == "missing"
        await it.take_back(files)
        page = await open_at(it, STALE)
        await it.press("m")
        assert [page.rows.row_at(at).id for at in range(page.rows.count)] == [STALE, MISSING]
        assert "s still right" in it.screen.hints.text
        await it.press("s")
        await it.until(lambda: page.rows.count == 1)
        assert 'text = "Sehr gut!", of = "Very well done!"' in german(it)
        assert page.entry is not None and page.entry.text.id == MISSING
        await it.press("s")
        assert f"{MISSING} in de is not of an earlier text" in it.notice
        await it.press("m")
        assert page.rows.count == len(it.screen.study.draft.checked.texts)
        assert page.entry.text.id == MISSING, "the cursor stays on its text"
        every = page.rows.count
        await it.press("slash")
        await it.type("klar genug")
        await it.until(lambda: page.rows.count == 1)
        await it.press("enter")
        assert page.rows.has_focus and page.entry is not None and page.entry.text.id == "R_AskUnderstood/2/2"
        await it.press("escape")
        assert page.rows.count == every and it.screen.opened is page


async def test_what_is_wrong_is_said_while_it_is_typed_what_is_pasted_is_one_line_and_stop_works(lab: Path) -> None:
    sessions = OneSession(RunningHere("/tmp/a.sock", "P07"))
    async with editor(lab, sessions=sessions) as it:
        it.screen.check_disk_changes()
        await it.until(lambda: "a session with P07 runs" in it.screen.banner.text)
        page = await open_at(it, MISSING)
        await it.press("enter")
        await it.type("{persn}")
        await it.until(lambda: "✗ the translation has {persn}" in page.remarks.text)
        assert "✓ no errors" in it.screen.top.text, "typing changes nothing"
        await it.press("f9")
        await it.until(lambda: sessions.stopped == 1)
        assert it.screen.page.is_typing
        await it.press("escape")
        assert "persn" not in it.draft_text
        await it.press("enter")
        page.field.post_message(events.Paste("Das sieht\r\ntoll\taus.\n\x1b"))
        await it.until(lambda: "toll" in page.field.text)
        await it.press("enter")
        await it.until(lambda: '"2/4" = { text = "Das sieht toll aus. ·"' in german(it))


async def test_j_opens_the_act_at_its_action_and_a_finding_leads_to_its_text(lab: Path) -> None:
    async with editor(lab) as it:
        await it.press("f")
        await it.shows(PickList)
        await it.type("changed since")
        await it.press("enter")
        await it.until(lambda: isinstance(it.screen.opened, TextsPage) and page_of(it).entry is not None)
        assert page_of(it).entry.text.id == STALE  # type: ignore[union-attr]
        await open_at(it, "R_Apology/5")
        await it.press("j")
        await it.until(lambda: isinstance(it.screen.opened, ActPage))
        act = it.screen.opened
        assert isinstance(act, ActPage)
        await it.until(lambda: act.action is not None)
        assert (act.shown_name, act.actions.current_id) == ("R_Apology", "5")
        await it.press("escape")
        await it.until(lambda: isinstance(it.screen.opened, TextsPage))
        await it.until(lambda: page_of(it).entry is not None)
        assert page_of(it).entry.text.id == "R_Apology/5"  # type: ignore[union-attr]
        await it.press("j")
        await it.until(lambda: isinstance(it.screen.opened, ActPage))
        await it.press("f2")
        await it.until(lambda: it.screen.opened is None)
        await it.pilot.resize_terminal(120, 40)
        await open_at(it, STALE)
        await it.until(lambda: page_of(it).size.width == 120, "the list of the study gives its room")
        await it.press("escape")
        await it.until(lambda: it.screen.opened is None and it.screen.home.display)


async def test_a_language_is_added_and_left_and_right_go_through_all(lab: Path) -> None:
    async with editor(lab) as it:
        page = await open_at(it, STALE)
        await it.press("a")
        await it.shows(AskText)
        await it.type("french")
        await it.press("enter")
        await it.until(lambda: "write fr" in it.notice)
        await it.press("L")
        await it.shows(PickList)
        await it.type("fr")
        await it.press("enter")
        await it.until(lambda: page.view.language == "fr")
        assert languages_of(it.screen.study.draft) == ("de", "fr")
        assert page.entry is not None and (page.entry.text.id, page.entry.state) == (STALE, "missing")
        assert "rise-tui --config lab --language fr; refused now: 72" in page.detail.text
        seen = []
        for key in ("left", "left", "left", "right", "right", "right"):
            await it.press(key)
            seen.append((page.column, page.view.language))
        assert seen == [(1, "de"), (0, "de"), (0, "de"), (1, "de"), (1, "fr"), (1, "fr")]
        await it.press("enter")
        await it.type("Bravo !")
        await it.press("enter")
        await it.until(lambda: "texts/fr.toml" in it.screen.study.draft.changed_files)
        await it.press("ctrl+u", "ctrl+u")
        await it.until(lambda: languages_of(it.screen.study.draft) == ("de",))
        assert not it.screen.study.draft.changed_files and page.view.language == "de"


async def test_with_the_first_language_it_is_asked_in_which_the_acts_are(study: Path) -> None:
    async with editor(study) as it:
        await it.open("texts")
        page = page_of(it)
        assert "in no other language: a adds one" in page.head.text and page.column == 0
        await it.press("tab")
        assert "a adds another" in it.notice
        await it.press("a")
        await it.shows(AskText)
        await it.type("de")
        await it.press("enter")
        await it.until(lambda: "In which language are the acts?" in _title(it))
        await it.press("enter")
        await it.until(lambda: page.view.language == "de")
        draft = it.screen.study.draft
        assert draft.checked.scenario is not None and draft.checked.scenario.language == "en"
        assert draft.checked.scenario.languages == ("de",) and len(draft.changes) == 1


def _title(it: Editor) -> str:
    asked = it.pilot.app.screen
    return asked._title if isinstance(asked, AskText) else ""


async def test_a_long_text_is_read_whole(lab: Path) -> None:
    async with editor(lab, (80, 24)) as it:
        page = await open_at(it, MISSING)
        words = [f"Wort{number}" for number in range(400)]
        await it.press("enter")
        page.field.post_message(events.Paste(" ".join(words)))
        await it.until(lambda: "Wort399" in page.field.text)
        await it.press("enter")
        await it.until(lambda: "Wort399" in german(it))
        for size in ((80, 24), (120, 40)):
            await it.pilot.resize_terminal(*size)
            await it.press("home")
            page = await open_at(it, MISSING)
            seen: set[str] = set()
            for _ in range(30):
                await it.pilot.pause()
                first = page.detail.scroll_offset.y
                lines = page.detail.text.splitlines()[first : first + page.detail.size.height]
                seen |= {word for line in lines for word in line.split()}
                assert page.rows.size.height >= 3, "the list stays in view"
                if set(words) <= seen:
                    break
                await it.press("space")
            assert set(words) <= seen


async def test_a_study_that_says_nothing_and_one_that_cannot_be_read(tmp_path: Path, study: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / "scenario.toml").write_text('title = "x"\n')
    async with editor(empty) as it:
        await it.open("texts")
        assert "this study has no texts yet" in page_of(it).parting.text
        await it.press("enter", "s", "j", "m", "delete", "tab", "right", "left", "space")
        assert it.screen.opened is not None
    shutil.copytree(LABLINKING, tmp_path / "broken")
    (tmp_path / "broken" / "texts" / "de.toml").write_text("[R_Yes\n")
    async with editor(tmp_path / "broken") as it:
        await it.open("texts", TextsView("de", "R_Yes/2/1").name)
        await it.press("enter")
        await it.type("x")
        await it.press("enter")
        await it.until(lambda: "texts/de.toml cannot be read, so it is not changed" in it.notice)
