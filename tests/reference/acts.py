"""Acts (semantics.md 2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import msgspec

from rise_engine.kernel.inputs import ActionReport, RobotChanged
from rise_engine.scenario.model import Act, Action, ActionCall, ActionSpec

from .parameters import Unfit, expected_seconds, filled, limit_seconds
from .session import Clock, Session
from .tasks import Task

CONFIRM = 5.0
"""Seconds that a robot has to confirm that it stopped."""
OUTCOMES = {"SUCCEEDED": "succeeded", "ABORTED": "failed", "CANCELED": "stopped"}


@dataclass(eq=False)
class Doing:
    """An action of an act that has begun."""

    action: Action
    type: str
    parameters: dict[str, Any]
    sent_as: str | None = None
    engine: bool = False
    clock: Clock | None = None


@dataclass(eq=False)
class Run:
    """An act that runs."""

    task: Task
    act: Act
    doing: dict[str, Doing] = field(default_factory=dict)
    """By actionID, what goes on."""
    ended: list[str] = field(default_factory=list)
    """The actionIDs of what has ended."""
    to_begin: list[Action] = field(default_factory=list)
    status: str = "SUCCEEDED"
    why: str = ""
    """Why it comes to an end before its time."""
    cancelled: list[str] = field(default_factory=list)
    """The actionIDs of what the robot was asked to cancel."""
    ours: bool = True
    """Whether nobody else, and not the robot by itself, has ended an action of it."""


class Acts:
    """Carries acts out."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.connected = True
        self.of_another_engine: list[Doing] = []
        """While it is given up: what an engine that has gone was doing."""
        self.open: list[dict[str, Any]] = []
        """What the robot may still be doing (9.3)."""
        self.last_variant: dict[tuple[str, str], int] = {}

    def begin(self, run: Run) -> None:
        """Begin with what waits for nothing."""
        run.to_begin = [action for action in run.act.actions if not action.wait_for]
        self.go_on(run)

    def report(self, input: ActionReport) -> None:
        """What the robot says about an action."""
        for run in list(self.session.scheduler.running):
            for doing in list(run.doing.values()):
                if not doing.engine and input.action == f"{run.task.id}/{doing.action.id}":
                    if input.status == "succeeded":
                        self._confirmed(run, doing)
                    if input.status != "accepted":
                        wanted = doing.action.id in run.cancelled
                        if input.aborted or (input.status == "canceled" and not wanted):
                            run.ours = False
                        self._end(run, doing, input.status, input.reason)
                        self.go_on(run)
                    else:
                        self._confirmed(run, doing)
                        self._record(run, doing, "accepted")
        self.session.scheduler.arrange()

    def _confirmed(self, run: Run, doing: Doing) -> None:
        if run.task.robot_at is None:
            run.task.robot_at = self.session.now
        does = self.session.scenario.robot.actions[doing.sent_as or doing.type]
        if "speech" in does.channels and run.task.voice_at is None:
            run.task.voice_at = self.session.now

    def robot_changed(self, input: RobotChanged) -> None:
        """The link to the robot."""
        self.open = [msgspec.to_builtins(goal) for goal in input.open]
        self.session.put("robot", status=input.status, detail=input.detail, open=self.open)
        was_connected, self.connected = self.connected, input.status != "lost"
        if not self.connected:
            self.lose(input.detail or "the robot is lost")
        elif not was_connected:
            self.session.failures.robot_is_back()

    def lose(self, why: str) -> None:
        """What the robot does is lost."""
        for run in list(self.session.scheduler.running):
            for action in run.act.actions:
                doing = run.doing.get(action.id)
                if doing is not None and not doing.engine:
                    if doing.action.id not in run.cancelled and doing not in self.of_another_engine:
                        self.session.order("cancel", f"{run.task.id}/{doing.action.id}")
                    self._end(run, doing, "lost", why)
            self.go_on(run)
        self.session.scheduler.arrange()

    def give_up(self) -> None:
        """What an engine that has gone was doing is lost; nothing of it is cancelled (0.3)."""
        going_on = [doing for run in self.session.scheduler.running for doing in run.doing.values()]
        self.of_another_engine = going_on
        self.lose("its engine has gone")
        self.of_another_engine = []

    def stop(self, run: Run, why: str) -> None:
        """Somebody stops an act."""
        run.status = "CANCELED"
        if run.why == "":
            self._break_off(run, why)
            self.go_on(run)

    # --- one action ---

    def go_on(self, run: Run) -> None:
        """Begin what may begin; at last the act ends."""
        while run.to_begin and run.why == "" and not self.session.scheduler.waits_for_wizard:
            self._begin_action(run, run.to_begin.pop(0))
        if run in self.session.scheduler.running and not run.doing and len(run.ended) == len(run.act.actions):
            self.session.scheduler.running.remove(run)
            self.tell_end(run.task, run.act, run.status, run.why, run.ours)
            self.session.scheduler.arrange()

    def _begin_action(self, run: Run, action: Action) -> None:
        session = self.session
        call = action.calls[0]
        if len(action.calls) > 1:
            call = action.calls[self._pick(run.act.name, action)]
        robot = session.scenario.robot
        spec = robot.actions[call.type]
        doing = Doing(action, call.type, as_written(call), None, spec.engine)
        run.doing[action.id] = doing
        try:
            doing.parameters = filled(call, spec, session.memory.readable)
            if not spec.engine and not self.connected:
                raise Unfit("the robot is not connected")
        except Unfit as why:
            self._end(run, doing, "failed", str(why))
            return
        doing.sent_as = None if spec.engine else spec.substitute
        self._record(run, doing, "started")
        if spec.engine:
            seconds = expected_seconds(spec, doing.parameters)
            if seconds == 0:
                self._end(run, doing, "succeeded")
            else:
                doing.clock = session.after(seconds, lambda: self._time_is_over(run, doing, "succeeded"), run.task.id)
            return
        self._send(run, doing, spec)

    def _send(self, run: Run, doing: Doing, spec: ActionSpec) -> None:
        parameters = doing.parameters
        if doing.sent_as is not None:
            spec = self.session.scenario.robot.actions[doing.sent_as]
            parameters = {name: value for name, value in parameters.items() if name in spec.parameters}
        expected = expected_seconds(spec, parameters)
        self.session.order("start", f"{run.task.id}/{doing.action.id}", spec.name, parameters, expected)
        limit = limit_seconds(spec, parameters)
        doing.clock = self.session.after(limit, lambda: self._time_is_over(run, doing, "timed-out"), run.task.id)

    def _pick(self, act: str, action: Action) -> int:
        """Which variant: never the same one twice running."""
        last = self.last_variant.get((act, action.id))
        if last is None:
            pick = self.session.chance.one_of(len(action.calls))
        else:
            pick = self.session.chance.one_of(len(action.calls) - 1)
            if pick >= last:
                pick += 1
        self.last_variant[act, action.id] = pick
        return pick

    def _time_is_over(self, run: Run, doing: Doing, status: str) -> None:
        if status == "timed-out":
            self.session.order("cancel", f"{run.task.id}/{doing.action.id}")
        reason = "" if status == "succeeded" else "it took too long"
        self._end(run, doing, status, reason)
        self.go_on(run)
        self.session.scheduler.arrange()

    def _end(self, run: Run, doing: Doing, status: str, reason: str = "") -> None:
        """An action has ended."""
        self.session.forget(doing.clock)
        del run.doing[doing.action.id]
        run.ended.append(doing.action.id)
        self._record(run, doing, status, reason)
        if run.why:
            return
        if status != "succeeded" and not doing.action.continue_on_failure:
            run.status = "ABORTED"
            self._break_off(run, f"action {doing.action.id} {status}")
            return
        for action in run.act.actions:
            if doing.action.id in action.wait_for and set(action.wait_for) <= set(run.ended):
                run.to_begin.append(action)

    def _break_off(self, run: Run, why: str) -> None:
        """Cancel what runs, skip what has not begun."""
        run.why = why
        for action in run.act.actions:
            doing = run.doing.get(action.id)
            if doing is None:
                if action.id not in run.ended:
                    run.ended.append(action.id)
                    self._record(run, self._never_begun(action), "skipped", why)
            elif doing.engine:
                self._end(run, doing, "canceled", why)
            elif doing not in self.of_another_engine:
                run.cancelled.append(doing.action.id)
                self.session.forget(doing.clock)
                self.session.order("cancel", f"{run.task.id}/{doing.action.id}")
                doing.clock = self.session.after(
                    CONFIRM, lambda doing=doing: self._time_is_over(run, doing, "lost"), run.task.id
                )
        run.to_begin = []

    def _never_begun(self, action: Action) -> Doing:
        """What never begins is recorded as it is written."""
        call = action.calls[0]
        return Doing(action, call.type, as_written(call))

    def _record(self, run: Run, doing: Doing, status: str, reason: str = "") -> None:
        self.session.put(
            "action",
            task=run.task.id,
            act=run.act.name,
            action=doing.action.id,
            type=doing.type,
            parameters=doing.parameters,
            status=status,
            reason=reason,
            sent_as=doing.sent_as,
        )

    # --- the end ---

    def tell_end(self, task: Task, act: Act, status: str, why: str, ours: bool = True) -> None:
        """An act has ended, or was taken out of the line."""
        session = self.session
        session.tasks.record(task, status, why)
        session.put(
            "timing",
            task=task.id,
            act=act.name,
            status=status,
            cue_at=task.cue_at,
            key_at=task.key_at,
            accepted_at=task.accepted_at,
            started_at=task.started_at,
            robot_at=task.robot_at,
            ended_at=session.now,
            source=task.source,
            filler=task.bridged,
            voice_at=task.voice_at,
        )
        session.marks.act_ends(task, status)
        if session.failures.ended(task, act.name, status, why, ours):
            session.rules.act_ended(task, act.name, OUTCOMES[status])


def as_written(call: ActionCall) -> dict[str, Any]:
    """The parameters with their braces."""
    return {name: template.text for name, template in call.parameters.items()}
