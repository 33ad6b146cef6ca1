"""What must hold for every scenario and every course of events (issue 2, section 4), over random ones."""

import itertools
from collections import Counter
from random import Random
from typing import Any, get_args

import msgspec
import pytest

from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import Command, StartAction
from rise_engine.kernel.history import MAX_STEPS
from rise_engine.kernel.inputs import AnyInput, EstopReport, StopReport
from rise_engine.kernel.records import (
    ENDINGS,
    ActionRecord,
    AnyRecord,
    ConditionRecord,
    EventRecord,
    RuleRecord,
    TaskRecord,
)
from rise_engine.kernel.snapshot import Snapshot
from rise_engine.kernel.view import _APPLY, SessionView
from rise_engine.scenario.model import Function, Rule, Scenario, State, Transition
from tests.chance import seeds
from tests.reference.comparison import Play

pytestmark = [pytest.mark.slow, pytest.mark.search, pytest.mark.xdist_group("kernel_properties")]

RUNAWAY = Rule(
    "runaway",
    "s0",
    {
        "s0": State("s0", (Function("raiseEventTopic", "/own_ping"),), (), (Transition("own_ping", None, None, "s1"),)),
        "s1": State("s1", (Function("raiseEventTopic", "/own_pong"),), (), (Transition("own_pong", None, None, "s0"),)),
    },
)
CALM = Rule("calm", "s0", {"s0": State("s0", (), (), (Transition("calm_event", None, None, "s0"),))})


class Course(Play):
    """A random study with two more rules, everything that went in and out, and a stop at the end.

    After the stop, the rules `calm` and `runaway` are started.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.records: list[AnyRecord] = []
        self.outputs: list[bytes] = []
        self.view = SessionView()
        self.started_while_latched: list[Any] = []
        self.again: list[bytes] = []
        """What a second kernel puts out on the same inputs; on the way, restored ones replace it."""
        self.run()

    def __repr__(self) -> str:
        return f"Course({self.seed})"  # what a failure shows, to play it again

    def study(self) -> Scenario:
        study = super().study()
        return msgspec.structs.replace(
            study,
            rules={**study.rules, "runaway": RUNAWAY, "calm": CALM},
            topics=study.topics | {"own_ping", "own_pong", "calm_event"},
        )

    def ask_kernel(self, input: AnyInput) -> tuple[list[AnyRecord], list[Command]]:
        latched = self.kernel.stop.latched
        records, commands = self.kernel.handle(input)
        self.outputs.append(msgspec.json.encode([records, commands]))
        self.records += records
        for record in records:
            self.view.apply(record)
        if latched and self.kernel.stop.latched:
            self.started_while_latched += filter(starts, [*records, *commands])
        return records, commands

    def move(self) -> None:
        super().move()
        assert_shown(self.view, self.kernel)

    def end(self) -> None:
        for button in ("estop:/a", "estop:/b"):
            self.do(EstopReport(source=button, pressed=False))
        self.submit("stopAll")
        self.do(StopReport(confirmed=("x",)))
        self.pass_time(100, most=1_000_000)
        self.at_stop = len(self.records)
        self.left = [self.kernel.is_busy, *self.kernel.rules.stack, *self.goals, *self.timers]
        for function, of in (
            ("releaseStop", ""),
            ("startInteractionRule", "calm"),
            ("startInteractionRule", "runaway"),
        ):
            self.submit(function, of)
        self.submit("raiseEventTopic", "calm_event")
        assert_shown(self.view, self.kernel)
        self.play_again()

    def play_again(self) -> None:
        kernel, cuts = Kernel(self.scenario, self.seed), Random(self.seed).sample(range(len(self.inputs)), 5)
        for number, input in enumerate(self.inputs):
            if number in cuts:
                sent = msgspec.json.decode(msgspec.json.encode(kernel.snapshot()), type=Snapshot)
                kernel = Kernel.restore(self.scenario, sent)
                assert kernel.snapshot() == sent
            self.again.append(msgspec.json.encode(list(kernel.handle(input))))
        self.last_snapshots = (kernel.snapshot(), self.kernel.snapshot())


def starts(out: AnyRecord | Command) -> bool:
    """Whether something begins with it."""
    match out:
        case RuleRecord():
            return out.status in ("started", "entered")
        case TaskRecord():
            return out.status == "ACTIVE"
        case _:
            return isinstance(out, StartAction)


def assert_shown(view: SessionView, kernel: Kernel) -> None:
    """The records alone have rebuilt the state."""
    assert view.seq == kernel.seq
    memory = {key: entry.value for key, entry in view.memory.items()}
    assert {**kernel.scenario.table_memory, **memory} == kernel.core.memory
    assert view.running_rules() == list(reversed(kernel.rules.stack))
    assert {name: rule.state for name, rule in view.rules.items() if rule.running} == {
        name: r.state.id for name, r in kernel.rules.stack.items()
    }
    assert view.waiting == [task.id for task in kernel.scheduler.waiting]
    assert sorted(view.running) == sorted(kernel.scheduler.runner.runs)
    assert view.stop.status == kernel.stop.status
    stood = [(rule.name, rule.state) for rule in kernel.stop.stopped_rules]
    assert [(rule.rule, rule.state) for rule in view.stop.stood] == stood
    assert view.questions == list(kernel.failures.state.asked)
    for name, each in kernel.rules.stack.items():
        assert view.rules[name].steps == each.steps[-MAX_STEPS:]
        assert view.changed_since_step(view.rules[name]) == kernel.rules.changed_since_step(each)


@pytest.fixture(scope="module")
def courses() -> list[Course]:
    return [Course(study) for study in seeds(24)]


def test_same_inputs_same_outputs_also_of_a_restored_kernel(courses: list[Course]) -> None:
    for course in courses:
        assert course.again == course.outputs
        restored, kernel = course.last_snapshots
        assert restored == kernel


def test_never_two_blocking_acts_at_once(courses: list[Course]) -> None:
    for course in courses:
        active: set[int] = set()
        for record in course.records:
            if (
                isinstance(record, TaskRecord)
                and record.function == "startCommunicationRobotAct"
                and record.calling_type == "Blocking"
            ):
                (active.add if record.status == "ACTIVE" else active.discard)(record.id)
                assert len(active) <= 1


def test_an_event_moves_one_rule_or_none(courses: list[Course]) -> None:
    for course in courses:
        taken: Counter[tuple[str, str]] = Counter()
        moved: Counter[tuple[str, str]] = Counter()
        for record in course.records:
            if isinstance(record, EventRecord) and record.taken_by is not None:
                taken[record.taken_by, record.topic] += 1
            elif isinstance(record, RuleRecord) and record.trigger is not None and record.trigger.startswith("/"):
                moved[record.name, record.trigger] += 1
        # A rule that ends while it leaves its state (its own onExit stops it, or it is faulted) takes without arriving.
        assert moved <= taken


def test_every_started_action_has_exactly_one_ending_after_a_stop(courses: list[Course]) -> None:
    for course in courses:
        actions = [record for record in course.records[: course.at_stop] if isinstance(record, ActionRecord)]
        started = {(record.task, record.action) for record in actions if record.status == "started"}
        ended = Counter((record.task, record.action) for record in actions if record.status in ENDINGS)
        assert started <= set(ended)
        assert set(ended.values()) <= {1}


def test_every_task_has_exactly_one_end_after_a_stop(courses: list[Course]) -> None:
    for course in courses:
        tasks: dict[int, list[str]] = {}
        for record in course.records[: course.at_stop]:
            if isinstance(record, TaskRecord):
                tasks.setdefault(record.id, []).append(record.status)
        for statuses in tasks.values():
            assert statuses[-1] in ("SUCCEEDED", "ABORTED", "CANCELED", "REJECTED")
            assert set(statuses[:-1]) <= {"PENDING", "ACTIVE"}


def test_after_a_stop_nothing_starts_and_nothing_runs(courses: list[Course]) -> None:
    for course in courses:
        assert course.started_while_latched == []
        assert course.left == [False]


def test_records_are_numbered_without_gaps_and_time_does_not_go_back(courses: list[Course]) -> None:
    for course in courses:
        assert [r.seq for r in course.records] == list(range(1, len(course.records) + 1))
        assert all(a.t <= b.t for a, b in itertools.pairwise(course.records))


def test_a_runaway_rule_is_faulted_alone(courses: list[Course]) -> None:
    for course in courses:
        rules = [r for r in course.records[course.at_stop :] if isinstance(r, RuleRecord)]
        assert [r.name for r in rules if r.status == "faulted"] == ["runaway"]
        assert "calm" in course.kernel.rules.stack
        assert [r.taken_by for r in course.records if isinstance(r, EventRecord)][-1] == "calm"


def test_every_kind_of_record_but_a_condition_changes_the_view() -> None:
    assert set(get_args(AnyRecord)) - set(_APPLY) == {ConditionRecord}
