"""What rules know of the session, conditions that have held, computed times, and events that are kept (semantics.md
5.5, semantics.md 6.6, semantics.md 7.2)."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.kernel.records import (
    CountdownRecord,
    EventRecord,
    KeptRecord,
    MemoryRecord,
    MistakeRecord,
    RuleRecord,
    TaskRecord,
)
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from tests.chance import examples

from .harness import Session, dialog, read, speech, view_of, write
from .test_rules import on, rule, session, state

TALK = dialog("A", speech(1), speech(2, "And more", "1"))


def after(time: str, target: str = "b", held: str = "", more: str = "") -> str:
    held = f'while="{held}" ' if held else ""
    return f'<transition {held}after="{time}" target="{target}" {more}/>'


def waits(*ways: str) -> str:
    return rule("R", state("a", "", "".join(ways)), state("b", "", on("/again", "a")))


# --- the session's keys -----------------------------------------------------------------------------------------------


def reader(text: str = "session.cue or session.speaking or session.stopped") -> str:
    return rule("R", state("a", "", f'<transition cond="{text}" target="b"/>'), state("b"))


def test_the_engine_says_how_the_session_stands(tmp_path: Path) -> None:
    s = session(tmp_path, reader(), TALK)
    assert s.memory["session"] == {
        "speaking": False,
        "cue": False,
        "stopped": False,
        "participant": "",
        "condition": "",
        "factors": {},
        "language": "",
    }
    told: list[dict[str, bool]] = []
    for step in ("mark", "act", "first", "second", "stop", "release"):
        match step:
            case "mark":
                s.submit("markCue")
            case "act":
                s.act("A")
            case "stop":
                s.submit("stopAll")
            case "release":
                s.confirm_stop()
                s.submit("releaseStop")
            case _:
                s.report(next(iter(s.goals)))
        told.append({name for name, value in s.memory["session"].items() if value is True})  # type: ignore[arg-type]
    assert told == [{"cue"}, {"speaking"}, {"speaking"}, set(), {"stopped"}, set()]


def test_a_change_is_recorded_with_the_whole_object(tmp_path: Path) -> None:
    s = session(tmp_path, reader(), TALK)
    before = s.memory["session"]
    s.submit("markCue")
    s.submit("stopAll")
    cue, stopped = (r for r in s.records if isinstance(r, MemoryRecord) and r.key == "session" and not r.created)
    assert (cue.old, cue.value) == (before, {**before, "cue": True})
    assert (stopped.old, stopped.value, stopped.source) == (cue.value, {**cue.value, "stopped": True}, "engine")


def test_between_two_sentences_of_an_act_the_robot_does_not_fall_silent(tmp_path: Path) -> None:
    s = session(tmp_path, reader(), TALK)
    s.act("A")
    s.lines()
    s.report("1/1")
    assert s.lines("memory") == []


def test_who_takes_part_and_in_what(tmp_path: Path) -> None:
    scenario = read(write(tmp_path, rules=reader("session.condition = 'b' and session.factors.pace = 'slow'")))
    kernel = Kernel(scenario, 1)
    kernel.handle(SessionStarted(participant="P7", condition="b", factors={"pace": "slow"}))
    s = Session(scenario, kernel=kernel)
    s.rule("R")
    assert s.states == {}, "its condition held at once, and b ends the rule"


@pytest.mark.parametrize(
    "text", ["session.cue = true", "session = 1", '{"session": {"cue": true}}', "x = 1; session.a = 2"]
)
def test_nobody_else_sets_them(tmp_path: Path, text: str) -> None:
    s = session(tmp_path, reader())
    before = dict(s.memory)
    assert s.assign(text).status == "REJECTED"
    assert s.submit("deleteValue", "session").status == "REJECTED"
    assert s.memory == before


def test_a_scenario_that_does_not_ask_has_none_of_it(tmp_path: Path) -> None:
    s = session(tmp_path, rule("R", state("a")), TALK)
    s.act("A")
    assert "session" not in s.memory


@pytest.mark.parametrize("memory", [{"session": 3}, {"session": {"speaking": "x"}}, {"session.cue": 1}])
def test_who_sets_it_has_a_key_of_their_own(tmp_path: Path, memory: dict[str, Any]) -> None:
    loaded = load(write(tmp_path, rules=reader("session.cue"), memory=memory))
    codes = {finding.code for finding in loaded.diagnostics}
    assert "own-session" in codes
    if loaded.scenario is not None:
        assert not loaded.scenario.reads_session


def test_a_misspelt_part_is_found(tmp_path: Path) -> None:
    loaded = load(write(tmp_path, rules=reader("session.speeking")))
    assert [finding.message for finding in loaded.errors] == [
        "the engine keeps no `speeking` under `session`; did you mean `session.speaking`?"
    ]


# --- conditions that have held ----------------------------------------------------------------------------------------


def counts(s: Session) -> list[str]:
    return [f"{each.t:g} {each.status}" for each in s.records if isinstance(each, CountdownRecord)]


def test_eight_seconds_without_interruption(tmp_path: Path) -> None:
    s = session(tmp_path, waits(after("8s", held="not session.speaking and not session.cue")), TALK)
    s.rule("R")
    s.wait(5)
    s.act("A")
    s.wait(2)
    s.finish_all()
    s.wait(7.9)
    s.submit("markCue")
    s.wait(3)
    s.submit("undoCue")
    s.wait(7.9)
    assert s.states == {"R": "a"}
    s.wait(0.1)
    assert s.states == {"R": "b"}
    assert counts(s) == ["0 began", "5 broken", "7 began", "14.9 broken", "17.9 began"]


@settings(max_examples=examples(150))
@given(st.lists(st.tuples(st.integers(0, 30), st.booleans()), max_size=12), st.integers(1, 30))
def test_it_fires_at_the_moment_that_the_definition_gives(changes: list[tuple[int, bool]], tenths: int) -> None:
    """For any interleaving: the first moment at which the condition has held for so long."""
    s = Session(HELD)
    s.assign(f"pause = {tenths / 10}")
    s.rule("R")
    now, since, due = 0, None, None
    for step, value in [*changes, (100, False)]:
        if since is not None and due is None and since + tenths <= now + step:
            due = since + tenths
        s.wait(step / 10)
        now += step
        s.assign(f"ready = {'true' if value else 'false'}")
        since = (now if since is None else since) if value else None
    taken = [round(each.t * 10) for each in s.records if isinstance(each, RuleRecord) and each.state == "b"]
    assert taken == ([] if due is None else [due])


# --- computed times ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("time", "memory", "seconds"),
    [
        ("{pause}", {"pause": 2}, 2),
        ("{pause}", {"pause": "1.5s"}, 1.5),
        ("{pause}", {"pause": "2min"}, 120),
        ("{pause / 4}", {"pause": 2}, 0.5),
        ("{pause}ms", {"pause": 250}, 0.25),
        (" { pause } min", {"pause": 0.5}, 30),
        ("{8 - pause}", {"pause": 20}, 0.001),
        ("{pause}", {"pause": 0}, 0.001),
        ("{pause}", {"pause": 86_400}, 86_400),
    ],
)
def test_a_time_is_computed_when_the_state_is_entered(
    tmp_path: Path, time: str, memory: dict[str, Any], seconds: float
) -> None:
    s = session(tmp_path, waits(after(time)), memory=memory)
    s.rule("R")
    assert list(s.timers.values()) == [seconds]
    s.assign("pause = 1")
    assert list(s.timers.values()) == [seconds], "and not anew afterwards"
    s.wait(seconds)
    assert s.states == {"R": "b"}


@pytest.mark.parametrize(
    ("time", "value", "reason"),
    [
        ("{pause}", True, "`{pause}` is true, which is not a time"),
        ("{pause}", "soon", '`{pause}` is the text "soon", which is not a time'),
        ("{pause}s", "2s", '`{pause}s` is the text "2s", which is not a time'),
        ("{pause}", None, "`{pause}` is null, which is not a time"),
        ("{pause}", 86_401, "`{pause}` is the number 86401, which is longer than 24 hours"),
        ("{pause}", 1e300, "which is longer than 24 hours"),
        ("{pause + 1}", "x", "which is not a number"),
    ],
)
def test_what_is_no_time_is_never_taken_and_says_why(tmp_path: Path, time: str, value: Any, reason: str) -> None:
    s = session(tmp_path, waits(after(time)), memory={"pause": value})
    s.rule("R")
    (failed,) = (each for each in s.records if isinstance(each, CountdownRecord))
    assert failed.status == "failed" and reason in failed.reason and failed.seconds is None
    assert s.timers == {} and s.states == {"R": "a"}


# --- kept events ------------------------------------------------------------------------------------------------------

EARLY = rule(
    "R", state("a", "", on("/next", "b")), state("b", "", on("/understood", "c")), state("c", "", on("/x", "a"))
)
KEEP = '{"event": "/understood", "keep": "2s"}'


def keep(s: Session, behavior: str = KEEP) -> int:
    records = s.do(Submit(function="raiseEventTopic", behavior=behavior, source="wizard:w"))
    return next(record.id for record in records if isinstance(record, TaskRecord))


def fate(s: Session, task: int) -> list[str]:
    """What became of a kept event: its task's and its own records."""
    return [
        each.status for each in s.records
        if (isinstance(each, TaskRecord) and each.id == task) or (isinstance(each, KeptRecord) and each.task == task)
    ]  # fmt: skip


def taken_by(s: Session) -> list[str | None]:
    return [each.taken_by for each in s.records if isinstance(each, EventRecord) and each.topic == "/understood"]


def test_a_key_pressed_a_moment_early_is_not_lost(tmp_path: Path) -> None:
    s = session(tmp_path, EARLY)
    s.rule("R")
    task = keep(s)
    assert s.states == {"R": "a"}
    s.wait(1.9)
    s.event("next")
    assert s.states == {"R": "c"}
    assert fate(s, task) == ["PENDING", "kept", "taken", "SUCCEEDED"] and taken_by(s) == ["R"]
    s.wait(5)
    assert s.timers == {}


@pytest.mark.parametrize("seconds", [0.5, 3.0])
def test_a_key_pressed_early_can_have_been_a_mistake_whatever_became_of_it(tmp_path: Path, seconds: float) -> None:
    s = session(tmp_path, EARLY)
    s.rule("R")
    task = keep(s)
    s.wait(seconds)
    s.submit("markMistake", f"{task} early")
    assert [(each.task, each.mark) for each in s.records if isinstance(each, MistakeRecord)] == [(task, "early")]


@pytest.mark.parametrize(
    ("waits_for", "told"),
    [
        ("/x", ["PENDING", "SUCCEEDED", "/x R"]),
        ("/y", ["PENDING", "CANCELED", "/x None"]),
        ("raised again", ["PENDING", "PENDING", "CANCELED", "kept"]),
    ],
)
def test_one_that_was_never_kept_has_no_record_of_keeping(tmp_path: Path, waits_for: str, told: list[str]) -> None:
    """The last case: the first of two ends before its turn, and only the second one is kept."""
    again = waits_for == "raised again"
    listens = rule(
        "R", state("a", "", on("/later" if again else waits_for, "b")), state("b", "", on("/x", "a") * again)
    )
    raises = rule("S", state("a", '<function raiseEventTopic="/x" keep="2s"/>' * (1 + again)))
    s = session(tmp_path, listens + raises)
    s.rule("R")
    seen = len(s.records)
    s.rule("S")
    kinds = (r for r in s.records[seen:] if getattr(r, "function", "") != "startInteractionRule")
    found = [
        f"{r.topic} {r.taken_by}" if isinstance(r, EventRecord) else r.status
        for r in kinds
        if isinstance(r, TaskRecord | KeptRecord | EventRecord)
    ]
    assert found == told


def test_one_that_is_raised_again_is_the_wizard_s_and_can_have_been_a_mistake(tmp_path: Path) -> None:
    s = session(tmp_path, EARLY)
    s.rule("R")
    first = keep(s)
    again = keep(s)
    assert (first, again) == (2, 3) and fate(s, first)[-1] == "CANCELED"
    for task in (first, again):
        assert s.submit("markMistake", f"{task} double").status == "SUCCEEDED"


@pytest.mark.parametrize("how", ["cancel", "again", "stop"])
def test_it_is_taken_back(tmp_path: Path, how: str) -> None:
    s = session(tmp_path, EARLY)
    s.rule("R")
    task = keep(s)
    if how == "cancel":
        assert s.submit("cancelTask", str(task)).status == "SUCCEEDED"
        assert s.submit("cancelTask", str(task)).status == "REJECTED"
    elif how == "again":
        keep(s)
    else:
        s.submit("stopAll")
    assert fate(s, task) == ["PENDING", "kept", "taken-back", "CANCELED"]
    assert taken_by(s) == []


@pytest.mark.parametrize(
    ("behavior", "reason"),
    [
        ('{"event": "/x", "keep": "soon"}', "`keep` is a time from 1ms to 24 hours"),
        ('{"event": "/x", "keep": 2}', "got `int` - at `$.keep`"),
        ('{"event": "/x", "keep": "25min', "the behaviour is an event, or JSON such as"),
        ('{"evnt": "/x"}', "there is no field `evnt`; did you mean `event`?"),
        ('{"keep": "2s"}', "missing required field `event`"),
        ('{"event": "/", "keep": "2s"}', "the event has no name"),
        pytest.param("{" * 5000, "the behaviour is an event, or JSON such as", id="deep"),
    ],
)
def test_what_cannot_be_read_is_rejected(tmp_path: Path, behavior: str, reason: str) -> None:
    s = session(tmp_path, EARLY)
    task = s.submit("raiseEventTopic", behavior)
    assert task.status == "REJECTED" and reason in task.reason


@settings(max_examples=examples(150))
@given(st.lists(st.sampled_from(["keep", "next", "x", "understood", "wait", "cancel", "stop", "rule"]), max_size=20))
def test_a_kept_event_ends_exactly_once(moves: list[str]) -> None:
    s, tasks = Session(KEEPS), []
    for move in moves:
        match move:
            case "keep":
                tasks.append(keep(s))
            case "wait":
                s.wait(0.7)
            case "cancel":
                s.submit("cancelTask", str(tasks[-1] if tasks else 0))
            case "stop":
                s.submit("stopAll")
                s.confirm_stop()
                s.submit("releaseStop")
            case "rule":
                s.rule("R")
            case _:
                s.event(move)
    assert set(view_of(s).kept) == {id for id, kept in s.kernel.rules.kept.items() if kept.is_recorded}
    s.wait(3)
    for task in tasks:
        told = fate(s, task)
        assert told[0] == "PENDING" and sum(each in ("SUCCEEDED", "CANCELED") for each in told) == 1
        assert sum(each in ("taken", "expired", "taken-back") for each in told) == told.count("kept") <= 1
    assert not s.kernel.rules.kept and not s.timers


def _read(**parts: Any) -> Scenario:
    with tempfile.TemporaryDirectory() as folder:
        return read(write(Path(folder), **parts))


HELD = _read(rules=waits(after("{pause}", held="ready")), memory={"ready": False, "pause": 1})
KEEPS = _read(rules=EARLY)
