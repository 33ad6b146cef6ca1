"""The engine: the kernel with a clock, a robot, a journal and an audience (architecture, "The engine").

One step: input -> stamp -> kernel -> journal -> records to the sinks -> commands carried out. It is synchronous and
belongs to one thread; real time comes from a `RealClock` on an asyncio loop, virtual time from somebody who advances a
`VirtualClock`.

With a journal, whatever a step sends out waits until the step is on the disk: no console shows, no robot begins and
nobody is answered what could still be lost. The loop does not wait meanwhile. Only what makes the robot safe (cancels,
stop-all) never waits for a disk. While the disk takes nothing, the session is paused: from outside only stop-all is
taken, and what the robot and the timers say is kept, with its time, until it can be recorded.
"""

from __future__ import annotations

import logging
import platform
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine import __version__
from rise_engine.clock import SessionClock
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import CancelAction, CancelTimer, Command, SetTimer, StartAction, StopRobot
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    Note,
    RobotChanged,
    SessionEnded,
    SessionRecovered,
    SessionStarted,
    StopReport,
    Submit,
    TimerElapsed,
)
from rise_engine.kernel.records import AnyRecord, TaskRecord
from rise_engine.link.client import Journaling, Reply
from rise_engine.robot import Robot, RobotReport, Timer
from rise_engine.scenario.model import Scenario
from rise_engine.session.journal import Journal
from rise_engine.session.lines import input_line, record_bytes, step_lines

_LOG = logging.getLogger(__name__)

BEHIND = 0.5
"""Seconds that the disk may lag before the audience is told."""

Sink = Callable[[AnyRecord], None]
"""Gets every record, in order, on the engine's thread. It must not block; one that raises is dropped."""

Answer: TypeAlias = Callable[[Reply], None]
"""Gets what became of an input, once."""


class Resumption(Struct, frozen=True):
    """What an unfinished session is gone on with (`rise_engine.session.recovery`)."""

    kernel: Kernel
    inputs: int
    """How many inputs the journal holds."""
    timers: dict[int, float]
    """The kernel's timers and when they are due, in session time."""
    reason: str = ""


class _Outgoing(Struct):
    """What a step sends out once it is on the disk."""

    position: int
    records: list[AnyRecord]
    starts: list[StartAction]
    answer: Answer
    reply: Reply


class Engine:
    """One session. All methods belong to the engine's thread.

    `start` or `resume`, then any number of `accept` (from outside) and `post` (from robots, timers, sinks), then `end`:

        clock, records = VirtualClock(), []
        engine = Engine(scenario, make_robot(scenario.robot, "debug", clock, 1), clock, seed=1, sinks=[records.append])
        engine.start()
        engine.accept(Submit(function="startCommunicationRobotAct", behavior="Greet"))
        while not engine.idle and clock.advance():
            pass
        engine.end("done")
    """

    def __init__(
        self,
        scenario: Scenario,
        robot: Robot,
        clock: SessionClock,
        seed: int,
        *,
        participant: str = "",
        condition: str = "",
        sinks: Iterable[Sink] = (),
        journal: Journal | None = None,
        resumption: Resumption | None = None,
    ) -> None:
        """Nothing happens before `start` or `resume`.

        :param scenario: what is run, as `rise_engine.scenario.load` gives it.
        :param robot: the adapter; the engine connects and closes it.
        :param clock: a `RealClock` on the loop that this engine belongs to, or a `VirtualClock`.
        :param seed: for everything that is picked at random: the same seed and inputs give the same records.
        :param participant: who takes part, for the record.
        :param condition: the session's condition, for the record.
        :param sinks: get every record from the first one on.
        :param journal: makes steps durable before anything of them goes out; without it nothing is kept.
        :param resumption: what an unfinished session is gone on with, by `resume` instead of `start`.
        """
        self.scenario = scenario
        self.clock = clock
        self.seed = seed
        self._who = participant, condition
        self.ended = False
        """True when the session is over; nothing is accepted any more."""
        self.failure: Exception | None = None
        """Why it is over, when that was an error of the engine itself."""
        self.inputs = resumption.inputs if resumption is not None else 0
        """How many inputs were handled."""
        self.after_inputs: Callable[[], object] | None = None
        """Called after inputs were handled, outside any step: the moment to look whether the session is idle."""
        self.journaling = Journaling()
        """How the record of the session stands."""
        self.when_journaling: Callable[[Journaling], object] | None = None
        """Called when that has changed."""
        self._resumption = resumption
        self._kernel = resumption.kernel if resumption is not None else Kernel(scenario, seed)
        self._robot = robot
        self._journal = journal
        self._outgoing: deque[_Outgoing] = deque()
        self._sinks: list[Sink] = list(sinks)
        self._on_end: list[Callable[[], None]] = []
        self._queue: deque[tuple[AnyInput, Answer]] = deque()
        self._stepping = False
        self._timers: dict[int, Timer] = {}
        self._t = self._kernel.core.t
        self._seq = self._kernel.core.seq
        self._ending: str | None = None
        self._over = False
        self._stops: list[str] = []
        """What has come of stops that were asked for while nothing could be recorded."""

    # --- a session's life ---------------------------------------------------------------------------------------

    def start(self) -> None:
        """Begin: the session's first record, then the robot."""
        participant, condition = self._who
        self.accept(SessionStarted(versions=versions(), participant=participant, condition=condition))
        self._connect()

    def resume(self) -> None:
        """Go on with a session whose engine has gone: timers with the time that they had left, then the robot."""
        assert self._resumption is not None
        for timer, at in sorted(self._resumption.timers.items(), key=lambda item: (item[1], item[0])):
            self._timers[timer] = self.clock.call_at(at, partial(self._elapsed, timer))
        self._stepping = True  # the robot is there before anything goes out to it, and its word comes after the record
        try:
            self._connect()
        finally:
            self._stepping = False
        self.accept(SessionRecovered(versions=versions(), reason=self._resumption.reason))

    def _connect(self) -> None:
        try:
            self._robot.connect(self._report)
        except Exception as error:
            _LOG.exception("the robot adapter failed to connect")
            self.post(RobotChanged(status="lost", detail=_adapter_failed(error)))

    def end(self, reason: str = "", *, stop: bool | None = None) -> None:
        """Begin to end the session: stop the robot when anything runs (or `stop` says so), then the last record.

        `ended` is true when that has happened: at once, or after the robot's answer or the kernel's own deadline.
        """
        if self._over or self._ending is not None:
            return
        self._ending = reason
        if self._kernel.busy if stop is None else stop:
            self.post(Submit(function="stopAll", source="engine"))
        self._end_if_quiet()

    def end_now(self, reason: str = "") -> None:
        """End the session without waiting for the robot any longer. What still runs is recorded as lost."""
        if self._over:
            return
        if self._ending is None:
            self.end(reason)
        if not self._over and self._kernel.busy:
            self.post(RobotChanged(status="lost", detail="no answer before the session ended"))
        if not self._over and not self.paused:  # the kernel may have become quiet by that
            self._finish()

    def give_up(self) -> None:
        """Close what `end_now` could not bring to an end, because the disk does not take the last records."""
        if not self.ended:
            self._drop()

    @property
    def busy(self) -> bool:
        """True while something runs or waits to run."""
        return self._kernel.busy

    @property
    def robot_seen(self) -> float | None:
        """Session time of the robot's last sign of life; None when its driver does not know, or has failed."""
        try:
            return self._robot.seen()
        except Exception:  # an adapter of others, perhaps older than this question
            return None

    @property
    def idle(self) -> bool:
        """True when nothing will happen by itself: nothing runs and no timer is set. Waiting rules do not count."""
        return not (self._kernel.busy or self._timers or self._queue or self._outgoing)

    @property
    def paused(self) -> bool:
        """True while nothing can be recorded."""
        return self._journal is not None and bool(self._journal.trouble)

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

    def accept(self, fact: AnyInput, answer: Answer | None = None) -> None:
        """Take one input from outside; `answer` gets what became of it, once it is recorded and the sinks have had it.

        :param fact: what happened; its time is put on here.
        :param answer: called once, perhaps before this returns.
        :raises RuntimeError: inside a step. Robots and sinks `post`.
        """
        answer = answer or _nobody
        if self._stepping:
            raise RuntimeError("accept() was called inside a step; use post()")
        if self._over:
            answer(Reply(False, "the session has ended"))
        elif self.paused:
            self._accept_while_paused(fact, answer)
        else:
            self._step(self._stamped(fact), answer)
            self._drain()

    def post(self, fact: AnyInput) -> None:
        """Take one input after the step that is being made, if any. Never nests."""
        if self._over:
            return
        self._queue.append((self._stamped(fact), _nobody))
        if self._stops and isinstance(fact, StopReport):
            self._stops.append(_stop_words(fact))
            self._tell_journaling()
        if not self._stepping:
            self._drain()

    def _accept_while_paused(self, fact: AnyInput, answer: Answer) -> None:
        assert self._journal is not None
        if not (isinstance(fact, Submit) and fact.function == "stopAll"):
            answer(Reply(False, f"nothing can be recorded, so the session is paused: {self._journal.trouble}"))
            return
        self._queue.append((self._stamped(fact), answer))
        self._stops.append(f"stop was sent to the robot by {fact.source}")
        self._safely(StopRobot())
        self._tell_journaling()

    def _report(self, report: RobotReport) -> None:
        self.post(report)

    def _drain(self) -> None:
        while self._queue and not self._over and not self.paused:
            self._step(*self._queue.popleft())
        self._end_if_quiet()
        if self.after_inputs is not None:
            self.after_inputs()

    def _stamped(self, fact: AnyInput) -> AnyInput:
        return replace(fact, t=max(self._t, round(self.clock.now(), 6)))

    def _step(self, fact: AnyInput, answer: Answer) -> None:
        """The one place where anything happens."""
        self._stepping = True
        try:
            if fact.t < self._t:
                fact = replace(fact, t=self._t)
            line = b""
            if self._journal is not None:
                try:
                    line = input_line(self.inputs + 1, fact)
                except UnicodeEncodeError:
                    answer(Reply(False, "it holds characters that are no text (half of a pair)"))
                    return
            self._t = fact.t
            self.inputs += 1
            try:
                records, commands = self._kernel.handle(fact)
            except Exception as error:
                self._fail(error)
                raise
            wall = self.clock.wall(self._t)  # all records of a step are of one moment
            for record in records:
                record.wall = wall
            reply = _reply(fact, records)
            if self._journal is None:
                self._publish(records)
                for command in commands:
                    self._carry_out(command)
                answer(reply)
            else:
                position = self._journal.append(step_lines(line, map(record_bytes, records)))
                starts = [command for command in commands if isinstance(command, StartAction)]
                # Before the safe commands: a cancel may concern an action that has not gone out yet.
                self._outgoing.append(_Outgoing(position, records, starts, answer, reply))
                for command in commands:
                    if not isinstance(command, StartAction):
                        self._safely(command)
        finally:
            self._stepping = False

    # --- outputs ------------------------------------------------------------------------------------------------

    def look_at_journal(self) -> None:
        """Send out what has become durable. The journal's `changed` calls for this, and somebody now and then, so that
        a lag shows."""
        journal = self._journal
        if journal is None:
            return
        outgoing, durable = self._outgoing, journal.durable
        if outgoing and outgoing[0].position <= durable:
            self._stepping = True  # what sinks and robots post meanwhile comes after
            try:
                while outgoing and outgoing[0].position <= durable:
                    step = outgoing.popleft()
                    self._publish(step.records)
                    for start in step.starts:
                        self._carry_out(start)
                    step.answer(step.reply)
            finally:
                self._stepping = False
            journal.progressed()
        self._tell_journaling()
        if self._over:
            if not outgoing and not self.ended:
                self._close()
        elif not self.paused:
            self._drain()

    def _tell_journaling(self) -> None:
        journal = self._journal
        assert journal is not None
        trouble = journal.trouble
        if trouble and self._stops:
            trouble += "; " + ", ".join(self._stops)
        elif not trouble and self.journaling.trouble:
            self._stops.clear()
            self.post(Note(text=f"recording was interrupted and goes on now: {self.journaling.trouble}"))
        behind = journal.behind
        now = Journaling(self._seq, round(behind, 1) if behind > BEHIND else 0.0, trouble)
        before, self.journaling = self.journaling, now
        if (before.behind, before.trouble) != (now.behind, now.trouble) and self.when_journaling is not None:
            self.when_journaling(now)

    def _publish(self, records: list[AnyRecord]) -> None:
        for record in records:
            self._seq = record.seq
            for sink in tuple(self._sinks):
                try:
                    sink(record)
                except Exception as error:
                    _LOG.exception("an output failed and gets no more records")
                    self.unsubscribe(sink)
                    self.post(Note(text=f"an output failed and gets no more records: {_name(error)}"))

    def _safely(self, command: Command) -> None:
        """Carry out at once what needs no record first. An action that is cancelled before it went out never does."""
        if isinstance(command, CancelAction):
            for step in self._outgoing:
                for start in step.starts:
                    if start.action == command.action:
                        step.starts.remove(start)
                        self.post(ActionReport(action=start.action, status="canceled", reason="it had not begun yet"))
                        return
        self._carry_out(command)

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
        waits = self._stepping or self._queue or self._kernel.busy or self.paused
        if self._ending is not None and not self._over and not waits:
            self._finish()

    def _finish(self) -> None:
        self._refuse_waiting()
        self._step(self._stamped(SessionEnded(reason=self._ending or "")), _nobody)
        self._over = True
        self._let_go()
        if not self._outgoing:
            self._close()

    def _fail(self, error: Exception) -> None:
        """The kernel itself failed: leave the robot still, and say why."""
        _LOG.error("the engine failed", exc_info=error)
        self.failure = error
        self._drop()

    def _drop(self) -> None:
        """End here and now, whatever is not recorded; the robot is asked to stop."""
        try:
            self._robot.stop_all()
        except Exception:
            _LOG.exception("the robot adapter failed to stop the robot")
        self._over = True
        self._let_go()
        self._close()

    def _let_go(self) -> None:
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        try:
            self._robot.close()
        except Exception:
            _LOG.exception("the robot adapter failed to close")

    def _close(self) -> None:
        self.ended = True
        for step in self._outgoing:
            step.answer(Reply(False, "the session has ended"))
        self._outgoing.clear()
        self._refuse_waiting()
        callbacks, self._on_end = self._on_end, []
        for callback in callbacks:
            callback()

    def _refuse_waiting(self) -> None:
        while self._queue:
            self._queue.popleft()[1](Reply(False, "the session has ended"))


def _nobody(reply: Reply) -> None:
    """Nobody waits for this answer."""


def _reply(fact: AnyInput, records: list[AnyRecord]) -> Reply:
    if not isinstance(fact, Submit):
        return Reply(True)
    first = records[0] if records else None
    if not isinstance(first, TaskRecord):
        return Reply(True)
    return Reply(first.status != "REJECTED", first.reason, first.id)


def _stop_words(report: StopReport) -> str:
    confirmed = f"confirmed by {', '.join(report.confirmed)}" if report.confirmed else "confirmed by nobody"
    return confirmed + (f", NOT by {', '.join(report.unconfirmed)}" if report.unconfirmed else "")


def versions() -> dict[str, str]:
    """What made a session's records: this program and its Python."""
    return {"rise-tui": __version__, "python": platform.python_version()}


def _name(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _adapter_failed(error: Exception) -> str:
    return f"the robot adapter failed ({_name(error)})"
