"""The engine: the kernel with a clock, a robot, a journal and sinks for its records (architecture, "The engine").

One step: input -> time -> kernel -> journal -> records to the sinks -> commands carried out. The engine is synchronous
and belongs to one thread. Real time comes from a `RealClock` on an asyncio loop, virtual time from a caller who
advances a `VirtualClock`.

With a journal, the effects of a step wait until the step is on the disk: records for consoles, starts on the robot, the
end of a stop, and replies. The loop continues meanwhile. Only cancels and stop-all, which make the robot safe, never
wait for the disk. While the disk fails, the session is paused and accepts only these from outside. Reports of the robot
and elapsed timers are kept, with their time, until they can be recorded.
"""

from __future__ import annotations

import logging
import platform
from collections import deque
from collections.abc import Callable, Iterable
from math import inf
from typing import TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine import __version__
from rise_engine.base.suspend import suspended_seconds
from rise_engine.base.text import pluralize
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import CancelAction, CancelOpenGoals, Command, EndStop, StartAction, StopRobot
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    EstopReport,
    Note,
    RobotChanged,
    ScenarioChanged,
    SessionEnded,
    SessionRecovered,
    SessionStarted,
    StopReport,
    Submit,
)
from rise_engine.kernel.records import AnyRecord, OpenGoal, StopRecord, TaskRecord
from rise_engine.ports.robot import Robot
from rise_engine.run.engine.clock import SessionClock, seconds_between_labels
from rise_engine.run.engine.command_runner import NOT_BEGUN, CommandRunner, error_text
from rise_engine.run.engine.drivers import driver_name_for
from rise_engine.run.protocol.client import JournalStatus, Reply, UnrecordedStop
from rise_engine.scenario.model import Scenario
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import encode_input, encode_record, join_step
from rise_engine.session.recovery import RecoveredSession

_LOG = logging.getLogger(__name__)

LAG_SHOWN_FROM = 0.5
"""Seconds of the disk's lag above which clients get a status."""

MAX_LATE_SECONDS = 5.0
"""Maximum seconds from an action's step to its start. After that, nobody expects it and it does not begin."""

END_SECONDS = 6.0
"""Seconds of session time for the robot to end everything before the session ends without it."""

Sink = Callable[[AnyRecord], None]
"""A sink gets every record, in order, on the engine's thread. It must not block; a sink that raises is removed."""

ReplyCallback: TypeAlias = Callable[[Reply], None]
"""Takes the reply to an input, once."""


def _ignore_reply(reply: Reply) -> None:
    """Ignore a reply."""


class _UnrecordedStep(Struct):
    """The effects of a step that wait until it is on the disk."""

    position: int
    records: list[AnyRecord]
    starts: list[StartAction]
    ends_stop: bool
    """Whether it releases a stop, and no later stop was requested."""
    on_reply: ReplyCallback
    reply: Reply
    t: float
    """The session time of the step."""
    suspended: float
    """`suspended_seconds` at that time."""


class Engine:
    """One session. All methods belong to the engine's thread.

    `start` or `resume`, then any number of `accept` (from outside) and `post` (from robots, timers, sinks), then `end`:

    >>> from rise_engine.run.engine.clock import VirtualClock
    >>> from rise_engine.run.engine.drivers import make_robot
    >>> from rise_engine.scenario.loader import load
    >>> scenario = load("scenarios/greeting").scenario
    >>> clock, records = VirtualClock(), []
    >>> robot = make_robot(scenario.robot, "debug", clock, seed=1)
    >>> engine = Engine(scenario, robot, clock, seed=1, participant="P07", sinks=[records.append])
    >>> engine.start()
    >>> engine.accept(Submit(function="startCommunicationRobotAct", behavior="R_Smile"), print)
    Reply(accepted=True, reason='', task=1)
    >>> while not engine.idle and clock.advance():
    ...     pass
    >>> engine.end("done")
    >>> engine.ended, [record.status for record in records if isinstance(record, TaskRecord)]
    (True, ['PENDING', 'ACTIVE', 'SUCCEEDED'])
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
        started: SessionStarted | None = None,
        sinks: Iterable[Sink] = (),
        journal: Journal | None = None,
        recovered: RecoveredSession | None = None,
        session_id: str = "",
    ) -> None:
        """Make an engine; nothing happens before `start` or `resume`.

        :param scenario: what is run, from `rise_engine.scenario.loader.load`.
        :param robot: the adapter; the engine connects and closes it.
        :param clock: a `RealClock` on the loop that this engine belongs to, or a `VirtualClock`.
        :param seed: for all random choices: the same seed and inputs give the same records.
        :param participant: the participant, for the record.
        :param condition: the session's condition, for the record.
        :param started: the session's first input, instead of `participant` and `condition`, for a session of a study;
            `versions` and `driver` are set here.
        :param sinks: get every record from the first one on.
        :param journal: makes steps durable before their effects; without it nothing is stored.
        :param recovered: the unfinished session to continue, by `resume` instead of `start`.
        :param session_id: identifies the session; the same for every engine of the session.
        """
        self.scenario = scenario
        self.clock = clock
        self.seed = seed
        first = started or SessionStarted(participant=participant, condition=condition)
        self._session_started = replace(
            first, versions=versions(), driver=driver_name_for(scenario.robot, scenario.mode)
        )
        self.ended = False
        """Whether the session is over and accepts nothing any more."""
        self.open_goals: tuple[OpenGoal, ...] = ()
        """The robot's open goals at the end of the session."""
        self.failure: Exception | None = None
        """The engine's own error that ended the session."""
        self.inputs = recovered.inputs if recovered is not None else 0
        """The number of handled inputs."""
        self.after_inputs: Callable[[], object] | None = None
        """Called after inputs, outside of any step: the moment to check whether the session is idle."""
        self.journal_status = JournalStatus()
        """The state of the session's record."""
        self.on_journal_status: Callable[[JournalStatus], object] | None = None
        """Called when that has changed."""
        self._timers_left = recovered.timers if recovered is not None else {}
        self._wall_before = recovered.last_wall if recovered is not None else ""
        self._t_before = recovered.last_t if recovered is not None else 0.0
        self._commands = CommandRunner(robot, scenario, clock, self.post, session_id)
        self._kernel = recovered.kernel if recovered is not None else Kernel(scenario, seed)
        self._journal = journal
        self._unrecorded_steps: deque[_UnrecordedStep] = deque()
        self._sinks: list[Sink] = list(sinks)
        self._end_callbacks: list[Callable[[], None]] = []
        self._queue: deque[tuple[AnyInput, ReplyCallback]] = deque()
        self._stepping = False
        self._t = self._kernel.core.t
        self._seq = self._kernel.seq
        self._end_reason: str | None = None
        self._last_record_made = False
        self._recorded_stop = _stop_in_force(recovered)
        """The stop in force, as the sinks know it."""
        self._end_by = inf
        """The session time at which the session ends without waiting for the robot."""
        self._delayed_from: float | None = None
        """The session time since which nothing can be recorded; None: recording works."""

    # --- a session's life ---------------------------------------------------------------------------------------

    def start(self) -> None:
        """Begin: make the session's first record, then connect the robot. Call it once, or call `resume` instead.

        :raises Exception: the kernel's, after it has ended the engine (`failure`).
        """
        self.accept(self._session_started)
        self._commands.connect()

    def resume(self, *, waits_for_wizard: bool = False) -> None:
        """Continue a session whose engine has gone: set the remaining timers, then connect the robot.

        Call it once, instead of `start`, on an engine made with a `recovered` session; it raises as `start` does.

        :param waits_for_wizard: whether nothing begins on the robot until a wizard has control.
        """
        for timer, at in sorted(self._timers_left.items(), key=lambda item: (item[1], item[0])):
            self._commands.set_timer(timer, at)
        self._stepping = True  # the robot must be connected before any command, and its report must follow the record
        try:
            self._commands.connect(self._kernel.unfinished_goals(), self._kernel.stop.held_by)
        finally:
            self._stepping = False
        now = self.clock.now()
        away = seconds_between_labels(self._wall_before, self.clock.wall_label(now))
        # The earlier engine lived longer than its last record. It has noted for how long.
        lived_on = (now - self._t_before) / self.clock.speed
        downtime = None
        if away is not None and away > lived_on - 1.0:  # otherwise the computer's clock was set back
            downtime = round(max(0.0, away - lived_on), 3)
        self.accept(
            SessionRecovered(
                versions=versions(),
                reason="its engine had gone",
                downtime=downtime,
                waits_for_wizard=waits_for_wizard,
            )
        )

    def stop_before_end(self) -> None:
        """Stop the robot and every rule immediately if anything runs or waits, because the session will end soon.

        Later inputs find everything stopped. Never call it within a step.
        """
        if self._last_record_made or self._end_reason is not None:
            return
        if self._must_stop_first or self._kernel.rules.rule_states() or self._commands.has_timers:
            self.accept(Submit(function="stopAll", source="engine"))

    def end(self, reason: str = "", *, stop: bool | None = None) -> None:
        """Begin to end the session: stop the robot, then make the last record. Has no effect if it is already ending.

        `ended` becomes true immediately, or when the robot has ended all its actions, within END_SECONDS.

        :param reason: why, for the record.
        :param stop: whether the robot is stopped first; None: if anything runs.
        """
        if self._last_record_made or self._end_reason is not None:
            return
        self._end_reason = reason
        self._end_by = self.clock.now() + END_SECONDS
        self.clock.call_at(self._end_by, self.end_now)
        if self._must_stop_first if stop is None else stop:
            self.post(Submit(function="stopAll", source="engine"))
        self._end_if_idle()

    def end_now(self, reason: str = "") -> None:
        """End the session without waiting for the robot, and record what still runs as lost.

        The last record names the robot's open goals.

        :param reason: why, for the record; an earlier reason given to `end` takes precedence.
        """
        self.end(reason)
        if self._kernel.is_busy:
            why = "no answer before the session ended"
            name, core = self.scenario.robot.name, self._kernel.core
            running = self._kernel.scheduler.runner.running_goals()
            left = tuple(OpenGoal(f"{name}/{goal.type}", goal.action, goal.type, why) for goal in running)
            self.post(RobotChanged(status="lost", detail=why, open=(*core.open_goals, *left)))
        if not self._last_record_made and not self.paused:  # the kernel may be idle now
            self._record_end()

    def abandon(self) -> None:
        """End immediately, even with unrecorded steps, and ask the robot to stop.

        For a session that `end_now` could not end, because the disk does not accept the last records.
        """
        if not self.ended:
            self._commands.stop_robot()
            self._last_record_made = True
            self._commands.release()
            self._close()

    @property
    def kernel(self) -> Kernel:
        """The session's state, for observers in the same process. Only inputs change it."""
        return self._kernel

    @property
    def holding_goals(self) -> tuple[OpenGoal, ...]:
        """The open goals that hold a part of the robot, and can be asked to stop."""
        reported = (input.open for input, _ in reversed(self._queue) if isinstance(input, RobotChanged))
        goals = next(reported, self._kernel.core.open_goals)  # the kernel does not know unrecorded reports
        return tuple(goal for goal in goals if goal.holds)

    @property
    def waits_for_wizard(self) -> bool:
        """Whether nothing may begin because no wizard has had control since the session was recovered."""
        return self._kernel.core.waits_for_wizard

    @property
    def robot_seen(self) -> float | None:
        """Session time of the robot's last sign of life; None if its driver does not know, or has failed."""
        return self._commands.robot_seen

    @property
    def idle(self) -> bool:
        """Whether nothing happens without an input: nothing runs, and no timer is set. Waiting rules do not count."""
        return not (self._kernel.is_busy or self._commands.has_timers or self._queue or self._unrecorded_steps)

    @property
    def paused(self) -> bool:
        """Whether nothing can be recorded now."""
        return self._journal is not None and bool(self._journal.error)

    def subscribe(self, sink: Sink) -> None:
        """Send every record from now on to a sink.

        :param sink: gets one record at a time, in order, on this thread, like the sinks given to `__init__`.
        """
        self._sinks.append(sink)

    def on_ended(self, callback: Callable[[], None]) -> None:
        """Call back when the session is over.

        :param callback: called once, without arguments; immediately if the session has ended already.
        """
        if self.ended:
            callback()
        else:
            self._end_callbacks.append(callback)

    # --- inputs -------------------------------------------------------------------------------------------------

    def accept(self, input: AnyInput, answer: ReplyCallback = _ignore_reply) -> None:
        """Take one input from outside.

        :param input: what happened; its time is set here.
        :param answer: gets the reply once, after the input is recorded and the sinks have it. A refusal, because the
            session has ended or is paused, may come before this returns.
        :raises RuntimeError: inside a step. Robots and sinks use `post`.
        """
        if self._stepping:
            raise RuntimeError("accept() was called inside a step; use post()")
        if self._last_record_made:
            answer(Reply(False, "the session has ended"))
        elif isinstance(input, SessionStarted | SessionRecovered):  # before earlier reports of the robot
            self._queue.appendleft((self._with_time(input), answer))
            if self.paused and self._kernel.stop.latched:
                self._carry_out_before_recording(StopRobot())
            self._process_queue()
        elif self.paused and not (requests_stop(input) or self._cancels_open_goals(input)):
            assert self._journal is not None
            answer(Reply(False, f"nothing can be recorded, so the session is paused: {self._journal.error}"))
        else:
            self._take(input, answer)

    def why_not_take_over(self, scenario: Scenario) -> list[str]:
        """Return why the session cannot continue with another scenario now; empty: it can."""
        if self._last_record_made or self._end_reason is not None:
            return ["the session is ending"]
        return self._kernel.why_not_take_over(scenario)

    def take_over(self, scenario: Scenario, copy: str, source: str, answer: ReplyCallback = _ignore_reply) -> bool:
        """Continue with another scenario; return whether it does. Never call it within a step.

        :param scenario: checked, read for the session's robot and mode.
        :param copy: the subfolder of the session's folder with a durable copy of its files.
        :param source: who requested it.
        :param answer: as for `accept`.
        """
        if problems := self.why_not_take_over(scenario):
            answer(Reply(False, "; ".join(problems)))
            return False
        self._kernel.offered = scenario
        self.accept(ScenarioChanged(hash=scenario.hash, was=self.scenario.hash, copy=copy, source=source), answer)
        if self._kernel.scenario is not scenario:  # nothing can be recorded now; the reply says so
            self._kernel.offered = None
            return False
        self.scenario = scenario
        self._commands.change_wording(scenario)
        return True

    def post(self, input: AnyInput) -> None:
        """Take one input after the present step, if any, so that steps never nest. There is no reply.

        :param input: what happened; its time is set here. After the session's end it is dropped.
        """
        if self._last_record_made:
            return
        self._take(input, _ignore_reply)

    def _take(self, input: AnyInput, answer: ReplyCallback) -> None:
        self._queue.append((self._with_time(input), answer))
        if self.paused:
            self._stop_while_paused(input)
        if not self._stepping:
            self._process_queue()

    def _stop_while_paused(self, input: AnyInput) -> None:
        """Make the robot safe if the input requests that, although nothing can be recorded, and publish what is known
        about stops. Actions that were not sent never start."""
        if requests_stop(input):
            for step in tuple(self._unrecorded_steps):  # a copy: more steps may come while the disk recovers
                starts, step.starts[:] = tuple(step.starts), ()
                for start in starts:
                    self._post_not_begun(start)
            self._carry_out_before_recording(StopRobot())
        elif isinstance(input, Submit) and self._cancels_open_goals(input):
            self._carry_out_before_recording(CancelOpenGoals(input.behavior))
        if requests_stop(input) or isinstance(input, StopReport):
            self._update_journal_status()

    def _cancels_open_goals(self, input: AnyInput) -> bool:
        return isinstance(input, Submit) and input.function == "cancelOpenGoals" and bool(self.holding_goals)

    def _process_queue(self) -> None:
        while self._queue and not self._last_record_made and not self.paused:
            self._step(*self._queue.popleft())
        self._end_if_idle()
        if self.after_inputs is not None:
            self.after_inputs()

    def _with_time(self, input: AnyInput) -> AnyInput:
        return replace(input, t=max(self._t, round(self.clock.now(), 6)))

    def _step(self, input: AnyInput, answer: ReplyCallback) -> None:
        """Handle one input. All changes happen here."""
        self._stepping = True
        try:
            if input.t < self._t:
                input = replace(input, t=self._t)
            line = b""
            if self._journal is not None:
                try:
                    line = encode_input(self.inputs + 1, input)
                except UnicodeEncodeError:
                    answer(Reply(False, "it has characters that are not text (half of a pair)"))
                    return
            self._t = input.t
            self.inputs += 1
            try:
                records, commands = self._kernel.handle(input)
            except Exception as error:  # after any error, the robot must stop
                self._fail(error)
                raise
            wall = self.clock.wall_label(self._t)  # all records of a step have one time
            for record in records:
                record.wall = wall
            reply = _reply_for(input, records)
            if self._journal is None:
                self._publish(records)
                for command in commands:
                    self._commands.run(command)
                answer(reply)
            else:
                position = self._journal.append(join_step(line, map(encode_record, records)))
                starts = [command for command in commands if isinstance(command, StartAction)]
                # Before the commands that need no record: a cancel may concern an action that was not sent yet.
                ends_stop, t = EndStop() in commands, self._t
                step = _UnrecordedStep(position, records, starts, ends_stop, answer, reply, t, suspended_seconds())
                self._unrecorded_steps.append(step)
                for command in commands:
                    if not isinstance(command, StartAction | EndStop):
                        self._carry_out_before_recording(command)
        finally:
            self._stepping = False

    # --- outputs ------------------------------------------------------------------------------------------------

    def flush_durable(self) -> None:
        """Send out what has become durable: records to the sinks, actions to the robot, replies to their callers.

        The journal's `changed` requests this call. Call it also about twice a second, to publish a lag.
        """
        journal = self._journal
        if journal is None:
            return
        outgoing, durable = self._unrecorded_steps, journal.durable
        if outgoing and outgoing[0].position <= durable:
            self._stepping = True  # so that inputs posted by sinks and robots come after this
            try:
                steps = []
                while outgoing and outgoing[0].position <= durable:
                    steps.append(outgoing.popleft())
                self._drop_late(steps)
                for step in steps:
                    self._publish(step.records)
                    if step.ends_stop:
                        self._commands.run(EndStop())
                    for start in step.starts:
                        self._commands.run(start)
                    try:
                        step.on_reply(step.reply)
                    except Exception:  # the caller's code; later replies must not be lost
                        _LOG.exception("a reply could not be passed on")
            finally:
                self._stepping = False
        self._update_journal_status()
        if self._last_record_made:
            if not outgoing and not self.ended:
                self._close()
        elif not self.paused:
            self._process_queue()
            if self.clock.now() >= self._end_by:
                self.end_now()

    def _drop_late(self, steps: Iterable[_UnrecordedStep]) -> None:
        """Drop the starts of steps that were recorded too late, and the tasks that these steps added to the queue.
        Tasks that wait behind a dropped Blocking act are cancelled, too."""
        late = [step for step in steps if self._age(step) > MAX_LATE_SECONDS]
        if not late:
            return
        starts = [(start, self._age(step)) for step in late for start in step.starts]
        for step in late:
            step.starts.clear()
        scheduler, dropped = self._kernel.scheduler, {start.action.partition("/")[0] for start, _ in starts}
        runs = [run for id, run in scheduler.runner.runs.items() if str(id) in dropped]
        is_behind = any(run.task.calling_type != "None" for run in runs)
        # While the session waits for a wizard, tasks begin only on the wizard's request.
        waiting = [] if self.waits_for_wizard else scheduler.waiting
        waiting = [task for task in waiting if is_behind or late[0].t <= task.accepted_at <= late[-1].t]
        for task in waiting:  # before the end of a start makes room for them
            self.post(Submit(function="cancelTask", behavior=str(task.id), source="engine"))
        if waiting:
            why = f"the record was up to {self._age(late[0]):.0f} s late"
            self.post(Note(text=f"{pluralize(len(waiting), 'waiting act')} cancelled: {why}"))
        for start, age in starts:
            self._post_not_begun(start, f"it was recorded {age:.0f} s late, so it was not begun")

    def _age(self, step: _UnrecordedStep) -> float:
        """Return the age of a step in real seconds. Session time stands still while the computer is suspended."""
        return (self.clock.now() - step.t) / self.clock.speed + suspended_seconds() - step.suspended

    def _update_journal_status(self) -> None:
        journal = self._journal
        assert journal is not None
        error = journal.error
        self._note_delay(journal)
        lag = round(journal.lag, 1) if journal.lag > LAG_SHOWN_FROM else 0.0
        is_reported = bool(error) or lag > 1 or self.journal_status.stop is not None  # a stop is told until recorded
        now = JournalStatus(self._seq, lag, error, self._find_unrecorded_stop() if is_reported else None)
        before, self.journal_status = self.journal_status, now
        if replace(before, durable=now.durable) != now and self.on_journal_status is not None:
            self.on_journal_status(now)

    def _note_delay(self, journal: Journal) -> None:
        """Note afterwards that nothing could be recorded for a while, because no reply was possible then."""
        now = self.clock.now()
        # A failing disk shows a shorter lag first. Without one, the engine itself stood still, and notes that.
        if journal.error or (journal.lag > MAX_LATE_SECONDS and self.journal_status.behind):
            if self._delayed_from is None:
                self._delayed_from = now - journal.lag * self.clock.speed
        elif self._delayed_from is not None:
            seconds, self._delayed_from = (now - self._delayed_from) / self.clock.speed, None
            trouble = self.journal_status.sentence if self.journal_status.trouble else f"the disk took {seconds:.0f} s"
            text = f"recording was interrupted and goes on now: {trouble}"
            self.post(Note(text=text, stood=round(seconds, 3)))

    def _find_unrecorded_stop(self) -> UnrecordedStop | None:
        """Return the stop in force with the robot's answer, if part of it is not recorded yet."""
        stop = self._recorded_stop
        for step in self._unrecorded_steps:
            for record in step.records:
                stop = _stop_after(stop, record)
        for input, _ in self._queue:
            stop = _stop_after(stop, input)
        return None if stop == self._recorded_stop else stop

    def _publish(self, records: list[AnyRecord]) -> None:
        for record in records:
            self._seq = record.seq
            self._recorded_stop = _stop_after(self._recorded_stop, record)
            for sink in tuple(self._sinks):
                try:
                    sink(record)
                except Exception as error:  # code of another author
                    _LOG.exception("an output failed and gets no more records")
                    self._sinks.remove(sink)
                    self.post(Note(text=f"an output failed and gets no more records: {error_text(error)}"))

    def _carry_out_before_recording(self, command: Command) -> None:
        """Carry out a command that needs no record first. An action that it cancels before sending never starts, and a
        stop stays when an earlier one is released."""
        if isinstance(command, CancelAction):
            for step in self._unrecorded_steps:
                for start in step.starts:
                    if start.action == command.action:
                        step.starts.remove(start)
                        self._post_not_begun(start)
                        return
        if isinstance(command, StopRobot):
            for step in self._unrecorded_steps:
                step.ends_stop = False
        self._commands.run(command)

    def _post_not_begun(self, start: StartAction, why: str = NOT_BEGUN) -> None:
        self.post(ActionReport(action=start.action, status="canceled", reason=why))

    # --- the end ------------------------------------------------------------------------------------------------

    @property
    def _is_robot_busy(self) -> bool:
        """Whether an act runs or waits, a stop is unanswered, or open goals hold a part of the robot."""
        return self._kernel.is_busy or bool(self._kernel.holding_goals)

    @property
    def _must_stop_first(self) -> bool:
        """Whether the robot must be stopped before the end. Unrecorded inputs may begin something."""
        return self._is_robot_busy or bool(self._queue) or self.paused

    def _end_if_idle(self) -> None:
        waits = self._stepping or self._queue or self._is_robot_busy or self.paused
        if self._end_reason is not None and not self._last_record_made and not waits:
            self._record_end()

    def _record_end(self) -> None:
        self._reject_waiting()
        self._step(self._with_time(SessionEnded(reason=self._end_reason or "")), _ignore_reply)
        self._last_record_made = True
        self.open_goals = self._kernel.core.open_goals
        self._commands.release()
        if not self._unrecorded_steps:
            self._close()

    def _fail(self, error: Exception) -> None:
        """Stop the robot after an error of the kernel, and log it."""
        _LOG.error("the engine failed", exc_info=error)
        self.failure = error
        self.abandon()

    def _close(self) -> None:
        self.ended = True
        for step in self._unrecorded_steps:
            step.on_reply(Reply(False, "the session has ended"))
        self._unrecorded_steps.clear()
        self._reject_waiting()
        callbacks, self._end_callbacks = self._end_callbacks, []
        for callback in callbacks:
            callback()

    def _reject_waiting(self) -> None:
        while self._queue:
            self._queue.popleft()[1](Reply(False, "the session has ended"))


def _reply_for(input: AnyInput, records: list[AnyRecord]) -> Reply:
    if not isinstance(input, Submit):
        return Reply(True)
    task = next(record for record in records if isinstance(record, TaskRecord))
    return Reply(task.status != "REJECTED", task.reason, task.id)


def requests_stop(input: AnyInput) -> bool:
    """Whether an input stops everything. Such an input never waits."""
    if isinstance(input, EstopReport):
        return input.pressed
    return isinstance(input, Submit) and input.function == "stopAll"


def _stop_in_force(recovered: RecoveredSession | None) -> UnrecordedStop | None:
    """Return the stop in force when a session is recovered."""
    if recovered is None or not recovered.view.stop.latched:
        return None
    stop = recovered.view.stop
    answered = stop.status == "latched"
    return UnrecordedStop(stop.source, answered, stop.confirmed, stop.unconfirmed, stop.unstoppable)


def _stop_after(stop: UnrecordedStop | None, news: AnyInput | AnyRecord) -> UnrecordedStop | None:
    """Return the stop in force after an input or a record."""
    match news:
        case Submit() | EstopReport() if requests_stop(news):
            return UnrecordedStop(news.source)
        case StopRecord(status="requested"):
            return UnrecordedStop(news.source)
        case StopRecord(status="released"):
            return None
        case StopReport() | StopRecord(status="latched") if stop is not None:
            return UnrecordedStop(stop.source, True, news.confirmed, news.unconfirmed, news.unstoppable)
    return stop


def versions() -> dict[str, str]:
    """Return the versions that made a session's records: of this program and its Python."""
    return {"rise-tui": __version__, "python": platform.python_version()}
