"""A step back: the state before, and the memory keys that have changed since. Lines for a question. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rise_tui.model.entry_text import entry_lines
from rise_tui.model.store import Store
from rise_tui.rendering.text import cell_width, clean, format_value, shorten

BACK, KEEP = "take back", "keep"
GO_ON, STOP = "go on", "stop"
ACTS = ""
"""Stands for the acts that the rule has started, where others stand for memory keys."""
MOST_VALUE = 24
"""Cells of a value."""


class BackStep(NamedTuple):
    """A step back that can be made now."""

    rule: str
    state: str
    """The state before."""
    keys: dict[str, str]
    """The memory keys that have changed since, each with its value now and the one before."""
    acts: tuple[str, ...]
    """Acts of the rule that run or wait, or have failed and wait for an answer."""


def find_back_step(store: Store, name: str) -> BackStep | None:
    """The step back of a rule; None when it does not run, or no state before is known."""
    view, rule = store.rule(name), store.scenario.rules.get(name)
    if not view.running or len(view.steps) < 2 or rule is None or view.steps[-2][0] not in rule.states:
        return None
    keys = {}
    for key, before in store.view.changed_since_step(view).items():
        now = _value_text(store.memory[key]) if key in store.memory else "not set"
        keys[key] = f"{now} → {_value_text(before.value) if before.existed else 'not set'}"
    failed = (store.view.tasks[id] for id in store.view.questions if id in store.view.tasks)
    tasks = (*failed, *store.running_tasks, *store.waiting_tasks)
    acts = dict.fromkeys(task.behavior for task in tasks if task.source == f"rule:{name}")
    return BackStep(name, view.steps[-2][0], keys, tuple(acts))


def question_lines(store: Store, step: BackStep, width: int) -> list[str]:
    """What the robot and the rule would do at once."""
    state = store.scenario.rules[step.rule].states[step.state]
    now = store.rule(step.rule).state
    return [
        shorten(f"Rule {step.rule} goes from {now} back to {step.state}. Its onEntry:", width),
        *(f"  {line}" for line in entry_lines(store.scenario, state, store.memory, width - 2, 4)),
    ]


def step_lines(
    step: BackStep, chosen: Mapping[str, str], selected: int, first: int, width: int, rows: int
) -> list[str]:
    """For each thing to choose what is chosen, from the first shown on."""
    names: Sequence[str] = list(chosen)
    lines = []
    for index, name in enumerate(names[first : first + rows], first):
        mark = "▸" if index == selected else " "
        word = f"‹{chosen[name]:^{len(BACK)}}›"
        text = f"its acts: {', '.join(step.acts)}" if name == ACTS else f"{name}: {step.keys[name]}"
        place = shorten(f"{mark} {clean(text)}", width - cell_width(word) - 1)
        lines.append(place + " " * (width - cell_width(place) - cell_width(word)) + word)
    return lines


def step_behavior(step: BackStep, chosen: Mapping[str, str], *, enter: bool) -> str:
    """The behaviour of the task that makes the step."""
    taken = [key for key in step.keys if chosen[key] == BACK]
    parts = {"rule": step.rule, "take_back": taken, "enter": enter, "stop_acts": chosen.get(ACTS) == STOP}
    return json.dumps(parts, ensure_ascii=False)


def _value_text(value: object) -> str:
    return shorten(format_value(value), MOST_VALUE)
