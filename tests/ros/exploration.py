"""Every sequence of events in a world, but for those that lead to a state that was met before."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol, TypeVar


class World(Protocol):
    """A robot and a session, which know everything about each other."""

    def possible(self) -> Iterable[str]:
        """The events that can happen now."""
        ...

    def do(self, event: str) -> None:
        """Let it happen, with what follows from it by itself, and compare what the session says with what is so."""
        ...

    def state(self) -> str:
        """What decides what can come of it. Worlds of one state are explored once."""
        ...


W = TypeVar("W", bound=World)


class Exploration(NamedTuple):
    states: int
    is_whole: bool
    """There is no other state that the model tells apart: every event leads from each of them to one of them."""


def explore(
    begin: Callable[[], W], beginnings: Iterable[tuple[str, ...]], depth: int, check_the_end: Callable[[W], None]
) -> Exploration:
    """Play every sequence of up to `depth` events after these beginnings, but for those that lead to a state that was
    met before. `check_the_end` uses up the world of each state.

    Whatever a state's name leaves out is as after the shortest way to it: a world that took another way is not used.
    """
    seen: set[str] = set()
    frontier = [(events, list(play(begin(), events).possible())) for events in beginnings]
    for _ in range(depth):
        following = []
        for events, possible in frontier:
            for event in possible:
                world = play(begin(), path := (*events, event))
                if (state := world.state()) not in seen:
                    seen.add(state)
                    following.append((path, list(world.possible())))
                    check_the_end(world)
        frontier = following
    return Exploration(len(seen), not frontier)


def play(world: W, events: Iterable[str]) -> W:
    for event in events:
        world.do(event)
    return world
