"""An export is there whole or not at all, whatever becomes of the program; it is never written over anything; and the
study knows of it before it is there."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.export.format import ExportContext, ExportError, ExportFormat, Shape, load_format
from rise_engine.results.export.writing import export_context, export_sessions, new_export
from rise_engine.session import unfinished_files
from rise_engine.session.folder import JOURNAL
from rise_engine.study.study_log import LOG_FILE, read_log
from tests.forked import PIPE, Forked
from tests.results.analysis.samples import make_study, play_session, sessions_of, short


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return make_study(tmp_path / "study")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def format_that(write: object, shape: Shape = "folder", suffix: str = "") -> ExportFormat:
    return ExportFormat("odd", "for tests", shape, suffix, write)  # type: ignore[arg-type]


def export(format: ExportFormat, out: Path, folders: list[Path], *, several: bool = True) -> list[str]:
    """Sentences that are said of it."""
    report = export_sessions(format, out, folders, export_context(folders, "full"), several=several)
    return [*report.problems, *report.warnings]


# --- whole or not at all ---


def test_while_it_is_written_nothing_is_in_its_place(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    seen: list[list[str]] = []

    def write(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
        path.mkdir()
        for data in sessions:
            (path / data.facts.session).write_text("x")
            seen.append(names(tmp_path))

    assert export(format_that(write), out, sessions_of(study)) == []
    assert len(seen) == 8 and all("out" not in each for each in seen)
    assert names(tmp_path) == ["out", "study"] and len(names(out)) == 8
    assert out.stat().st_mode & 0o777 == 0o700
    assert {path.stat().st_mode & 0o777 for path in out.iterdir()} == {0o600}


@pytest.mark.parametrize(
    "error", [ExportError("no"), OSError(28, "No space left on device"), RuntimeError("a mistake")]
)
def test_what_fails_in_the_middle_leaves_nothing(study: Path, tmp_path: Path, error: Exception) -> None:
    def write(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
        path.mkdir()
        (path / "half").write_text("x")
        for data in sessions:
            if data.facts.participant == "P02":
                raise error

    with pytest.raises(RuntimeError if isinstance(error, RuntimeError) else ExportError) as raised:
        export(format_that(write), tmp_path / "out", sessions_of(study))
    assert names(tmp_path) == ["study"]
    if isinstance(error, OSError):
        assert str(raised.value) == f"{tmp_path / 'out'} could not be written: the disk is full"


def test_what_no_session_can_be_read_of_is_not_there(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions", short(), until=20)
    (folder / JOURNAL).write_bytes(b"")
    with pytest.raises(ExportError, match="is empty: nothing was ever recorded\nno session could be read"):
        export(load_format("tables"), tmp_path / "out", [folder])
    assert "out" not in names(tmp_path)


def test_a_session_that_cannot_be_read_is_said_and_the_others_are_exported(study: Path, tmp_path: Path) -> None:
    first, *others = sessions_of(study)
    (first / JOURNAL).unlink()
    said = export(load_format("jsonl"), tmp_path / "out", [first, *others])
    assert len(said) == 1 and said[0].startswith(f"{first.name} is not in it: there is no journal")
    assert len(names(tmp_path / "out")) == 7


# --- never over anything ---


@pytest.mark.parametrize("what", ["file", "folder", "full folder", "link to nothing"])
@pytest.mark.parametrize("name", ["csv", "tables"])
def test_what_is_there_stays_as_it_is(tmp_path: Path, name: str, what: str) -> None:
    folder = play_session(tmp_path / "sessions", short(), until=20)
    out = tmp_path / "out"
    match what:
        case "file":
            out.write_text("mine")
        case "link to nothing":
            out.symlink_to(tmp_path / "nowhere")
        case _:
            out.mkdir()
            if what == "full folder":
                (out / "mine").write_text("mine")
    before = out.lstat()
    with pytest.raises(ExportError, match="is there already, and files are never overwritten"):
        export(load_format(name), out, [folder])
    assert out.lstat() == before and not (tmp_path / "nowhere").exists()
    assert names(tmp_path) == ["out", "scenario", "sessions"]


@pytest.mark.parametrize("kind", ["file", "folder"])
@pytest.mark.parametrize("links", [True, False])
def test_what_somebody_puts_there_meanwhile_stays_too(
    tmp_path: Path, kind: str, links: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_link(*_: object) -> None:
        raise OSError(95, "not here")

    if not links:  # as on a USB stick
        monkeypatch.setattr(os, "link", no_link)
    out = tmp_path / "out"
    with pytest.raises(ExportError, match="is there already"), new_export(out, [], "csv", "full") as export:
        if kind == "file":
            export.here.write_text("ours")
        else:
            export.here.mkdir()
        out.write_text("theirs")
    assert out.read_text() == "theirs" and names(tmp_path) == ["out"]


def test_where_no_links_can_be_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_link(*_: object) -> None:
        raise OSError(1, "not permitted")

    monkeypatch.setattr(os, "link", no_link)
    with new_export(tmp_path / "out", [], "csv", "full") as export:
        export.here.write_text("ours")
    assert (tmp_path / "out").read_text() == "ours" and names(tmp_path) == ["out"]


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="there is no folder"), new_export(tmp_path / "no" / "out", [], "csv", "full"):
        raise AssertionError("nothing can be made there")


# --- killed ---

_HALF = """
import sys
from pathlib import Path
from rise_engine.cli import main
from rise_engine.cli.data import export
from rise_engine.results.export.format import ExportFormat

def write(path, sessions, context):
    path.mkdir()
    for data in sessions:
        (path / data.facts.session).write_text("half")
        print("writing", flush=True)
        sys.stdin.read()

export.load_format = lambda name: ExportFormat("odd", "", "folder", "", write)
export.format_names = lambda: ["odd"]
main(["export", sys.argv[1], "--format", "odd", "-o", sys.argv[2]])
"""


@contextmanager
def half_written(study: Path, out: Path) -> Iterator[Forked]:
    """A process that has written half of an export, and waits."""
    with Forked(study, out, code=_HALF, stdin=PIPE) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == "writing\n"
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_whoever_ends_it_finds_nothing_of_it(study: Path, tmp_path: Path, number: signal.Signals) -> None:
    with half_written(study, tmp_path / "out") as process:
        process.send_signal(number)
        _, said = process.communicate()
    assert (process.returncode, said) == (130, "")
    assert names(tmp_path) == ["study"]


def test_a_kill_leaves_nothing_in_its_place_and_the_next_one_clears_up(study: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    with half_written(study, out) as process:
        busy = [name for name in names(tmp_path) if name.startswith(".out.unfinished-")]
        assert len(busy) == 1 and unfinished_files.erase_unfinished(out) == [tmp_path / busy[0]]
        assert names(tmp_path) == [*busy, "study"], "it is being written: nobody takes it for a leftover"
        process.kill()
        process.wait()
    assert names(tmp_path) == [*busy, "study"]
    assert [each.get("path") for each in read_log(study) if each.kind == "exported"] == [str(out)]
    assert export(load_format("csv"), out, sessions_of(study)) == []
    assert names(tmp_path) == ["out", "study"]


# --- the study knows of it ---


def test_the_study_knows_of_it_before_it_is_there(study: Path, tmp_path: Path) -> None:
    logged: list[dict[str, object]] = []

    def write(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
        logged.append(read_log(study)[-1].fields)
        path.mkdir()

    sessions = sessions_of(study)[:4]
    export(format_that(write), study / "out", sessions)
    assert logged == [
        {
            "path": "out",
            "format": "odd",
            "level": "full",
            "sessions": [each.name for each in sessions],
            "participants": ["P01", "P02"],
            "folder": True,
        }
    ]


def test_two_studies_and_a_session_of_none(tmp_path: Path) -> None:
    one, two = make_study(tmp_path / "one"), make_study(tmp_path / "two")
    alone = play_session(tmp_path / "sessions", short(), until=20)
    folders = [sessions_of(one)[1], alone, sessions_of(two)[2]]
    with new_export(tmp_path / "x.csv", folders, "csv", "shared") as export:
        assert export.problems == []
        export.here.touch()
    for study, folder in ((one, folders[0]), (two, folders[2])):
        entry = read_log(study)[-1]
        assert (entry.kind, entry.get("path"), entry.get("sessions")) == (
            *("exported", str(tmp_path / "x.csv")),
            [folder.name],
        )
        assert entry.get("folder") is None
    assert export_context(folders, "full").study is None
    assert export_context(folders[:1], "full").study is not None


def test_a_study_that_cannot_be_told_is_said(study: Path, tmp_path: Path) -> None:
    (study / LOG_FILE).unlink()
    (study / LOG_FILE).mkdir()
    said = export(load_format("csv"), tmp_path / "out.csv", sessions_of(study))
    assert len(said) == 1 and "a withdrawal will not erase it" in said[0]


def test_names_of_files_are_never_twice_the_same(tmp_path: Path) -> None:
    folders = [play_session(tmp_path / where / "sessions", short(), until=20) for where in ("a", "b")]
    assert folders[0].name == folders[1].name
    export(load_format("jsonl"), tmp_path / "out", folders)
    assert names(tmp_path / "out") == [f"{folders[0].name}-2.jsonl", f"{folders[0].name}.jsonl"]


def test_one_session_is_one_file_where_each_has_one(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions", short(), until=20)
    export(load_format("jsonl"), tmp_path / "one.jsonl", [folder], several=False)
    assert (tmp_path / "one.jsonl").is_file() and os.stat(tmp_path / "one.jsonl").st_nlink == 1  # noqa: PTH116
