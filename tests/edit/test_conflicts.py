"""Files that git could not join: each conflict one version or both, and nothing around it changes."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from random import Random

import pytest

from rise_engine.edit.conflicts import conflict_files, conflicts_of
from rise_engine.edit.edits import AddAct, ResolveConflict, SetParameter
from rise_engine.edit.plan import EditRefused, Files
from rise_engine.edit.workspace import Workspace
from rise_engine.scenario import load
from rise_engine.scenario.merge_conflicts import Keep, find_conflicts
from tests.edit.samples import SCENARIOS, SPELLINGS, after, state_of, study_files, study_state

SPEECH = "acts/greeting.xml"


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def conflicted(data: bytes, random: Random) -> tuple[bytes, dict[Keep, bytes]]:
    """A file with conflicts between its lines, and what it is with each version kept."""
    lines = data.splitlines(keepends=True)
    ending = b"\r\n" if data.count(b"\r\n") else b"\n"
    marked, kept = b"", {"yours": b"", "theirs": b"", "both": b""}
    for line in lines:
        if line.endswith(b"\n") and random.random() < 0.2:
            other = bytes(line[: len(line) // 2]) + b"\xc3\xb6" + ending if random.random() < 0.7 else b""
            base = b"||||||| 1a2b3c" + ending + b"as it was" + ending if random.random() < 0.5 else b""
            parts = [b"<<<<<<< HEAD", ending, line, base, b"=======", ending, other, b">>>>>>> anna's", ending]
            marked += b"".join(parts)
            kept = {
                "yours": kept["yours"] + line,
                "theirs": kept["theirs"] + other,
                "both": kept["both"] + line + other,
            }
        else:
            marked += line
            kept = {key: value + line for key, value in kept.items()}
    return marked, kept  # type: ignore[return-value]


@pytest.mark.parametrize("spelling", [each for each in SPELLINGS if each not in ("cr", "one_line")])
def test_each_version_is_kept_byte_for_byte(spelling: str) -> None:
    files = study_files("greeting", spelling)
    marked, kept = conflicted(files[SPEECH], Random(spelling))
    number = marked.count(b"<<<<<<<")
    assert number > 3
    broken = state_of({**files, SPEECH: marked, "notes.md": marked}, "greeting")
    assert [each.code for each in broken.checked.errors] == ["merge-conflict"]
    assert conflict_files(broken.files) == {SPEECH: number, "notes.md": number}
    keeps: tuple[tuple[str, Keep], ...] = ((SPEECH, "yours"), (SPEECH, "theirs"), ("notes.md", "both"))
    for file, keep in keeps:
        now = broken
        for at in reversed(range(number)):
            now = after(now, ResolveConflict(file, at, keep))
        assert now.files == {**broken.files, file: kept[keep]}
        assert file not in conflict_files(now.files)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("<<<<<<< a\nx\n=======\ny\n>>>>>>> b", [("x\n", "y\n", "a", "b")]),
        ("<<<<<<<\r\n=======\r\n>>>>>>>\r\n", [("", "", "", "")]),
        ("<<<<<<< a\nx\n||||||| o\nz\n=======\ny\n>>>>>>> b\n", [("x\n", "y\n", "a", "b")]),
        ("<<<<<<< a\nx\n<<<<<<< b\ny\n=======\nz\n>>>>>>> c\n", [("y\n", "z\n", "b", "c")]),
        ("<<<<<<< a\nx\n=======\n=======\ny\n>>>>>>> b\n", [("x\n", "=======\ny\n", "a", "b")]),
        ("<<<<<<< a\nx\n>>>>>>> b\n", []),
        ("=======\nx\n>>>>>>> b\n", []),
        (" <<<<<<< a\nx\n=======\ny\n>>>>>>> b\n", []),
        ("<<<<<<<< a\nx\n=======\ny\n>>>>>>> b\n", []),
    ],
)
def test_what_is_a_conflict(text: str, found: list[tuple[str, str, str, str]]) -> None:
    assert [
        (text[slice(*each.yours)], text[slice(*each.theirs)], each.your_name, each.their_name)
        for each in find_conflicts(text)
    ] == found


def test_what_cannot_be_resolved() -> None:
    state = study_state("greeting")
    for edit, why in (
        (ResolveConflict("acts/no.xml", 0, "yours"), "there is no file acts/no.xml"),
        (ResolveConflict(SPEECH, 0, "yours"), "has no conflict that git has left"),
    ):
        with pytest.raises(EditRefused, match=why):
            after(state, edit)


def test_a_table_that_is_not_utf_8(tmp_path: Path) -> None:
    data = b"<<<<<<< a\nGr\xfcn\n=======\nBlau\n>>>>>>> b\n"
    file, conflicts = conflicts_of("tables/colours.csv", data)
    files: Files = {**study_files("greeting"), "tables/colours.csv": data}
    assert len(conflicts) == 1 and file.text.startswith("<<<")
    resolved = after(state_of(files, "greeting"), ResolveConflict("tables/colours.csv", 0, "yours"))
    assert resolved.files["tables/colours.csv"] == b"Gr\xfcn\n"


def test_both_of_what_is_no_whole_element_is_refused() -> None:
    files = dict(study_files("greeting"))
    line = b"<<<<<<< a\n<Dialog name='A'>\n=======\n<Dialog name='B'>\n>>>>>>> b\n"
    files["acts/new.xml"] = b"<Dialogs>\n" + line + b"<Speech/>\n</Dialog>\n</Dialogs>\n"
    both = after(state_of(files, "greeting"), ResolveConflict("acts/new.xml", 0, "both"))
    assert both.files["acts/new.xml"] == (
        b"<Dialogs>\n<Dialog name='A'>\n<Speech/>\n</Dialog>\n<Dialog name='B'>\n<Speech/>\n</Dialog>\n</Dialogs>\n"
    ), "what git has left once for both is there twice"
    files["acts/new.xml"] = line.replace(b"<Dialog name='B'>", b"</Dialog>")
    with pytest.raises(EditRefused, match=r"acts/new\.xml, line 1: yours and the other's are not whole elements"):
        after(state_of(files, "greeting"), ResolveConflict("acts/new.xml", 0, "both"))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")
def test_what_git_leaves_is_resolved_undone_and_saved(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    shutil.copytree(SCENARIOS / "greeting", folder)

    def git(*arguments: str, status: int = 0) -> None:
        who = ("-c", "user.name=A", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false")
        done = subprocess.run(["git", *who, *arguments], cwd=folder, capture_output=True, check=False)
        assert done.returncode == status, done.stderr

    def change(*edits: AddAct | SetParameter) -> None:
        study = Workspace(folder)
        study.apply(*edits)
        study.save()
        study.close()
        git("commit", "-qam", "change")

    git("init", "-q", "-b", "main")
    git("add", ".")
    git("commit", "-qm", "begin")
    git("checkout", "-qb", "anna")
    change(AddAct("R_Anna", "I am Anna's."), SetParameter("R_Introduction", "1", "message", "Anna wrote this."))
    git("checkout", "-q", "main")
    change(AddAct("R_Mine", "I am mine."), SetParameter("R_Introduction", "1", "message", "I wrote this."))
    git("merge", "anna", status=1)

    study = Workspace(folder)
    assert conflict_files(study.files) == {SPEECH: 1, "acts/signals.xml": 1}
    before = study.files
    study.apply(ResolveConflict(SPEECH, 0, "theirs"))
    with pytest.raises(EditRefused, match="a merge of git was not resolved"):
        study.save()
    study.apply(ResolveConflict("acts/signals.xml", 0, "both"))
    line = (folder / SPEECH).read_text().partition("<<<<<<<")[0].count("\n") + 1
    assert study.changes[0].says == (f"{SPEECH}, line {line}: the other's (anna) is taken",)
    assert study.checked.errors == []
    study.undo()
    study.undo()
    assert study.files == before
    study.redo()
    study.redo()
    assert study.save().files == (SPEECH, "acts/signals.xml")
    scenario = load(folder).scenario
    assert scenario is not None
    assert {"R_Anna", "R_Mine"} <= scenario.acts.keys()
    assert scenario.acts["R_Introduction"].actions[0].calls[0].parameters["message"].text == "Anna wrote this."  # type: ignore[union-attr]
