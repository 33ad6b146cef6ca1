"""The kernel: inputs in, records and commands out (architecture, "The kernel").

    records, commands = kernel.handle(input)

Everything that a session is changes here and nowhere else. Same scenario, same seed, same inputs: the same outputs,
byte for byte. The first record that a `Submit` causes is the record of its own task.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeAlias

from rise_engine.kernel.commands import Command
from rise_engine.kernel.core import Core
from rise_engine.kernel.functions import Functions
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    ControlChanged,
    Note,
    RobotChanged,
    SessionEnded,
    SessionRecovered,
    SessionStarted,
    StopReport,
    Submit,
    TimerElapsed,
)
from rise_engine.kernel.records import AnyRecord, ControlRecord, RobotRecord, SessionRecord
from rise_engine.kernel.scheduler import Scheduler
from rise_engine.kernel.snapshot import Snapshot, restore, take
from rise_engine.kernel.stop import StopLatch
from rise_engine.kernel.wizard import Wizard
from rise_engine.scenario.model import Scenario

_SessionStatus: TypeAlias = Literal["started", "recovered", "ended"]


class Kernel:
    """A session's state and its only way to change. Pure: it knows no clock, disk, robot, thread or screen."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario = scenario
        self.seed = seed
        self.participant = self.condition = ""
        self.core = Core(scenario, seed)
        self.stop = StopLatch(self.core)
        self.wizard = Wizard(self.core)
        self.scheduler = Scheduler(self.core, self.wizard)
        self._functions = Functions(self.core, self.scheduler, self.stop, self.wizard)
        self.rules = self._functions.rules
        self._inputs: dict[type, Callable[[Any], None]] = {
            ActionReport: self._action_reported,
            TimerElapsed: self._timer_elapsed,
            RobotChanged: self._robot_changed,
            StopReport: self._stop_reported,
            Note: self._note,
            ControlChanged: self._control_changed,
            SessionStarted: self._session_started,
            SessionRecovered: self._session_recovered,
            SessionEnded: self._session_ended,
        }

    @property
    def busy(self) -> bool:
        """True while an act runs or waits, or a stop is not yet confirmed. Rules that wait do not count."""
        return bool(self.scheduler.runner.runs or self.scheduler.waiting) or self.stop.status == "requested"

    def handle(self, input: AnyInput) -> tuple[list[AnyRecord], list[Command]]:
        """Take one input, run everything that it sets off to completion, and say what came of it."""
        core = self.core
        kind = type(input)
        if input.t > core.t:
            core.t = input.t
            core.step += 1
        elif kind is not TimerElapsed:  # timers of one moment are one go: a loop of empty waits is a runaway too
            core.step += 1
        else:
            core.resumed = core.step
        core.cause = None
        records: list[AnyRecord] = []
        commands: list[Command] = []
        core.records, core.commands = records, commands
        if kind is Submit:
            pressed: float | None = input.pressed  # type: ignore[union-attr]
            core.pressed = None if pressed is None else round(min(pressed, core.t), 6)  # two clocks never agree quite
            functions = self._functions
            (functions.by_name.get(input.function) or functions.unknown)(input)  # type: ignore[union-attr, arg-type]
            self.wizard.done(records[0])  # type: ignore[arg-type]
        else:
            core.pressed = None
            self._inputs[kind](input)
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

    # --- inputs other than tasks ---

    def _action_reported(self, input: ActionReport) -> None:
        self.scheduler.runner.report(input.action, input.status, input.reason)

    def _timer_elapsed(self, input: TimerElapsed) -> None:
        target = self.core.timers.pop(input.timer, None)
        if target is None:
            return  # cancelled meanwhile
        if target.what == "after":
            self.rules.timer_elapsed(input.timer, target)
        elif target.what == "stop":
            self.stop.limit_passed()
        elif target.what == "filler":
            self._filler_wanted()
        else:
            self.scheduler.runner.timer_elapsed(target, input.timer)

    def _filler_wanted(self) -> None:
        """The scenario wants a filler when nothing has answered the cue for so long; not over anything that runs."""
        self.wizard.state.filler_timer = None
        name = self.wizard.next_filler()
        if name is not None and not self.busy and not self.stop.latched:
            self._functions.start_filler(name, "engine")

    def _robot_changed(self, input: RobotChanged) -> None:
        core = self.core
        core.seq += 1
        core.records.append(RobotRecord(core.seq, core.t, "", input.status, input.detail))
        if input.status == "lost":
            self.scheduler.runner.lose_robot(input.detail or "the link is lost")
        else:
            self.scheduler.runner.robot_lost = None

    def _stop_reported(self, input: StopReport) -> None:
        self.stop.answered(input.confirmed, input.unconfirmed)

    def _note(self, input: Note) -> None:
        self.core.note(input.text, input.source)

    def _control_changed(self, input: ControlChanged) -> None:
        core = self.core
        core.seq += 1
        core.records.append(ControlRecord(core.seq, core.t, "", input.status, input.by, input.holder))

    def _session_started(self, input: SessionStarted) -> None:
        self.participant, self.condition = input.participant, input.condition
        self._session("started", input.versions)
        self.rules.memory.begin()

    def _session_recovered(self, input: SessionRecovered) -> None:
        """Rules and timers go on, the latch holds; nothing that the robot was doing is done again by itself."""
        self._session("recovered", input.versions, input.reason)
        self.scheduler.runner.lose_running("the engine was restarted while it ran")
        self.wizard.no_filler()
        if self.stop.status == "requested":  # its answer went to the engine that has gone
            self.stop.ask_robot()

    def _session_ended(self, input: SessionEnded) -> None:
        self._session("ended", {}, input.reason)

    def _session(self, status: _SessionStatus, versions: dict[str, str], reason: str = "") -> None:
        core = self.core
        core.seq += 1
        scenario = self.scenario
        core.records.append(
            SessionRecord(
                core.seq,
                core.t,
                "",
                status=status,
                scenario=scenario.title,
                scenario_hash=scenario.hash,
                mode=scenario.mode,
                robot=scenario.robot.name,
                seed=self.seed,
                versions=versions,
                reason=reason,
                participant=self.participant,
                condition=self.condition,
            )
        )
