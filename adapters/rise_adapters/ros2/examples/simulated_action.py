"""One action server of the simulated robot: what waits, what runs, and how it ends."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from typing import Any, Literal, TypeAlias

from rise_adapters.ros2.actions.server import ActionServer, Decide
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.examples.goal_reader import GoalReader
from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.transport.port import Message, Transport
from rise_adapters.simulated.faults import ActionFault
from rise_engine.cli.transcript import parameters_text
from rise_engine.ports.robot import Clock, Timer
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.model import ActionSpec

WhenBusy: TypeAlias = Literal["wait", "reject"]
"""What becomes of a goal that comes while another one of its action runs."""
PrintLine: TypeAlias = Callable[[str], None]
FaultOf: TypeAlias = Callable[[str], ActionFault | None]

STOPPING_SECONDS = 0.05
"""Seconds until a movement has stopped."""
PROGRESS_SECONDS = 0.2
"""Between two messages of feedback."""
CANCELED, FAILED = 125, 255
"""Error codes for results that have one, as std_skills/msg/Result defines them."""


class SimulatedAction:
    """Does one goal at a time. All methods belong to the transport's loop."""

    def __init__(
        self,
        transport: Transport,
        mapping: ActionMapping,
        specs: Sequence[ActionSpec],
        clock: Clock,
        print_line: PrintLine,
        next_fault: FaultOf,
        busy: WhenBusy,
    ) -> None:
        """`specs` are the actions that come under this name, with their carriers (`with_all_carriers`); `next_fault`
        tells what goes wrong with the next goal of an action."""
        self._clock, self._print, self._next_fault, self._busy = clock, print_line, next_fault, busy
        self._reader = GoalReader(specs)
        self._results = _ResultMaker(transport, mapping.type, specs[0].carrier.get("error", {}))
        self._progress = _make_progress_feedback(transport, mapping.type)
        self._waiting: deque[_RunningGoal] = deque()
        self._running: _RunningGoal | None = None
        self._server = ActionServer(
            transport, mapping.name, mapping.type, self._take_goal, self._take_cancel, clock=clock
        )

    def close(self) -> None:
        """Abort what runs and waits, and offer the action no more."""
        self._drop_timers()
        self._server.close(self._results.make_result("the simulated robot was switched off", FAILED))

    def vanish(self) -> None:
        """Be gone, without a word about what was running."""
        self._drop_timers()
        self._server.vanish()

    def _drop_timers(self) -> None:
        if self._running is not None:  # what waits has none
            self._running.drop_timers()

    def _take_goal(self, goal: ServerGoal) -> None:
        spec, parameters = self._reader.read(goal.message)
        run = goal.data = _RunningGoal(goal, spec, parameters, self._next_fault(spec.name))
        if run.has_fault("reject") or (self._running is not None and self._busy == "reject"):
            goal.reject()
            self._print(f"{run}: rejected, {'a simulated fault' if run.has_fault('reject') else 'the robot is busy'}")
            return
        goal.accept()
        self._waiting.append(run)
        if self._running is not None:
            self._print(f"{run}: waits")
        self._start_next()

    def _start_next(self) -> None:
        if self._running is not None or not self._waiting:
            return
        run = self._running = self._waiting.popleft()
        run.goal.execute()
        run.begun, run.seconds = self._clock.now(), expected_seconds(run.spec, run.parameters)
        if run.fault is not None and run.has_fault("slow"):
            run.seconds *= run.fault.factor
        self._tell_progress(run)
        if run.has_fault("hang"):
            run.seconds = inf
        elif run.has_fault("fail"):
            run.ending = self._call_after(run.seconds / 2, partial(self._fail, run))
        else:
            run.ending = self._call_after(run.seconds, partial(self._succeed, run))
        self._print(f"{run}{': hangs, a simulated fault' if run.has_fault('hang') else ''}")

    def _succeed(self, run: _RunningGoal) -> None:
        run.goal.succeed(self._results.make_result("", 0))
        self._finish(run, f"done, {run.seconds:.1f} s")

    def _fail(self, run: _RunningGoal) -> None:
        run.goal.abort(self._results.make_result("it went wrong on the robot (simulated fault)", FAILED))
        self._finish(run, "failed, a simulated fault")

    def _stop(self, run: _RunningGoal) -> None:
        run.goal.cancel(self._results.make_result("canceled", CANCELED))
        self._finish(run, "stopped")

    def _finish(self, run: _RunningGoal, how: str) -> None:
        run.drop_timers()
        self._print(f"{run}: {how}")
        if run is self._running:
            self._running = None
        else:
            self._waiting.remove(run)
        self._start_next()

    def _take_cancel(self, goal: ServerGoal, decide: Decide) -> None:
        run = goal.data
        assert isinstance(run, _RunningGoal)
        if run.seconds == inf:
            return  # it hangs, and says nothing to that either
        decide(True)
        run.drop_timers()
        if run is self._running:
            run.ending = self._call_after(STOPPING_SECONDS, partial(self._stop, run))
        else:
            self._stop(run)

    def _tell_progress(self, run: _RunningGoal) -> None:
        if self._progress is None:
            return
        done = (self._clock.now() - run.begun) / run.seconds if run.seconds else 1.0
        run.goal.publish_feedback(self._progress(min(done, 1.0)))
        run.progress = self._call_after(PROGRESS_SECONDS, partial(self._tell_progress, run))

    def _call_after(self, seconds: float, then: Callable[[], None]) -> Timer:
        return self._clock.call_at(self._clock.now() + seconds, then)


def describe_action(spec: ActionSpec, parameters: dict[str, Any]) -> str:
    """`Speech "Hello!"`"""
    return f"{spec.name} {parameters_text(parameters)}".rstrip()


class _RunningGoal:
    """A goal on its way."""

    def __init__(
        self, goal: ServerGoal, spec: ActionSpec, parameters: dict[str, Any], fault: ActionFault | None
    ) -> None:
        self.goal, self.spec, self.parameters, self.fault = goal, spec, parameters, fault
        self.begun = 0.0
        self.seconds = 0.0
        """How long it takes; inf: it hangs."""
        self.ending: Timer | None = None
        self.progress: Timer | None = None

    def has_fault(self, kind: str) -> bool:
        return self.fault is not None and self.fault.kind == kind

    def drop_timers(self) -> None:
        for timer in (self.ending, self.progress):
            if timer is not None:
                timer.cancel()

    def __str__(self) -> str:
        return describe_action(self.spec, self.parameters)


class _ResultMaker:
    """The results of an action, whatever fields they have: a reason, an error code with its text."""

    def __init__(self, transport: Transport, type: str, error: Mapping[str, Any]) -> None:
        """`error`: where a result says that it is none, as in a profile's carrier."""
        fields = transport.fields(f"{type}_Result")
        self._ok = error.get("ok", 0)
        self._paths = {
            key: error[key].split(".")
            for key in ("code", "text")
            if isinstance(error.get(key), str) and error[key].partition(".")[0] in fields
        }
        if fields.get("reason") == "string":
            self._paths.setdefault("text", ["reason"])

    def make_result(self, reason: str, code: int) -> Message:
        values: dict[str, Any] = {"text": reason, "code": code}
        if not code:
            values["code"] = self._ok
        elif isinstance(self._ok, bool):
            values["code"] = not self._ok
        result: Message = {}
        for key, path in self._paths.items():
            inside = result
            for name in path[:-1]:
                inside = inside.setdefault(name, {})
            inside[path[-1]] = values[key]
        return result


def _make_progress_feedback(transport: Transport, type: str) -> Callable[[float], Message] | None:
    """How this action's feedback tells what part is done, from 0 to 1; None: it has no field for that."""
    fields = transport.fields(f"{type}_Feedback")
    if fields.get("progress") in ("float32", "float64"):
        return lambda done: {"progress": done}
    if fields.get("feedback") == "std_skills/msg/Feedback":
        return lambda done: {"feedback": {"data_float": done}}
    return None
