"""One step back: the state before, with what the memory was then (semantics.md 12.4)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.kernel.history import MAX_STEPS, MIN_CHANGES, MemoryLog, ValueBefore
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import RuleRecord, TaskRecord
from tests.chance import examples

from .harness import Session, dialog, speech, view_of
from .test_rules import do, on, rule, session, state

ACTS = dialog("A", speech(1)) + dialog("B", speech(1))
START = "startCommunicationRobotAct"
R = rule(
    "R",
    state("a", do("assignValue", "n = n + 1") + do(START, "A"), on("/x", "b")),
    state("b", do("assignValue", "n = n + 10"), on("/x", "c"), do("assignValue", "left = true")),
    state("c", do(START, "B") + do("assignValue", "new = 1"), on("/x", "a") + on("/end", "d")),
    state("d"),
)


def back(s: Session, rule: str = "R", **more: Any) -> TaskRecord:
    return s.submit("stepBack", json.dumps({"rule": rule, **more}))


def offered(s: Session) -> dict[str, ValueBefore]:
    """What would be asked about, as the view has it; the kernel must have the same."""
    view = view_of(s)
    found = view.changed_since_step(view.rules["R"])
    assert found == s.kernel.rules.changed_since_step(s.kernel.rules.stack["R"])
    return found


@pytest.fixture
def s(tmp_path: Path) -> Session:
    """The rule stands in `c`: it has come there from `a` by `b`."""
    s = session(tmp_path, R, ACTS, {"n": 0, "left": False})
    s.rule("R")
    s.event("x")
    s.assign("other = 'x'")
    s.event("x")
    assert (s.states, s.memory["n"]) == ({"R": "c"}, 11)
    return s


def test_what_has_changed_since_the_state_before_was_entered(s: Session) -> None:
    assert offered(s) == {
        "n": ValueBefore(True, 1),
        "other": ValueBefore(False),
        "left": ValueBefore(True, False),
        "new": ValueBefore(False),
    }
    s.assign("n = 1")
    assert "n" not in offered(s), "it has again what it had"


@pytest.mark.parametrize(
    ("more", "memory"),
    [
        ({"enter": False}, {"n": 11, "left": True, "other": "x", "new": 1}),
        ({"enter": False, "take_back": ["n", "new"]}, {"n": 1, "left": True, "other": "x"}),
        ({"take_back": ["n", "left", "other", "new"]}, {"n": 11, "left": False}),
        ({}, {"n": 21, "left": True, "other": "x", "new": 1}),
    ],
)
def test_each_key_is_taken_back_or_kept(s: Session, more: dict[str, Any], memory: dict[str, Any]) -> None:
    assert back(s, **more).status == "SUCCEEDED"
    assert (s.states, s.memory) == ({"R": "b"}, memory)
    record = [r for r in s.records if isinstance(r, RuleRecord)][-1]
    assert (record.previous, record.transition) == ("c", None)
    assert record.trigger == ("stepped back" if more.get("enter", True) else "stepped back, without onEntry")


def test_several_steps_back_in_a_row(s: Session) -> None:
    back(s, enter=False, take_back=["n", "left", "new"])
    back(s, enter=False, take_back=["n"])
    assert (s.states, s.memory["n"]) == ({"R": "a"}, 0)
    assert "no state is known" in back(s).reason
    s.event("x")
    back(s)
    assert (s.states, s.memory["n"]) == ({"R": "a"}, 11)


def test_what_it_has_started_goes_on_unless_it_is_to_be_stopped(s: Session) -> None:
    begun = list(s.goals)
    back(s, enter=False)
    assert list(s.goals) == begun and s.cancels == []
    s.event("x")
    back(s, enter=False, stop_acts=True)
    assert set(s.cancels) == set(s.goals) and s.kernel.scheduler.waiting == []


def test_it_moves_to_the_top_and_no_on_exit_runs(tmp_path: Path) -> None:
    low = rule(
        "Low", state("a", "", on("/l", "b")), state("b", "", on("/l", "a"), do("assignValue", "out = 1")), priority=1
    )
    s = session(tmp_path, low + rule("High", state("a", "", on("/h", "a")), priority=5), ACTS)
    s.rule("Low")
    s.event("l")
    s.rule("High")
    assert s.stack == ["High", "Low"]
    back(s, "Low")
    assert s.stack == ["Low", "High"] and "out" not in s.memory
    s.event("l")
    assert s.states["Low"] == "b"


@pytest.mark.parametrize(
    ("behavior", "reason"),
    [
        ("R2", "there is no rule 'R2'; did you mean 'R'?"),
        (
            '{"rule": "R", "take_back": ["nn"]}',
            "the memory key 'nn' has not changed since the state before was entered",
        ),
        ('{"rule": "R", "keep": ["n"]}', "there is no field `keep`"),
        ('{"rule": "R", "take_back": "n"}', "Expected `array`"),
    ],
)
def test_what_cannot_be_is_rejected(s: Session, behavior: str, reason: str) -> None:
    task = s.submit("stepBack", behavior)
    assert task.status == "REJECTED" and reason in task.reason
    assert s.states == {"R": "c"}


def test_a_rule_that_does_not_run_has_no_step(s: Session) -> None:
    s.event("end")
    assert back(s).reason == "rule 'R' is not running"
    s.rule("R")
    assert "no state is known" in back(s).reason, "it has begun anew"


def test_after_a_stop_the_steps_from_before_are_known(s: Session) -> None:
    s.submit("stopAll")
    for goal in list(s.goals):
        s.report(goal, "canceled")
    s.confirm_stop()
    s.submit("releaseStop", '{"R": "wait"}')
    assert set(offered(s)) == {"n", "other", "left", "new"}
    back(s, enter=False, take_back=["n"])
    assert (s.states, s.memory["n"]) == ({"R": "b"}, 1)


def test_so_many_steps_are_kept_and_not_more(tmp_path: Path) -> None:
    s = session(tmp_path, rule("R", state("a", "", on("/x", "b")), state("b", "", on("/x", "a"))), ACTS, {"n": 0})
    s.rule("R")
    for number in range(MIN_CHANGES + 100):
        s.assign(f"n = {number}")
        s.event("x")
    assert len(s.kernel.core.memory_log.changes) <= MIN_CHANGES + 1
    offered(s)
    done = 0
    while back(s, enter=False, take_back=["n"]).status == "SUCCEEDED":
        done += 1
    assert done == MAX_STEPS - 1
    assert s.memory["n"] == MIN_CHANGES + 100 - MAX_STEPS


# --- the log of the memory ---


@settings(max_examples=examples(200))
@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("write"), st.sampled_from("abc"), st.integers(0, 2)),
            st.tuples(st.just("step"), st.sampled_from("PQ"), st.just(0)),
            st.tuples(st.just("trim"), st.just(""), st.just(0)),
        ),
        max_size=60,
    )
)
def test_the_log_knows_what_the_memory_was(happenings: list[tuple[str, str, int]]) -> None:
    """Against whole copies of the memory; steps fall out, and changes are left out at any time."""
    log, memory = MemoryLog(), {"a": 0}
    steps: dict[str, list[tuple[str, int]]] = {"P": [], "Q": []}
    copies: dict[str, list[dict[str, int]]] = {"P": [], "Q": []}
    for at, (kind, name, value) in enumerate(happenings):
        if kind == "write":
            log.note(at, name, name in memory, memory.get(name))
            memory[name] = value
        elif kind == "step":
            steps[name] = [*steps[name], (name, at)][-3:]
            copies[name] = [*copies[name], dict(memory)][-3:]
        else:
            log.trim(steps.values())
        for owner, known in steps.items():
            for (_, number), copy in zip(known, copies[owner], strict=True):
                expected = {
                    key: ValueBefore(key in copy, copy.get(key))
                    for key in memory.keys() | copy.keys()
                    if (key in memory) != (key in copy) or memory.get(key) != copy.get(key)
                }
                assert log.changed_since(number, memory) == expected


def test_a_kept_event_is_taken_by_a_rule_that_steps_back_to_where_it_is_waited_for(tmp_path: Path) -> None:
    waits = state("a", "", on("/go", "b") + on("/answer", "c"))
    s = session(tmp_path, rule("R", waits, state("b", "", on("/x", "a")), state("c", "", on("/x", "a"))))
    s.rule("R")
    s.event("go")
    s.submit("raiseEventTopic", '{"event": "/answer"}')
    assert s.states == {"R": "b"}, "this one is gone"
    s.do(Submit(function="raiseEventTopic", behavior='{"event": "/answer", "keep": "1min"}', source="wizard:w"))
    back(s)
    assert s.states == {"R": "c"}
