"""The engine: the kernel with a clock, a robot and an audience (architecture, "The engine").

One step: input -> stamp -> kernel -> records to the sinks -> commands carried out. It is synchronous and belongs to one
thread; real time comes from a `RealClock` on an asyncio loop, virtual time from somebody who advances a `VirtualClock`.
"""

from __future__ import annotations

import logging
import platform
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from importlib.metadata import PackageNotFoundError, version

from msgspec.structs import replace

from rise_engine.clock import SessionClock
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import CancelAction, CancelTimer, Command, SetTimer, StartAction, StopRobot
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
from rise_engine.kernel.records import AnyRecord, StopRecord, TaskRecord
from rise_engine.link.client import Reply
from rise_engine.robot import Robot, RobotReport, Timer
from rise_engine.scenario.model import Scenario

_LOG = logging.getLogger(__name__)

Sink = Callable[[AnyRecord], None]
"""Gets every record, in order, on the engine's thread. It must not block; one that raises is dropped."""


class Engine:
    """One session. All methods belong to the engine's thread.

    `start`, then any number of `accept` (from outside) and `post` (from robots, timers, sinks), then `end`.
    """

    def __init__(
        self, scenario: Scenario, robot: Robot, clock: SessionClock, seed: int, *, sinks: Iterable[Sink] = ()
    ) -> None:
        self.scenario = scenario
        self.clock = clock
        self.seed = seed
        self.ended = False
        """True when the session is over; nothing is accepted any more."""
        self.failure: Exception | None = None
        """Why it is over, when that was an error of the engine itself."""
        self.inputs = 0
        """How many inputs were handled."""
        self.after_inputs: Callable[[], object] | None = None
        """Called after inputs were handled, outside any step: the moment to look whether the session is idle."""
        self._kernel = Kernel(scenario, seed)
        self._robot = robot
        self._sinks: list[Sink] = list(sinks)
        self._on_end: list[Callable[[], None]] = []
        self._queue: deque[AnyInput] = deque()
        self._stepping = False
        self._timers: dict[int, Timer] = {}
        self._t = 0.0
        self._ending: str | None = None
        self._stop_status = "released"

    # --- a session's life ---------------------------------------------------------------------------------------

    def start(self) -> None:
        """Begin: the session's first record, then the robot."""
        self.accept(SessionStarted(versions=versions()))
        try:
            self._robot.connect(self._report)
        except Exception as error:
            _LOG.exception("the robot adapter failed to connect")
            self.post(RobotChanged(status="lost", detail=_adapter_failed(error)))

    def end(self, reason: str = "", *, stop: bool | None = None) -> None:
        """Begin to end the session: stop the robot when anything runs (or `stop` says so), then the last record.

        `ended` is true when that has happened: at once, or after the robot's answer or the kernel's own deadline.
        """
        if self.ended or self._ending is not None:
            return
        self._ending = reason
        if self._kernel.busy if stop is None else stop:
            self.post(Submit(function="stopAll", source="engine"))
        self._end_if_quiet()

    def end_now(self, reason: str = "") -> None:
        """End the session without waiting for the robot any longer. What still runs is recorded as lost."""
        if self.ended:
            return
        if self._ending is None:
            self.end(reason)
        if not self.ended and self._kernel.busy:
            self.post(RobotChanged(status="lost", detail="no answer before the session ended"))
        if not self.ended:  # the kernel may have become quiet by that
            self._finish()

    @property
    def busy(self) -> bool:
        """True while something runs or waits to run."""
        return self._kernel.busy

    @property
    def idle(self) -> bool:
        """True when nothing will happen by itself: nothing runs and no timer is set. Waiting rules do not count."""
        return not (self._kernel.busy or self._timers or self._queue)

    def subscribe(self, sink: Sink) -> None:
        """Let `sink` have every record from now on."""
        self._sinks.append(sink)

    def unsubscribe(self, sink: Sink) -> None:
        if sink in self._sinks:
            self._sinks.remove(sink)

    def when_ended(self, callback: Callable[[], None]) -> None:
        """Call `callback` once the session is over (at once when it is)."""
        if self.ended:
            callback()
        else:
            self._on_end.append(callback)

    # --- inputs -------------------------------------------------------------------------------------------------

    def accept(self, fact: AnyInput) -> Reply:
        """Take one input from outside and say what became of it. Not for robots and sinks: they `post`."""
        if self._stepping:
            raise RuntimeError("accept() was called inside a step; use post()")
        if self.ended:
            return Reply(False, "the session has ended")
        records = self._step(fact)
        self._drain()
        if not isinstance(fact, Submit):
            return Reply(True)
        first = records[0] if records else None
        if not isinstance(first, TaskRecord):
            return Reply(True)
        return Reply(first.status != "REJECTED", first.reason, first.id)

    def post(self, fact: AnyInput) -> None:
        """Take one input after the step that is being made, if any. Never nests."""
        if not self.ended:
            self._queue.append(fact)
            if not self._stepping:
                self._drain()

    def _report(self, report: RobotReport) -> None:
        self.post(report)

    def _drain(self) -> None:
        while self._queue and not self.ended:
            self._step(self._queue.popleft())
        self._end_if_quiet()
        if self.after_inputs is not None:
            self.after_inputs()

    def _step(self, fact: AnyInput) -> list[AnyRecord]:
        """The one place where anything happens. (A journal goes before `handle`: durable first, then accepted.)"""
        self._stepping = True
        try:
            self._t = max(self._t, round(self.clock.now(), 6))
            self.inputs += 1
            try:
                records, commands = self._kernel.handle(replace(fact, t=self._t))
            except Exception as error:
                self._fail(error)
                raise
            self._publish(records)
            for command in commands:
                self._carry_out(command)
            return records
        finally:
            self._stepping = False

    # --- outputs ------------------------------------------------------------------------------------------------

    def _publish(self, records: list[AnyRecord]) -> None:
        wall = self.clock.wall(self._t)  # all records of a step are of one moment
        for record in records:
            record.wall = wall
            if isinstance(record, StopRecord):
                self._stop_status = record.status
            for sink in tuple(self._sinks):
                try:
                    sink(record)
                except Exception as error:
                    _LOG.exception("an output failed and gets no more records")
                    self.unsubscribe(sink)
                    self.post(Note(text=f"an output failed and gets no more records: {_name(error)}"))

    def _carry_out(self, command: Command) -> None:
        match command:
            case SetTimer(timer=timer, at=at):
                self._timers[timer] = self.clock.call_at(at, partial(self._elapsed, timer))
            case CancelTimer(timer=timer):
                handle = self._timers.pop(timer, None)
                if handle is not None:
                    handle.cancel()
            case StartAction():
                try:
                    self._robot.start(command)
                except Exception as error:
                    _LOG.exception("the robot adapter failed to start %s", command.action)
                    self.post(ActionReport(action=command.action, status="failed", reason=_adapter_failed(error)))
            case CancelAction(action=action):
                try:
                    self._robot.cancel(action)
                except Exception as error:  # it goes on running until it ends or its time is over
                    _LOG.exception("the robot adapter failed to cancel %s", action)
                    self.post(Note(text=f"{action} could not be cancelled: {_adapter_failed(error)}"))
            case StopRobot():
                try:
                    self._robot.stop_all()
                except Exception as error:
                    _LOG.exception("the robot adapter failed to stop the robot")
                    self.post(StopReport(unconfirmed=(self.scenario.robot.name,)))
                    self.post(Note(text=f"the robot could not be asked to stop: {_adapter_failed(error)}"))

    def _elapsed(self, timer: int) -> None:
        self._timers.pop(timer, None)
        self.post(TimerElapsed(timer=timer))

    # --- the end ------------------------------------------------------------------------------------------------

    def _end_if_quiet(self) -> None:
        quiet = not self._kernel.busy and self._stop_status != "requested"
        if self._ending is not None and not self.ended and quiet and not self._stepping and not self._queue:
            self._finish()

    def _finish(self) -> None:
        self._queue.clear()
        self._step(SessionEnded(reason=self._ending or ""))
        self._close()

    def _fail(self, error: Exception) -> None:
        """The kernel itself failed: leave the robot still, and say why."""
        _LOG.error("the engine failed", exc_info=error)
        self.failure = error
        try:
            self._robot.stop_all()
        except Exception:
            _LOG.exception("the robot adapter failed to stop the robot")
        self._close()

    def _close(self) -> None:
        self.ended = True
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        try:
            self._robot.close()
        except Exception:
            _LOG.exception("the robot adapter failed to close")
        callbacks, self._on_end = self._on_end, []
        for callback in callbacks:
            callback()


def versions() -> dict[str, str]:
    """What made a session's records: this program and its Python."""
    try:
        own = version("rise-tui")
    except PackageNotFoundError:  # run from a source tree that was never installed
        own = "unknown"
    return {"rise-tui": own, "python": platform.python_version()}


def _name(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _adapter_failed(error: Exception) -> str:
    return f"the robot adapter failed ({_name(error)})"
