"""When each step of a path can come: bounds between the times of its steps, and the earliest times that keep them all.

Each bound says that one step comes at least so long after another (a negative number: at most so long before). The
earliest times are the longest ways from the beginning; where bounds contradict one another there is a round that is
longer than nothing, and one of the bounds in it must give way.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import TypeAlias

from msgspec import Struct

Tag: TypeAlias = tuple[Hashable, ...]
"""What a bound comes from."""

_TOLERANCE = 1e-7


class TimeBound(Struct, frozen=True):
    """Step `later` comes at least `seconds` after step `earlier`."""

    earlier: int
    later: int
    seconds: float
    tag: Tag


class Contradiction(Struct, frozen=True):
    """Bounds that cannot all be kept."""

    tags: tuple[Tag, ...]


def earliest_times(steps: int, bounds: Sequence[TimeBound]) -> list[float] | Contradiction:
    """The earliest time of each of so many steps, the first of which is the beginning, at 0."""
    times = [0.0] * steps
    came_by: list[TimeBound | None] = [None] * steps
    changed = None
    for _ in range(steps + 1):
        changed = None
        for bound in bounds:
            time = times[bound.earlier] + bound.seconds
            if time > times[bound.later] + _TOLERANCE:
                times[bound.later] = time
                came_by[bound.later] = bound
                changed = bound.later
        if changed is None and times[0] <= _TOLERANCE:
            return [round(time, 6) for time in times]
        if times[0] > _TOLERANCE:  # something would have to come before the beginning
            return Contradiction(_tags_back_to(0, came_by))
    assert changed is not None
    return Contradiction(_tags_back_to(changed, came_by))


def _tags_back_to(step: int, came_by: Sequence[TimeBound | None]) -> tuple[Tag, ...]:
    """What the round consists of that leads to a step."""
    at = step
    for _ in range(len(came_by)):  # into the round itself, if the step only hangs on it
        bound = came_by[at]
        if bound is None:
            break
        at = bound.earlier
    tags: list[Tag] = []
    start = at
    while (bound := came_by[at]) is not None:
        tags.append(bound.tag)
        at = bound.earlier
        if at == start:
            break
    return tuple(dict.fromkeys(tags))


def settle(
    steps: int,
    bounds_at: Callable[[Mapping[Tag, int]], Iterable[TimeBound]],
    costs: Callable[[Tag], Sequence[int]],
    levels: dict[Tag, int],
) -> list[float] | Contradiction:
    """Let bounds give way until all can be kept: of those in a round, the one that costs least.

    Arguments:
        steps: how many there are, the beginning among them.
        bounds_at: the bounds, when each tag has given way so often.
        costs: what it costs when a tag gives way, each time.
        levels: how often each has given way so far; changed.
    """
    while True:
        times = earliest_times(steps, [*bounds_at(levels)])
        if not isinstance(times, Contradiction):
            break
        open_tags = [tag for tag in times.tags if levels.get(tag, 0) < len(costs(tag))]
        if not open_tags:
            return times
        cheapest = min(open_tags, key=lambda tag: costs(tag)[levels.get(tag, 0)])
        levels[cheapest] = levels.get(cheapest, 0) + 1
    for tag in sorted(levels, key=lambda tag: -costs(tag)[levels[tag] - 1]):  # what need not give way after all
        for level in range(levels[tag]):
            before, levels[tag] = levels[tag], level
            better = earliest_times(steps, [*bounds_at(levels)])
            if not isinstance(better, Contradiction):
                times = better
                break
            levels[tag] = before
    return times
