"""In which order a rule's states stand below each other, so that its usual course reads from top to bottom."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from rise_engine.scenario.model import Rule

Ways = Mapping[str, Sequence[str]]
"""For every state the states that it can go to, in the file's order, each once."""


class StateOrder(NamedTuple):
    """All states of a rule, each once."""

    states: tuple[str, ...]
    reached: int
    """How many of them, from the first on, some course of the rule can reach; the others stand behind them."""


def find_state_order(rule: Rule) -> StateOrder:
    """The rule's states: what follows stands below, its first way first, and an end behind what goes on.

    Depends on the rule alone, so that a state never changes its place.
    """
    ways = {
        name: tuple(dict.fromkeys(way.target for way in state.transitions if way.target in rule.states))
        for name, state in rule.states.items()
    }
    first = [rule.initial] if rule.initial in ways else []
    course = _find_course(first, ways)
    rest = _find_course((name for name in ways if name not in set(course)), ways, frozenset(course))
    return StateOrder((*course, *rest), len(course))


def _find_course(roots: Iterable[str], ways: Ways, known: frozenset[str] = frozenset()) -> list[str]:
    """Everything that the roots reach: a state comes after all that lead to it, loops left aside."""
    entries, loops, found = _explore(roots, ways, known)
    open_ways = dict.fromkeys(found, 0)
    for source in found:
        for target in _onward_states(source, ways, loops, open_ways):
            open_ways[target] += 1
    placed: list[str] = []
    ready = [root for root in reversed(entries) if not open_ways[root]]
    while ready:
        state = ready.pop()
        placed.append(state)
        follow = []
        for target in _onward_states(state, ways, loops, open_ways):
            open_ways[target] -= 1
            if not open_ways[target]:
                follow.append(target)
        follow.reverse()  # the last is the next
        ready.extend(sorted(follow, key=lambda one: bool(ways[one])))
    return placed


def _onward_states(source: str, ways: Ways, loops: set[tuple[str, str]], among: Mapping[str, int]) -> Iterable[str]:
    return (target for target in ways[source] if target in among and (source, target) not in loops)


def _explore(
    roots: Iterable[str], ways: Ways, known: frozenset[str]
) -> tuple[list[str], set[tuple[str, str]], list[str]]:
    """Depth first, first ways first: where it began, the ways that lead back into the course, and what it found."""
    entries: list[str] = []
    loops: set[tuple[str, str]] = set()
    found: list[str] = []
    seen = set(known)
    for root in roots:
        if root in seen:
            continue
        entries.append(root)
        seen.add(root)
        found.append(root)
        walked = [(root, iter(ways[root]))]
        walking = {root}
        while walked:
            state, rest = walked[-1]
            target = next(rest, None)
            if target is None:
                walked.pop()
                walking.discard(state)
            elif target in walking:
                loops.add((state, target))
            elif target not in seen:
                seen.add(target)
                found.append(target)
                walking.add(target)
                walked.append((target, iter(ways[target])))
    return entries, loops, found
