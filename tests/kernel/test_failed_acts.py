"""What becomes of an act that has failed: go on, ask, repeat (semantics.md 12.2)."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rise_engine.kernel.inputs import ActionReport, SessionRecovered
from rise_engine.kernel.records import EventRecord, FailureRecord, RuleRecord, TaskRecord
from rise_engine.scenario.loader import load

from .harness import Session, dialog, gaze, pause, read, speech, view_of, write
from .test_rules import do, on, rule, state

ACTS = dialog("A", speech(1)) + dialog("B", speech(1)) + dialog("Wait", pause(1, 10)) + dialog("Gaze", gaze(1))
OWN = '<transition ended="A" outcome="succeeded" target="good"/><transition ended="A" target="bad"/>'
R = rule(
    "R",
    state("a", do("startCommunicationRobotAct", "A"), OWN),
    state("good", "", on("/x", "a")),
    state("bad", "", on("/x", "a")),
)


def session(tmp_path: Path, on_failure: str = "ask", rules: str = R, toml: str = "") -> Session:
    return Session(read(write(tmp_path, rules=rules, acts=ACTS, toml=f'on_failure = "{on_failure}"\n{toml}')))


def fail(s: Session) -> int:
    """The robot fails with the one action that runs; the id of its task."""
    (goal,) = s.goals
    s.report(goal, "failed", "the motor is hot")
    return int(goal.partition("/")[0])


def wait_for_pause(s: Session) -> None:
    """The failed act that waits is repeated."""
    ((timer, at),) = [each for each in s.timers.items() if s.kernel.core.timers[each[0]].purpose == "repeat"]
    s.wait(at - s.t)
    assert timer not in s.timers


def failures(s: Session) -> list[tuple[str, int | None, str]]:
    return [(r.status, r.by, r.source) for r in s.records if isinstance(r, FailureRecord)]


def topics(s: Session) -> list[str]:
    return [record.topic for record in s.records if isinstance(record, EventRecord)]


def test_asked_nothing_is_raised_until_somebody_goes_on(tmp_path: Path) -> None:
    s = session(tmp_path)
    s.rule("R")
    id = fail(s)
    s.wait(100)
    assert (s.states, topics(s)) == ({"R": "a"}, [])
    assert (view_of(s).questions, view_of(s).failed) == ([id], [])
    assert s.submit("goOn", str(id)).status == "SUCCEEDED"
    assert s.states == {"R": "bad"}
    assert failures(s) == [("asked", None, "engine"), ("gone-on", None, "wizard:w")]
    assert (view_of(s).questions, view_of(s).failed) == ([], [])
    assert s.submit("goOn", str(id)).status == "REJECTED"


@pytest.mark.parametrize("how", ["id", "name"])
def test_a_repetition_is_the_act_that_the_rule_has_started(tmp_path: Path, how: str) -> None:
    s = session(tmp_path)
    s.rule("R")
    id = fail(s)
    s.submit("repeatAct", str(id) if how == "id" else "A")
    again = fail(s)
    assert s.states == {"R": "a"}, "it is asked again"
    s.submit("repeatAct", str(again))
    s.finish_all()
    assert s.states == {"R": "good"}
    tasks = [r for r in s.records if isinstance(r, TaskRecord) and r.status == "PENDING" and r.behavior == "A"]
    assert [(r.source, r.reason) for r in tasks] == [
        ("rule:R", ""),
        ("rule:R", f"repeats task {id}"),
        ("rule:R", f"repeats task {again}"),
    ]
    assert [by for _, by, _ in failures(s)] == [None, again, None, tasks[-1].id]


def test_the_rule_can_be_stopped_instead(tmp_path: Path) -> None:
    s = session(tmp_path)
    s.rule("R")
    s.submit("stopRuleOfAct", str(fail(s)))
    assert (s.states, topics(s)) == ({}, [])
    assert [status for status, _, _ in failures(s)] == ["asked", "dropped"]
    stopped = next(r for r in s.records if isinstance(r, RuleRecord) and r.status == "stopped")
    assert stopped.reason == "stopped by wizard:w, because A failed"


@pytest.mark.parametrize("function", ["stopInteractionRule", "stopAll"])
def test_what_stops_the_rule_makes_the_question_void(tmp_path: Path, function: str) -> None:
    s = session(tmp_path)
    s.rule("R")
    id = fail(s)
    s.submit(function, "R" if function == "stopInteractionRule" else "")
    assert [status for status, _, _ in failures(s)] == ["asked", "dropped"]
    assert view_of(s).questions == [] and topics(s) == []
    assert s.submit("repeatAct", str(id)).reason == f"no failed act {id} waits for an answer"


@pytest.mark.parametrize("stop_acts", [True, False])
def test_a_step_back_that_stops_the_acts_makes_the_question_void(tmp_path: Path, stop_acts: bool) -> None:
    first = state("first", "", on("/x", "a"))
    s = session(tmp_path, rules=R.replace("<State", first + "<State", 1).replace('initial="a"', 'initial="first"'))
    s.rule("R")
    s.event("x")
    id = fail(s)
    s.submit("stepBack", json.dumps({"rule": "R", "stop_acts": stop_acts}))
    assert s.states == {"R": "first"}
    assert view_of(s).questions == list(s.kernel.failures.state.asked) == ([] if stop_acts else [id])


def test_repeating_by_itself_and_then_going_on(tmp_path: Path) -> None:
    s = session(tmp_path, "repeat:2")
    s.rule("R")
    ids = [fail(s)]
    assert (view_of(s).questions, view_of(s).repeats) == (ids, {ids[0]: 2.0})
    for _ in range(2):
        wait_for_pause(s)
        ids.append(fail(s))
    assert (s.states, s.t) == ({"R": "bad"}, 6.0), "after 2 s, and then after 4 s"
    assert failures(s) == [
        ("waiting", None, "engine"),
        ("repeated", ids[1], "engine"),
        ("waiting", None, "engine"),
        ("repeated", ids[2], "engine"),
        ("gone-on", None, "engine"),
    ]
    assert (view_of(s).questions, view_of(s).repeats) == ([], {})
    assert view_of(s).failed == [ids[2]], "the wizard sees that it failed"
    last = [r for r in s.records if isinstance(r, FailureRecord)][-1]
    assert last.reason == "failed 3 times"


def test_pauses_are_twice_as_long_each_time_up_to_a_limit(tmp_path: Path) -> None:
    s = session(tmp_path, "repeat:10")
    s.act("A")
    for _ in range(10):
        fail(s)
        wait_for_pause(s)
    fail(s)
    pauses = [r.seconds for r in s.records if isinstance(r, FailureRecord) and r.status == "waiting"]
    assert pauses == [2.0, 4.0, 8.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0]
    assert failures(s)[-1] == ("gone-on", None, "engine")


NOT_OURS = {
    "an emergency stop cancels it": lambda s, goal: s.report(goal, "canceled", "somebody else stopped it"),
    "the robot gives it up": lambda s, goal: s.do(
        ActionReport(action=goal, status="failed", reason="protective stop", aborted=True)
    ),
    "its engine has gone": lambda s, goal: s.do(SessionRecovered()),
}


@pytest.mark.parametrize("end", NOT_OURS)
@pytest.mark.parametrize("attempt", [1, 2])
def test_what_is_not_ours_to_repeat_is_asked_however_often_it_was_repeated(
    tmp_path: Path, end: str, attempt: int
) -> None:
    s = session(tmp_path, "repeat:1")
    s.rule("R")
    if attempt == 2:
        fail(s)
        wait_for_pause(s)
    NOT_OURS[end](s, *s.goals)
    s.robot("lost")
    s.robot("connected")
    s.wait(100)
    assert (failures(s)[-1], s.states, s.goals) == (("asked", None, "engine"), {"R": "a"}, {})
    s.submit("repeatAct", "A")
    s.finish_all()
    assert s.states == {"R": "good"}


@pytest.mark.parametrize("lost", ["while it runs", "in its pause"])
def test_without_the_robot_it_waits_until_the_robot_is_back_and_is_counted_anew(tmp_path: Path, lost: str) -> None:
    s = session(tmp_path, "repeat:2")
    s.rule("R")
    fail(s)
    wait_for_pause(s)

    if lost == "in its pause":
        fail(s)
    s.robot("lost", "no link")
    s.wait(100)
    assert (view_of(s).repeats, s.states) == ({3: None}, {"R": "a"})
    s.robot("degraded")
    for _ in range(2):
        wait_for_pause(s)
        fail(s)
    assert (s.states, s.t) == ({"R": "bad"}, 108.0)


STOPS = {
    "stopCommunicationRobotAct": ("A", "gone-on", {"R": "bad"}),
    "cancelTask": ("2", "gone-on", {"R": "bad"}),
    "goOn": ("A", "gone-on", {"R": "bad"}),
    "stopRuleOfAct": ("A", "dropped", {}),
    "stopInteractionRule": ("R", "dropped", {}),
    "stopAll": ("", "dropped", {}),
}


@pytest.mark.parametrize("function", STOPS)
@pytest.mark.parametrize("robot", ["connected", "lost"])
def test_what_waits_to_be_repeated_can_be_stopped(tmp_path: Path, function: str, robot: str) -> None:
    behavior, status, states = STOPS[function]
    s = session(tmp_path, "repeat:1")
    s.rule("R")
    fail(s) if robot == "connected" else s.robot("lost")
    assert s.submit(function, behavior).status == "SUCCEEDED"
    s.robot("connected")
    s.wait(100)
    assert ([each for each, _, _ in failures(s)], s.states, s.goals) == (["waiting", status], states, {})
    assert (view_of(s).questions, view_of(s).repeats, s.timers) == ([], {}, {})


def test_stops_and_free_speech_are_never_asked_about(tmp_path: Path) -> None:
    s = session(tmp_path)
    s.rule("R")
    s.submit("stopCommunicationRobotAct", "A")
    s.report(next(iter(s.goals)), "canceled")
    assert s.states == {"R": "bad"}
    s.submit("say", "Hello")
    fail(s)
    assert failures(s) == []


def test_an_act_may_have_its_own_word_and_so_may_a_pattern(tmp_path: Path) -> None:
    s = session(tmp_path, "ask", toml='[act."A*"]\non_failure = "go_on"\n[act.B]\nhold = true\n')
    assert [s.scenario.failure_policy(act).kind for act in ("A", "B", "Wait")] == ["go_on", "ask", "ask"]


@pytest.mark.parametrize("written", ['"repeat"', '"repeat:0"', '"repeat:11"', '"asks"', "true", '"repeat:²"'])
def test_what_on_failure_cannot_be(tmp_path: Path, written: str) -> None:
    for toml in (f"on_failure = {written}", f"[act.A]\non_failure = {written}"):
        (error,) = load(write(tmp_path, rules="", acts=ACTS, toml=toml)).errors
        assert error.code == "wrong-value" and '"go_on", "ask" or "repeat:2"' in error.message


ALLOW = "check: allow unnoticed-failure: meant"
WAITS = rule("W", state("a", do("startCommunicationRobotAct", "A"), on("/A_end", "b")), state("b"))
CAREFUL = WAITS.replace("<transition", OWN.replace("good", "b").replace("bad", "b") + "<transition")


@pytest.mark.parametrize(
    ("rules", "toml", "warned"),
    [
        (WAITS, 'title = "x"', True),
        (WAITS, "", False),
        (WAITS, 'on_failure = "ask"', False),
        (WAITS, 'on_failure = "ask"\n[act.A]\non_failure = "go_on"', True),
        (WAITS, '[act.A]\non_failure = "repeat:1"', False),
        (WAITS, "[act.A]\nfiller = true", False),
        (WAITS.replace("/A_end", "/A_succeeded"), 'title = "x"', False),
        (WAITS + rule("S", state("a", "", on("/A_failed", "a"))), 'title = "x"', False),
        (CAREFUL, 'title = "x"', False),
        (WAITS.replace(do("startCommunicationRobotAct", "A"), ""), 'title = "x"', False),
        (WAITS.replace("A_end", "Wait_end").replace('"A"', '"Wait"'), 'title = "x"', False),
        (
            WAITS.replace("<transition", f"<!-- {ALLOW} --><transition"),
            'title = "x"',
            False,
        ),
    ],
)
def test_check_warns_where_nothing_deals_with_a_failure(tmp_path: Path, rules: str, toml: str, warned: bool) -> None:
    found = [each.code for each in load(write(tmp_path, rules=rules, acts=ACTS, toml=toml)).diagnostics]
    assert [code for code in found if code == "unnoticed-failure"] == ["unnoticed-failure"] * warned
