"""A study opened for editing: steps, drafts, what others do meanwhile, one editor at a time."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rise_engine.author.edit import workspace as workspace_module
from rise_engine.author.edit.edits import RemoveStartValue, Rename, ReplaceFile, SetParameter, SetStartValue
from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.author.edit.workspace import Workspace, diff_of
from rise_engine.scenario.loader import load
from tests.author.edit.samples import SCENARIOS, SPELLINGS, study_files
from tests.forked import run_engine

SPEECH = "acts/greeting.xml"
FACE = "acts/signals.xml"
SAY = SetParameter("R_Introduction", "1", "message", "I am Floka.")
SMILE = SetParameter("R_Smile", "1", "duration", "2500")


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    to = tmp_path / "greeting"
    shutil.copytree(SCENARIOS / "greeting", to)
    return to


def _write(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")


def _disk(folder: Path) -> Files:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# --- steps --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_opening_and_saving_writes_nothing(tmp_path: Path, spelling: str) -> None:
    folder = tmp_path / "study"
    for name, data in study_files("greeting", spelling).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    before = {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in folder.rglob("*")}
    study = Workspace(folder)
    study.apply(SAY)
    study.undo()

    assert study.save().files == ()
    study.close()
    assert {path: (path.stat().st_ino, path.stat().st_mtime_ns) for path in folder.rglob("*")} == before


def test_steps_over_several_files_and_a_save(folder: Path) -> None:
    study = Workspace(folder)
    stages = [study.files]
    for edits in ((SAY,), (SMILE, SetStartValue("person_y", 0.5)), (Rename("act", "R_Nod", "R_Yes"),)):
        study.apply(*edits)
        stages.append(study.files)
    assert len(study.changes) == 3
    assert set(study.save().files) == {SPEECH, FACE, "memory.json", "scenario.toml", "rules/greeting.xml"}
    assert study.changes == []
    assert _disk(folder) == stages[-1]

    for stage in reversed(stages[:-1]):
        assert study.undo() is not None
        assert study.files == stage
    assert study.undo() is None
    assert [change.says[0][:11] for change in study.changes] == ["taken back:"] * 3
    for stage in stages[1:]:
        assert study.redo() is not None
        assert study.files == stage
    assert study.redo() is None
    assert study.changes == []
    study.undo()
    assert set(study.save().files) == {FACE, "scenario.toml", "rules/greeting.xml"}
    assert _disk(folder) == stages[2]
    study.close()


def test_an_edit_that_cannot_be_made_takes_its_step_with_it(folder: Path) -> None:
    study = Workspace(folder)
    files = study.files
    with pytest.raises(EditRefused, match="R_Smil"):
        study.apply(SAY, SetParameter("R_Smil", "1", "duration", "1"))
    assert study.files is files
    assert not study.changes


def test_a_preview_changes_nothing(folder: Path) -> None:
    study = Workspace(folder)
    found = study.preview(SetParameter("R_Smile", "1", "duration", "soon"))
    assert [each.location.file for each in found.errors] == [FACE]
    assert study.checked.errors == []
    assert study.diff() == ""


def test_nothing_is_saved_while_there_is_an_error(folder: Path) -> None:
    study = Workspace(folder)
    before = _disk(folder)
    study.apply(SetParameter("R_Smile", "1", "duration", "soon"))
    with pytest.raises(EditRefused, match=r"nothing is saved while there is an error: acts/signals\.xml:\d+"):
        study.save()
    assert _disk(folder) == before
    study.undo()
    assert study.save().files == ()


def test_the_diff_of_one_sentence_is_one_line(folder: Path) -> None:
    study = Workspace(folder)
    study.apply(SAY)
    lines = study.diff().splitlines()
    assert lines[:2] == [f"--- a/{SPEECH}", f"+++ b/{SPEECH}"]
    assert [line for line in lines[2:] if line[0] in "+-"] == [
        "-    <message>My name is Floka, and I am a robot. Well, the head of one.</message>",
        "+    <message>I am Floka.</message>",
    ]


def test_the_diff_of_lone_carriage_returns_and_of_a_last_line_without_end() -> None:
    assert diff_of({"a": b"one\rtwo\rthree"}, {"a": b"one\rTWO\rthree"}).splitlines()[3:] == [
        " one",
        "-two",
        "+TWO",
        " three",
        "\\ No newline at end of file",
    ]


# --- what others do -----------------------------------------------------------------------------------------------


def test_two_people_change_two_files(folder: Path) -> None:
    study = Workspace(folder)
    study.apply(SAY)
    _write(folder / FACE, "<duration>600</duration>", "<duration>700</duration>")

    outside = study.read_disk_changes()
    assert outside is not None
    assert (outside.files, outside.clash, outside.forgotten) == ((FACE,), (), False)
    assert study.save().files == (SPEECH,)
    assert b"I am Floka." in _disk(folder)[SPEECH]
    assert b"700" in _disk(folder)[FACE]
    assert study.read_disk_changes() is None


def test_a_file_that_somebody_is_writing_is_read_once_it_is_whole(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Many programs empty a file and then fill it: an author must not be asked about half of it."""
    study = Workspace(folder)
    whole = (folder / FACE).read_text("utf-8").replace("<duration>600</duration>", "<duration>700</duration>")
    (folder / FACE).write_text("", "utf-8")
    monkeypatch.setattr(workspace_module.time, "sleep", lambda seconds: (folder / FACE).write_text(whole, "utf-8"))
    assert study.read_disk_changes(settled=True) is None
    outside = study.read_disk_changes(settled=True)
    assert outside is not None and outside.files == (FACE,)
    assert b"700" in (study.files[FACE] or b"")


def test_steps_are_kept_when_other_files_change(folder: Path) -> None:
    study = Workspace(folder)
    first = study.files
    study.apply(SAY)
    study.save()
    _write(folder / FACE, "<duration>600</duration>", "<duration>700</duration>")
    (folder / "acts" / "new.xml").write_text("<Dialogs/>", "utf-8")
    (folder / "session.jsonl").unlink()

    outside = study.read_disk_changes()
    assert outside is not None
    assert (outside.files, outside.forgotten) == (("acts/new.xml", FACE, "session.jsonl"), False)
    study.undo()
    assert study.files[SPEECH] == first[SPEECH]
    assert study.save().files == (SPEECH,)
    assert b"700" in _disk(folder)[FACE]


@pytest.mark.parametrize("keeps", ["mine", "theirs"])
def test_two_people_change_one_file(folder: Path, keeps: str) -> None:
    """The author is asked which version is to stay. Until then nothing of either is lost."""
    study = Workspace(folder)
    study.apply(SAY)
    study.apply(SMILE)
    _write(folder / SPEECH, "Hi there! Good to see you.", "Hey!")
    theirs = _disk(folder)[SPEECH]

    with pytest.raises(EditRefused, match="has changed on the disk meanwhile"):
        study.save()
    outside = study.read_disk_changes()
    assert outside is not None
    assert (outside.files, outside.clash, outside.forgotten) == ((SPEECH,), (SPEECH,), True)
    mine = study.files
    assert b"I am Floka." in mine[SPEECH] and b"2500" in mine[FACE]
    assert "<message>Hey!</message>" in study.diff(), "saving shows what it would write over"
    if keeps == "mine":
        assert set(study.save().files) == {SPEECH, FACE}
        assert _disk(folder)[SPEECH] == mine[SPEECH]
    else:
        assert study.take_disk_changes(outside.clash).says == (f"{SPEECH} is as it is on the disk",)
        assert study.files == {**mine, SPEECH: theirs}
        study.undo()
        assert study.files == mine
        study.redo()
        assert study.save().files == (FACE,)
        assert _disk(folder)[SPEECH] == theirs
    assert study.read_disk_changes() is None


@pytest.mark.parametrize(("here", "there"), [(None, b"<Dialogs/>"), (b"<Dialogs/>", None)])
def test_a_file_that_is_deleted_on_one_side(folder: Path, here: bytes | None, there: bytes | None) -> None:
    (folder / "acts" / "more.xml").write_bytes(b"<Dialogs></Dialogs>")
    study = Workspace(folder)
    study.apply(ReplaceFile("acts/more.xml", here.decode() if here is not None else None))
    (folder / "acts" / "more.xml").unlink()
    if there is not None:
        (folder / "acts" / "more.xml").write_bytes(there)
    outside = study.read_disk_changes()
    assert outside is not None and outside.clash == ("acts/more.xml",)
    assert study.files.get("acts/more.xml") == here
    study.take_disk_changes(outside.clash)
    assert study.files.get("acts/more.xml") == there
    study.undo()
    study.save()
    assert _disk(folder).get("acts/more.xml") == here


def test_after_a_change_outside_of_a_saved_file_its_steps_are_forgotten(folder: Path) -> None:
    study = Workspace(folder)
    study.apply(SAY)
    study.save()
    study.apply(SMILE)
    _write(folder / SPEECH, "Hi there! Good to see you.", "Hey!")
    outside = study.read_disk_changes()
    assert outside is not None and (outside.clash, outside.forgotten) == ((), True)
    assert study.undo() is not None and study.undo() is None
    assert study.files == _disk(folder)


# --- drafts -------------------------------------------------------------------------------------------------------


def test_a_killed_editor_loses_nothing(folder: Path) -> None:
    script = (
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from rise_engine.author.edit.edits import SetParameter\n"
        "from rise_engine.author.edit.workspace import Workspace\n"
        "study = Workspace(Path(sys.argv[1]))\n"
        "study.apply(SetParameter('R_Introduction', '1', 'message', 'I am Floka.'))\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    assert subprocess.run([sys.executable, "-c", script, str(folder)], check=False).returncode == -9

    study = Workspace(folder)
    assert study.read_only == ""
    draft = study.draft
    assert draft is not None
    assert draft.says[0].startswith("R_Introduction 1 says")
    assert study.take_up_draft(draft).clash == ()
    assert [change.says for change in study.changes] == [draft.says]
    study.save()
    assert study.draft is None
    assert b"I am Floka." in _disk(folder)[SPEECH]


def test_a_draft_with_a_step_back_over_a_save(folder: Path) -> None:
    study = Workspace(folder)
    first = study.files
    study.apply(SAY)
    study.save()
    study.undo()
    study.close()
    again = Workspace(folder)
    draft = again.draft
    assert draft is not None
    assert again.take_up_draft(draft).clash == ()
    assert again.files == first
    again.save()
    assert _disk(folder) == first


def test_a_draft_that_is_not_answered_is_offered_again(folder: Path) -> None:
    study = Workspace(folder)
    study.apply(SAY)
    study.close()
    second = Workspace(folder)
    second.apply(SMILE)
    second.save()
    second.close()
    third = Workspace(folder)
    draft = third.draft
    assert draft is not None
    assert draft.files.keys() == {SPEECH}
    third.discard_draft()
    assert third.draft is None
    assert list((Path(os.environ["XDG_STATE_HOME"]) / "rise-tui" / "drafts").glob("*.json")) == []


def test_a_draft_on_files_that_have_changed_since(folder: Path) -> None:
    study = Workspace(folder)
    study.apply(SAY)
    study.apply(SMILE)
    study.close()
    _write(folder / FACE, "<duration>2000</duration>", "<duration>9000</duration>")
    again = Workspace(folder)
    draft = again.draft
    assert draft is not None
    outside = again.take_up_draft(draft)
    assert (outside.files, outside.clash) == ((FACE,), (FACE,))
    assert b"2500" in again.files[FACE]
    again.take_disk_changes(outside.clash)
    assert b"9000" in again.files[FACE]
    assert b"I am Floka." in again.files[SPEECH]


def test_a_damaged_draft_is_none(folder: Path) -> None:
    study = Workspace(folder)
    study.apply(SAY)
    study.close()
    (path,) = (Path(os.environ["XDG_STATE_HOME"]) / "rise-tui" / "drafts").glob("*.json")
    path.write_bytes(path.read_bytes()[:-20])
    assert Workspace(folder).draft is None


# --- one editor at a time -----------------------------------------------------------------------------------------


def test_the_second_editor_may_look_and_takes_over(folder: Path) -> None:
    first = Workspace(folder)
    second = Workspace(folder)
    assert second.read_only.startswith(f"another editor, process {os.getpid()} on ")
    second.apply(SAY)
    with pytest.raises(EditRefused, match="here you can only look"):
        second.save()
    assert second.draft is None

    first.apply(SMILE)
    first.save()
    first.close()
    outside = second.read_disk_changes()
    assert outside is not None
    assert second.read_only == ""
    assert second.save().files == (SPEECH,)
    assert b"2500" in _disk(folder)[FACE]


def test_a_folder_that_cannot_be_opened_is_not_locked(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rise_engine.author.edit.study_folder._MAX_FILES", 2)
    with pytest.raises(EditRefused, match="is it the folder of one study"):
        Workspace(folder)
    monkeypatch.undo()
    assert Workspace(folder).read_only == ""


@pytest.mark.parametrize("place", ["nowhere", "greeting"])
def test_what_cannot_be_opened(tmp_path: Path, place: str) -> None:
    folder = tmp_path / "nowhere" if place == "nowhere" else SCENARIOS / place
    with pytest.raises(EditRefused, match=r"no such folder|comes with the program"):
        Workspace(folder)


def test_a_study_with_an_unreadable_file_stays_editable(folder: Path) -> None:
    (folder / "rules" / "broken.xml").write_text("<InteractionRule", "utf-8")
    study = Workspace(folder)
    study.apply(SAY)
    assert study.checked.scenario is None
    with pytest.raises(EditRefused, match=r"rules/broken\.xml"):
        study.save()
    study.apply(ReplaceFile("rules/broken.xml", None))
    assert set(study.save().files) == {SPEECH, "rules/broken.xml"}
    assert load(folder).scenario is not None


def test_the_study_of_a_folder_above_is_known(folder: Path) -> None:
    """A study whose scenario is one of its folders: its study.toml is seen, also when it is written later."""
    study = Workspace(folder)
    assert study.above == {}
    above = folder.parent / "study.toml"
    levels = "levels.near.memory = { person_near = true }\nlevels.other.scenario = 'elsewhere'\n"
    above.write_text(f"scenario = '{folder.name}'\n[factors.place]\n{levels}")
    assert study.read_disk_changes() is None
    assert study.above == {str(above.resolve()): above.read_bytes()}
    with pytest.raises(EditRefused, match=r"study\.toml sets `person_near`, too; change it there by hand first"):
        study.apply(Rename("key", "person_near", "near"))
    assert study.apply(RemoveStartValue("person_near")).noticed == (f"{above.resolve()} sets `person_near`",)
    study.apply(Rename("key", "person_name", "name"))
    above.write_text("scenario = ")  # cannot be read: nobody knows
    study.read_disk_changes()
    with pytest.raises(EditRefused, match=r"study\.toml cannot be read, and may set `person_x`, too"):
        study.apply(Rename("key", "person_x", "x"))
    (folder.parent / "deep").mkdir()
    above.write_text("[factors.place]\nlevels.near = { scenario = 'deep/one' }\n")
    assert study.read_disk_changes() is None
    assert study.above == {}, "it has other scenarios"
    deep = folder.parent / "deep" / "one"
    shutil.copytree(folder, deep)
    assert list(Workspace(deep).above) == [str(above.resolve())]


# --- two processes ------------------------------------------------------------------------------------------------


def test_a_program_and_a_person_change_one_study(folder: Path) -> None:
    """Somebody has the study open; `rise-engine edit` may not, `sed` does; nothing of anybody is lost."""
    study = Workspace(folder)
    study.apply(SAY)
    edits = '{"edit": "set_start_value", "key": "person_y", "value": 0.5}'
    refused = run_engine("edit", folder, "-", stdin=edits)
    assert refused.returncode == 1
    assert f"process {os.getpid()} on " in refused.stderr
    subprocess.run(["sed", "-i", "s/<duration>600</<duration>650</", str(folder / FACE)], check=True)

    outside = study.read_disk_changes()
    assert outside is not None
    assert (outside.files, outside.clash) == ((FACE,), ())
    assert study.save().files == (SPEECH,)
    study.close()
    made = run_engine("edit", folder, "-", stdin=edits)
    assert (made.returncode, made.stderr) == (0, "")

    disk = _disk(folder)
    assert b"I am Floka." in disk[SPEECH]
    assert b"<duration>650<" in disk[FACE]
    assert b"0.5" in disk["memory.json"]
    assert load(folder).errors == []
