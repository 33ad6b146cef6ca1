"""Stop-all remembers where the rules stood, and the release resumes them (semantics.md 12.3)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import asdict

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionRecovered
from rise_engine.kernel.records import ActionRecord, AnyRecord, RuleRecord, TaskRecord
from rise_engine.kernel.view import StoppedRuleView
from rise_engine.scenario.loader import load
from tests.chance import examples

from .harness import Session, dialog, read, speech, view_of, write
from .test_rules import do, on, rule, session, state

STUDIES = Path(__file__).parents[2] / "scenarios"
ACTS = dialog("A", speech(1)) + dialog("B", speech(1))
START = "startCommunicationRobotAct"
RULES = rule(
    "Low", state("a", do(START, "A"), on("/x", "b")), state("b", "", on("/x", "a") + on("/y", "b")), priority=1
) + rule("High", state("a", do(START, "B"), on("/x", "b") + on("/z", "a")), state("b", "", on("/w", "a")), priority=5)


def stopped(s: Session) -> None:
    """Everything is stopped, and the robot has confirmed it."""
    s.submit("stopAll")
    for goal in list(s.goals):
        s.report(goal, "canceled")
    s.confirm_stop("all")


def release(s: Session, **how: str) -> TaskRecord:
    return s.submit("releaseStop", json.dumps(how) if how else "")


@pytest.fixture
def two(tmp_path: Path) -> Session:
    """Two rules, the one with the smaller priority on top, because it has moved last."""
    s = session(tmp_path, RULES, ACTS)
    s.rule("Low")
    s.rule("High")
    s.finish_all()
    s.event("x")  # High takes it, and waits for w
    s.event("x")  # Low takes it, and is on top
    assert s.stack == ["Low", "High"]
    return s


@pytest.mark.parametrize(
    ("how", "states"),
    [
        ({}, {}),
        ({"Low": "leave"}, {}),
        ({"Low": "enter"}, {"Low": "b"}),
        ({"High": "wait"}, {"High": "b"}),
        ({"Low": "wait", "High": "enter"}, {"High": "b", "Low": "b"}),
    ],
)
def test_each_rule_goes_on_where_it_stood_or_stays_stopped(
    two: Session, how: dict[str, str], states: dict[str, str]
) -> None:
    stopped(two)
    assert release(two, **how).status == "SUCCEEDED"
    assert two.states == states
    assert list(two.states) == list(states), "in the order of the stack"


def test_stack_order_and_priority_come_back(two: Session) -> None:
    before = [(run.name, run.priority) for run in two.kernel.rules.stack.values()]
    stopped(two)
    release(two, High="wait", Low="wait")
    assert [(run.name, run.priority) for run in two.kernel.rules.stack.values()] == before


def test_the_highest_rule_says_its_first_and_the_record_says_how(tmp_path: Path) -> None:
    s = session(tmp_path, RULES, ACTS)
    s.rule("Low")
    s.rule("High")
    stopped(s)
    s.lines()
    release(s, Low="enter", High="enter")
    assert [line for line in s.lines("task", "stop", "rule") if "PENDING" not in line] == [
        'task releaseStop {"Low": "enter", "High": "enter"} SUCCEEDED',
        "stop released [] []",
        'task rule {"rule": "Low", "state": "a"} ACTIVE',
        "rule Low started a",
        "rule Low entered a",
        'task rule {"rule": "High", "state": "a"} ACTIVE',
        "rule High started a",
        "rule High entered a",
        "task act B ACTIVE",
    ]
    triggers = [r.trigger for r in s.records if isinstance(r, RuleRecord) and r.status == "started"]
    assert triggers == ["start", "start", "resumed", "resumed"]
    s.submit("stopAll")
    s.report(next(iter(s.goals)), "canceled")
    s.confirm_stop()
    release(s, Low="wait")
    assert s.goals == {}
    assert [r.trigger for r in s.records if isinstance(r, RuleRecord)][-1] == "resumed, without onEntry"
    resumed = [r for r in s.records if isinstance(r, TaskRecord)][-1]
    assert (resumed.behavior, resumed.source) == ('{"rule": "Low", "state": "a", "enter": false}', "wizard:w")


@pytest.mark.parametrize(
    ("behavior", "reason"),
    [
        ('{"Low": "enter", "Hihg": "wait"}', "the stop has ended no rule 'Hihg'; did you mean 'High'?"),
        ('{"Low": "enter", "High": "go"}', "Invalid enum value 'go'"),
        ('{"Low": "enter", "stop": 2}', "everything was stopped again since: look at the robot, and release this stop"),
        ('{"Low": "enter", "High": 1}', "the behaviour is empty, or JSON such as"),
        ('["Low"]', "the behaviour is empty, or JSON such as"),
        ("Low", "the behaviour is empty, or JSON such as"),
    ],
)
def test_nothing_is_applied_by_half(two: Session, behavior: str, reason: str) -> None:
    stopped(two)
    task = two.submit("releaseStop", behavior)
    assert task.status == "REJECTED" and reason in task.reason
    assert two.kernel.stop.latched and two.states == {}
    release(two, Low="enter", High="enter")
    assert len(two.states) == 2, "and all is remembered still"


def test_a_release_that_names_a_stop_releases_no_later_one(two: Session) -> None:
    """Somebody else has stopped everything since: nobody who has not seen that lets the robot go on."""
    stopped(two)
    two.submit("stopAll", source="wizard:olga")
    two.confirm_stop("all")
    task = two.submit("releaseStop", '{"Low": "wait", "stop": 1}')
    assert (task.status, two.kernel.stop.latched) == ("REJECTED", True)
    assert view_of(two).stop.count == 2
    assert two.submit("releaseStop", '{"Low": "wait", "stop": 2}').status == "SUCCEEDED"
    assert list(two.states) == ["Low"]


def test_a_second_stop_forgets_nothing_and_the_release_forgets_all(two: Session) -> None:
    stopped(two)
    two.submit("stopAll")
    two.confirm_stop("all")
    assert view_of(two).stop.stood == [StoppedRuleView("High", "b"), StoppedRuleView("Low", "b")]
    release(two, Low="wait")
    assert view_of(two).stop.stood == []
    stopped(two)
    assert release(two, High="wait").status == "REJECTED", "it was left stopped, and this stop has not ended it"


def test_what_is_remembered_survives_an_engine(two: Session) -> None:
    stopped(two)
    later = Session(two.scenario, kernel=Kernel.restore(two.scenario, two.kernel.snapshot()))
    later.do(SessionRecovered())
    release(later, High="wait", Low="enter")
    assert later.stack == ["Low", "High"]


def test_a_condition_that_was_taken_is_not_taken_again_by_waiting(tmp_path: Path) -> None:
    once = rule(
        "R",
        state(
            "a", "", '<transition cond="n = 1">' + do("assignValue", "m = 'twice'") + "</transition>" + on("/x", "a")
        ),
    )
    s = session(tmp_path, once, ACTS, {"n": 1, "m": ""})
    s.rule("R")
    s.assign("m = 'once'")
    stopped(s)
    release(s, R="wait")
    assert s.memory["m"] == "once"
    s.assign("n = 2")
    s.assign("n = 1")
    assert s.memory["m"] == "twice"


@pytest.mark.parametrize(("waited", "again"), [(3, True), (9, False)])
def test_a_time_that_was_still_counting_counts_anew(tmp_path: Path, waited: float, again: bool) -> None:
    """Else a rule that waits for silence would wait for ever."""
    once = rule(
        "R",
        state("a", "", f'<transition while="n = 1" after="8s">{do("assignValue", "m = m + 1")}</transition>'),
    )
    s = session(tmp_path, once, ACTS, {"n": 1, "m": 0})
    s.rule("R")
    s.wait(waited)
    taken = s.memory["m"]
    stopped(s)
    release(s, R="wait")
    s.wait(8)
    assert s.memory["m"] == taken + again


# --- as if there had been no stop ---

EVENTS = ("u", "v", "w")


@st.composite
def studies(draw: st.DrawFn) -> str:
    """A rule whose functions can be done twice with the same effect."""
    names = ["a", "b", "c", "d"]
    function = st.sampled_from(
        [
            do(START, "A"),
            do(START, "B"),
            do("assignValue", "n = 1"),
            do("assignValue", "n = 2"),
            do("raiseEventTopic", "/heard"),
        ]
    )
    states = []
    for name in names:
        ways = [on(f"/{topic}", draw(st.sampled_from(names))) for topic in draw(st.sets(st.sampled_from(EVENTS)))]
        ways.append(on("/z", "a"))
        if draw(st.booleans()):
            ways.append(f'<transition ended="A" target="{draw(st.sampled_from(names))}"/>')
        if draw(st.booleans()):
            ways.append('<transition after="3s">' + do("raiseEventTopic", "/late") + "</transition>")
        if draw(st.booleans()):
            ways.append('<transition cond="n = 2">' + do("raiseEventTopic", "/two") + "</transition>")
        states.append(state(name, "".join(draw(st.lists(function, max_size=2))), "".join(ways)))
    return rule("R", *states)


@dataclass
class Step:
    """One thing that the world does."""

    kind: str
    value: str = ""

    def do(self, s: Session) -> None:
        match self.kind:
            case "event":
                s.event(self.value)
            case "assign":
                s.assign(self.value)
            case "finish":
                for goal in list(s.goals)[:1]:
                    s.report(goal)
            case "wait":
                s.wait(2)


steps = st.lists(
    st.one_of(
        st.builds(Step, st.just("event"), st.sampled_from(EVENTS)),
        st.builds(Step, st.just("assign"), st.sampled_from(["n = 1", "n = 2"])),
        st.builds(Step, st.sampled_from(["finish", "wait"])),
    ),
    max_size=12,
)


def finish(s: Session) -> None:
    """Let what runs succeed; a rule may begin it again and again."""
    for _ in range(6):
        for goal in list(s.goals)[:1]:
            s.report(goal)


def plain(records: list[AnyRecord]) -> list[dict[str, object]]:
    """Without times, numbers and ids."""
    left_out = {"seq", "t", "wall", "id", "task", "ref", "cause"} | {
        "key_at",
        "accepted_at",
        "started_at",
        "robot_at",
        "ended_at",
    }
    return [
        {"kind": type(record).__name__, **{k: v for k, v in asdict(record).items() if k not in left_out}}
        for record in records
    ]


def later_records(s: Session, then: list[Step]) -> list[dict[str, object]]:
    s.lines()
    count = len(s.records)
    for step in then:
        step.do(s)
    return plain(s.records[count:])


@settings(max_examples=examples(150))
@given(studies(), steps, steps)
def test_who_waits_goes_on_as_if_there_had_been_no_stop(rules: str, before: list[Step], then: list[Step]) -> None:
    with TemporaryDirectory() as folder:
        scenario = read(write(Path(folder), rules=rules, acts=ACTS, memory={"n": 0}))
    runs = [Session(scenario), Session(scenario)]
    for s in runs:
        s.rule("R")
        for step in before:
            step.do(s)
        finish(s)
        s.event("z")  # into `a`
        finish(s)
    if runs[0].states["R"] != "a" or runs[0].goals:
        return
    stopped(runs[1])
    release(runs[1], R="wait")
    assert later_records(runs[0], then) == later_records(runs[1], then)


# --- the study of the issue ---


def sentences(s: Session) -> list[str]:
    begun = [record for record in s.records if isinstance(record, ActionRecord) and record.status == "started"]
    return [record.parameters["message"] for record in begun if "message" in record.parameters]


def play(s: Session, *, stop_in: str) -> str:
    """Press *next* until the end; with `stop_in`, stop everything once in the first sentence of that state. What was
    cut."""
    key = next(key for key in s.scenario.keys.values() if key.label == "n")
    begin = next(key for key in s.scenario.keys.values() if key.behavior == "Table setting")
    s.submit(begin.function, begin.task_behavior)
    cut = ""
    for _ in range(200):
        speaking = next((goal for goal in s.goals.values() if "message" in goal.parameters), None)
        if speaking is not None and stop_in and s.states.get("Table setting") == stop_in and not cut:
            cut = speaking.parameters["message"]
            stopped(s)
            release(s, **{"Table setting": "enter"})
        elif s.goals:
            s.report(next(iter(s.goals)))
        elif s.timers:
            s.wait(max(s.timers.values()) - s.t)
        elif s.states:
            s.submit(key.function, key.task_behavior)
        else:
            break
    return cut


def test_lablinking_goes_on_with_the_sentence_that_was_cut() -> None:
    scenario = load(STUDIES / "lablinking").scenario
    assert scenario is not None
    whole, cut_off = Session(scenario), Session(scenario)
    play(whole, stop_in="")
    cut = play(cut_off, stop_in="Task 2, step 2")
    told = sentences(cut_off)
    assert cut and told.count(cut) == sentences(whole).count(cut) + 1
    told.remove(cut)
    assert told == sentences(whole), "nothing else was said twice, and nothing was left out"
