"""What a withdrawal leaves alone: whatever a log or a session names that is not what exports and recorders wrote."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from rise_engine.base.files import fingerprint, tree_hash
from rise_engine.base.words import Words, parse_replacement
from rise_engine.cli.data.redact import redact_in_study
from rise_engine.privacy.redaction import RedactionReport
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.writing import new_export
from rise_engine.session.media import MediaFile, register_media
from rise_engine.session.unfinished_files import private_folder
from rise_engine.study.state import read_state
from rise_engine.study.study_log import LockedLog, read_log
from rise_engine.study.traces import WORK_FOLDER
from rise_engine.study.withdrawal import withdraw
from tests.commands import typed

from .test_withdrawal import Folder, assert_gone


@pytest.fixture
def made(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def exported(made: Folder, path: str, participants: Any = ("P01",), *, noted: bool = True) -> None:
    """Entries as an export writes them."""
    with LockedLog(made.study) as log:
        log.append("exported", path=path, participants=participants, sessions=[], folder=True)
        if noted:
            log.append("written", path=path, participants=participants, sha256=tree_hash(made.study / path))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(each): each.read_bytes() for each in sorted(folder.rglob("*")) if each.is_file()}


def test_a_log_that_names_what_is_no_export_has_nothing_erased(made: Folder) -> None:
    elsewhere = made.root / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "mine.csv").write_text("mine")
    (made.study / "link").symlink_to(elsewhere)
    theirs = f"sessions/{made.sessions[2].name}"
    named = [theirs, f"{theirs}/journal.jsonl", "study.toml", "participants.csv", "plan.csv", "study.jsonl", "sessions"]
    named += [f"scenario/../{theirs}", "scenario/scenario.toml", "link/mine.csv", "..", "/etc/hostname", str(elsewhere)]
    before = {**contents(made.sessions[2]), **contents(elsewhere), **contents(made.study / "scenario")}
    for path in named:
        exported(made, path, noted=path != "/etc/hostname" and (made.study / path).is_file())
    exported(made, "a\0b", noted=False)
    exported(made, "scenario")
    exported(made, "link")
    exported(made, "p02.csv", 5, noted=False)

    report = withdraw(made.study, "P01")

    after = {**contents(made.sessions[2]), **contents(elsewhere), **contents(made.study / "scenario")}
    assert after == before
    assert all((made.study / name).exists() for name in ("study.toml", "participants.csv", "plan.csv"))
    assert (made.study / "link").is_symlink()
    for path in (*named, "a\0b", "scenario", "link"):
        assert any(path in each for each in report.unreached), path


def test_an_export_that_is_not_what_was_written_is_told(made: Folder) -> None:
    kinds = ("changed", "added to", "not noted", "deleted")
    for kind in kinds:
        path = made.study / kind
        path.mkdir()
        (path / "acts.csv").write_text("P01")
        exported(made, kind, noted=kind != "not noted")
    (made.study / "changed" / "acts.csv").write_text("mine")
    (made.study / "added to" / "mine.txt").write_text("mine")
    shutil.rmtree(made.study / "deleted")
    result = typed("study", "withdraw", made.study, "P01", "--yes")
    assert result.exit_code == 1
    told = result.output.partition("not erased; you must see to it:")[2]
    for kind in kinds:
        assert f"  {made.study / kind}" in told, result.output
        assert (made.study / kind).exists() == (kind != "deleted")


def test_what_a_session_calls_its_recording_and_is_none_is_told(made: Folder) -> None:
    root = made.root
    films = {kind: root / f"{kind}.mp4" for kind in ("older", "grown", "unknown size", "linked")}
    (root / "other").mkdir()
    (root / "other" / "session.toml").touch()
    films["of another study"] = root / "other" / "film.mp4"
    for film in films.values():
        film.write_bytes(b"film")
    os.utime(films["older"], (10**9, 10**9))
    (root / "link.mp4").symlink_to(films["linked"])
    (root / "metadata.yaml").touch()
    theirs = made.sessions[0] / ".." / made.sessions[2].name / "journal.jsonl"
    named = [*(films[kind] for kind in films if kind != "linked"), root / "link.mp4", root]
    named += [made.study / "study.toml", theirs, Path("~nobody-of-this-name/film.mp4")]
    for path in named:
        size = None if path == films["unknown size"] else path.stat().st_size if path.is_file() else 1
        register_media(made.sessions[0], MediaFile(path=str(path), kind="video", bytes=size))
    films["grown"].write_bytes(b"longer film")

    def kept() -> dict[str, bytes]:
        toml = {"study.toml": (made.study / "study.toml").read_bytes()}
        return contents(made.sessions[2]) | toml | {str(film): film.read_bytes() for film in films.values()}

    before = kept()
    report = withdraw(made.study, "P01")
    assert kept() == before
    for path in named:
        assert any(os.path.normpath(path) in each for each in report.unreached), path


def test_a_recording_whose_hash_is_another_is_told(made: Folder) -> None:
    same, other = made.root / "same.mp4", made.root / "other.mp4"
    for path in (same, other):
        path.write_bytes(b"film")
        register_media(made.sessions[0], MediaFile(path=str(path), kind="video", bytes=4, sha256=tree_hash(path)))
    other.write_bytes(b"mine")
    report = withdraw(made.study, "P01")
    assert not same.exists() and other.read_bytes() == b"mine"
    assert any(f"{other} was changed since it was written" in each for each in report.unreached)


def test_sessions_that_lie_elsewhere_are_told(made: Folder) -> None:
    away = made.root / "away"
    made.sessions[0].rename(away)
    made.sessions[1].rename(made.root / "linked")
    made.sessions[1].symlink_to(made.root / "linked")
    report = withdraw(made.study, "P01")
    assert away.exists() and (made.root / "linked").exists()
    assert f"session {made.sessions[0].name} is not in sessions any more: erase it where it is now" in report.unreached
    assert any(f"{made.sessions[1]} is a link to {made.root / 'linked'}" in each for each in report.unreached)


def test_a_file_with_another_name_is_told(made: Folder) -> None:
    name = made.sessions[0].name
    os.link(made.sessions[0] / "journal.jsonl", made.root / "backup.jsonl")
    os.link(made.sessions[0] / "scenario" / "note.txt", made.root / "note.txt")
    os.link(made.videos / "one", made.root / "second.mkv")
    os.link(made.study / "all.csv", made.root / "all.csv")
    told = "had another name on this disk (a hard link, as backups make them): it is there still"
    report = withdraw(made.study, "P01")
    assert [each for each in report.unreached if told in each] == [
        f"{made.videos / 'one'} {told}",
        f"{made.study / 'all.csv'} {told}",
        f"sessions/{name}: journal.jsonl, scenario/note.txt {told}",
    ]
    assert (made.root / "backup.jsonl").exists()


@pytest.mark.parametrize("what", ["videos/one", "study/p01.csv", "session"])
def test_what_cannot_be_erased_is_told_the_rest_is_and_the_next_time_goes_on(made: Folder, what: str) -> None:
    path = made.sessions[1] / "journal.jsonl" if what == "session" else made.root / what
    number, unlink = path.stat().st_ino, Path.unlink

    def refused(file: Path, missing_ok: bool = False) -> None:
        if file.exists() and file.lstat().st_ino == number:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        unlink(file, missing_ok)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "unlink", refused)
        report = withdraw(made.study, "P01")
    said = [each for each in report.unreached if "could not be erased: " in each]
    assert len(said) == 1 and (path.name in said[0] or "sessions" in said[0] or WORK_FOLDER in said[0])
    assert len(report.erased) == 3 + 2 + 3 - 1 and (made.study / WORK_FOLDER).exists()
    assert not any(WORK_FOLDER in each for each in report.remains)
    again = withdraw(made.study, "P01")
    assert not any("could not be erased" in each for each in again.unreached)
    assert_gone(made)


def test_what_killed_exports_have_left_goes_whosever_it_was(made: Folder) -> None:
    with private_folder(made.study / "x.zip") as work:
        left = Path(shutil.copytree(work, made.study / ".y.zip.unfinished-abcdefgh"))
        (left / "y.zip").write_bytes(b"P01")
        report = withdraw(made.study, "P01")
        assert work.exists() and any(f"{work} is being written just now" in each for each in report.unreached)
    assert not left.exists()


def test_whom_a_report_names_without_a_session_is_noted(made: Folder) -> None:
    with LockedLog(made.study) as log:
        log.append("excluded", participant="P05", reason="did not come")
    people = {made.study.resolve(): read_state(made.study).pseudonyms}
    with new_export(made.study / "r.html", made.sessions[2:3], "report", "full", people=people) as export:
        export.here.write_text("excluded: P05")
    assert withdraw(made.study, "P05").make_again == [f"{made.study / 'r.html'} (with P02, P01, P03)"]
    assert not (made.study / "r.html").exists()


def test_an_export_of_somebody_without_a_session_who_withdraws_meanwhile_is_not_kept(made: Folder) -> None:
    people = {made.study.resolve(): ("P05",)}
    with (
        pytest.raises(ExportError, match="P05: gone while this was made"),
        new_export(made.study / "r.html", made.sessions[2:3], "report", "full", people=people) as export,
    ):
        export.here.write_text("excluded: P05")
        withdraw(made.study, "P05")
    assert not (made.study / "r.html").exists()


# --- redaction ---


def redacted(made: Folder, lines: int) -> list[str]:
    return redact_in_study(made.sessions[2], RedactionReport(lines=lines), Words([parse_replacement("Zelda=NAME1")]))


def test_an_export_that_is_overtaken_by_a_redaction_is_not_kept(made: Folder) -> None:
    out = made.study / "late.csv"
    with (
        pytest.raises(ExportError, match="words were taken out of it while this was made"),
        new_export(out, made.sessions[2:3], "csv", "full") as export,
    ):
        export.here.write_text("Zelda")
        redacted(made, 1)
    assert not out.exists()


def test_older_exports_of_a_redacted_session_are_named_until_they_are_gone(made: Folder, tmp_path: Path) -> None:
    for out in (made.study / "old.csv", tmp_path / "old.csv", made.study / "again.csv"):
        with new_export(out, made.sessions[2:3], "csv", "full") as export:
            export.here.write_text("Zelda")
    everything = ["old.csv", str(tmp_path / "old.csv"), "again.csv"]
    assert redacted(made, 2) == everything
    assert redacted(made, 0) == everything, "the first one was killed before it could say so"
    (made.study / "again.csv").unlink()
    with new_export(made.study / "again.csv", made.sessions[2:3], "csv", "full") as export:
        export.here.write_text("NAME1")
    (tmp_path / "old.csv").unlink()
    assert redacted(made, 0) == ["old.csv"]
    assert [each.get("lines") for each in read_log(made.study) if each.kind == "redacted"] == [2]


MIB = 1 << 20


@pytest.mark.parametrize(("size", "at"), [(0, None), (1, 0), (MIB, MIB - 1), (5 * MIB, MIB - 1), (5 * MIB, 4 * MIB)])
def test_a_fingerprint_differs_with_the_size_and_the_ends_of_a_film(tmp_path: Path, size: int, at: int | None) -> None:
    film = tmp_path / "film"
    film.write_bytes(bytes(size))
    before = fingerprint(film)
    changed = bytearray(size + (at is None))
    if at is not None:
        changed[at] = 1
    film.write_bytes(changed)
    assert fingerprint(film) != before


def test_a_recording_without_a_fingerprint_is_listed(made: Folder, tmp_path: Path) -> None:
    """Its recorder was killed, for example. The size alone does not prove that the file is what was recorded."""
    film = tmp_path / "film.mkv"
    film.write_bytes(b"film")
    register_media(made.sessions[0], MediaFile(path=str(film), kind="video", bytes=4))
    unreached = withdraw(made.study, "P01").unreached
    assert any(each.startswith(f"{film}: nothing says what was written there") for each in unreached)
    assert film.exists()
