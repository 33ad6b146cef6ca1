"""Changes that wait: set aside, as somebody has changed the same, or proposed. Whatever is chosen, nothing is lost."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.edit.drafts import DraftChange, state_folder
from rise_engine.edit.edits import AddAct, AddAction, AnyEdit, Rename, SetParameter, SetStartValue
from rise_engine.edit.plan import EditRefused
from rise_engine.edit.proposals import ProposalFiles
from rise_engine.edit.workspace import Workspace
from rise_engine.json_codec import decode
from tests.chance import examples
from tests.edit.samples import SCENARIOS

SPEECH = "acts/greeting.xml"
OLD = "My name is Floka, and I am a robot. Well, the head of one."
SAY = SetParameter("R_Introduction", "1", "message", "I am Floka.")
BYE = AddAct("R_Bye", "Bye!")
SEE_YOU = AddAction("R_Bye", "Speech", {"message": "See you."})
NAMED = Rename("act", "R_Nod", "R_Yes")


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    to = tmp_path / "greeting"
    shutil.copytree(SCENARIOS / "greeting", to)
    return to


def write(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")


def propose(folder: Path, *edits: AnyEdit) -> int:
    """What `rise-engine edit --propose` keeps; how many were new."""
    study = Workspace(folder)
    _, changes, refused = study.foresee_each(*edits)
    assert refused == ()
    study.close()
    return len(ProposalFiles(folder).propose([DraftChange(each.edits, each.says, each.noticed) for each in changes]))


def proposed_on_disk() -> list[DraftChange]:
    folder = state_folder()
    files = sorted(folder.glob("*.proposed-*.json")) if folder.is_dir() else []
    return [each for file in files for each in decode(file.read_text())["changes"]]


def in_their_way(folder: Path) -> Workspace:
    """A study in which an own change is set aside."""
    study = Workspace(folder)
    study.apply(SAY)
    write(folder / SPEECH, OLD, "Call me Floka.")
    outside = study.notice_outside()
    assert outside is not None
    assert [each.edits for each in outside.lost] == [(SAY,)]
    return study


# --- set aside ----------------------------------------------------------------------------------------------------


def test_both_versions_are_shown(folder: Path) -> None:
    study = in_their_way(folder)
    (outlook,) = study.outlooks
    assert (outlook.waiting.origin, outlook.why_not) == ("yours", "")
    assert outlook.says == ("R_Introduction 1 says “I am Floka.” (was “Call me Floka.”)",)
    changed = [line for line in outlook.diff.splitlines() if line[:1] in "+-" and line[:3] not in ("---", "+++")]
    assert [line.strip("+- ") for line in changed] == [
        "<message>Call me Floka.</message>", "<message>I am Floka.</message>"
    ]  # fmt: skip


def test_the_others_stays_and_the_own_one_can_still_be_made(folder: Path) -> None:
    study = in_their_way(folder)
    (waiting,) = study.waiting
    assert study.give_up(waiting.number).given_up
    assert study.set_aside == ()
    assert study.save().files == ()
    study.make_waiting(waiting.number)  # after all
    assert study.waiting == ()
    study.save()
    assert b"I am Floka." in (folder / SPEECH).read_bytes()
    study.undo()  # over the save: the other's is there again, and the own one waits
    assert b"Call me Floka." in study.files[SPEECH]
    assert [each.change.edits for each in study.waiting] == [(SAY,)]
    study.save()
    assert b"Call me Floka." in (folder / SPEECH).read_bytes()


def test_the_own_one_is_made_and_undo_gives_the_others(folder: Path) -> None:
    study = in_their_way(folder)
    study.make_waiting(study.waiting[0].number)
    assert b"I am Floka." in study.files[SPEECH]
    assert study.undo() is not None
    assert b"Call me Floka." in study.files[SPEECH]
    (waiting,) = study.waiting
    assert not waiting.given_up
    study.redo()
    assert study.waiting == ()


def test_a_killed_editor_still_has_what_was_set_aside_and_given_up(folder: Path) -> None:
    script = (
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from tests.edit.test_waiting import SMILE, in_their_way\n"
        "study = in_their_way(Path(sys.argv[1]))\n"
        "study.give_up(study.waiting[0].number)\n"
        "study.apply(SMILE)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    killed = subprocess.run([sys.executable, "-c", script, str(folder)], check=False)
    assert killed.returncode == -signal.SIGKILL
    study = Workspace(folder)
    draft = study.draft
    assert draft is not None
    study.take_up_draft(draft)
    assert [(each.change.edits, each.given_up) for each in study.waiting] == [((SAY,), True)]
    study.give_up(study.waiting[0].number, given_up=False)
    assert study.set_aside[0].edits == (SAY,)


SMILE = SetParameter("R_Smile", "1", "duration", "2500")


def test_what_was_given_up_goes_when_the_editor_is_closed(folder: Path) -> None:
    study = in_their_way(folder)
    study.give_up(study.waiting[0].number)
    study.close()
    assert Workspace(folder).draft is None


def test_what_is_set_aside_alone_is_a_draft_that_is_offered(folder: Path) -> None:
    in_their_way(folder).close()
    study = Workspace(folder)
    assert study.draft is not None
    assert study.draft.is_to_be_offered
    assert [each.edits for each in study.take_up_draft(study.draft).lost] == [(SAY,)]


def test_a_step_back_over_a_save_that_is_in_the_way_can_be_made(folder: Path) -> None:
    """What was saved and taken back is set aside as the files as they were, and not as the contrary."""
    study = Workspace(folder)
    study.apply(SAY)
    study.save()
    study.undo()
    write(folder / SPEECH, "I am Floka.", "Call me Floka.")
    outside = study.notice_outside()
    assert outside is not None
    (outlook,) = study.outlooks
    assert outlook.says[0].startswith(f"{SPEECH}, line ")
    assert study.waiting[0].change.says[0].startswith("taken back: R_Introduction 1 says “I am Floka.”")
    study.make_waiting(study.waiting[0].number)
    assert OLD.encode() in study.files[SPEECH]


# --- proposed -------------------------------------------------------------------------------------------------------


def test_proposals_are_decided_one_by_one(folder: Path) -> None:
    assert propose(folder, SAY, BYE, SEE_YOU, NAMED) == 4
    before = {path: path.read_bytes() for path in folder.rglob("*.*")}
    study = Workspace(folder)
    say, bye, see_you, named = study.waiting
    assert {each.origin for each in study.waiting} == {"proposed"}
    assert "there is no act `R_Bye`" in study.outlooks[2].why_not
    with pytest.raises(EditRefused, match="there is no act `R_Bye`"):
        study.make_waiting(see_you.number)
    study.make_waiting(bye.number)
    assert study.outlooks[1].why_not == ""
    study.make_waiting(see_you.number)
    study.give_up(say.number)
    assert [change.edits for change in study.changes] == [(BYE,), (SEE_YOU,)]
    assert [each.number for each in study.waiting] == [say.number, named.number]
    assert {path: path.read_bytes() for path in folder.rglob("*.*")} == before, "nothing is written before it is saved"
    study.save()
    study.close()

    again = Workspace(folder)
    assert [each.change.edits for each in again.waiting] == [(NAMED,)], "refused and accepted ones are gone"
    again.make_waiting(again.waiting[0].number)
    again.save()
    again.close()
    assert proposed_on_disk() == []


def test_an_accepted_one_that_is_taken_back_waits_again_also_on_the_disk(folder: Path) -> None:
    propose(folder, BYE)
    study = Workspace(folder)
    study.make_waiting(study.waiting[0].number)
    study.save()
    assert (study.waiting, proposed_on_disk()) == ((), [])
    study.undo()
    assert [each.change.edits for each in study.waiting] == [(BYE,)]
    assert len(proposed_on_disk()) == 1
    study.redo()
    assert (study.waiting, proposed_on_disk()) == ((), [])
    study.close()
    assert Workspace(folder).waiting == ()


def test_killed_between_the_draft_and_the_proposals_nothing_is_made_twice(folder: Path) -> None:
    propose(folder, BYE, SEE_YOU)
    (file,) = state_folder().glob("*.proposed-*.json")
    data = file.read_bytes()
    study = Workspace(folder)
    bye, see_you = study.waiting
    study.make_waiting(bye.number)
    study.make_waiting(see_you.number)
    file.write_bytes(data)  # the draft has them, and they are not out of their file yet
    study._lock.release()  # as the process that ends gives it back
    again = Workspace(folder)
    assert len(again.waiting) == 2
    draft = again.draft
    assert draft is not None
    again.take_up_draft(draft)
    assert again.waiting == ()
    assert proposed_on_disk() == []
    again.undo()
    assert [each.change.edits for each in again.waiting] == [(SEE_YOU,)]


def test_what_was_proposed_already_is_not_proposed_twice(folder: Path) -> None:
    assert propose(folder, SAY, BYE) == 2
    assert propose(folder, BYE, NAMED) == 1
    assert [each.change.edits for each in Workspace(folder).waiting] == [(SAY,), (BYE,), (NAMED,)]


def test_a_proposal_for_what_has_changed_shows_what_is_there_now(folder: Path) -> None:
    propose(folder, SAY)
    write(folder / SPEECH, OLD, "Call me Floka.")
    study = Workspace(folder)
    assert study.outlooks[0].says == ("R_Introduction 1 says “I am Floka.” (was “Call me Floka.”)",)
    write(folder / SPEECH, "Call me Floka.", "I am Floka.")
    study.notice_outside()
    assert study.outlooks[0].why_not == "the files say so already"


def test_a_damaged_file_of_proposals_hides_no_other(folder: Path) -> None:
    propose(folder, SAY)
    (file,) = state_folder().glob("*.proposed-*.json")
    for number, data in enumerate((b"{", b"\xff", json.dumps({"format": 99, "changes": []}).encode())):
        file.with_name(f"{file.stem[:-1]}{number}0.json").write_bytes(data)
    assert [each.change.edits for each in Workspace(folder).waiting] == [(SAY,)]


def test_only_whoever_has_the_study_open_decides(folder: Path) -> None:
    first = Workspace(folder)
    second = Workspace(folder)
    propose(folder, SAY)
    assert (second.notice_proposals(), first.notice_proposals(), first.notice_proposals()) == (0, 1, 0)
    first.make_waiting(first.waiting[0].number)
    first.save()
    propose(folder, BYE)
    first.close()
    second.notice_outside()
    assert [each.change.edits for each in second.waiting] == [(BYE,)], "with the study it takes over what is proposed"


@pytest.mark.slow
@settings(max_examples=examples(25))
@given(
    st.lists(st.sampled_from(["make", "give up", "undo", "redo", "save", "outside", "killed"]), max_size=12), st.data()
)
def test_whatever_is_done_each_change_is_made_waits_or_was_given_up(
    tmp_path_factory: pytest.TempPathFactory, steps: list[str], data: st.DataObject
) -> None:
    """Three proposals and one that is set aside; none of them is ever lost, and none is made twice."""
    folder = tmp_path_factory.mktemp("waiting") / "greeting"
    shutil.copytree(SCENARIOS / "greeting", folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder.parent / "state"))
        propose(folder, *(edit for edit, _, _ in MARKS[:3]))
        study = in_their_way(folder)
        for number, step in enumerate(steps):
            waiting = study.waiting
            if step == "make" and waiting:
                study.make_waiting(data.draw(st.sampled_from(waiting)).number)
            elif step == "give up" and waiting:
                study.give_up(data.draw(st.sampled_from(waiting)).number)
            elif step == "undo":
                study.undo()
            elif step == "redo":
                study.redo()
            elif step == "save":
                study.save()
            elif step == "outside":
                path = folder / data.draw(st.sampled_from(["acts/signals.xml", "README.md"]))
                path.write_text(f"{path.read_text('utf-8')}<!-- {number} -->\n", "utf-8")
                study.notice_outside()
            elif step == "killed":
                study._lock.release()  # as the process that ends gives it back
                study = Workspace(folder)
                if (draft := study.draft) is not None:
                    study.take_up_draft(draft)
            for edit, file, mark in MARKS:
                waits = any(each.change.edits == (edit,) for each in study.waiting)
                assert study.files[file].count(mark) + waits >= 1, f"{edit} is lost"
                assert study.files[file].count(mark) <= 1, f"{edit} is made twice"
        study.close()


MARKS: list[tuple[AnyEdit, str, bytes]] = [
    (AddAction("R_Smile", "Speech", {"message": "Ha!"}), "acts/signals.xml", b"Ha!"),
    (AddAct("R_Bye", "Bye!"), "acts/signals.xml", b"Bye!"),
    (SetStartValue("person_y", 0.5), "memory.json", b"0.5"),
    (SAY, SPEECH, b"I am Floka."),
]
"""Edits, and what each writes once."""
