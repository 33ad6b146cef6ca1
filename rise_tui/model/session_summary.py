"""Whose session it is and what is going on in it, in words: for questions about ending it. Pure; knows no screen."""

from __future__ import annotations

from rise_engine.scenario.study import condition_label
from rise_tui.model.store import Store
from rise_tui.model.task_messages import act_label
from rise_tui.rendering.text import clean

SHOWN = 5
"""Things that are named; of more it is said how many."""


def participant_parts(store: Store) -> list[str]:
    """Who takes part, and the condition as the scenario labels it, as far as they were named."""
    session = store.view.session
    if session is None:
        return []
    return [text for text in (session.participant, condition_label(store.scenario, session.condition)) if text]


def participant_text(store: Store) -> str:
    """`P07 · hesitation`; empty when nobody was named."""
    return clean(" · ".join(participant_parts(store)))


def session_title(store: Store) -> str:
    """`P07 · hesitation · LabLinking: setting the table`."""
    return " · ".join(filter(None, (participant_text(store) or "no participant named", clean(store.scenario.title))))


def running_lines(store: Store) -> list[str]:
    """Rules with their states, acts that run and acts that wait, in lines for a question."""
    running = [f"rule {name}: in {store.view.rules[name].state}" for name in store.view.running_rules()]
    running += [f"act {act_label(task.function, task.behavior)}" for task in store.running_tasks]
    running += [f"act {act_label(task.function, task.behavior)}, waiting" for task in store.waiting_tasks]
    if not running:
        return ["Nothing runs now: no rule, no act."]
    more = [f"  and {len(running) - SHOWN} more"] if len(running) > SHOWN else []
    return ["Running now:", *(f"  {clean(each)}" for each in running[:SHOWN]), *more]
