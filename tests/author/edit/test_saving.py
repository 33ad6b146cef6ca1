"""Saving a study: all files of a change or none."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from rise_engine.author.edit.edits import ReplaceFile, SetParameter, SetSetting, SetStartValue
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.study_folder import finish_interrupted, read_study_files, write_files
from rise_engine.author.edit.workspace import Workspace
from rise_engine.scenario.files.tree import NOTE
from rise_engine.scenario.loader import load
from tests.author.edit.samples import SCENARIOS
from tests.kills import every_kill


class Killed(BaseException):
    """In the place of a signal, where the process must go on."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number in range(3):
        (tmp_path / f"{number}.xml").write_bytes(b"old %d" % number)
    return tmp_path


def _changed(folder: Path) -> tuple[dict[str, bytes], dict[str, bytes]]:
    before = dict(read_study_files(folder))
    return before, {name: data.replace(b"old", b"new") for name, data in before.items()}


EDITS = (
    SetParameter("R_Introduction", "1", "message", "I am Floka."),
    SetParameter("R_LookAhead", "1", "duration", "1500"),
    SetStartValue("person_y", 0.25),
    SetSetting(("title",), "Greeting everybody"),
    ReplaceFile("tests/new.jsonl", '{"at": 1, "command": "end"}\n'),
    ReplaceFile("session.jsonl", None),
)


@pytest.mark.slow
def test_kills_leave_the_old_files_or_the_new_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As whoever reads next finds them, and as they are once the save is finished. The draft stays till then."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    shutil.copytree(SCENARIOS / "greeting", folder := tmp_path / "greeting")
    workspace = Workspace(folder)
    old = workspace.saved
    workspace.apply(*EDITS)
    new = workspace.files
    hashes = [load(folder, held=files).scenario.hash for files in (old, new)]  # type: ignore[union-attr]

    def again() -> None:
        shutil.rmtree(folder)
        shutil.copytree(SCENARIOS / "greeting", folder)
        workspace._keep_draft()  # a save that has come so far takes it away

    found = []
    for touch in every_kill(tmp_path, again, lambda disk: workspace.save(), every=2):
        drafted = workspace.draft is not None
        read, loaded = read_study_files(folder), load(folder).scenario
        finish_interrupted(folder)
        paths = [path for path in folder.rglob("*") if path.is_file()]
        finished = {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
        assert read == finished and finished in (old, new), touch
        assert loaded is not None and loaded.hash == hashes[finished == new], touch
        assert drafted or finished == new, touch
        found.append(finished == new)
    workspace.close()
    assert len(found) > 20 and set(found) == {False, True}


def test_an_error_on_the_way_changes_nothing(folder: Path) -> None:
    before, after = _changed(folder)
    (folder / "2.xml").unlink()
    (folder / "2.xml").mkdir()  # cannot be replaced by a file

    with pytest.raises(EditRefused, match=r"2\.xml.*nothing was written"):
        write_files(folder, before, after)

    assert (folder / "0.xml").read_bytes() == b"old 0"
    assert sorted(path.name for path in folder.iterdir()) == ["0.xml", "1.xml", "2.xml"]


def test_a_full_disk_changes_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before, after = _changed(folder)
    after["new/deep/3.xml"] = b"more"
    calls = []

    def no_space(descriptor: int) -> None:
        calls.append(descriptor)
        if len(calls) == 3:
            raise OSError(28, os.strerror(28), str(folder / ".2.xml.rise-new"))

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(EditRefused, match=r"No space left on device; nothing was written"):
        write_files(folder, before, after)

    assert read_study_files(folder) == before
    assert sorted(path.name for path in folder.iterdir()) == ["0.xml", "1.xml", "2.xml"]


def test_links_stay_links_and_modes_stay(folder: Path) -> None:
    elsewhere = folder / "shared" / "shared.xml"
    elsewhere.parent.mkdir()
    elsewhere.write_bytes(b"old link")
    elsewhere.chmod(0o640)
    (folder / "linked.xml").symlink_to(elsewhere)
    (folder / "0.xml").chmod(0o664)
    before, after = _changed(folder)
    after["shared/shared.xml"] = b"old link"  # the same file

    assert write_files(folder, before, after) == ("0.xml", "1.xml", "2.xml", "linked.xml")

    assert (folder / "linked.xml").is_symlink()
    assert elsewhere.read_bytes() == b"new link"
    assert elsewhere.stat().st_mode & 0o777 == 0o640
    assert (folder / "0.xml").stat().st_mode & 0o777 == 0o664
    assert [path.name for path in elsewhere.parent.iterdir()] == ["shared.xml"]


def test_a_linked_file_that_goes_is_only_the_link(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "shared.xml"
    elsewhere.write_bytes(b"kept")
    (folder / "linked.xml").symlink_to(elsewhere)

    write_files(folder, {"linked.xml": b"kept"}, {})

    assert not os.path.lexists(folder / "linked.xml")
    assert elsewhere.read_bytes() == b"kept"


def test_what_changed_meanwhile_is_not_overwritten(folder: Path) -> None:
    before, after = _changed(folder)

    def somebody_writes(step: str) -> None:
        if step == "wrote 1.xml":
            (folder / "0.xml").write_bytes(b"somebody else")

    with pytest.raises(EditRefused, match=r"0\.xml has changed on the disk meanwhile"):
        write_files(folder, before, after, reached=somebody_writes)

    assert read_study_files(folder) == {**before, "0.xml": b"somebody else"}


def _kill_at(folder: Path, step: str) -> None:
    before, after = _changed(folder)

    def kill(reached: str) -> None:
        if reached == step:
            raise Killed

    with pytest.raises(Killed):
        write_files(folder, before, after, reached=kill)
    assert (folder / NOTE).exists()


def test_a_file_that_was_changed_after_a_killed_save_stays(folder: Path) -> None:
    _kill_at(folder, "put 0.xml in its place")
    (folder / "1.xml").write_bytes(b"by hand")

    assert read_study_files(folder) == {"0.xml": b"new 0", "1.xml": b"by hand", "2.xml": b"new 2"}
    assert finish_interrupted(folder) == ("2.xml",)
    assert sorted(path.name for path in folder.iterdir()) == ["0.xml", "1.xml", "2.xml"]
    assert (folder / "1.xml").read_bytes() == b"by hand"


def test_a_copy_of_a_folder_with_a_killed_save_leaves_the_original_alone(folder: Path, tmp_path: Path) -> None:
    _kill_at(folder, "wrote the note")
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)

    assert finish_interrupted(copy) == ("0.xml", "1.xml", "2.xml")
    assert (copy / "0.xml").read_bytes() == b"new 0"
    assert (folder / "0.xml").read_bytes() == b"old 0"


@pytest.mark.parametrize("note", [b"", b"{", b'[{"name": "../x", "before": null, "after": null}]', b"\xff"])
def test_a_note_of_somebody_else_is_left_alone(folder: Path, note: bytes) -> None:
    (folder / NOTE).write_bytes(note)

    assert finish_interrupted(folder) == ()
    assert read_study_files(folder)["0.xml"] == b"old 0"
    assert (folder / NOTE).read_bytes() == note


def test_the_studies_that_come_with_the_program_are_not_written() -> None:
    with pytest.raises(EditRefused, match="comes with the program"):
        write_files(SCENARIOS / "greeting", {}, {"acts/new.xml": b"<Dialogs/>"})
