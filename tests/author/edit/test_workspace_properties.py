"""Whatever is done to a study, in whatever order: steps go back and forth, and only what is right is saved."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.author.edit.edits import AddAction, AnyEdit, RemoveVariant, Rename, SetParameter, SetStartValue
from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.author.edit.workspace import Workspace
from rise_engine.scenario.loader import load
from tests.author.edit.samples import SCENARIOS
from tests.chance import examples

_OUTSIDE = {
    "acts/greeting.xml": [b"<message>Hi there! Good to see you.</message>", b"<message>Hey!</message>"],
    "acts/signals.xml": [b"<duration>600</duration>", b"<duration>650</duration>"],
    "README.md": [b"# ", b"# Our "],
}
"""What another person changes in a file, there and back."""

EDITS: list[AnyEdit] = [
    SetParameter("R_Introduction", "1", "message", "I am Floka."),
    SetParameter("R_Introduction", "1", "message", "A & B < C"),
    SetParameter("R_Notice", "1", "duration", "700"),
    SetParameter("R_Smile", "1", "duration", "soon"),  # an error
    SetParameter("R_Smile", "1", "duration", "1500"),
    AddAction("R_Nod", "Speech", {"message": "Yes."}),
    RemoveVariant("R_Greeting", "2", 1),
    SetStartValue("person_y", 0.5),
    Rename("act", "R_Smile", "R_Grin"),
    Rename("act", "R_Grin", "R_Smile"),
]

_DOINGS = st.one_of(
    st.tuples(st.just("edit"), st.integers(0, len(EDITS) - 1)),
    st.tuples(st.sampled_from(["undo", "redo", "save", "reopen"]), st.just(0)),
    st.tuples(st.just("outside"), st.integers(0, len(_OUTSIDE) - 1)),
)


@contextmanager
def _folder() -> Iterator[Path]:
    with TemporaryDirectory() as place, pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", f"{place}/state")
        folder = Path(place, "greeting")
        shutil.copytree(SCENARIOS / "greeting", folder)
        yield folder


def _disk(folder: Path) -> Files:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _write_outside(folder: Path, which: int) -> None:
    name = list(_OUTSIDE)[which]
    path, (one, other) = folder / name, _OUTSIDE[name]
    data = path.read_bytes()
    path.write_bytes(data.replace(one, other, 1) if other not in data else data.replace(other, one, 1))


def _edit(study: Workspace, which: int) -> bool:
    """Whether it could be made, and changed something."""
    before = study.files
    try:
        study.apply(EDITS[which])
    except EditRefused:
        assert study.files is before
    return study.files is not before


@settings(max_examples=examples(40))
@given(st.lists(_DOINGS, max_size=14))
def test_only_what_is_right_is_saved_and_nothing_of_others_is_overwritten(doings: list[tuple[str, int]]) -> None:
    with _folder() as folder:
        study = Workspace(folder)
        for doing, which in doings:
            disk = _disk(folder)
            if doing == "edit":
                _edit(study, which)
            elif doing in ("undo", "redo"):
                (study.undo if doing == "undo" else study.redo)()
            elif doing == "outside":
                _write_outside(folder, which)
                disk = _disk(folder)
            elif doing == "reopen":
                study = _reopened(study, folder)
            else:
                _save(study, folder, disk)
                disk = _disk(folder)
            assert _disk(folder) == disk
        study.close()


def _reopened(study: Workspace, folder: Path) -> Workspace:
    """With the draft taken up, the same files again, unless somebody else has changed some."""
    files, nobody = study.files, _disk(folder) == study.saved
    study.close()
    again = Workspace(folder)
    draft = again.draft
    if draft is not None:
        again.take_up_draft(draft)
    if nobody:
        assert again.files == files
    return again


def _save(study: Workspace, folder: Path, disk: Files) -> None:
    outside = {name for name in disk if disk[name] != study.saved.get(name)}
    mine = {name for name in study.files if study.files[name] != study.saved.get(name)}
    try:
        written = set(study.save().files)
    except EditRefused:
        assert study.checked.errors or outside & mine
        assert _disk(folder) == disk
        study.read_disk_changes()
        assert study.saved == disk
        return
    assert written == mine
    assert not written & outside
    now = _disk(folder)
    assert {name: now[name] for name in now if name not in written} == {
        name: disk[name] for name in disk if name not in written
    }
    if not outside:
        assert now == study.files
        assert load(folder).errors == []


@settings(max_examples=examples(40))
@given(st.lists(st.integers(0, len(EDITS) - 1), max_size=10), st.integers(0, 10))
def test_steps_go_back_and_forth_over_a_save_and_changes_of_others(edits: list[int], save_at: int) -> None:
    """A file that no step touches is changed by somebody else on the way: the steps stay, and so does the change."""
    with _folder() as folder:
        study = Workspace(folder)
        stages = [dict(study.files)]
        for number, edit in enumerate(edits):
            if number == save_at and not study.checked.errors:
                study.save()
            if _edit(study, edit):
                stages.append(dict(study.files))
        _write_outside(folder, 2)
        outside = study.read_disk_changes()
        assert outside is not None
        readme = (folder / "README.md").read_bytes()
        for stage in stages:
            stage["README.md"] = readme
        for stage in reversed(stages[:-1]):
            study.undo()
            assert study.files == stage
        assert study.undo() is None
        for stage in stages[1:]:
            study.redo()
            assert study.files == stage
        assert study.redo() is None
        study.close()
