"""The kernel: inputs in, records and commands out (architecture, "The kernel").

    records, commands = kernel.handle(input)

Everything that a session is changes here and nowhere else. Same scenario, same seed, same inputs: the same outputs, byte
for byte. The first record that a `Submit` causes is the record of its own task.
"""

from __future__ import annotations

from collections.abc import Callable
from sys import intern
from typing import Any

from rise_engine.expression import Assignment, EvaluationError, ExpressionError
from rise_engine.kernel.commands import Command, StopRobot
from rise_engine.kernel.core import Core, Task, TimerTarget
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    Note,
    RobotChanged,
    SessionEnded,
    SessionStarted,
    StopReport,
    Submit,
    TimerElapsed,
)
from rise_engine.kernel.records import AnyRecord, RobotRecord, SessionRecord, StopRecord, TaskRecord
from rise_engine.kernel.rules import RuleMachine
from rise_engine.kernel.scheduler import Scheduler
from rise_engine.kernel.snapshot import Snapshot, restore, take
from rise_engine.scenario.model import Scenario, normal_topic

STOP_LIMIT = 3.0
"""Seconds that the robot has to answer a stop-all; then those who have not are listed as unconfirmed."""


class Kernel:
    """A session's state and its only way to change. Pure: it knows no clock, disk, robot, thread or screen."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario = scenario
        self.seed = seed
        self.core = Core(scenario, seed)
        self.rules = RuleMachine(self.core, self._submit_from_rule)
        self.scheduler = Scheduler(self.core)
        self.stop = "released"
        """released, requested (the robot has not answered yet) or latched."""
        self.stop_timer: int | None = None
        self._topics = {form: (topic, intern("/" + topic)) for topic in scenario.topics for form in (topic, "/" + topic)}
        """Both ways to write a topic, to the one for routing and the one for records."""
        self._functions: dict[str, Callable[[Submit], None]] = {
            "startCommunicationRobotAct": self._start_act,
            "stopCommunicationRobotAct": self._stop_act,
            "startInteractionRule": self._start_rule,
            "stopInteractionRule": self._stop_rule,
            "raiseEventTopic": self._raise_event,
            "assignValue": self._assign,
            "deleteValue": self._delete,
            "cancelTask": self._cancel_task,
            "moveTask": self._move_task,
            "stopAll": self._stop_all,
            "releaseStop": self._release,
        }

        self._inputs: dict[type, Callable[[Any], None]] = {
            ActionReport: self._action_reported,
            TimerElapsed: self._timer,
            RobotChanged: self._robot_changed,
            StopReport: self._stop_reported,
            Note: self._note,
            SessionStarted: self._session_started,
            SessionEnded: self._session_ended,
        }

    @property
    def busy(self) -> bool:
        """True while an act runs or waits, or a stop is not yet confirmed. Rules that wait do not count."""
        return bool(self.scheduler.runner.runs or self.scheduler.waiting) or self.stop == "requested"

    def handle(self, input: AnyInput) -> tuple[list[AnyRecord], list[Command]]:
        """Take one input, run everything that it sets off to completion, and say what came of it."""
        core = self.core
        core.step += 1
        if input.t > core.t:
            core.t = input.t
        records: list[AnyRecord] = []
        commands: list[Command] = []
        core.records, core.commands = records, commands
        if type(input) is Submit:
            (self._functions.get(input.function) or self._no_such_function)(input)
        else:
            self._inputs[type(input)](input)
        self.rules.settle()
        return records, commands

    # --- snapshot ---

    def snapshot(self) -> Snapshot:
        """Everything that the kernel needs to go on, as a value that can be sent. Only between inputs."""
        return take(self)

    @classmethod
    def restore(cls, scenario: Scenario, snapshot: Snapshot) -> Kernel:
        """A kernel that goes on exactly where the snapshot was taken, given the same scenario."""
        kernel = cls(scenario, snapshot.seed)
        restore(kernel, snapshot)
        return kernel

    # --- acts ---

    def _no_such_function(self, input: Submit) -> None:
        self._reject(input, f"there is no function {input.function!r}" + self._near(input.function, self._functions))

    def _start_act(self, input: Submit) -> None:
        name = input.behavior
        if name not in self.scenario.acts:
            self._reject(input, f"there is no act {name!r}" + self._near(name, self.scenario.acts))
        elif input.calling_type not in ("", "None", "Blocking"):
            self._reject(input, f"the calling type is `None` or `Blocking`, not {input.calling_type!r}")
        elif self.stop != "released":
            self._reject(input, "everything is stopped; release the stop first")
        else:
            calling_type = input.calling_type or self.scenario.settings_of(name).calling_type
            task = self.core.new_task(input.function, name, calling_type, input.source, input.ref)
            self.scheduler.add(task)

    def _stop_act(self, input: Submit) -> None:
        name = input.behavior
        scheduler = self.scheduler
        if name not in self.scenario.acts:
            self._reject(input, f"there is no act {name!r}" + self._near(name, self.scenario.acts))
        elif not any(run.task.behavior == name for run in scheduler.runner.runs.values()) and not any(
            task.behavior == name for task in scheduler.waiting
        ):
            self._reject(input, f"{name} is neither running nor waiting")
        else:
            self._done(input)
            scheduler.stop(name, f"stopped by {input.source}")

    # --- rules ---

    def _start_rule(self, input: Submit) -> None:
        name = input.behavior
        if name not in self.scenario.rules:
            self._reject(input, f"there is no rule {name!r}" + self._near(name, self.scenario.rules))
        elif name in self.rules.stack:
            self._reject(input, f"rule {name!r} is already running")
        elif self.stop != "released":
            self._reject(input, "everything is stopped; release the stop first")
        else:
            task = self.core.new_task(input.function, name, input.calling_type or "None", input.source, input.ref)
            self.core.task_record(task)
            task.status = "ACTIVE"
            self.core.task_record(task)
            self.rules.start(name, task, on_top=input.source.startswith("rule:"))

    def _stop_rule(self, input: Submit) -> None:
        name = input.behavior
        if name not in self.scenario.rules:
            self._reject(input, f"there is no rule {name!r}" + self._near(name, self.scenario.rules))
        elif name not in self.rules.stack:
            self._reject(input, f"rule {name!r} is not running")
        else:
            self._done(input)
            self.rules.stop(name, f"stopped by {input.source}")

    def _submit_from_rule(self, function: str, behavior: str, source: str) -> None:
        self._functions[function](Submit(function=function, behavior=behavior, source=source))

    # --- events and memory ---

    def _raise_event(self, input: Submit) -> None:
        named = self._topics.get(input.behavior)
        if named is None:
            topic = normal_topic(input.behavior)
            if not topic:
                self._reject(input, "the event has no name")
                return
            named = (topic, "/" + topic)
        topic, shown = named
        core = self.core
        id = core.next_task
        core.next_task = id + 1
        core.seq = seq = core.seq + 1
        source = input.source
        core.records.append(
            TaskRecord(
                seq,
                core.t,
                "",
                id,
                "raiseEventTopic",
                input.behavior,
                "None",
                source,
                "SUCCEEDED",
                "",
                None,
                input.ref,
            )
        )
        core.events.append((topic, shown, source))

    def _assign(self, input: Submit) -> None:
        try:
            written = self.rules.memory.compute(Assignment.parse_all(input.behavior))
        except ExpressionError as problem:
            self._reject(input, str(problem))
        except EvaluationError as problem:
            self.core.settled(input.function, input.behavior, input.source, "ABORTED", str(problem), input.ref)
        else:
            self._done(input)
            self.rules.memory.assign(written, input.source)

    def _delete(self, input: Submit) -> None:
        memory = self.core.memory
        if input.behavior not in memory:
            self._reject(input, f"the memory has no key {input.behavior!r}" + self._near(input.behavior, memory))
        else:
            self._done(input)
            self.rules.memory.delete(input.behavior, input.source)

    # --- tasks ---

    def _cancel_task(self, input: Submit) -> None:
        reason = f"cancelled by {input.source}"
        waiting = self._waiting_task(input.behavior)
        if waiting is not None:
            self._done(input)
            self.scheduler.remove(waiting, reason)
            return
        for run in self.scheduler.runner.runs.values():
            if str(run.task.id) == input.behavior:
                self._done(input)
                self.scheduler.runner.cancel(run, reason)
                return
        for rule in self.rules.stack.values():
            if str(rule.task.id) == input.behavior:
                self._done(input)
                self.rules.stop(rule.name, reason)
                return
        self._reject(input, f"no task {input.behavior} is running or waiting")

    def _move_task(self, input: Submit) -> None:
        id, _, position = input.behavior.partition(" ")
        task = self._waiting_task(id)
        if not position.strip().isdigit():
            self._reject(input, "write the task's id and its new place, as in `17 0`")
        elif task is None:
            self._reject(input, f"no task {id} is waiting")
        else:
            self._done(input)
            self.scheduler.move(task, int(position))

    def _waiting_task(self, id: str) -> Task | None:
        return next((task for task in self.scheduler.waiting if str(task.id) == id), None)

    # --- stop-all ---

    def _stop_all(self, input: Submit) -> None:
        """Law 1 of the console: at once, without asking, also when it is pressed again."""
        core = self.core
        reason = f"stop-all by {input.source}"
        self._done(input)
        self.stop = "requested"
        self._stop_record("requested", source=input.source)
        self.rules.stop_all(reason)
        self.scheduler.stop_all(reason)
        core.commands.append(StopRobot())
        if self.stop_timer is not None:
            core.cancel_timer(self.stop_timer)
        self.stop_timer = core.set_timer(STOP_LIMIT, TimerTarget("stop"))

    def _stop_reported(self, input: StopReport) -> None:
        if self.stop == "released":
            return
        if self.stop_timer is not None:
            self.core.cancel_timer(self.stop_timer)
            self.stop_timer = None
        self.stop = "latched"
        self._stop_record("latched", input.confirmed, input.unconfirmed)

    def _release(self, input: Submit) -> None:
        if self.stop == "released":
            self._reject(input, "nothing is stopped")
        elif self.stop == "requested":
            self._reject(input, "the robot has not answered the stop yet")
        else:
            self._done(input)
            self.stop = "released"
            self._stop_record("released", source=input.source)

    # --- time, robot, session ---

    def _timer(self, input: TimerElapsed) -> None:
        timer = input.timer
        target = self.core.timers.pop(timer, None)
        if target is None:
            return
        if target.what == "after":
            self.rules.timer_elapsed(timer, target)
        elif target.what == "stop":
            self.stop_timer = None
            self.stop = "latched"
            self._stop_record("latched", (), (self.scenario.robot.name,))
        else:
            self.scheduler.runner.timer_elapsed(target, timer)

    def _robot_changed(self, input: RobotChanged) -> None:
        core = self.core
        core.seq += 1
        core.records.append(RobotRecord(core.seq, core.t, "", input.status, input.detail))
        if input.status == "lost":
            self.scheduler.runner.lose_robot(input.detail or "the link is lost")
        else:
            self.scheduler.runner.robot_lost = None

    def _action_reported(self, input: ActionReport) -> None:
        self.scheduler.runner.report(input.action, input.status, input.reason)

    def _note(self, input: Note) -> None:
        self.core.note(input.text, input.source)

    def _session_started(self, input: SessionStarted) -> None:
        self._session("started", versions=input.versions)
        self.rules.memory.begin()

    def _session_ended(self, input: SessionEnded) -> None:
        self._session("ended", reason=input.reason)

    def _session(self, status: str, versions: dict[str, str] | None = None, reason: str = "") -> None:
        core = self.core
        core.seq += 1
        scenario = self.scenario
        core.records.append(
            SessionRecord(
                core.seq,
                core.t,
                "",
                status=status,  # type: ignore[arg-type]
                scenario=scenario.title,
                scenario_hash=scenario.hash,
                mode=scenario.mode,
                robot=scenario.robot.name,
                seed=self.seed,
                versions=versions or {},
                reason=reason,
            )
        )

    # --- answers ---

    def _done(self, input: Submit) -> None:
        self.core.settled(input.function, input.behavior, input.source, "SUCCEEDED", "", input.ref)

    def _reject(self, input: Submit, reason: str) -> None:
        self.core.settled(input.function, input.behavior, input.source, "REJECTED", reason, input.ref)

    def _stop_record(
        self, status: str, confirmed: tuple[str, ...] = (), unconfirmed: tuple[str, ...] = (), source: str = ""
    ) -> None:
        core = self.core
        core.seq += 1
        core.records.append(StopRecord(core.seq, core.t, "", status, confirmed, unconfirmed, source))  # type: ignore[arg-type]

    @staticmethod
    def _near(name: str, known: object) -> str:
        from difflib import get_close_matches  # only when something is wrong

        close = get_close_matches(name, list(known), 1)  # type: ignore[call-overload]
        return f"; did you mean {close[0]!r}?" if close else ""
