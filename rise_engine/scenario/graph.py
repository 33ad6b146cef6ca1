"""Small graph questions: who waits for each other, and what can be reached."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping


def cycles(edges: Mapping[str, Iterable[str]]) -> Iterator[list[str]]:
    """One cycle for each knot of nodes that reach each other, each starting with the node that comes first."""
    done: set[str] = set()
    for start in edges:
        if start in done:
            continue
        path: list[str] = [start]
        on_path = {start: 0}
        pending = [iter(edges[start])]
        while pending:
            following = next(pending[-1], None)
            if following is None:
                pending.pop()
                last = path.pop()
                del on_path[last]
                done.add(last)
            elif following in on_path:
                yield path[on_path[following] :]
                done.update(path)
            elif following not in done:
                on_path[following] = len(path)
                path.append(following)
                pending.append(iter(edges[following]))


def reachable(start: str, edges: Mapping[str, Iterable[str]]) -> set[str]:
    """Every node that can be reached from `start`, itself included."""
    found = {start}
    pending = [start]
    while pending:
        for following in edges.get(pending.pop(), ()):
            if following not in found:
                found.add(following)
                pending.append(following)
    return found


def knots(edges: Mapping[str, Iterable[str]]) -> dict[str, int]:
    """For each node the number of its knot: two nodes have the same one when each can be reached from the other.

    Nodes that are only pointed at have to be keys too. Linear (Tarjan 1972), without recursion.
    """
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    knot: dict[str, int] = {}
    open_nodes: list[str] = []
    for start in edges:
        if start in order:
            continue
        order[start] = lowest[start] = len(order)
        open_nodes.append(start)
        pending = [(start, iter(edges[start]))]
        while pending:
            node, ways = pending[-1]
            following = next(ways, None)
            if following is None:
                pending.pop()
                if lowest[node] == order[node]:
                    while True:
                        member = open_nodes.pop()
                        knot[member] = order[node]
                        if member == node:
                            break
                if pending:
                    before = pending[-1][0]
                    lowest[before] = min(lowest[before], lowest[node])
            elif following not in order:
                order[following] = lowest[following] = len(order)
                open_nodes.append(following)
                pending.append((following, iter(edges[following])))
            elif following not in knot:
                lowest[node] = min(lowest[node], order[following])
    return knot
