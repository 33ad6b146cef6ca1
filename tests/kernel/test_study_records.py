"""What a session knows of the study that it belongs to, what its condition sets, and what is reported about it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import (
    AnyInput,
    CheckReport,
    OutcomeReport,
    RecordingReport,
    SessionEnded,
    SessionRecovered,
    SessionStarted,
    SyncMark,
)
from rise_engine.kernel.records import AnyRecord, MemoryRecord, NoteRecord, SessionRecord
from rise_engine.kernel.snapshot import Snapshot
from rise_engine.kernel.view import SessionView
from rise_engine.results.analysis.course import ConditionCollector
from rise_engine.scenario.model import Scenario

from .harness import dialog, folded, read, speech, write
from .test_rules import on, rule, state

MEMORY: dict[str, Any] = {"hesitation": False, "name": "Ada"}
STARTED = SessionStarted(
    participant="P07",
    condition="yes+loud",
    study="lablinking",
    study_hash="3f0a",
    slot=7,
    run=2,
    attempt=1,
    purpose="counted",
    factors={"hesitation": "yes", "noise": "loud"},
    memory={"hesitation": True, "noise": {"level": 3}},
)
ACTS, TOML = dialog("Hello", speech(1)), 'title = "t"\n'
RULES = rule("Main", state("a", ways=on("next", "b")) + state("b"))
READS_SESSION = rule(
    "Main", state("a", ways='<transition cond="session.factors.noise == \'loud\'" target="b"/>') + state("b")
)


def scenario(folder: Path, rules: str = RULES, tables: dict[str, str] | None = None) -> Scenario:
    return read(write(folder, acts=ACTS, rules=rules, memory=MEMORY, toml=TOML, tables=tables))


def began(which: Scenario, started: SessionStarted) -> tuple[Kernel, list[AnyRecord]]:
    kernel = Kernel(which, 1)
    return kernel, kernel.handle(started)[0]


def changes(records: list[AnyRecord]) -> list[tuple[str, Any, Any, str, bool]]:
    return [(r.key, r.value, r.old, r.source, r.created) for r in records if isinstance(r, MemoryRecord)]


START = [("hesitation", False, None, "file", True), ("name", "Ada", None, "file", True)]


@pytest.mark.parametrize(
    ("started", "expected"),
    [
        (SessionStarted(), []),
        (SessionStarted(study="s"), []),
        (
            SessionStarted(study="s", memory={"hesitation": True, "noise": 3}),
            [("hesitation", True, False, "study", False), ("noise", 3, None, "study", True)],
        ),
        (SessionStarted(condition="yes", memory={"hesitation": True}),
         [("hesitation", True, False, "condition", False)]),
        (SessionStarted(memory={"name": None}), [("name", None, "Ada", "condition", False)]),
    ],
)  # fmt: skip
def test_what_the_condition_sets(tmp_path: Path, started: SessionStarted, expected: list[Any]) -> None:
    kernel, records = began(scenario(tmp_path), started)
    assert isinstance(records[0], SessionRecord), "first it is said what session this is"
    assert changes(records) == [*START, *expected], "after the start values, in the order in which they are given"
    assert kernel.core.memory == {**MEMORY, **started.memory}


def test_nothing_is_set_that_nobody_may_set(tmp_path: Path) -> None:
    which = scenario(tmp_path, tables={"words": "word\nhm\n"})
    kernel, records = began(which, SessionStarted(study="s", memory={"words": [], "words.0": 1, "hesitation": True}))
    notes = [record.text for record in records if isinstance(record, NoteRecord)]
    assert len(notes) == 2 and all(note.startswith("the study could not set 'words") for note in notes)
    assert kernel.core.memory["hesitation"] is True and kernel.core.memory["words"] == which.table_memory["words"]


def test_the_engine_s_own_keys_follow_and_know_the_factors(tmp_path: Path) -> None:
    kernel, records = began(scenario(tmp_path, READS_SESSION), STARTED)
    assert [change[0] for change in changes(records)] == ["hesitation", "name", "hesitation", "noise", "session"]
    assert kernel.core.memory["session"]["factors"] == STARTED.factors
    _, records = began(scenario(tmp_path / "more", READS_SESSION), SessionStarted(memory={"session": 1}))
    assert [record.text for record in records if isinstance(record, NoteRecord)], "nobody else sets these"


def test_every_session_record_says_which_part_of_which_study_it_is(tmp_path: Path) -> None:
    kernel, records = began(scenario(tmp_path), STARTED)
    snapshot = msgspec.json.decode(msgspec.json.encode(kernel.snapshot()), type=Snapshot)
    again = Kernel.restore(kernel.scenario, snapshot)
    for fact in (SessionRecovered(downtime=12.5), SessionEnded(reason="over")):
        records += again.handle(fact)[0]
    told = [record for record in records if isinstance(record, SessionRecord)]
    assert [(each.status, each.downtime) for each in told] == [("started", None), ("recovered", 12.5), ("ended", None)]
    for each in told:
        assert (each.participant, each.condition, each.study, each.study_hash) == (
            *("P07", "yes+loud"),
            *("lablinking", "3f0a"),
        )
        assert (each.slot, each.run, each.attempt, each.purpose) == (7, 2, 1, "counted")
        assert each.factors == STARTED.factors


def test_a_session_without_a_study_says_so(tmp_path: Path) -> None:
    (first, *_) = began(scenario(tmp_path), SessionStarted(condition="yes"))[1]
    assert isinstance(first, SessionRecord)
    assert (first.study, first.slot, first.run, first.attempt, first.purpose, first.factors) == ("", None, 0, 0, "", {})


REPORTS: list[tuple[AnyInput, dict[str, Any]]] = [
    (CheckReport(id="lights", text="The lamp is on", result="passed", source="wizard:a"),
     {"kind": "check", "id": "lights", "text": "The lamp is on", "result": "passed", "value": "", "reason": "",
      "source": "wizard:a"}),
    (CheckReport(id="disk", result="skipped", value="3 GB", reason="one session only"),
     {"kind": "check", "id": "disk", "text": "", "result": "skipped", "value": "3 GB", "reason": "one session only",
      "source": "engine"}),
    (OutcomeReport(status="aborted", reason="a fire drill", source="wizard:a"),
     {"kind": "outcome", "status": "aborted", "reason": "a fire drill", "source": "wizard:a"}),
    (RecordingReport(name="camera", status="stalled", path="/a.mkv", bytes=2**40, reason="it does not grow"),
     {"kind": "recording", "name": "camera", "status": "stalled", "path": "/a.mkv", "bytes": 2**40,
      "reason": "it does not grow", "source": "engine"}),
    (RecordingReport(name="bag", status="started"),
     {"kind": "recording", "name": "bag", "status": "started", "path": "", "bytes": None, "reason": "",
      "source": "engine"}),
    (SyncMark(number=2, medium="sound", text="at the end", source="node:beep"),
     {"kind": "sync", "number": 2, "medium": "sound", "text": "at the end", "source": "node:beep", "at": None,
      "within": None}),
    (SyncMark(number=3, medium="sound", at=2.75, within=0.02, source="node:beep"),
     {"kind": "sync", "number": 3, "medium": "sound", "text": "", "source": "node:beep", "at": 2.75, "within": 0.02}),
]  # fmt: skip


@pytest.mark.parametrize(("report", "expected"), REPORTS)
def test_what_is_reported_is_recorded_and_changes_nothing(
    tmp_path: Path, report: AnyInput, expected: dict[str, Any]
) -> None:
    kernel, _ = began(scenario(tmp_path), STARTED)
    before = msgspec.json.decode(msgspec.json.encode(kernel.snapshot()))
    records, commands = kernel.handle(msgspec.structs.replace(report, t=4.0))
    assert not commands
    (row,) = [msgspec.json.decode(msgspec.json.encode(record)) for record in records]
    assert row == {"seq": kernel.seq, "t": 4.0, "wall": "", **expected}
    after = msgspec.json.decode(msgspec.json.encode(kernel.snapshot()))
    assert after == {**before, "seq": before["seq"] + 1, "t": 4.0}


def test_a_view_remembers_the_last_word(tmp_path: Path) -> None:
    kernel, records = began(scenario(tmp_path), STARTED)
    again = [
        CheckReport(id="lights", result="failed", reason="dark"),
        CheckReport(id="disk", result="passed", value="90 GB"),
        CheckReport(id="lights", result="skipped", reason="daylight"),
        RecordingReport(name="camera", status="started", bytes=0),
        RecordingReport(name="camera", status="running", bytes=10),
        SyncMark(number=1, medium="sound"),
        OutcomeReport(status="complete"),
        OutcomeReport(status="excluded", reason="asked for it"),
    ]
    for report in again:
        records += kernel.handle(report)[0]
    view = folded(records)
    assert [(each.id, each.result) for each in view.checks.values()] == [("lights", "skipped"), ("disk", "passed")]
    assert {name: (each.status, each.bytes) for name, each in view.recordings.items()} == {"camera": ("running", 10)}
    assert view.sync is not None and view.sync.number == 1
    assert view.outcome is not None and (view.outcome.status, view.outcome.reason) == ("excluded", "asked for it")
    assert view.session is not None and (view.session.slot, view.session.factors) == (7, STARTED.factors)


@pytest.mark.parametrize(
    ("key", "value", "deleted", "overridden"),
    [
        ("hesitation", False, False, "hesitation"),
        ("hesitation", True, False, ""),
        ("hesitation", 1, False, "hesitation"),
        ("hesitation", None, True, "hesitation"),
        ("noise.level", 9, False, "noise"),
        ("noise[0]", 9, False, "noise"),
        ("noisy", 9, False, ""),
    ],
)
def test_a_wizard_s_other_value_for_a_key_of_the_condition_shows_in_view_and_results(
    key: str, value: Any, deleted: bool, overridden: str
) -> None:
    given = {"hesitation": True, "noise": {"level": 3}}
    records = [
        *(MemoryRecord(1, 0.0, "", name, it, None, "condition") for name, it in given.items()),
        MemoryRecord(2, 1.5, "", key, value, given.get(key), "wizard:anna", deleted=deleted),
    ]
    view, collector = SessionView(), ConditionCollector()
    for record in records:
        view.apply(record)
        collector.add(record)
    assert view.overridden == ({overridden: "wizard:anna"} if overridden else {})
    assert collector.keys() == ({overridden: 1.5} if overridden else {})
