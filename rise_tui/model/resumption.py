"""What a stop has interrupted, and what would come of each rule if it went on: lines for a question. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rise_engine.author.drawing.rule_text import wait_text
from rise_engine.kernel.behaviors import Resumption
from rise_tui.model.entry_text import entry_summary
from rise_tui.model.store import Store
from rise_tui.rendering.text import cell_width, clean, shorten

OPTIONS: tuple[Resumption, ...] = ("leave", "enter", "wait")
"""The first is what holds if nobody chooses."""
WORDS: dict[str, str] = {"enter": "re-enter", "wait": "wait there", "leave": "leave stopped"}
WORD_WIDTH = max(map(len, WORDS.values()))
MARGIN = 4
"""Cells before what would come of it."""


class InterruptedRule(NamedTuple):
    """A rule that the stop has ended."""

    name: str
    state: str
    entry: str
    """What the robot would do at once if it entered its state again."""
    waits: str
    """What it would wait for."""

    def effect(self, how: str) -> str:
        """What would come of it at once, in a line."""
        if how == "enter":
            return self.entry
        return f"waits for {self.waits}" if how == "wait" else f"stays stopped; if re-entered: {self.entry}"


def interrupted_rules(store: Store) -> list[InterruptedRule]:
    """The rules that the stop has ended, the top of the stack first."""
    found = []
    for stood in reversed(store.view.stop.stood):
        rule = store.scenario.rules.get(stood.rule)
        state = rule.states.get(stood.state) if rule is not None else None
        if rule is not None and state is not None:
            waits = " or ".join(dict.fromkeys(wait_text(store.scenario, way) for way in state.transitions))
            found.append(
                InterruptedRule(rule.name, state.id, entry_summary(store.scenario, rule, state.id, store.memory), waits)
            )
    return found


def resumption_lines(
    rules: Sequence[InterruptedRule], chosen: Mapping[str, str], selected: int, width: int, rows: int
) -> list[str]:
    """For each rule where it stood and what becomes of it, and below what the robot would do at once.

    Of more rules than there are rows for, those around the selected one."""
    most = max(1, rows // 2)
    first = max(0, min(selected - most // 2, len(rules) - most))  # the selected one in the middle
    lines = []
    for index, rule in enumerate(rules[first : first + most], first):
        mark = "▸" if index == selected else " "
        word = f"‹{WORDS[chosen[rule.name]]:^{WORD_WIDTH}}›"
        place = shorten(f"{mark} {clean(rule.name)}: {clean(rule.state)}", width - cell_width(word) - 1)
        lines.append(place + " " * (width - cell_width(place) - cell_width(word)) + word)
        lines.append(shorten(" " * MARGIN + clean(rule.effect(chosen[rule.name])), width))
    return lines


def release_behavior(chosen: Mapping[str, str]) -> str:
    """The behaviour of the task that releases the stop: empty when every rule is left stopped."""
    resumed = {name: how for name, how in chosen.items() if how != "leave"}
    return json.dumps(resumed, ensure_ascii=False) if resumed else ""
