"""An act as a graph: its levels."""

from __future__ import annotations

from graphlib import TopologicalSorter

from rise_engine.scenario.model import Act, Action


def action_levels(act: Act) -> list[list[int]]:
    """An act's graph by levels: indexes of actions, each level one after all that it waits for."""
    index_of = {action.id: index for index, action in enumerate(act.actions)}
    sorter = TopologicalSorter(
        {index: [index_of[id] for id in action.wait_for if id in index_of] for index, action in enumerate(act.actions)}
    )
    sorter.prepare()
    levels = []
    while sorter.is_active():
        ready = sorter.get_ready()
        levels.append(sorted(ready))
        sorter.done(*ready)
    return levels


def actions_in_order(act: Act) -> list[Action]:
    """An act's actions, each after those that it waits for."""
    return [act.actions[index] for level in action_levels(act) for index in level]
