"""Sessions that older programs have left are still read, replayed, exported and gone on with.

Those in `old_sessions` were made by the program as it was: commit 7cb6b41 (`before_turns`) and 86ffa93
(`before_studies`), each with `rise-engine serve`, a client, a `kill -9` in the middle of a sentence, and `--recover`.
One of each was then ended, the other killed again.
"""

from __future__ import annotations

import csv
import io
import shutil
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from rise_engine.export.records import COLUMNS, SessionExport
from rise_engine.kernel.inputs import (
    AnyInput,
    CheckReport,
    OutcomeReport,
    SessionEnded,
    SessionRecovered,
    Submit,
    SyncMark,
)
from rise_engine.kernel.records import OutcomeRecord, SessionRecord, TimingRecord
from rise_engine.session.folder import JOURNAL, SessionError
from rise_engine.session.journal_format import (
    FORMAT,
    encode_input,
    encode_record,
    fields_left_out,
    join_step,
    with_checksum,
)
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.recovery import RecoveredSession, recover
from rise_engine.session.replay import compare_replay

OLD = Path(__file__).parent / "old_sessions"
ALL = sorted(folder.name for folder in OLD.iterdir() if folder.is_dir())
UNFINISHED = [name for name in ALL if name.endswith("unfinished")]


@pytest.fixture
def folder(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A copy of an old session."""
    copied: Path = shutil.copytree(OLD / request.param, tmp_path / request.param)
    return copied


def go_on(folder: Path, found: RecoveredSession, *inputs: AnyInput) -> None:
    """What the engine does with a session that it has recovered."""
    with (folder / JOURNAL).open("ab") as journal:
        for number, fact in enumerate(inputs, found.inputs + 1):
            fact = replace(fact, t=found.t + number - found.inputs)
            records, _ = found.kernel.handle(fact)
            for record in records:
                record.wall = "2026-11-23T09:00:00.000+01:00"
            journal.write(join_step(encode_input(number, fact), map(encode_record, records)))


def test_there_are_some_of_format_1_with_what_matters() -> None:
    assert len(ALL) == 4 and len(UNFINISHED) == 2
    for name in ALL:
        contents = read_journal(OLD / name / JOURNAL)
        records = [*contents.read_records()]
        assert contents.format == 1 and not contents.damaged and not contents.gaps
        assert contents.ended is (name not in UNFINISHED)
        told = {(msgspec.json.decode(encode_record(each))["kind"], getattr(each, "status", "")) for each in records}
        assert told >= {("cue", "filled"), ("cue", "answered"), ("session", "recovered"), ("timing", "ABORTED")}
        assert any(isinstance(each, TimingRecord) and each.act == "say" for each in records)
        assert any(msgspec.json.decode(encode_record(each))["kind"] == "failure" for each in records) is (
            "studies" in name
        )


@pytest.mark.parametrize("folder", ALL, indirect=True)
def test_they_replay_identically(folder: Path) -> None:
    found = compare_replay(folder)
    assert found.identical and found.records == read_journal(folder / JOURNAL).records, found.difference


@pytest.mark.parametrize("folder", ALL, indirect=True)
def test_they_are_exported_and_what_was_not_known_is_empty(folder: Path) -> None:
    exported, lines = io.BytesIO(), io.BytesIO()
    export = SessionExport(folder)
    assert not export.problems
    export.write("csv", exported)
    export.write("jsonl", lines)
    rows = [*csv.DictReader(io.StringIO(exported.getvalue().decode(), newline=""))]
    assert tuple(rows[0]) == COLUMNS and len(rows) == len(lines.getvalue().splitlines())
    timings = [row for row in rows if row["kind"] == "timing"]
    assert timings and all(row["started_at"] and not row["voice_at"] and not row["source"] for row in timings)
    sessions = [row for row in rows if row["kind"] == "session"]
    assert all(row["participant"] == "P07" and not row["slot"] and row["wall"] for row in sessions)


@pytest.mark.parametrize("folder", UNFINISHED, indirect=True)
def test_an_unfinished_one_is_gone_on_with_and_the_whole_replays_identically(folder: Path) -> None:
    found = recover(folder)
    assert found.report == [] and found.last_wall == read_journal(folder / JOURNAL).last_record.wall  # type: ignore[union-attr]
    go_on(
        folder,
        found,
        SessionRecovered(downtime=3600.5),
        CheckReport(id="lights", result="passed"),
        Submit(function="say", behavior="Where were we?", source="wizard:anna"),
        OutcomeReport(status="complete", source="wizard:anna"),
        SessionEnded(reason="done"),
    )
    contents = read_journal(folder / JOURNAL)
    assert contents.ended and contents.format == 1, "the beginning is still an older program's"
    assert compare_replay(folder).identical
    records = [*contents.read_records()]
    [again] = [each for each in records if isinstance(each, SessionRecord) and each.downtime is not None]
    assert (again.status, again.downtime) == ("recovered", 3600.5)
    [outcome] = [each for each in records if isinstance(each, OutcomeRecord)]
    assert outcome.status == "complete"
    lost = [each for each in records if isinstance(each, TimingRecord) and each.seq > again.seq]
    assert lost and all(each.voice_at is not None for each in lost if each.act == "Story"), "it had begun to speak"


@pytest.mark.parametrize("folder", UNFINISHED[:1], indirect=True)
def test_marks_from_before_it_was_known_when_they_began(folder: Path) -> None:
    go_on(folder, recover(folder), SessionRecovered(downtime=1.0), SyncMark(number=1, medium="sound"), SessionEnded())
    lines = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    at = next(index for index, line in enumerate(lines) if b'"kind":"sync"' in line)
    value = {name: each for name, each in msgspec.json.decode(lines[at]).items() if name not in ("at", "within", "crc")}
    assert len(value) == 8
    lines[at] = with_checksum(msgspec.json.encode(value))
    (folder / JOURNAL).write_bytes(b"".join(lines))
    assert compare_replay(folder).identical
    assert fields_left_out(lines[at], "sync", 2) == {"at", "within"} and not fields_left_out(lines[at], "sync", FORMAT)


@pytest.mark.parametrize("folder", UNFINISHED, indirect=True)
def test_what_a_newer_program_has_added_to_one_is_compared_in_full(folder: Path) -> None:
    go_on(folder, recover(folder), SessionRecovered(downtime=1.0), SessionEnded())
    lines = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    at = next(index for index in range(len(lines) - 1, 0, -1) if b'"kind":"timing"' in lines[index])
    value = msgspec.json.decode(lines[at])
    del value["crc"]
    lines[at] = with_checksum(msgspec.json.encode({**value, "source": "wizard:eve"}))
    (folder / JOURNAL).write_bytes(b"".join(lines))
    difference = compare_replay(folder).difference
    assert difference is not None and (difference.field, difference.line) == ("source", at + 1)


@pytest.mark.parametrize("folder", ALL[:1], indirect=True)
def test_what_the_format_had_is_compared(folder: Path) -> None:
    lines = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    at = next(index for index, line in enumerate(lines) if b'"kind":"timing"' in line)
    value = msgspec.json.decode(lines[at])
    del value["crc"]
    lines[at] = with_checksum(msgspec.json.encode({**value, "robot_at": 99.0}))
    (folder / JOURNAL).write_bytes(b"".join(lines))
    difference = compare_replay(folder).difference
    assert difference is not None and (difference.field, difference.recorded) == ("robot_at", 99.0)


@pytest.mark.parametrize("folder", UNFINISHED[:1], indirect=True)
def test_one_that_says_it_is_of_the_present_format_must_have_all_of_it(folder: Path) -> None:
    text = (folder / JOURNAL).read_bytes()
    header = msgspec.json.decode(text.partition(b"\n")[0])
    del header["crc"]
    newer = with_checksum(msgspec.json.encode({**header, "journal": FORMAT}))
    (folder / JOURNAL).write_bytes(newer + text.partition(b"\n")[2])
    difference = compare_replay(folder).difference
    assert difference is not None and (difference.kind, difference.field) == ("timing", "source")
    with pytest.raises(SessionError, match="does not repeat"):
        recover(folder)


@pytest.mark.parametrize("folder", UNFINISHED[:1], indirect=True)
def test_a_damaged_one_is_repaired_and_stays_of_its_format(folder: Path) -> None:
    lines = (folder / JOURNAL).read_bytes().splitlines(keepends=True)
    timing = next(index for index, line in enumerate(lines) if b'"kind":"timing"' in line)
    for at in (0, timing):
        lines[at] = lines[at].replace(b'"', b"'", 1)
    (folder / JOURNAL).write_bytes(b"".join(lines))
    assert "lines 1, " in recover(folder).report[0]
    assert read_journal(folder / JOURNAL).format == 1 and compare_replay(folder).identical
