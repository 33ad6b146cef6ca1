"""What has to be known of an act so that it can be looked at as one thing: how it begins, ends and takes its time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.drawing.act_levels import actions_in_order
from rise_engine.drawing.act_seconds import estimate_call_seconds
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
    waits: bool
    """Whether there can be a moment at which it only waits, and the robot does nothing of it."""
    is_parallel: bool
    """Whether two of its actions can be under way on the robot at once."""
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
        waits=any(_is_wait(scenario, action) and not _takes_no_time(action) for action in act.actions),
        is_parallel=_has_parallel(act, {action.id for action in on_robot}),
        speaks=any(action in speaking for action in initial),
        changes_voice=bool(speaking) and len(act.actions) > len(speaking),
        least=int(1000 * min(_length(scenario, act, memory, pace[0], min) for memory in memories)),
        most=int(1000 * max(_length(scenario, act, memory, pace[1], max) for memory in memories)) + 1,
    )


def begin(scenario: Scenario, act: Act, memory: Mapping[str, Any], robot_lost: bool) -> tuple[Beginning, bool, bool]:
    """What becomes of an act that is started with this memory.

    Returns what becomes of it at once; whether the robot has begun with something of it by then; and whether an action
    that comes later would fail as things stand.
    """
    ready = [action for action in act.actions if not action.wait_for]
    ended: set[str] = set()
    started = False
    running = False
    while ready:
        action = ready.pop(0)
        if _is_wait(scenario, action) and not _lacks_value(action, memory):
            if not _takes_no_time(action):
                running = True
                continue
        elif robot_lost or _is_sure_to_fail(scenario, action, memory):
            if not action.continue_on_failure:
                return "fails", started, True
        else:
            started = running = True
            continue
        ended.add(action.id)
        ready += [later for later in act.successors.get(action.id, ()) if ended.issuperset(later.wait_for)]
    later = [action for action in act.actions if action.id not in ended and action.wait_for]
    doomed = any(not action.continue_on_failure and _is_sure_to_fail(scenario, action, memory) for action in later)
    return ("runs" if running else "ends"), started, doomed


def keys_without_fallback(act: Act) -> Iterable[str]:
    """The memory keys without whose value an action of an act fails."""
    for action in act.actions:
        for call in action.calls:
            for slot in _slots(call):
                if slot.fallback is None:
                    yield from slot.part.keys if slot.part is not None else (slot.key,)


def keys_read(act: Act) -> Iterable[str]:
    """The memory keys that an act's words and numbers are made of."""
    for action in act.actions:
        for call in action.calls:
            for slot in _slots(call):
                yield from slot.part.keys if slot.part is not None else (slot.key,)


def _slots(call: ActionCall) -> Iterable[MemorySlot]:
    for template in call.parameters.values():
        yield from (part for part in template.parts if isinstance(part, MemorySlot))


def _lacks_value(action: Action, memory: Mapping[str, Any]) -> bool:
    keys = (slot.key for call in action.calls[:1] for slot in _slots(call) if slot.fallback is None and not slot.part)
    return any(lookup(memory, key)[1] is None for key in keys)


def _is_sure_to_fail(scenario: Scenario, action: Action, memory: Mapping[str, Any]) -> bool:
    """Whether the robot cannot do it, or a value is not there that it needs."""
    specs = (scenario.robot.actions[call.type] for call in action.calls)
    unable = all(not spec.engine and not spec.supported and spec.substitute is None for spec in specs)
    return unable or _lacks_value(action, memory)


def _is_wait(scenario: Scenario, action: Action) -> bool:
    return all(scenario.robot.actions[call.type].engine for call in action.calls)


def _takes_no_time(action: Action) -> bool:
    """Whether a wait is over at once."""
    return all(
        template.text.strip() in ("0", "0.0", "")
        for call in action.calls
        for name, template in call.parameters.items()
        if name == "duration"
    )


def _speaks(scenario: Scenario, action: Action) -> bool:
    specs = (scenario.robot.actions[call.type] for call in action.calls)
    sent = (scenario.robot.actions[spec.substitute] if spec.substitute is not None else spec for spec in specs)
    return any(SPEECH_CHANNEL in spec.channels for spec in sent)


def _has_parallel(act: Act, on_robot: set[str]) -> bool:
    """Whether two of these actions can be under way at once: neither has to wait for the other."""
    before: dict[str, set[str]] = {}
    for action in actions_in_order(act):
        before[action.id] = {id for each in action.wait_for for id in (each, *before.get(each, ()))}
    ids = sorted(on_robot)
    return any(
        one not in before[other] and other not in before[one] for at, one in enumerate(ids) for other in ids[at + 1 :]
    )


def _length(scenario: Scenario, act: Act, memory: Mapping[str, Any], pace: float, among: Any) -> float:
    """Seconds of the longest way through an act; of several wordings the shortest or the longest."""
    ends: dict[str, float] = {}
    for action in actions_in_order(act):
        start = max((ends.get(before, 0.0) for before in action.wait_for), default=0.0)
        seconds = among(estimate_call_seconds(scenario, call, memory) or 0.0 for call in action.calls)
        ends[action.id] = start + seconds * (1.0 if _is_wait(scenario, action) else pace)
    return max(ends.values(), default=0.0)
