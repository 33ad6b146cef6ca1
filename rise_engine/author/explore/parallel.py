"""Several cores: each follows some of the situations, and one keeps all of them."""

from __future__ import annotations

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable
from multiprocessing.pool import ApplyResult
from typing import TypeAlias

from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.space import Number, Space
from rise_engine.author.explore.stepper import FollowedMove, Stepper
from rise_engine.author.explore.zones import Zone

_PORTION = 64
"""Situations that a core is given at a time: so many that sending them costs little beside following them."""
_AHEAD = 3
"""Portions for each core that are under way at once."""
_SECONDS = 0.05
"""How long a portion is waited for before it is asked again whether to go on."""

_Portion: TypeAlias = list[tuple[Number, Situation, Zone]]
_Followed: TypeAlias = tuple[list[tuple[Number, list[FollowedMove]]], int]
"""What follows each situation, and how many inputs that took."""

_stepper: Stepper | None = None
"""The one of this process."""


def explore_on_cores(space: Space, cores: int, go_on: Callable[[], bool]) -> None:
    """As `Space.explore`, on several cores. Processes are forked, so that nothing of the scenario has to be sent;
    where that cannot be done, one core does it all."""
    if cores < 2 or "fork" not in multiprocessing.get_all_start_methods():
        space.explore(go_on)
        return
    context = multiprocessing.get_context("fork")
    most = space.stepper.bounds.situations
    under_way: deque[tuple[list[Number], ApplyResult[_Followed]]] = deque()
    with context.Pool(cores, _begin, (space.stepper,)) as pool:
        while (space.pending or under_way) and len(space.situations) <= most and go_on():
            while space.pending and len(under_way) < _AHEAD * cores:
                portion = space.take_pending(_PORTION)
                numbers = [number for number, _, _ in portion]
                under_way.append((numbers, pool.apply_async(_follow, (portion,))))
            first = under_way[0][1]
            first.wait(_SECONDS)
            if not first.ready():
                continue  # somebody may have had enough meanwhile
            under_way.popleft()
            followed, steps = first.get()
            space.stepper.steps += steps
            for number, found in followed:
                space.take(number, found)
        space.complete = not space.pending and not under_way
        for numbers, _ in under_way:  # broken off, and waited for no more: what they were given was not looked at
            space.put_back(numbers)


def _begin(stepper: Stepper) -> None:
    global _stepper
    _stepper = stepper
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # ctrl+c is for who keeps the situations


def _follow(portion: _Portion) -> _Followed:
    assert _stepper is not None, "set when the process began"
    before = _stepper.steps
    found = [(number, list(_stepper.follow(situation, zone))) for number, situation, zone in portion]
    return found, _stepper.steps - before
