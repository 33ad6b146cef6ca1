"""One action server or service of the simulated robot: waiting goals, the running goal, and its ending."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from math import inf
from typing import Any, Literal, TypeAlias

from rise_adapters.ros2.actions.server import ActionServer, Decide
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.transport.port import Closable, Message, SendReply, Transport
from rise_adapters.simulated.faults import ActionFault, FaultKind

from rise_engine.kernel.record_words import parameters_text
from rise_engine.ports.robot import Clock, Timer
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.model import ActionSpec
from rise_ros.examples.goal_reader import GoalReader, Places
from rise_ros.examples.robot_log import RobotLog
from rise_ros.examples.service_call import ServiceCall
from rise_ros.examples.simulated_messages import CANCELED, FAILED, ResultMaker, make_feedback

WhenBusy: TypeAlias = Literal["wait", "reject"]
"""The treatment of a goal that arrives while another one of its action runs."""
PrintLine: TypeAlias = Callable[[str], None]
FaultOf: TypeAlias = Callable[[str], ActionFault | None]

Die: TypeAlias = Callable[[float | None], None]

STOPPING_SECONDS = 0.05
"""Seconds until a movement has stopped."""
PROGRESS_SECONDS = 0.2
"""Seconds between two messages of feedback, unless the profile expects them sooner."""


class SimulatedAction:
    """Carries out one goal at a time. All methods belong to the transport's loop."""

    def __init__(
        self,
        transport: Transport,
        mapping: ActionMapping,
        specs: Sequence[ActionSpec],
        places: Places,
        clock: Clock,
        print_line: PrintLine,
        next_fault: FaultOf,
        busy: WhenBusy,
        log: RobotLog,
        die: Die,
        is_active: Callable[[], bool],
    ) -> None:
        """`specs`: the actions under this name, with their carriers (`with_all_carriers`). `next_fault` returns the
        fault of an action's next goal. `die` makes the whole robot vanish, for some seconds or permanently."""
        self._clock, self._print, self._next_fault, self._busy = clock, print_line, next_fault, busy
        self._log, self._die, self._is_active = log, die, is_active
        self._reader = GoalReader(specs, places)
        self._results = ResultMaker(transport, mapping)
        self._progress = make_feedback(transport, mapping.type) if mapping.kind == "action" else None
        self._every = min(PROGRESS_SECONDS, mapping.deadlines.feedback / 3 or inf)
        self._waiting: deque[_RunningGoal] = deque()
        self._running: _RunningGoal | None = None
        self._goals: set[_RunningGoal] = set()
        """All goals that have not ended, including undecided ones."""
        self._server: ActionServer | None = None
        self._service: Closable | None = None
        if mapping.kind == "service":
            self._service = transport.serve(mapping.name, mapping.type, self._take_call)
            return
        self._server = ActionServer(
            transport,
            mapping.name,
            mapping.type,
            self._take_goal,
            self._take_cancel,
            clock=clock,
            feedback=mapping.feedback_qos,
            status=mapping.status_qos,
        )

    def close(self) -> None:
        """Abort running and waiting goals, and stop offering the action."""
        for run in self._drop_all("failed"):
            if isinstance(run.goal, ServiceCall):
                run.goal.abort(self._results.make_result("the simulated robot was switched off", FAILED))
        if self._server is not None:
            self._server.close(self._results.make_result("the simulated robot was switched off", FAILED))
        if self._service is not None:
            self._service.close()

    def vanish(self) -> None:
        """Disappear without reporting running goals."""
        self._drop_all("vanished")
        if self._server is not None:
            self._server.vanish()
        if self._service is not None:
            self._service.close()

    def _drop_all(self, how: str) -> set[_RunningGoal]:
        dropped, self._goals = self._goals, set()
        for run in dropped:
            run.drop_timers()
            if run.is_begun:
                self._note("ended", run, how=how)
        return dropped

    def _note(self, event: str, run: _RunningGoal, **more: object) -> None:
        self._log.note(event, run.spec.name, run.goal.id.hex(), **more)

    # --- a goal, from its arrival to its end ----------------------------------------------------------------------

    def _take_call(self, request: Message, reply: SendReply) -> None:
        self._take_goal(ServiceCall(request, reply))

    def _take_goal(self, goal: ServerGoal | ServiceCall) -> None:
        spec, parameters = self._reader.read(goal.message)
        run = goal.data = _RunningGoal(goal, spec, parameters, self._next_fault(spec.name))
        self._note("arrived", run)
        self._goals.add(run)
        if run.has_fault("die-on-goal"):
            self._die(run.amount)
        elif run.has_fault("slow-accept", "slow-reject"):
            self._print(f"{run}: thinks about it for {run.amount:g} s, a simulated fault")
            run.ending = self._call_after(run.amount or 0.0, partial(self._decide, run))
        else:
            self._decide(run)

    def _decide(self, run: _RunningGoal) -> None:
        """Accept or reject the goal."""
        is_faulty = run.has_fault("reject", "slow-reject")
        if is_faulty or not self._is_active() or (self._running is not None and self._busy == "reject"):
            why = "a simulated fault" if is_faulty else "the robot is busy" if self._is_active() else "it is inactive"
            if isinstance(run.goal, ServiceCall):
                run.goal.abort(self._results.make_result(f"refused: {why}", FAILED))
            else:
                run.goal.reject()
            self._goals.discard(run)
            self._note("rejected", run)
            self._print(f"{run}: rejected, {why}")
            return
        if run.has_fault("lost-accept") and isinstance(run.goal, ServerGoal):
            run.goal.reply = _lose
        run.goal.accept()
        self._note("accepted", run)
        if run.has_fault("late-begin"):
            self._print(f"{run}: begins in {run.amount:g} s, a simulated fault")
            run.ending = self._call_after(run.amount or 0.0, partial(self._queue, run))
        else:
            self._queue(run)

    def _queue(self, run: _RunningGoal) -> None:
        self._waiting.append(run)
        if self._running is not None:
            self._print(f"{run}: waits")
        self._start_next()

    def _start_next(self) -> None:
        if self._running is not None or not self._waiting:
            return
        run = self._running = self._waiting.popleft()
        run.goal.execute()
        run.is_begun = True
        self._note("begun", run)
        run.begun, run.seconds = self._clock.now(), expected_seconds(run.spec, run.parameters)
        if run.has_fault("slow"):
            run.seconds *= run.amount or 1.0
        self._publish_progress(run)
        if run.has_fault("hang"):
            run.seconds = inf
        elif run.has_fault("fail", "abort"):
            run.ending = self._call_after(run.seconds / 2, partial(self._fail, run))
        else:
            run.ending = self._call_after(run.seconds, partial(self._succeed, run))
        self._print(f"{run}{': hangs, a simulated fault' if run.has_fault('hang') else ''}")

    def _succeed(self, run: _RunningGoal) -> None:
        run.goal.succeed(self._results.make_result("", 0))
        self._finish(run, "succeeded", f"done, {run.seconds:.1f} s")

    def _fail(self, run: _RunningGoal) -> None:
        run.goal.abort(self._results.make_result("it went wrong on the robot (simulated fault)", FAILED))
        self._finish(run, "failed", "failed, a simulated fault")

    def _stop(self, run: _RunningGoal) -> None:
        run.goal.cancel(self._results.make_result("canceled", CANCELED))
        self._finish(run, "canceled", "stopped")

    def _finish(self, run: _RunningGoal, how: str, words: str) -> None:
        run.drop_timers()
        self._goals.discard(run)
        self._note("ended", run, how=how)
        self._print(f"{run}: {words}")
        if run is self._running:
            self._running = None
        elif run in self._waiting:
            self._waiting.remove(run)
        self._start_next()

    def _take_cancel(self, goal: ServerGoal, decide: Decide) -> None:
        run = goal.data
        assert isinstance(run, _RunningGoal)
        self._note("cancel-asked", run)
        if run.has_fault("die-on-cancel"):
            self._die(run.amount)
        elif run.seconds == inf or run.has_fault("ignore-cancel"):
            return  # a hanging goal does not answer this either
        elif run.has_fault("refuse-cancel"):
            decide(False)
            self._print(f"{run}: does not let itself be stopped, a simulated fault")
        else:
            decide(True)
            run.drop_timers()
            seconds = run.amount if run.has_fault("slow-cancel") else STOPPING_SECONDS
            if run is self._running:
                run.ending = self._call_after(seconds or 0.0, partial(self._stop, run))
            else:
                self._stop(run)

    def _publish_progress(self, run: _RunningGoal) -> None:
        if self._progress is None:
            return
        done = (self._clock.now() - run.begun) / run.seconds if run.seconds else 1.0
        run.goal.publish_feedback(self._progress(min(done, 1.0)))
        run.progress = self._call_after(self._every, partial(self._publish_progress, run))

    def _call_after(self, seconds: float, then: Callable[[], None]) -> Timer:
        return self._clock.call_at(self._clock.now() + seconds, then)


def describe_action(spec: ActionSpec, parameters: dict[str, Any]) -> str:
    """`Speech "Hello!"`"""
    duration = spec.parameters.get("duration")
    in_ms = duration is not None and duration.unit != "s"
    return f"{spec.name} {parameters_text(parameters, in_ms=in_ms)}".rstrip()


class _RunningGoal:
    """A goal in progress."""

    def __init__(
        self, goal: ServerGoal | ServiceCall, spec: ActionSpec, parameters: dict[str, Any], fault: ActionFault | None
    ) -> None:
        self.goal, self.spec, self.parameters, self.fault = goal, spec, parameters, fault
        self.is_begun = False
        self.begun = 0.0
        self.seconds = 0.0
        """Its duration; inf: it hangs."""
        self.ending: Timer | None = None
        self.progress: Timer | None = None

    def has_fault(self, *kinds: FaultKind) -> bool:
        return self.fault is not None and self.fault.kind in kinds

    @property
    def amount(self) -> float | None:
        """The number in its fault."""
        return self.fault.amount if self.fault is not None else None

    def drop_timers(self) -> None:
        for timer in (self.ending, self.progress):
            if timer is not None:
                timer.cancel()

    def __str__(self) -> str:
        return describe_action(self.spec, self.parameters)


def _lose(message: Message) -> None:
    """Lose the answer: it never arrives."""
