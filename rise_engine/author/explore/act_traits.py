"""Acts as single units, with only their duration and what rules and the scheduler can observe.

Rules learn only that an act has ended, and how. The scheduler uses only the channels of the whole act. So exploring
does not follow an act's actions: the act runs until it succeeds, fails, or is cancelled. After a failure or
cancellation, the robot may have to confirm before the act ends. If the next step depends on the moment within the act,
each possibility is a decision (`Decisions`), so that exploring tries them all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, Literal, TypeAlias, cast

from msgspec import Struct

from rise_engine.author.drawing.act_graph import actions_in_order, estimate_call_seconds
from rise_engine.expression import lookup
from rise_engine.kernel.act_runner import SPEECH_CHANNEL, ActRun, ActRunner
from rise_engine.kernel.core import Core, Task, TimerTarget, parse_task_id
from rise_engine.kernel.records import ActionStatus, TaskStatus
from rise_engine.kernel.rng import Rng
from rise_engine.kernel.speech import find_act
from rise_engine.scenario.model import Act, Action, ActionCall, Scenario
from rise_engine.scenario.speech.template import MemorySlot

Beginning: TypeAlias = Literal["runs", "ends", "fails"]
"""The immediate result of an act's start. `ends`: it contains nothing that takes time."""
Pace: TypeAlias = tuple[float, float]
"""The minimum and maximum duration of a robot's action, as multiples of the expected one."""


class ActTraits(Struct, frozen=True):
    """The properties of an act that exploring uses."""

    name: str
    uses_robot: bool
    """Whether the robot takes part; False: the act only waits."""
    can_fail: bool
    """Whether a failed action would make it fail."""
    can_go_on: bool
    """Whether it continues after a failed action, with `<onFailure>continue</onFailure>`."""
    waits: bool
    """Whether it may have a moment at which it only waits and the robot does nothing for it."""
    is_parallel: bool
    """Whether the robot may still be busy with it when it fails."""
    speaks: bool
    """Whether it begins with an action that uses the robot's voice."""
    changes_voice: bool
    """Whether the robot is silent in one part of it and speaks in another."""
    least: int
    """Its minimum and maximum duration in milliseconds, if nothing fails."""
    most: int


def traits_of(scenario: Scenario, act: Act, memories: Sequence[Mapping[str, Any]], pace: Pace) -> ActTraits:
    """Compute an act's traits; `memories`, the possible memories at the beginning, decide the durations."""
    on_robot = [action for action in act.actions if not _is_wait(scenario, action)]
    speaking = [action for action in on_robot if _speaks(scenario, action)]
    initial = [action for action in act.actions if not action.wait_for]
    return ActTraits(
        act.name,
        uses_robot=bool(on_robot),
        can_fail=any(not action.continue_on_failure for action in on_robot),
        can_go_on=any(action.continue_on_failure for action in on_robot),
        waits=any(_is_wait(scenario, action) and not all(map(_takes_no_time, action.calls)) for action in act.actions),
        is_parallel=_has_parallel(act, on_robot),
        speaks=any(action in speaking for action in initial),
        changes_voice=bool(speaking) and len(act.actions) > len(speaking),
        least=int(1000 * min(_length(scenario, act, memory, pace[0], min) for memory in memories)),
        most=int(1000 * max(_length(scenario, act, memory, pace[1], max) for memory in memories)) + 1,
    )


def begin(
    scenario: Scenario, act: Act, memory: Mapping[str, Any], robot_lost: bool, choose: Callable[[int], int]
) -> tuple[Beginning, bool, bool]:
    """Determine the immediate result of an act that starts with this memory.

    :param choose: chooses one of a number of possibilities. If only some wordings can be spoken, each may be chosen.
    :return: the immediate result; whether the robot has begun an action by then; whether a later action could fail with
        this memory.
    """
    ready = [action for action in act.actions if not action.wait_for]
    ended: set[str] = set()
    started = False
    running = False
    while ready:
        action = ready.pop(0)
        failing = _failing_calls(scenario, action, memory)
        fails = failing == len(action.calls) or (failing > 0 and bool(choose(2)))
        if not fails and _is_wait(scenario, action):
            at_once = sum(map(_takes_no_time, action.calls))
            if at_once < len(action.calls) and not (at_once and choose(2)):
                running = True
                continue
        elif fails or robot_lost:
            if not action.continue_on_failure:
                return "fails", started, True
        else:
            started = running = True
            continue
        ended.add(action.id)
        ready += [later for later in act.successors.get(action.id, ()) if ended.issuperset(later.wait_for)]
    later = [action for action in act.actions if action.id not in ended and action.wait_for]
    doomed = any(not action.continue_on_failure and _failing_calls(scenario, action, memory) for action in later)
    return ("runs" if running else "ends"), started, doomed


def keys_without_fallback(act: Act) -> Iterable[str]:
    """Yield the memory keys whose absence makes an action fail, except parts of values (`items[i]`)."""
    for action in act.actions:
        for call in action.calls:
            yield from (slot.key for slot in _slots(call) if slot.fallback is None and slot.part is None)


def keys_read(act: Act) -> Iterable[str]:
    """Yield the memory keys that an act's texts and numbers use."""
    for action in act.actions:
        for call in action.calls:
            for slot in _slots(call):
                yield from slot.part.keys if slot.part is not None else (slot.key,)


def _slots(call: ActionCall) -> Iterable[MemorySlot]:
    for template in call.parameters.values():
        yield from (part for part in template.parts if isinstance(part, MemorySlot))


def _failing_calls(scenario: Scenario, action: Action, memory: Mapping[str, Any]) -> int:
    """Count the wordings of an action that the robot cannot perform, or that need a missing value."""
    failing = 0
    for call in action.calls:
        spec = scenario.robot.actions[call.type]
        needed = (slot.key for slot in _slots(call) if slot.fallback is None and slot.part is None)
        unable = not spec.engine and not spec.supported and spec.substitute is None
        failing += unable or any(lookup(memory, key)[1] is None for key in needed)
    return failing


def _is_wait(scenario: Scenario, action: Action) -> bool:
    return all(scenario.robot.actions[call.type].engine for call in action.calls)


def _takes_no_time(call: ActionCall) -> bool:
    """Return whether a wait ends immediately."""
    duration = call.parameters.get("duration")
    return duration is not None and duration.text.strip() in ("0", "0.0")


def _speaks(scenario: Scenario, action: Action) -> bool:
    specs = (scenario.robot.actions[call.type] for call in action.calls)
    sent = (scenario.robot.actions[spec.substitute] if spec.substitute is not None else spec for spec in specs)
    return any(SPEECH_CHANNEL in spec.channels for spec in sent)


def _has_parallel(act: Act, on_robot: Sequence[Action]) -> bool:
    """Return whether an action can fail, and the act with it, while another independent one is running."""
    before: dict[str, set[str]] = {}
    for action in actions_in_order(act):
        before[action.id] = {id for each in action.wait_for for id in (each, *before.get(each, ()))}
    return any(
        one.id not in before[other.id]
        and other.id not in before[one.id]
        and not (one.continue_on_failure and other.continue_on_failure)
        for one, other in combinations(on_robot, 2)
    )


def _length(scenario: Scenario, act: Act, memory: Mapping[str, Any], pace: float, among: Any) -> float:
    """Compute the seconds of the longest path through an act, with the shortest or the longest of several wordings."""
    ends: dict[str, float] = {}
    for action in actions_in_order(act):
        start = max((ends.get(before, 0.0) for before in action.wait_for), default=0.0)
        seconds = among(estimate_call_seconds(scenario, call, memory) or 0.0 for call in action.calls)
        ends[action.id] = start + seconds * (1.0 if _is_wait(scenario, action) else pace)
    return max(ends.values(), default=0.0)


# --- chance -----------------------------------------------------------------------------------------------------------

FRACTIONS = tuple(index / 12 for index in range(12))
"""Representatives of the numbers in [0, 1): twelve values, so that parts down to a twelfth all occur."""
MAX_SCRIPTS = 64
"""Maximum number of outcomes of one input that are tried; random choices with more are incomplete."""


class Decisions(Rng):
    """Makes random decisions from a script, and provides the next script."""

    def __init__(self) -> None:
        super().__init__(0)
        self.made: list[tuple[int, int]] = []
        """Since `begin`: each decision, and its number of possibilities."""
        self._script: list[int] = []

    def begin(self, script: list[int]) -> None:
        """Decide from now on according to the script, and by 0 after its end."""
        self._script = script
        self.made.clear()

    def choose(self, count: int) -> int:
        """Choose one of `count` possibilities."""
        position = len(self.made)
        choice = self._script[position] if position < len(self._script) else 0
        self.made.append((choice, count))
        return choice

    def integer_below(self, count: int) -> int:
        return self.choose(count)

    def fraction(self) -> float:
        return FRACTIONS[self.choose(len(FRACTIONS))]

    def next_script(self) -> list[int] | None:
        """Return the next script: the last decision with an untried possibility takes it; None: all were tried."""
        made = self.made
        while made:
            choice, count = made.pop()
            if choice + 1 < count:
                return [*(before for before, _ in made), choice + 1]
        return None


Phase: TypeAlias = Literal["running", "doomed", "failing", "canceling", "failing and canceling"]
"""doomed: one of its actions will fail in its turn, unless the memory gets the missing value."""
FAILED = "an action failed"


class WholeActRun(ActRun):
    """An act that runs."""

    doomed: bool = False
    speaking: bool = False

    @property
    def phase(self) -> Phase:
        if self.cancel_reason is not None:
            return "canceling" if self.failure is None else "failing and canceling"
        if self.failure is not None:
            return "failing"
        return "doomed" if self.doomed else "running"


class WholeActs(ActRunner):
    """All running acts, each as a single unit.

    The robot's report on an act is an `ActionReport` for the action `ACT` of its task: `succeeded`; `failed`, or
    `aborted` by the robot or another program; `canceled`, when a failing or cancelled act is over; `accepted`, when an
    act changes between speaking and silence.
    """

    def __init__(self, core: Core, on_ended: Callable[[ActRun, TaskStatus, str], None]) -> None:
        super().__init__(core, on_ended)
        self.traits: dict[str, ActTraits] = {}
        self.decisions = Decisions()
        """The decisions between the possibilities of a moment."""

    @property
    def is_speaking(self) -> bool:
        return any(cast(WholeActRun, run).speaking for run in self.runs.values())

    def start(self, task: Task) -> None:
        run = WholeActRun(task, {})
        self.runs[task.id] = run
        core = self._core
        act = find_act(core.scenario, task)
        traits = self.traits[act.name]
        lost = self.robot_lost is not None
        beginning, robot_began, run.doomed = begin(core.scenario, act, core.memory, lost, self.decisions.choose)
        if beginning == "fails":
            run.failure = FAILED
            if not (robot_began and self.decisions.choose(2)):
                self._finish(run)
        elif beginning == "ends":
            self._finish(run)
        else:
            run.speaking = traits.speaks

    def report(self, goal: str, status: ActionStatus, reason: str, *, aborted: bool = False) -> None:
        run = cast(WholeActRun, self.runs[parse_task_id(goal.partition("/")[0])])
        if status == "accepted":
            run.speaking = not run.speaking
        elif aborted and self.traits[run.task.behavior].can_go_on and self.decisions.choose(2):
            run.interfered = True
        elif status == "failed":
            run.failure, run.interfered = FAILED, aborted or run.interfered
            winds_down = self.robot_lost is None and self.traits[run.task.behavior].is_parallel
            if not (winds_down and self.decisions.choose(2)):
                self._finish(run)
        else:
            self._finish(run)

    def timer_elapsed(self, target: TimerTarget) -> None:
        raise AssertionError("acts that are one thing set no timers")

    def lose_running(self, reason: str) -> None:
        for each in list(self.runs.values()):
            run, traits = cast(WholeActRun, each), self.traits[each.task.behavior]
            if run.failure is not None or run.cancel_reason is not None:
                self._finish(run)
            elif traits.uses_robot and not (traits.waits and self.decisions.choose(2)):
                if traits.can_fail:
                    run.failure = reason
                self._finish(run)
            elif traits.can_fail:
                run.speaking = False

    def cancel(self, run: ActRun, reason: str) -> None:
        if run.cancel_reason is not None:
            return
        run.cancel_reason = reason
        traits = self.traits[run.task.behavior]
        if run.failure is None and (not traits.uses_robot or (traits.waits and self.decisions.choose(2))):
            self._finish(run)
