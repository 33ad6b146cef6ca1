"""Runs CRAs: the action graph of one act, from its first action to its single end (semantics.md 2)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import Struct, field

from rise_engine.kernel.commands import CancelAction, StartAction
from rise_engine.kernel.core import Core, Task, TimerTarget, parse_task_id
from rise_engine.kernel.records import ActionRecord, ActionStatus, TaskStatus
from rise_engine.kernel.speech import act_name, find_act
from rise_engine.scenario.durations import expected_seconds, limit_seconds
from rise_engine.scenario.model import Act, Action, ActionCall
from rise_engine.scenario.parameters import fill_parameters
from rise_engine.scenario.speech.template import MissingValueError

SPEECH_CHANNEL = "speech"
CANCEL_LIMIT = 5.0
"""Seconds for the robot to confirm a cancel. After that the action counts as lost."""


class ActionRun(Struct):
    """One action of a running act."""

    index: int
    """Its index in the act's file order."""
    state: str = "waiting"
    """waiting, running, canceling or ended."""
    type: str = ""
    parameters: dict[str, Any] = {}
    sent_as: str | None = None
    accepted: bool = False
    """Whether the robot has accepted it."""
    timer: int | None = None
    """The timer of the wait, of the time limit, or of the cancel."""


class ActRun(Struct):
    """A running CRA."""

    task: Task
    actions: dict[str, ActionRun]
    cancel_reason: str | None = None
    """Why it is being stopped; None: it is not."""
    failure: str | None = None
    """Why it failed; None: it has not. After a failure its running actions are cancelled."""
    interfered: bool = False
    """Whether the robot itself, or another program, ended one of its actions."""
    starting: bool = False
    ready: list[str] = field(default_factory=list)
    """Actions that can start now."""


class ActRunner:
    """Runs all acts."""

    def __init__(self, core: Core, on_ended: Callable[[ActRun, TaskStatus, str], None]) -> None:
        self._core = core
        self._on_ended = on_ended
        """Called once when an act's last action has ended, with the act, its task's final status and the reason."""
        self.last_pick: dict[str, int] = {}
        """The last picked variant, by `<act>/<actionID>`."""
        self.robot_lost: str | None = None
        """Why goals cannot be sent; None: the robot is connected."""
        self.earlier_goals: frozenset[str] = frozenset()
        """The goals of an earlier engine while they are given up. None is cancelled: a person decides about them."""
        self.runs: dict[int, ActRun] = {}
        """By task id, oldest first."""

    @property
    def is_speaking(self) -> bool:
        """Whether the robot is executing an action that uses its voice."""
        specs = self._core.scenario.robot.actions
        under_way = (
            specs[action.sent_as or action.type]
            for run in self.runs.values()
            for action in run.actions.values()
            if action.state in ("running", "canceling")
        )
        return any(SPEECH_CHANNEL in spec.channels for spec in under_way)

    def running_goals(self) -> list[StartAction]:
        """The goals that were sent to the robot and have not ended."""
        specs = self._core.scenario.robot.actions
        return [
            StartAction(
                f"{run.task.id}/{id}", state.sent_as or state.type, state.parameters, 0.0, accepted=state.accepted
            )
            for run in self.runs.values()
            for id, state in run.actions.items()
            if state.state in ("running", "canceling") and not specs[state.type].engine
        ]

    # --- start ---

    def start(self, task: Task) -> None:
        """Run the act of a task that has just become ACTIVE."""
        act = find_act(self._core.scenario, task)
        run = ActRun(
            task,
            {action.id: ActionRun(index) for index, action in enumerate(act.actions)},
            ready=[action.id for action in act.actions if not action.wait_for],
        )
        self.runs[task.id] = run
        self._advance(run)

    def _advance(self, run: ActRun) -> None:
        """Start all ready actions in file order (one that ends immediately makes others ready), then check for the
        end."""
        if run.starting:
            return
        run.starting = True
        while run.ready and run.cancel_reason is None and run.failure is None and not self._core.waits_for_wizard:
            self._start_action(run, run.ready.pop(0))
        run.starting = False
        if all(action.state == "ended" for action in run.actions.values()):
            self._finish(run)

    def go_on(self) -> None:
        """Start the actions that waited for a wizard."""
        for run in list(self.runs.values()):
            self._advance(run)

    def _start_action(self, run: ActRun, id: str) -> None:
        core = self._core
        state = run.actions[id]
        action = self._act_of(run).actions[state.index]
        call = self._pick_variant(run, action)
        state.type = call.type
        spec = core.scenario.robot.actions[call.type]
        try:
            state.parameters = fill_parameters(call, spec, core.memory)
        except (MissingValueError, ValueError) as problem:
            state.parameters = {name: template.text for name, template in call.parameters.items()}
            self._end_action(run, id, "failed", str(problem))
            return
        if spec.engine:
            seconds = float(state.parameters.get("duration", 0)) / 1000
            state.state = "running"
            self._record(run, id, "started")
            if seconds > 0:
                state.timer = core.set_timer(seconds, TimerTarget("wait", str(run.task.id), id))
            else:
                self._end_action(run, id, "succeeded")
            return
        if self.robot_lost is not None:
            self._end_action(run, id, "failed", f"the robot is not connected: {self.robot_lost}")
            return
        if not spec.supported and spec.substitute is None:
            self._end_action(run, id, "failed", f"{core.scenario.robot.name} cannot do {call.type}")
            return
        parameters = state.parameters
        if spec.substitute is not None:
            state.sent_as = spec.substitute
            spec = core.scenario.robot.actions[spec.substitute]
            # The substitute may lack some parameters (a gaze has no hand).
            parameters = {name: value for name, value in parameters.items() if name in spec.parameters}
        state.state = "running"
        self._record(run, id, "started")
        core.commands.append(
            StartAction(f"{run.task.id}/{id}", spec.name, parameters, expected_seconds(spec, parameters))
        )
        state.timer = core.set_timer(limit_seconds(spec, parameters), TimerTarget("limit", str(run.task.id), id))

    def _pick_variant(self, run: ActRun, action: Action) -> ActionCall:
        """Return the action's call: of several variants a random one, but never the last one again."""
        calls = action.calls
        if len(calls) == 1:
            return calls[0]
        name = f"{run.task.behavior}/{action.id}"
        last = self.last_pick.get(name)
        if last is None or last >= len(calls):
            pick = self._core.rng.integer_below(len(calls))
        else:
            pick = self._core.rng.integer_below(len(calls) - 1)
            pick += pick >= last
        self.last_pick[name] = pick
        return calls[pick]

    # --- reports of the robot and the clock ---

    def report(self, goal: str, status: ActionStatus, reason: str, *, aborted: bool = False) -> None:
        """Handle the robot's report about a goal; late and unknown ones are ignored. `aborted`: see `ActionReport`."""
        task, _, id = goal.partition("/")
        run = self.runs.get(parse_task_id(task))
        state = run.actions.get(id) if run is not None else None
        if run is None or state is None or state.state not in ("running", "canceling"):
            return
        if self._core.scenario.robot.actions[state.type].engine:
            return  # the robot never receives a wait
        if status in ("accepted", "succeeded") and run.task.voice_at is None:
            self._note_confirmation(run.task, state)
        if status == "accepted":
            state.accepted = True
            self._record(run, id, "accepted")
        else:
            run.interfered |= aborted or (status == "canceled" and state.state == "running")
            self._end_action(run, id, status, reason)
            self._advance(run)

    def _note_confirmation(self, task: Task, state: ActionRun) -> None:
        """Note that the robot has begun an action: perhaps the act's first one, or its first audible one."""
        if task.robot_at is None:
            task.robot_at = self._core.t
        if SPEECH_CHANNEL in self._core.scenario.robot.actions[state.sent_as or state.type].channels:
            task.voice_at = self._core.t

    def timer_elapsed(self, target: TimerTarget) -> None:
        """Handle the end of a wait, or the time limit of an action or its cancel."""
        run = self.runs[int(target.owner)]
        run.actions[target.item].timer = None
        if target.purpose == "wait":
            self._end_action(run, target.item, "succeeded")
        elif target.purpose == "limit":
            self._core.commands.append(CancelAction(f"{target.owner}/{target.item}"))
            self._end_action(run, target.item, "timed-out", "the robot reported no ending in time")
        else:
            self._end_action(
                run, target.item, "lost", f"the robot did not confirm the cancel within {CANCEL_LIMIT:g} s"
            )
        self._advance(run)

    def lose_robot(self, reason: str) -> None:
        """Handle a lost link: the state of the robot's actions is unknown, and goals cannot be sent."""
        self.robot_lost = reason
        self.lose_running(reason)

    def lose_running(self, reason: str) -> None:
        """End the actions on the robot as lost. Tasks that wait for these acts continue.

        Each action is cancelled, because it may not have been sent yet.
        """
        for run in list(self.runs.values()):
            for id, state in run.actions.items():
                if state.state in ("running", "canceling") and not self._core.scenario.robot.actions[state.type].engine:
                    goal = f"{run.task.id}/{id}"
                    if state.state == "running" and goal not in self.earlier_goals:
                        self._core.commands.append(CancelAction(goal))
                    self._end_action(run, id, "lost", reason)
            self._advance(run)

    def lose_earlier_goals(self) -> None:
        """End the goals of an earlier engine as lost, without cancelling them."""
        self.earlier_goals = frozenset(goal.action for goal in self.running_goals())
        self.lose_running("the engine was restarted while it ran")
        self.earlier_goals = frozenset()

    # --- cancel and end ---

    def cancel(self, run: ActRun, reason: str) -> None:
        """Stop an act: cancel its running actions and skip the others. It ends when the robot has confirmed."""
        if run.cancel_reason is not None:
            return
        run.cancel_reason = reason
        self._wind_down(run, reason)
        self._advance(run)

    def _wind_down(self, run: ActRun, reason: str) -> None:
        core = self._core
        for id, state in run.actions.items():
            if state.state == "waiting":
                action = self._act_of(run).actions[state.index]
                state.type = action.calls[0].type
                state.parameters = {name: template.text for name, template in action.calls[0].parameters.items()}
                self._end_action(run, id, "skipped", reason)
            elif state.state == "running":
                if core.scenario.robot.actions[state.type].engine:
                    self._end_action(run, id, "canceled", reason)
                elif (goal := f"{run.task.id}/{id}") not in self.earlier_goals:
                    self._cancel_timer(state)
                    state.state = "canceling"
                    core.commands.append(CancelAction(goal))
                    state.timer = core.set_timer(CANCEL_LIMIT, TimerTarget("cancel", str(run.task.id), id))

    def _end_action(self, run: ActRun, id: str, status: ActionStatus, reason: str = "") -> None:
        state = run.actions[id]
        self._cancel_timer(state)
        state.state = "ended"
        self._record(run, id, status, reason)
        if run.cancel_reason is not None or run.failure is not None:
            return
        act = self._act_of(run)
        if status == "succeeded" or act.actions[state.index].continue_on_failure:
            for successor in act.successors.get(id, ()):
                if all(run.actions[each].state == "ended" for each in successor.wait_for):
                    run.ready.append(successor.id)
        else:
            run.failure = f"action {id} ({state.type}) {status}" + (f": {reason}" if reason else "")
            self._wind_down(run, f"action {id} {status}")

    def _finish(self, run: ActRun) -> None:
        if self.runs.pop(run.task.id, None) is None:
            return
        if run.cancel_reason is not None:
            self._on_ended(run, "CANCELED", run.cancel_reason)
        elif run.failure is not None:
            self._on_ended(run, "ABORTED", run.failure)
        else:
            self._on_ended(run, "SUCCEEDED", "")

    # --- helpers ---

    def _act_of(self, run: ActRun) -> Act:
        return find_act(self._core.scenario, run.task)

    def _cancel_timer(self, state: ActionRun) -> None:
        if state.timer is not None:
            self._core.cancel_timer(state.timer)
            state.timer = None

    def _record(self, run: ActRun, id: str, status: ActionStatus, reason: str = "") -> None:
        state = run.actions[id]
        self._core.emit(
            ActionRecord,
            run.task.id,
            act_name(run.task),
            id,
            state.type,
            state.parameters,
            status,
            reason,
            state.sent_as,
        )
