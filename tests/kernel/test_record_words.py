"""A record in words: one sentence for everybody who tells it."""

from __future__ import annotations

from typing import Any

import pytest

from rise_engine.author.trial.trial_history import lines_of
from rise_engine.cli.session.transcript import Transcript
from rise_engine.kernel.record_words import words_of
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    CheckRecord,
    ConditionRecord,
    CountdownRecord,
    CueRecord,
    EventRecord,
    FailureRecord,
    KeptRecord,
    MemoryRecord,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    SessionRecord,
    StopRecord,
    TaskRecord,
)
from rise_tui.model.notice import record_notice

AT: Any = (1, 2.5, "")
ANNA = "wizard:anna"


def task(status: Any, reason: str = "", source: str = ANNA) -> TaskRecord:
    return TaskRecord(*AT, 7, "startCommunicationRobotAct", "Greet", "Blocking", source, status, reason)


def rule(status: Any, state: str | None = "Talk", **more: Any) -> RuleRecord:
    return RuleRecord(*AT, "Visit", status, state, **more)


@pytest.mark.parametrize(
    ("record", "sentence"),
    [
        (task("ACTIVE"), "act Greet started"),
        (task("REJECTED", "everything is stopped"), "act Greet was rejected: everything is stopped"),
        (task("ABORTED", "no voice"), "act Greet failed: no voice"),
        (task("CANCELED", "interrupted by Answer"), "act Greet was interrupted by Answer"),
        (ActionRecord(*AT, 7, "Greet", "1", "Speech", {"message": "Hi"}, "timed-out", "no answer"),
         'Speech "Hi" timed out: no answer'),
        (rule("entered"), "rule Visit: in Talk"),
        (rule("entered", trigger="resumed, without onEntry"), "rule Visit: in Talk (resumed, without onEntry)"),
        (rule("entered", previous="Start", trigger="/tea"), "rule Visit: Start → Talk on /tea"),
        (rule("entered", previous="Start", trigger="after 2s"), "rule Visit: Start → Talk after 2s"),
        (rule("entered", previous="Start", trigger="ended Greet failed"), "rule Visit: Start → Talk when Greet failed"),
        (rule("entered", previous="Start", trigger="ended == 1"), "rule Visit: Start → Talk when ended == 1"),
        (rule("entered", previous="Talk", trigger="x > 0"), "rule Visit: again in Talk when x > 0"),
        (rule("stayed", trigger="while calm after 5s"), "rule Visit stays in Talk after 5s of calm"),
        (rule("stopped", reason="stop-all by wizard:anna"), "rule Visit was stopped in Talk: stop-all by wizard:anna"),
        (rule("faulted", None, reason="it ran away"), "rule Visit was stopped by a fault: it ran away"),
        (EventRecord(*AT, "/tea", ANNA, "Visit"), "event /tea: Visit takes it"),
        (EventRecord(*AT, "/tea", ANNA, None), "event /tea: no rule waits for it"),
        (ConditionRecord(*AT, "Visit", "Talk", "x > 1", {"x": 2}, result=True),
         "condition x > 1: true in Visit (x is 2)"),
        (ConditionRecord(*AT, "Visit", "Talk", "x > 1", {"x": None}, False, missing=("x",)),
         "condition x > 1: false in Visit (x is not set)"),
        (ConditionRecord(*AT, "Visit", "Talk", "happy", {"happy": True}, result=True),
         "condition happy: true in Visit"),
        (MemoryRecord(*AT, "mood", "happy", "sad", ANNA), "memory mood = happy (was sad)"),
        (MemoryRecord(*AT, "mood", None, "sad", ANNA, deleted=True), "memory mood is deleted (was sad)"),
        (CountdownRecord(*AT, "Visit", "Talk", 1, "began", 5.0), "countdown Visit: transition 2 fires in 5 s"),
        (CountdownRecord(*AT, "Visit", "Talk", 1, "failed", None, "no time"),
         "countdown Visit: transition 2 never fires: no time"),
        (KeptRecord(*AT, 7, "/yes", "kept", 2.0), "event /yes is kept for 2 s: no rule waits for it yet"),
        (KeptRecord(*AT, 7, "/yes", "taken", rule="Visit"), "event /yes was kept, and Visit takes it now"),
        (KeptRecord(*AT, 7, "/yes", "expired"), "event /yes expired: no rule waited for it"),
        (CueRecord(*AT, "answered", ANNA, task=8, since=2.5),
         "cue the participant's cue is answered by task 8 after 2.5 s"),
        (FailureRecord(*AT, 7, "Greet", "asked", "engine", reason="no voice"),
         "act Greet failed, and somebody is asked what to do: no voice"),
        (FailureRecord(*AT, 7, "Greet", "waiting", "engine", seconds=2.0), "act Greet failed, and is repeated in 2 s"),
        (StopRecord(*AT, "requested", source=ANNA), "stop requested by wizard:anna"),
        (StopRecord(*AT, "latched", ("voice",), ("arms",), ANNA, ("wheels",)),
         "stop latched: confirmed by voice; NOT confirmed by arms; wheels CANNOT be stopped"),
        (RobotRecord(*AT, "lost", "unplugged"), "robot lost: unplugged"),
        (CheckRecord(*AT, "lamp", "The lamp is on", "failed", "", "it is dark", ANNA),
         "check failed: The lamp is on: it is dark"),
        (RecordingRecord(*AT, "camera", "stalled", "/a", 5, "the disk is full", "node:c"),
         "recording stalled: camera: the disk is full"),
        (OutcomeRecord(*AT, "aborted", "a fire drill", ANNA), "session counts as aborted: a fire drill"),
    ],
)  # fmt: skip
def test_a_record_in_words(record: AnyRecord, sentence: str) -> None:
    assert words_of(record).full_sentence == sentence


def test_who_takes_part_is_told_where_it_is_asked_for_only() -> None:
    """ROS's log goes to whoever listens."""
    began = SessionRecord(*AT, status="started", scenario="Tea", mode="real", robot="generic", participant="P07")
    assert "P07" not in words_of(began).full_sentence
    assert words_of(began, sources=True).text == "Tea, mode real, robot generic, seed 0, P07"


def test_trials_notices_and_transcripts_say_the_same() -> None:
    kept = KeptRecord(*AT, 7, "/yes", "kept", 2.0)
    notice, (line,) = record_notice(kept), lines_of([kept])
    assert notice is not None and notice.text == line.text == words_of(kept).sentence
    told = Transcript().line_for(kept)
    assert told is not None and told.split() == ["00:02.5", "event", *line.text.split()]
