"""Whose session it is and what is going on in it, in words: for questions about ending it. Pure; knows no screen."""

from __future__ import annotations

from rise_engine.kernel.records import SessionRecord
from rise_engine.scenario.conditions import condition_label
from rise_tui.model.store import Store
from rise_tui.model.task_messages import act_label
from rise_tui.rendering.text import clean

SHOWN = 5
"""Things that are named; of more it is said how many."""


def participant_parts(store: Store) -> list[str]:
    """Who takes part (in a study with the run, and what for if it does not count: `P07 run 2`), and the condition as
    the study or the scenario labels it, as far as they were named."""
    session = store.view.session
    if session is None:
        return []
    run = f"run {session.run}" if session.study and session.run else ""
    rehearsal = session.purpose if session.purpose not in ("counted", "debug") else ""  # debug is said as the mode
    who = " ".join(filter(None, (session.participant, run, rehearsal)))
    return [text for text in (who, _labelled_condition(store, session)) if text]


def _labelled_condition(store: Store, session: SessionRecord) -> str:
    """Empty as long as the study has not been read: a blinded wizard must not see the name for a moment."""
    if not session.study:
        return condition_label(store.scenario, session.condition)
    labels = store.condition_labels
    return "" if labels is None else labels.get(session.condition, session.condition)


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
        return ["No rule and no act is running."]
    more = [f"  and {len(running) - SHOWN} more"] if len(running) > SHOWN else []
    return ["Running now:", *(f"  {clean(each)}" for each in running[:SHOWN]), *more]
