"""What stands beside the own changes, by its keys: proposed changes, two people at one sentence, a merge of git."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from pathlib import Path

import pytest

from rise_engine.cli.edit_file import read_edits
from rise_engine.edit.drafts import DraftChange
from rise_engine.edit.proposals import ProposalFiles
from rise_engine.edit.workspace import Workspace
from rise_engine.scenario import load
from rise_tui.editing.conflict_page import ConflictPage
from rise_tui.editing.data_pages import SettingsPage
from rise_tui.editing.save_dialog import SaveDialog
from rise_tui.editing.waiting_page import WaitingPage
from rise_tui.rendering.text import plain_text
from rise_tui.screens.dialog import Dialog
from rise_tui.widgets.row_list import RowList
from tests.console.editing.conftest import Editor, editor

SIZES = [(80, 24), (120, 40)]
SPEECH = "acts/greeting.xml"
OLD, MINE, THEIRS = "Hello! How nice that you are here.", "Hello! Welcome.", "Hey, you are here!"
EDITS = """[
  {"edit": "set_parameter", "act": "R_Introduction", "action": "1", "parameter": "message", "value": "I am Floka."},
  {"edit": "add_act", "name": "R_Bye", "text": "Bye!"},
  {"edit": "add_action", "act": "R_Bye", "type": "Speech", "parameters": {"message": "See you."}},
  {"edit": "rename", "kind": "act", "old": "R_Nod", "new": "R_Yes"}
]"""


def propose(folder: Path, text: str = EDITS) -> None:
    study = Workspace(folder)
    _, changes, refused = study.foresee_each(*read_edits(text, "edits.json"))
    study.close()
    assert refused == ()
    ProposalFiles(folder).propose([DraftChange(each.edits, each.says) for each in changes])


def page(it: Editor) -> WaitingPage:
    found = it.screen.opened
    assert isinstance(found, WaitingPage)
    return found


def text_of(rows: RowList) -> str:
    return "\n".join(plain_text(rows.row_at(number).line) for number in range(rows.count))


async def open_page(it: Editor) -> None:
    await it.press("p")
    await it.until(lambda: isinstance(it.screen.opened, WaitingPage) and page(it).rows.current_id)


def write(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")


# --- proposals ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", SIZES)
async def test_proposed_changes_are_shown_accepted_and_refused_one_by_one(study: Path, size: tuple[int, int]) -> None:
    propose(study)
    before = (study / SPEECH).read_bytes()
    async with editor(study, size) as it:
        await it.until(lambda: "4 changes are proposed: p shows" in it.notice)
        assert "4 wait (p)" in it.screen.top.text
        await open_page(it)
        assert "now         │ <message>My name is Floka" in text_of(page(it).beside)
        assert "proposed    │ <message>I am Floka.</message>" in text_of(page(it).beside)
        assert "✗ R_Bye gets the action 2" in text_of(page(it).rows)

        await it.press("down", "down", "enter")
        await it.until(lambda: "it cannot be made now: there is no act `R_Bye`" in it.notice)
        await it.press("up", "space")
        await it.until(lambda: "1 change unsaved" in it.screen.top.text)
        assert "✗" not in text_of(page(it).rows)
        await it.press("enter")  # the cursor has gone to the next, which can be made now
        await it.until(lambda: "2 changes unsaved" in it.screen.top.text)
        await it.press("home", "delete")
        await it.until(lambda: "GIVEN UP" in text_of(page(it).rows))
        assert page(it).hints["edit.open"] == "accept", "the cursor does not follow what was refused"
        assert "1 waits (p)" in it.screen.top.text

        await it.press("ctrl+u")
        await it.until(lambda: "2 wait (p)" in it.screen.top.text)
        assert "See you." in text_of(page(it).rows), "what is taken back waits again"
        await it.press("ctrl+r", "ctrl+o")
        await it.until(lambda: isinstance(it.pilot.app.screen, SaveDialog))
        await it.press("enter")
        await it.until(lambda: "saved: acts/signals.xml" in it.notice)
    scenario = load(study).scenario
    assert scenario is not None
    assert len(scenario.acts["R_Bye"].actions) == 2
    assert (study / SPEECH).read_bytes() == before, "what was refused is not written"
    async with editor(study) as again:
        await again.until(lambda: "1 change is proposed" in again.notice)


async def test_what_is_refused_can_still_be_accepted_and_goes_back_to_the_list(study: Path) -> None:
    propose(study)
    async with editor(study) as it:
        await open_page(it)
        await it.press("end", "delete")
        await it.until(lambda: "refused; it can still be made" in it.notice)
        await it.press("end")
        assert page(it).hints["edit.open"] == "make it after all"
        await it.press("delete")
        await it.until(lambda: "it waits again" in it.notice)
        assert "GIVEN UP" not in text_of(page(it).rows)
        await it.press("end", "delete", "end", "enter")
        await it.until(lambda: "R_Yes" in it.draft_text)
        for _ in range(3):
            await it.press("home", "delete")
            await it.pilot.pause(0.05)
        await it.until(lambda: "everything is decided" in page(it).head.text)
        await it.press("escape")
        await it.until(lambda: it.screen.opened is None)


@pytest.mark.slow
async def test_a_proposal_is_seen_while_the_editor_is_open(study: Path) -> None:
    async with editor(study) as it:
        await it.press("p")
        assert "nothing waits" in it.notice
        engine = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "rise_engine", "edit", str(study), "-", "--propose", stdin=subprocess.PIPE
        )
        await engine.communicate(EDITS.encode())
        assert engine.returncode == 0
        it.screen.look_outside()
        await it.until(lambda: "4 changes are proposed: p shows" in it.notice)


# --- two people -----------------------------------------------------------------------------------------------------


async def change_the_sentence(it: Editor) -> None:
    """As somebody types it who is not the last to do so."""
    edits = read_edits(
        f'{{"edit": "set_parameter", "act": "R_Greeting", "action": "2", "parameter": "message", "value": "{MINE}"}}',
        "edits.json",
    )
    it.screen.make(*edits)
    await it.until(lambda: MINE in it.draft_text)
    write(it.folder / SPEECH, OLD, THEIRS)
    it.screen.look_outside()
    await it.until(lambda: isinstance(it.pilot.app.screen, Dialog))
    dialog = it.pilot.app.screen
    assert isinstance(dialog, Dialog)
    assert "set aside, and nothing is lost" in "\n".join(dialog._lines)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("choice", ["enter", "delete"])
async def test_two_people_change_one_sentence_and_one_chooses(study: Path, choice: str, size: tuple[int, int]) -> None:
    async with editor(study, size) as it:
        await change_the_sentence(it)
        assert THEIRS in it.draft_text and MINE not in it.draft_text
        await it.press("enter")
        await it.until(lambda: isinstance(it.screen.opened, WaitingPage) and page(it).rows.current_id)
        beside = text_of(page(it).beside)
        assert f"the other's │ <Speech><message>{THEIRS}</message></Speech>" in beside
        assert f"yours       │ <Speech><message>{MINE}</message></Speech>" in beside
        await it.press(choice)
        if choice == "enter":
            await it.until(lambda: MINE in it.draft_text)
            await it.press("ctrl+o")
            await it.until(lambda: isinstance(it.pilot.app.screen, SaveDialog))
            await it.press("enter")
            await it.until(lambda: "saved" in it.notice)
            await it.press("ctrl+u")  # and the other's is not lost either
            await it.until(lambda: THEIRS in it.draft_text)
            await it.press("ctrl+r")
            await it.until(lambda: MINE in it.draft_text)
        else:
            await it.until(lambda: "the other's stays; yours can still be made" in it.notice)
            assert "wait" not in it.screen.top.text
    text = (study / SPEECH).read_text("utf-8")
    assert (MINE in text, THEIRS in text) == ((True, False) if choice == "enter" else (False, True))


async def test_later_it_is_named_when_saving_and_offered_the_next_time(study: Path) -> None:
    async with editor(study) as it:
        await change_the_sentence(it)
        await it.press("escape")
        await it.until(lambda: "1 change of yours was set aside: p shows" in it.notice)
        (edit,) = read_edits('{"edit": "set_start_value", "key": "person_y", "value": 0.5}', "edits.json")
        it.screen.make(edit)
        await it.until(lambda: "1 change unsaved" in it.screen.top.text)
        await it.press("ctrl+o")
        await it.until(lambda: isinstance(it.pilot.app.screen, SaveDialog))
        dialog = it.pilot.app.screen
        assert isinstance(dialog, SaveDialog)
        assert "▲ set aside, and not saved with these: R_Greeting 2/1 says" in text_of(dialog.list)
        await it.press("enter")
        await it.until(lambda: "saved: memory.json" in it.notice)
    async with editor(study) as again:
        await again.until(lambda: isinstance(again.pilot.app.screen, Dialog))
        await again.press("t")
        await again.until(lambda: [each.waiting.origin for each in again.screen.study.draft.waiting] == ["yours"])


# --- a merge --------------------------------------------------------------------------------------------------------


def conflict(yours: str, theirs: str) -> str:
    return f"<<<<<<< HEAD\n{yours}\n=======\n{theirs}\n>>>>>>> anna\n"


@pytest.mark.parametrize("size", SIZES)
async def test_both_versions_of_a_merge_are_shown_and_chosen_from(study: Path, size: tuple[int, int]) -> None:
    before = (study / SPEECH).read_text("utf-8")
    lines = before.splitlines(keepends=True)
    first = next(number for number, line in enumerate(lines) if OLD in line)
    second = next(number for number, line in enumerate(lines) if "My name is Floka" in line)
    mine, theirs = lines[first].rstrip("\n"), lines[first].rstrip("\n").replace(OLD, THEIRS)
    lines[second] = conflict(lines[second].rstrip("\n"), "    <message>I am another.</message>")
    lines[first] = conflict(mine, theirs)
    (study / SPEECH).write_text("".join(lines), "utf-8")
    async with editor(study, size) as it:
        assert "1 error" in it.screen.top.text
        assert f"✗ {SPEECH}: 2 to choose" in text_of(it.screen.home.rows)
        await it.press("end", "enter")
        await it.until(lambda: isinstance(it.screen.opened, ConflictPage))
        opened = it.screen.opened
        assert isinstance(opened, ConflictPage)
        await it.until(lambda: opened.rows.current_id)
        shown = text_of(opened.rows)
        assert f"1 of 2: line {first + 1}, in the act R_Greeting" in shown
        assert "2 of 2: line" in shown and ", in the act R_Introduction" in shown
        whole = " ".join(shown.replace("│", "").split())
        assert mine.strip() in whole and theirs.strip() in whole
        assert opened.place is not None and opened.place.line == first + 1
        await it.press("down", "enter")
        await it.until(lambda: "the other's (anna) is taken" in it.notice)
        await it.until(lambda: "1 of 1" in text_of(opened.rows))
        await it.press("enter")  # the cursor stands on yours of the next
        await it.until(lambda: it.screen.opened is None)
        assert "yours (HEAD) is kept" in it.notice
        assert "no errors" in it.screen.top.text
        await it.press("ctrl+u")
        await it.until(lambda: "1 error" in it.screen.top.text)
        await it.press("ctrl+r")
        await it.until(lambda: "no errors" in it.screen.top.text)
        await it.press("ctrl+o")
        await it.until(lambda: isinstance(it.pilot.app.screen, SaveDialog))
        await it.press("enter")
        await it.until(lambda: f"saved: {SPEECH}" in it.notice)
    assert (study / SPEECH).read_text("utf-8") == before.replace(OLD, THEIRS)


async def test_a_finding_leads_to_the_two_versions(study: Path) -> None:
    text = (study / "memory.json").read_text("utf-8")
    (study / "memory.json").write_text(conflict(text.rstrip("\n"), "{}"), "utf-8")
    async with editor(study) as it:
        await it.press("f", "enter")
        await it.until(lambda: isinstance(it.screen.opened, ConflictPage))
        await it.press("end")
        await it.until(lambda: it.screen.page.hints)
        await it.press("up", "enter")
        await it.until(lambda: it.screen.opened is None)
    assert (study / "memory.json").read_text("utf-8").startswith("<<<<<<<"), "nothing is written before it is saved"


# --- the study of a folder above ------------------------------------------------------------------------------------


async def test_what_the_study_above_says_is_shown_and_not_changed(study: Path) -> None:
    above = study.parent / "study.toml"
    above.write_text(f"n = 24\nscenario = '{study.name}'\n[factors.f]\nlevels.yes.memory = {{ person_near = true }}\n")
    async with editor(study) as it:
        await it.open("settings")
        opened = it.screen.opened
        assert isinstance(opened, SettingsPage)
        rows = text_of(opened.form.rows)
        assert "study.toml above" in rows, rows
        opened.form.rows.action_edge(1)
        assert opened.place is not None and opened.place.file == str(above.resolve())
        await it.press("enter")
        assert not opened.is_typing
    async with editor(study) as again:
        (edit,) = read_edits('{"edit": "rename", "kind": "key", "old": "person_near", "new": "near"}', "edits.json")
        again.screen.make(edit)
        await again.until(lambda: "sets `person_near`, too; change it there by hand first" in again.notice)
