"""What must hold for every scenario and every course of events (issue 2, section 4), over random ones."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Callable
from random import Random
from typing import Any, get_args

import msgspec
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from rise_engine.expression import Assignment, Expression
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import CancelTimer, SetTimer, StartAction, StopRobot
from rise_engine.kernel.history import MAX_STEPS
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    ControlChanged,
    RobotChanged,
    SessionRecovered,
    SessionStarted,
    StopReport,
    Submit,
    TimerElapsed,
)
from rise_engine.kernel.records import (
    ENDINGS,
    ActionRecord,
    AnyRecord,
    ConditionRecord,
    EventRecord,
    RuleRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.kernel.snapshot import Snapshot
from rise_engine.kernel.view import _APPLY, SessionView
from rise_engine.scenario.model import (
    Act,
    Action,
    ActionCall,
    ActionSpec,
    ActOutcome,
    Branch,
    Delay,
    Function,
    If,
    OneOf,
    Parameter,
    RobotProfile,
    Rule,
    Scenario,
    State,
    Statement,
    Table,
    Transition,
)
from rise_engine.scenario.speech.template import parse_template
from tests.chance import examples

ACTS = ("A0", "A1", "A2", "A3")
RULES = ("R0", "R1", "R2", "R3")
STATES = ("s0", "s1", "s2")
TOPICS = ("e0", "e1", "e2", "A0_end", "A1_failed", "A2_stopped", "R0_end", "R1_end")
CONDITIONS = (
    "k0",
    "not k0",
    "k1 > 2",
    "k0 and k1 < 5",
    "missing",
    "name > 3",
    "rand(1) > 0.5",
    "person.near",
    "session.speaking",
    "not session.speaking and not session.cue",
    "session.stopped",
    "session.condition = 'b'",
    "items[k1].n > 1",
    "items[order[k1]].text = name",
    "length(order) > 2 and order[k1]",
    "defined(items[k1 + 1])",
)
ASSIGNMENTS = (
    "k0 = true",
    "k0 = false",
    "k1 = k1 + 1",
    "k1 = 0",
    "k1 = name + 1",
    "k1 = missing + 1",
    '{"person": {"near": true}}',
    "order = shuffle(range(length(items)))",
    "order = sample(order, 2)",
    "order = latin(items, k1)",
    "order[k1] = items[k1].n",
    "person.near = items[order[0]]",
    "items = 1",
)

text = Parameter("message", "text", required=True)
milliseconds = Parameter("duration", "number", unit="ms")
ROBOT = RobotProfile(
    "test",
    "Test",
    "none",
    {
        "Speech": ActionSpec("Speech", {"message": text}, ("speech",)),
        "LookAt": ActionSpec("LookAt", {"message": text}, ("gaze",)),
        "Wait": ActionSpec("Wait", {"duration": milliseconds}, (), engine=True),
    },
)


class Author:
    """Writes a random scenario. From a number, because that is many times quicker than drawing every part of it."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)

    def some(self, make: Callable[[], Any], most: int) -> tuple[Any, ...]:
        return tuple(make() for _ in range(self.random.randint(0, most)))

    def scenario(self) -> Scenario:
        return Scenario(
            "random",
            "/",
            "debug",
            ROBOT,
            {name: self.act(name) for name in ACTS},
            {name: self.rule(name) for name in RULES},
            {"k0": False, "k1": 0, "name": "Ada", "order": [0, 1, 2]},
            tables={"items": Table("items", ("n", "text"), [[1, "one"], [2, None], [3, "three"]])},
            known_keys=frozenset({"k0", "k1", "name", "person", "order"}),
            topics=frozenset(TOPICS),
            reads_session=self.random.random() < 0.7,
            on_failure=self.random.choice(["go_on", "ask", "ask", "repeat:1"]),
        )

    def act(self, name: str) -> Act:
        actions: list[Action] = []
        for n in range(self.random.randint(1, 4)):
            waits = self.random.sample([a.id for a in actions], self.random.randint(0, min(2, n)))
            calls = tuple(self.call() for _ in range(self.random.choice([1, 1, 3])))
            actions.append(Action(str(n), calls, tuple(waits), self.random.random() < 0.3))
        used = {c for a in actions for call in a.calls for c in ROBOT.actions[call.type].channels}
        return Act(name, tuple(actions), frozenset(used))

    def call(self) -> ActionCall:
        kind = self.random.choice(["Speech", "LookAt", "Wait"])
        if kind == "Wait":
            return ActionCall("Wait", {"duration": parse_template(self.random.choice(["0", "100", "2000"]))})
        return ActionCall(
            kind,
            {
                "message": parse_template(
                    self.random.choice(["hi", "{name}", "{missing}", "{missing|x}", "{items[k1].text}"])
                )
            },
        )

    def function(self) -> Statement:
        pick = self.random.choice
        match self.random.randrange(6):
            case 0:
                return Function("startCommunicationRobotAct", pick(ACTS))
            case 1:
                return Function("stopCommunicationRobotAct", pick(ACTS))
            case 2:
                return Function("startInteractionRule", pick(RULES))
            case 3:
                return Function("stopInteractionRule", pick(RULES))
            case 4:
                return Function("raiseEventTopic", "/" + pick(TOPICS), keep=pick([None, None, 0.5, 5.0]))
            case _:
                text = pick(ASSIGNMENTS)
                return Function("assignValue", text, Assignment.parse(text))

    def condition(self) -> Expression:
        return Expression.parse(self.random.choice(CONDITIONS))

    def statement(self) -> Statement:
        match self.random.randrange(5):
            case 0:
                arms = (
                    Branch(self.condition(), self.some(self.function, 2)),
                    Branch(None, self.some(self.function, 2)),
                )
                return If(arms)
            case 1:
                return OneOf((self.function(), self.function()))
            case _:
                return self.function()

    def transition(self) -> Transition:
        guard = self.condition() if self.random.random() < 0.4 else None
        target = self.random.choice([*STATES, None])
        block = self.some(self.function, 1)
        match self.random.randrange(6):
            case 0:
                return Transition(None, self.condition(), None, target, block)
            case 1:
                return Transition(None, guard, self.delay(), target, block)
            case 5:
                return Transition(None, guard, self.delay(), target, block, held=self.condition())
            case 2:
                outcomes: tuple[ActOutcome, ...] = self.random.choice([(), ("succeeded",), ("failed", "stopped")])
                return Transition(None, guard, None, target, block, ended=self.random.choice(ACTS), outcomes=outcomes)
            case _:
                return Transition(self.random.choice(TOPICS), guard, None, target, block)

    def delay(self) -> Delay:
        if self.random.random() < 0.5:
            return Delay("", self.random.choice([0.1, 1.0]))
        text = self.random.choice(["k1", "k1 / 10", "name", "missing", "rand(0.1, 2)"])
        return Delay(f"{{{text}}}", None, Expression.parse(text), self.random.choice([None, 1.0, 0.001]))

    def rule(self, name: str) -> Rule:
        states = {
            state: State(
                state, self.some(self.statement, 3), self.some(self.function, 1), self.some(self.transition, 3)
            )
            for state in STATES
        }
        return Rule(name, "s0", states, self.random.choice([0, 1, 2]))


def scenarios() -> st.SearchStrategy[Scenario]:
    return st.integers(0, 2**32).map(lambda seed: Author(seed).scenario())


Move = tuple[str, Any, Any]
MOVES: st.SearchStrategy[Move] = st.one_of(
    st.tuples(st.just("act"), st.sampled_from(ACTS), st.sampled_from(["", "None", "Blocking"])),
    st.tuples(st.just("rule"), st.sampled_from(RULES), st.just("")),
    st.tuples(st.just("event"), st.sampled_from(TOPICS), st.just("")),
    st.tuples(st.just("keep"), st.sampled_from((*TOPICS, "nobody")), st.sampled_from(["500ms", "5s"])),
    st.tuples(st.just("cue"), st.sampled_from(["markCue", "undoCue"]), st.just("")),
    st.tuples(st.just("assign"), st.sampled_from(ASSIGNMENTS), st.just("")),
    st.tuples(
        st.just("report"),
        st.integers(0, 9),
        st.sampled_from(["accepted", "succeeded", "succeeded", "failed", "canceled"]),
    ),
    st.tuples(st.just("report"), st.integers(0, 9), st.just("succeeded")),
    st.tuples(st.just("wait"), st.sampled_from([0.05, 1.0, 20.0]), st.just("")),
    st.tuples(st.just("cancel"), st.integers(1, 20), st.just("")),
    st.tuples(st.just("move"), st.integers(1, 20), st.integers(0, 3)),
    st.tuples(st.just("stop"), st.booleans(), st.just("")),
    st.tuples(
        st.just("release"),
        st.dictionaries(st.sampled_from(RULES), st.sampled_from(["enter", "wait", "leave"])),
        st.just(""),
    ),
    st.tuples(st.just("back"), st.sampled_from(RULES), st.booleans()),
    st.tuples(
        st.just("answer"), st.sampled_from(["goOn", "repeatAct", "stopRuleOfAct"]), st.sampled_from([*ACTS, "1", "3"])
    ),
    st.tuples(st.just("robot"), st.sampled_from(["lost", "connected"]), st.just("")),
    st.tuples(st.just("recover"), st.just(""), st.just("")),
    st.tuples(st.just("control"), st.sampled_from(["taken", "asked", "released"]), st.sampled_from(["wizard:a", None])),
)


class Run:
    """Plays moves against a kernel and keeps everything that went in and out."""

    def __init__(self, scenario: Scenario, moves: list[Move]) -> None:
        self.scenario = scenario
        self.kernel = Kernel(scenario, 7)
        self.inputs: list[AnyInput] = []
        self.outputs: list[bytes] = []
        self.records: list[AnyRecord] = []
        self.snapshots: list[Snapshot] = []
        self.goals: dict[str, None] = {}
        self.timers: dict[int, float] = {}
        self.t = 0.0
        self.started_while_latched: list[Any] = []
        self.view = SessionView()
        self.do(SessionStarted())
        for move in moves:
            self.play(*move)

    def do(self, input: AnyInput) -> None:
        latched = self.kernel.stop.latched
        stamped = msgspec.structs.replace(input, t=self.t)
        self.inputs.append(stamped)
        records, commands = self.kernel.handle(stamped)
        self.outputs.append(msgspec.json.encode([records, commands]))
        self.records += records
        for record in records:
            self.view.apply(record)
            if isinstance(record, ActionRecord) and record.status in ENDINGS:
                self.goals.pop(f"{record.task}/{record.action}", None)
        for command in commands:
            match command:
                case StartAction():
                    self.goals[command.action] = None
                case SetTimer():
                    self.timers[command.timer] = command.at
                case CancelTimer():
                    del self.timers[command.timer]
                case StopRobot():
                    pass
        if latched and self.kernel.stop.latched:
            self.started_while_latched += [c for c in commands if isinstance(c, StartAction)]
            self.started_while_latched += [
                r
                for r in records
                if (isinstance(r, RuleRecord) and r.status in ("started", "entered"))
                or (isinstance(r, TaskRecord) and r.status == "ACTIVE")
            ]

    def play(self, what: str, a: Any, b: Any) -> None:
        match what:
            case "act":
                self.do(Submit(function="startCommunicationRobotAct", behavior=a, calling_type=b, source="wizard:w"))
            case "rule":
                self.do(Submit(function="startInteractionRule", behavior=a, source="wizard:w"))
            case "event":
                self.do(Submit(function="raiseEventTopic", behavior=a, source="wizard:w"))
            case "keep":
                behavior = f'{{"event": "/{a}", "keep": "{b}"}}'
                self.do(Submit(function="raiseEventTopic", behavior=behavior, source="wizard:w"))
            case "cue":
                self.do(Submit(function=a, source="wizard:w"))
            case "assign":
                self.do(Submit(function="assignValue", behavior=a, source="wizard:w"))
            case "report":
                if self.goals:
                    self.do(ActionReport(action=list(self.goals)[a % len(self.goals)], status=b))
            case "cancel":
                self.do(Submit(function="cancelTask", behavior=str(a), source="wizard:w"))
            case "move":
                self.do(Submit(function="moveTask", behavior=f"{a} {b}", source="wizard:w"))
            case "stop":
                self.do(Submit(function="stopAll", source="wizard:w"))
                if a:
                    self.do(StopReport(confirmed=("x",)))
            case "release":
                stood = {rule.name for rule in self.kernel.stop.stood}
                chosen = {name: how for name, how in a.items() if name in stood}
                self.do(Submit(function="releaseStop", behavior=json.dumps(chosen), source="wizard:w"))
            case "back":
                run = self.kernel.rules.stack.get(a)
                changed = list(self.kernel.rules.changed_since_step(run)) if run is not None else []
                parts = {"rule": a, "take_back": changed[::2], "enter": b, "stop_acts": not b}
                self.do(Submit(function="stepBack", behavior=json.dumps(parts), source="wizard:w"))
            case "answer":
                self.do(Submit(function=a, behavior=b, source="wizard:w"))
            case "robot":
                self.do(RobotChanged(status=a))
            case "recover":
                self.do(SessionRecovered(reason="test"))
            case "control":
                self.do(ControlChanged(status=a, by="wizard:b", holder=b))
            case "wait":
                self.wait(a)
        self.snapshots.append(self.kernel.snapshot())

    def wait(self, seconds: float) -> None:
        until = round(self.t + seconds, 6)
        for _ in range(200):
            due = min(self.timers.items(), key=lambda item: (item[1], item[0]), default=None)
            if due is None or due[1] > until:
                break
            del self.timers[due[0]]
            self.t = max(self.t, due[1])
            self.do(TimerElapsed(timer=due[0]))
        self.t = until


cases = given(scenarios(), st.lists(MOVES, max_size=25))
quick = settings(max_examples=examples(60), phases=[p for p in Phase if p not in (Phase.shrink, Phase.explain)])


@pytest.mark.slow
@quick
@cases
def test_same_inputs_same_outputs(scenario: Scenario, moves: list[Move]) -> None:
    run = Run(scenario, moves)
    again = Kernel(scenario, 7)
    assert [msgspec.json.encode(list(again.handle(input))) for input in run.inputs] == run.outputs


@quick
@given(scenarios(), st.lists(MOVES, min_size=1, max_size=25), st.data())
def test_a_restored_kernel_continues_identically(scenario: Scenario, moves: list[Move], data: st.DataObject) -> None:
    run = Run(scenario, moves)
    cut = data.draw(st.integers(0, len(run.inputs) - 1))
    kernel = Kernel(scenario, 7)
    for input in run.inputs[:cut]:
        kernel.handle(input)
    sent = msgspec.json.decode(msgspec.json.encode(kernel.snapshot()), type=Snapshot)
    restored = Kernel.restore(scenario, sent)
    assert [msgspec.json.encode(list(restored.handle(i))) for i in run.inputs[cut:]] == run.outputs[cut:]
    assert restored.snapshot() == run.kernel.snapshot()


@quick
@cases
def test_never_two_blocking_acts_at_once(scenario: Scenario, moves: list[Move]) -> None:
    active: set[int] = set()
    for record in Run(scenario, moves).records:
        if (
            isinstance(record, TaskRecord)
            and record.function == "startCommunicationRobotAct"
            and record.calling_type == "Blocking"
        ):
            if record.status == "ACTIVE":
                active.add(record.id)
            else:
                active.discard(record.id)
            assert len(active) <= 1


@quick
@cases
def test_an_event_moves_one_rule_or_none(scenario: Scenario, moves: list[Move]) -> None:
    taken: Counter[tuple[str, str]] = Counter()
    moved: Counter[tuple[str, str]] = Counter()
    for record in Run(scenario, moves).records:
        if isinstance(record, EventRecord) and record.taken_by is not None:
            taken[record.taken_by, record.topic] += 1
        elif isinstance(record, RuleRecord) and record.trigger is not None and record.trigger.startswith("/"):
            moved[record.name, record.trigger] += 1
    # A rule that ends while it leaves its state (its own onExit stops it, or it is faulted) takes without arriving.
    assert moved <= taken


@quick
@cases
def test_every_started_action_has_exactly_one_ending(scenario: Scenario, moves: list[Move]) -> None:
    run = Run(scenario, moves)
    run.play("stop", True, "")
    run.wait(100)
    started: set[tuple[int, str]] = set()
    ended: Counter[tuple[int, str]] = Counter()
    for record in run.records:
        if isinstance(record, ActionRecord):
            if record.status == "started":
                started.add((record.task, record.action))
            elif record.status in ENDINGS:
                ended[record.task, record.action] += 1
    assert started <= set(ended)
    assert set(ended.values()) <= {1}


@quick
@cases
def test_every_task_has_exactly_one_end_after_a_stop(scenario: Scenario, moves: list[Move]) -> None:
    run = Run(scenario, moves)
    run.play("stop", True, "")
    run.wait(100)
    tasks: dict[int, list[str]] = {}
    for record in run.records:
        if isinstance(record, TaskRecord):
            tasks.setdefault(record.id, []).append(record.status)
    for statuses in tasks.values():
        assert statuses[-1] in ("SUCCEEDED", "ABORTED", "CANCELED", "REJECTED")
        assert set(statuses[:-1]) <= {"PENDING", "ACTIVE"}


@quick
@cases
def test_after_a_stop_nothing_starts_and_nothing_runs(scenario: Scenario, moves: list[Move]) -> None:
    run = Run(scenario, [*moves, ("stop", True, "")])
    run.wait(100)
    assert run.started_while_latched == []
    assert not run.kernel.is_busy
    assert not run.kernel.rules.stack
    assert not run.goals
    assert not run.timers
    assert isinstance([r for r in run.records if isinstance(r, StopRecord)][-1], StopRecord)


@quick
@cases
def test_the_records_alone_rebuild_the_state(scenario: Scenario, moves: list[Move]) -> None:
    run = Run(scenario, moves)
    view, kernel = run.view, run.kernel
    assert view.seq == kernel.seq
    memory = {key: entry.value for key, entry in view.memory.items()}
    assert {**scenario.table_memory, **memory} == kernel.core.memory
    assert view.running_rules() == list(reversed(kernel.rules.stack))
    assert {name: rule.state for name, rule in view.rules.items() if rule.running} == {
        name: r.state.id for name, r in kernel.rules.stack.items()
    }
    assert view.waiting == [task.id for task in kernel.scheduler.waiting]
    assert sorted(view.running) == sorted(kernel.scheduler.runner.runs)
    assert view.stop.status == kernel.stop.status
    stood = [(rule.name, rule.state) for rule in kernel.stop.stood]
    assert [(rule.rule, rule.state) for rule in view.stop.stood] == stood
    assert view.questions == list(kernel.failures.state.asked)
    for name, each in kernel.rules.stack.items():
        assert view.rules[name].steps == each.steps[-MAX_STEPS:]
        assert view.changed_since_step(view.rules[name]) == kernel.rules.changed_since_step(each)


@quick
@cases
def test_records_are_numbered_without_gaps_and_time_does_not_go_back(scenario: Scenario, moves: list[Move]) -> None:
    records = Run(scenario, moves).records
    assert [r.seq for r in records] == list(range(1, len(records) + 1))
    assert all(a.t <= b.t for a, b in itertools.pairwise(records))


@quick
@given(scenarios(), st.lists(MOVES, max_size=10))
def test_a_runaway_rule_is_faulted_alone(scenario: Scenario, moves: list[Move]) -> None:
    runaway = Rule(
        "runaway",
        "s0",
        {
            "s0": State(
                "s0", (Function("raiseEventTopic", "/own_ping"),), (), (Transition("own_ping", None, None, "s1"),)
            ),
            "s1": State(
                "s1", (Function("raiseEventTopic", "/own_pong"),), (), (Transition("own_pong", None, None, "s0"),)
            ),
        },
    )
    calm = Rule("calm", "s0", {"s0": State("s0", (), (), (Transition("calm_event", None, None, "s0"),))})
    scenario = msgspec.structs.replace(
        scenario,
        rules={**scenario.rules, "runaway": runaway, "calm": calm},
        topics=scenario.topics | {"own_ping", "own_pong", "calm_event"},
    )
    run = Run(scenario, moves)
    run.play("stop", True, "")
    run.play("release", {}, "")
    run.play("rule", "calm", "")
    run.play("rule", "runaway", "")
    faulted = [
        r.name for r in run.records if isinstance(r, RuleRecord) and r.status == "faulted" and r.name == "runaway"
    ]
    assert faulted == ["runaway"]
    assert "calm" in run.kernel.rules.stack
    run.play("event", "calm_event", "")
    assert [r.taken_by for r in run.records if isinstance(r, EventRecord)][-1] == "calm"


def test_every_kind_of_record_but_a_condition_changes_the_view() -> None:
    assert set(get_args(AnyRecord)) - set(_APPLY) == {ConditionRecord}
