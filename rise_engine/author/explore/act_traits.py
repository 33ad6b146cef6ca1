"""What has to be known of an act so that it can be looked at as one thing: how it begins, ends and takes its time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.author.drawing.act_seconds import actions_in_order, estimate_call_seconds
from rise_engine.expression import lookup
from rise_engine.kernel.act_runner import SPEECH_CHANNEL
from rise_engine.scenario.model import Act, Action, ActionCall, Scenario
from rise_engine.scenario.template import MemorySlot

Beginning: TypeAlias = Literal["runs", "ends", "fails"]
"""What becomes of an act at once when it is started: `ends`: nothing in it takes any time."""
Pace: TypeAlias = tuple[float, float]
"""So many times what is expected is the least and the most that a robot takes for an action."""


class ActTraits(Struct, frozen=True):
    """An act, as exploring sees it."""

    name: str
    uses_robot: bool
    """Whether the robot has a part in it; false: it only waits."""
    can_fail: bool
    """Whether a failed action would make it fail."""
    can_go_on: bool
    """Whether it goes on after a failed action, with `<onFailure>continue</onFailure>`."""
    waits: bool
    """Whether there can be a moment at which it only waits, and the robot does nothing of it."""
    is_parallel: bool
    """Whether the robot can still be doing something of it when it fails."""
    speaks: bool
    """Whether it begins with something that takes the robot's voice."""
    changes_voice: bool
    """Whether the robot is silent in a part of it and speaks in another."""
    least: int
    """Milliseconds that it takes at least, and at most, when nothing fails."""
    most: int


def traits_of(scenario: Scenario, act: Act, memories: Sequence[Mapping[str, Any]], pace: Pace) -> ActTraits:
    """What is to be known of an act. `memories`: what the memory can be at the beginning, for how long things take."""
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
    """What becomes of an act that is started with this memory.

    `choose` gives one of so many possibilities: of wordings of which only some can be said, any can be taken.

    Returns what becomes of it at once; whether the robot has begun with something of it by then; and whether an action
    that comes later could fail as things stand.
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
    """The memory keys without whose value an action of an act fails. Parts of values (`items[i]`) are not followed."""
    for action in act.actions:
        for call in action.calls:
            yield from (slot.key for slot in _slots(call) if slot.fallback is None and slot.part is None)


def keys_read(act: Act) -> Iterable[str]:
    """The memory keys that an act's words and numbers are made of."""
    for action in act.actions:
        for call in action.calls:
            for slot in _slots(call):
                yield from slot.part.keys if slot.part is not None else (slot.key,)


def _slots(call: ActionCall) -> Iterable[MemorySlot]:
    for template in call.parameters.values():
        yield from (part for part in template.parts if isinstance(part, MemorySlot))


def _failing_calls(scenario: Scenario, action: Action, memory: Mapping[str, Any]) -> int:
    """How many of an action's wordings the robot cannot do, or need a value that is not there."""
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
    """Whether a wait is over at once."""
    duration = call.parameters.get("duration")
    return duration is not None and duration.text.strip() in ("0", "0.0")


def _speaks(scenario: Scenario, action: Action) -> bool:
    specs = (scenario.robot.actions[call.type] for call in action.calls)
    sent = (scenario.robot.actions[spec.substitute] if spec.substitute is not None else spec for spec in specs)
    return any(SPEECH_CHANNEL in spec.channels for spec in sent)


def _has_parallel(act: Act, on_robot: Sequence[Action]) -> bool:
    """Whether one of these actions can fail, and the act with it, while another is under way: neither has to wait for
    the other."""
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
    """Seconds of the longest way through an act; of several wordings the shortest or the longest."""
    ends: dict[str, float] = {}
    for action in actions_in_order(act):
        start = max((ends.get(before, 0.0) for before in action.wait_for), default=0.0)
        seconds = among(estimate_call_seconds(scenario, call, memory) or 0.0 for call in action.calls)
        ends[action.id] = start + seconds * (1.0 if _is_wait(scenario, action) else pace)
    return max(ends.values(), default=0.0)
