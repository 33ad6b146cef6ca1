"""A trial run of a study on a virtual clock with the simulated robot, without record, journal and people.

It uses the engine of a session, so it shows what `rise-engine run --speed max` would record. A trial is the list of its
steps: going one step back repeats all steps but the last.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import floor
from typing import Any, Literal, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.kernel.inputs import Note, SessionStarted, Submit
from rise_engine.kernel.records import AnyRecord, TaskRecord
from rise_engine.kernel.task_view import ACT_FUNCTIONS
from rise_engine.kernel.view import SessionView
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import first_input, start_remarks
from rise_engine.scenario.model import KeyBinding, Scenario, normal_topic, rule_start_behavior
from rise_engine.scenario.reading.conditions import condition_problem

SOURCE = "wizard:trial"
"""The source of requests in a trial."""
LONGEST = 600.0
"""Maximum seconds until something waits for a person."""
LIVELOCK = 20_000
"""Number of inputs in one moment that indicates an endless loop, which stops the clock."""
PRESS_DELAY_SECONDS = 0.1
"""Seconds from an event to a person's action, because nobody presses a key at the same moment."""

StepKind: TypeAlias = Literal["task", "go_on", "wait"]


class TrialStep(Struct, frozen=True):
    """One step: a request, or time that passes."""

    kind: StepKind
    at: float
    """Session time of the task, or at the end of the wait."""
    task: Submit | None = None
    key: str = ""
    """The label of the pressed key of the study; empty: none."""
    seconds: float = 0.0
    """The duration for `wait`."""
    first_record: int = 0
    """The `seq` of its first record; its records end before those of the next step."""


class Trial:
    """A study played without robot and record. It belongs to one thread and never blocks.

    >>> from rise_engine.scenario.loader import load
    >>> trial = Trial(load("scenarios/greeting").scenario)
    >>> trial.start_act("R_Smile").kind
    'task'
    >>> trial.go_on().kind, trial.is_busy, trial.now > 1
    ('go_on', False, True)
    >>> trial.back(), trial.is_busy
    (True, True)
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        seed: int = 1,
        condition: str = "",
        memory: dict[str, Any] | None = None,
        started: SessionStarted | None = None,
    ) -> None:
        """Begin at time 0, with nothing started.

        :param scenario: a checked scenario; its robot and mode do not matter, and no robot is connected.
        :param seed: determines all random choices.
        :param condition: one of the scenario's conditions, whose memory values it begins with.
        :param memory: values that replace the start values, by key.
        :param started: the beginning of the session instead, as in a session of a study.
        :raises ValueError: there is no such condition.
        :raises RobotOptionsError: the robot's profile has options that the simulated driver does not understand.
        """
        self.scenario = replace(scenario, mode="debug")
        if condition and (problem := condition_problem(self.scenario, condition)):
            raise ValueError(problem)
        self.seed = seed
        self.condition = condition
        self.start_memory = dict(memory or {})
        self._started = started or first_input(scenario, SessionOptions(scenario.folder, condition=condition))
        self.steps: list[TrialStep] = []
        """The steps so far, the last one last."""
        self.problem = ""
        """Why time could not pass as requested; empty: it could."""
        self._begin()

    def _begin(self) -> None:
        scenario = self.scenario
        self.clock = VirtualClock()
        self.view = SessionView()
        """The session for an outside observer."""
        self.records: list[AnyRecord] = []
        robot = make_robot(scenario.robot, "debug", self.clock, self.seed)
        started = replace(self._started, memory={**self._started.memory, **self.start_memory})
        sinks = (self.records.append, self.view.apply)
        self._engine = Engine(scenario, robot, self.clock, self.seed, started=started, sinks=sinks)
        self._engine.start()
        for sentence in start_remarks(scenario, started):
            self._engine.post(Note(text=sentence))
        self._handled_until = -1.0
        """The time of the last timer; a person's action comes after it."""

    # --- the state ------------------------------------------------------------------------------------------------

    @property
    def now(self) -> float:
        """Virtual seconds since it began."""
        return self.clock.now()

    @property
    def is_busy(self) -> bool:
        """Whether the robot is busy, or acts wait for it."""
        view = self.view
        return bool(view.running or view.waiting) or view.stop.status == "requested"

    @property
    def next_at(self) -> float | None:
        """The time of the next event without a person; None: everything waits for a person."""
        return self.clock.next_at

    @property
    def memory(self) -> dict[str, Any]:
        """The present working memory, including tables."""
        return {**self.scenario.table_memory, **{key: entry.value for key, entry in self.view.memory.items()}}

    def records_of(self, number: int) -> list[AnyRecord]:
        """Return the records of a step, by its index in `steps`; -1: of the last one."""
        if not self.steps:
            return list(self.records)
        number %= len(self.steps)
        end = self.steps[number + 1].first_record if number + 1 < len(self.steps) else len(self.records) + 1
        return self.records[self.steps[number].first_record - 1 : end - 1]

    # --- steps ----------------------------------------------------------------------------------------------------

    def press(self, key: KeyBinding, at: float | None = None) -> TrialStep:
        """Press a key of the study; `at` as in `submit`."""
        return self.submit(Submit(function=key.function, behavior=key.task_behavior, source=SOURCE), key.label, at)

    def start_rule(self, name: str, state: str | None = None, enter: bool = True) -> TrialStep:
        """Start a rule, in its initial state or another; with `enter` False, it waits there without running onEntry."""
        behavior = rule_start_behavior(name, state, enter)
        return self.submit(Submit(function="startInteractionRule", behavior=behavior, source=SOURCE))

    def start_act(self, name: str) -> TrialStep:
        """Make the robot do an act."""
        return self.submit(Submit(function="startCommunicationRobotAct", behavior=name, source=SOURCE))

    def raise_event(self, topic: str) -> TrialStep:
        """Raise an event, with or without slash."""
        return self.submit(Submit(function="raiseEventTopic", behavior=f"/{normal_topic(topic)}", source=SOURCE))

    def set_value(self, assignment: str) -> TrialStep:
        """Set a memory key, written as in a rule: `step = 2`."""
        return self.submit(Submit(function="assignValue", behavior=assignment, source=SOURCE))

    def mark_cue(self) -> TrialStep:
        """Mark the end of the participant's turn, like the space bar in a session."""
        return self.submit(Submit(function="markCue", source=SOURCE))

    def submit(self, task: Submit, key: str = "", at: float | None = None) -> TrialStep:
        """Submit any request that a session accepts. Impossible requests are recorded as REJECTED.

        :param task: the request; its time is set here.
        :param key: the label of the study's key.
        :param at: session time; None: a tenth of a second after the last event.
        """
        if at is None:
            now = self.now
            is_free = self._handled_until < now or now == 0
            at = (
                now
                if is_free and not self._has_step_at(now)
                else (floor(now / PRESS_DELAY_SECONDS + 1e-6) + 1) * PRESS_DELAY_SECONDS
            )
        return self._do(TrialStep("task", round(at, 6), task, key))

    def _has_step_at(self, now: float) -> bool:
        return bool(self.steps) and self.steps[-1].kind == "task" and self.steps[-1].at == now

    def go_on(self) -> TrialStep | None:
        """Let time pass until the robot is idle; if it already is, until the next event.

        If it is never idle, stop when all its present acts have begun again, or after LONGEST seconds. Returns None if
        everything waits for a person.
        """
        self.problem = ""
        if self.next_at is None:
            self.problem = "nothing happens by itself any more: it waits for you"
            return None
        return self._do(TrialStep("go_on", self.now))

    def pass_time(self, seconds: float) -> TrialStep:
        """Let this many seconds pass."""
        return self._do(TrialStep("wait", round(self.now + seconds, 6), seconds=seconds))

    def back(self) -> bool:
        """Undo the last step. False: there is none."""
        if not self.steps:
            return False
        self._replay(self.steps[:-1])
        return True

    def restart(self) -> None:
        """Return to the start, without any steps."""
        self._replay([])

    # --- execution ------------------------------------------------------------------------------------------------

    def _replay(self, steps: Iterable[TrialStep]) -> None:
        self.steps = []
        self.problem = ""
        self._begin()
        for step in steps:
            self.do(step)

    def do(self, step: TrialStep) -> TrialStep:
        """Repeat a recorded step of a trial."""
        return self._do(step, again=True)

    def _do(self, step: TrialStep, *, again: bool = False) -> TrialStep:
        first_record = len(self.records) + 1
        if step.task is not None:
            self.clock.pass_until(step.at)
            self._engine.accept(step.task)
        elif step.kind == "wait" or again:
            self._advance_to(step.at)
        else:
            self._advance_until_quiet(first_record - 1)
            step = replace(step, at=self.now)
        step = replace(step, first_record=first_record)
        self.steps.append(step)
        return step

    def _is_idle_except(self, acts: set[str]) -> bool:
        """Return whether the robot is idle, or only performs these acts."""
        view = self.view
        return view.stop.status != "requested" and all(
            view.tasks[id].behavior in acts for id in (*view.running, *view.waiting)
        )

    def _advance_to(self, until: float) -> None:
        """Let all events up to this time happen, including those that are due then."""
        guard = _CircleGuard(self._engine)
        while (due := self.clock.next_at) is not None and due <= until:
            self.clock.advance()
            self._handled_until = self.now
            if guard.is_looping(self.now):
                self.problem = guard.text
                return
        self.clock.pass_until(until)

    def _advance_until_quiet(self, seq: int) -> None:
        """Advance until nothing runs, or only acts that have begun again, and there is a record after `seq`."""
        deadline = self.now + LONGEST
        guard = _CircleGuard(self._engine)
        begun = {self.view.tasks[id].behavior for id in self.view.running}
        seen, again = seq, set[str]()
        while (due := self.clock.next_at) is not None:
            for record in self.records[seen:]:
                if isinstance(record, TaskRecord) and record.function in ACT_FUNCTIONS and record.status == "ACTIVE":
                    (again if record.behavior in begun else begun).add(record.behavior)
            seen = len(self.records)
            if due > self.now and self.view.seq > seq and self._is_idle_except(again):
                return
            if due > deadline:
                self.problem = f"after {LONGEST / 60:.0f} minutes something still goes on by itself"
                return
            self.clock.advance()
            self._handled_until = self.now
            if guard.is_looping(self.now):
                self.problem = guard.text
                return


class _CircleGuard:
    """Detects endless loops: more inputs in one moment than anything else causes."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._moment, self._inputs = -1.0, 0
        self.text = ""

    def is_looping(self, now: float) -> bool:
        if now > self._moment + PRESS_DELAY_SECONDS:
            self._moment, self._inputs = now, self._engine.inputs
        if self._engine.inputs - self._inputs > LIVELOCK:
            self.text = f"{LIVELOCK:,} inputs in one moment, at {now:g} s: something goes round in circles"
        return bool(self.text)
