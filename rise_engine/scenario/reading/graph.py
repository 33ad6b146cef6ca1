"""Algorithms for small graphs: cycles, and reachability."""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Iterable, Iterator, Mapping
from typing import TypeVar

Node = TypeVar("Node", bound=Hashable)


def find_cycles(edges: Mapping[str, Iterable[str]]) -> Iterator[list[str]]:
    """Yield one shortest cycle for each strongly connected component, from the component's first node."""
    order = {node: index for index, node in enumerate(edges)}
    for knot in sorted(
        (sorted(knot, key=order.__getitem__) for knot in _strongly_connected_components(edges)),
        key=lambda k: order[k[0]],
    ):
        first, inside = knot[0], set(knot)
        came_from: dict[str, str] = {}
        pending = deque([first])
        while first not in came_from and pending:
            node = pending.popleft()
            for following in edges[node]:
                if following in inside and following not in came_from:
                    came_from[following] = node
                    pending.append(following)
        if first in came_from:  # a single node is a cycle only if it points at itself
            cycle = [came_from[first]]
            while cycle[-1] != first:
                cycle.append(came_from[cycle[-1]])
            yield cycle[::-1]


def _strongly_connected_components(edges: Mapping[Node, Iterable[Node]]) -> Iterator[list[Node]]:
    """The strongly connected components (Tarjan, SIAM J. Comput. 1 (2), 1972), without recursion."""
    number: dict[Node, int] = {}
    lowest: dict[Node, int] = {}
    stack: list[Node] = []
    on_stack: set[Node] = set()
    for start in edges:
        if start in number:
            continue
        number[start] = lowest[start] = len(number)
        stack.append(start)
        on_stack.add(start)
        pending = [(start, iter(edges[start]))]
        while pending:
            node, others = pending[-1]
            for following in others:
                if following not in number:
                    number[following] = lowest[following] = len(number)
                    stack.append(following)
                    on_stack.add(following)
                    pending.append((following, iter(edges[following])))
                    break
                if following in on_stack:
                    lowest[node] = min(lowest[node], number[following])
            else:
                pending.pop()
                if pending:
                    lowest[pending[-1][0]] = min(lowest[pending[-1][0]], lowest[node])
                if lowest[node] == number[node]:
                    at = len(stack) - 1
                    while stack[at] != node:
                        at -= 1
                    knot = stack[at:]
                    del stack[at:]
                    on_stack.difference_update(knot)
                    yield knot


def reachable_from(start: str, edges: Mapping[str, Iterable[str]]) -> set[str]:
    """All nodes that can be reached from `start`, including `start`."""
    found = {start}
    pending = [start]
    while pending:
        for following in edges.get(pending.pop(), ()):
            if following not in found:
                found.add(following)
                pending.append(following)
    return found


def component_numbers(edges: Mapping[Node, Iterable[Node]]) -> dict[Node, int]:
    """Number each node's strongly connected component: nodes that can be reached from each other share a number.

    Every node must be a key, even without edges.
    """
    return {node: number for number, knot in enumerate(_strongly_connected_components(edges)) for node in knot}
