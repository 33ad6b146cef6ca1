"""Everything about one task, in words: what the details of the log and of the scheduler show. Pure."""

from __future__ import annotations

import json

from rise_engine.scenario.template import as_text
from rise_engine.view import ActionView, TaskView
from rise_tui.model.deeds import FUNCTION_WORDS
from rise_tui.model.states import State, action_state
from rise_tui.text import Line, Row, Tone, cell, clock, duration, wrap

LABEL = 13
CALLING = {
    "Blocking": "Blocking: waits its turn",
    "None": "None: runs beside others",
    "Interrupt": "Interrupt: goes first",
}
MARKS = {"wrong": "the wrong act", "late": "too late", "early": "too early", "double": "started twice"}


def task_rows(task: TaskView, state: State, now: float, width: int) -> list[Row]:
    """All that is known of a task at session time `now`, in rows of at most `width` cells."""
    lines: list[Line] = [*field(FUNCTION_WORDS.get(task.function, task.function), task.behavior, width, "strong")]
    if state.word:
        lines += field("state", f"{state.glyph} {state.word}", width, state.tone)
    if task.reason:
        lines += field("reason", task.reason, width, state.tone)
    if task.mark:
        lines += field("mistake", f"! {task.mark}: {MARKS.get(task.mark, task.mark)}", width, "wait")
    lines += field("from", task.source, width)
    if task.calling_type:
        lines += field("calling type", CALLING.get(task.calling_type, task.calling_type), width)
    if task.id:
        lines += field("task", f"{task.id} · {task.function}", width, "muted")
    lines += [(), *_times(task, now, width)]
    for action in task.actions.values():
        lines += [(), *_action(action, now, width)]
    return [Row(str(at), line) for at, line in enumerate(lines)]


def value_rows(name: str, value: str, kind: str, about: str, width: int) -> list[Row]:
    """A memory value in full."""
    lines = [*field("key", name, width, "strong"), *field("type", kind, width), *field("changed", about, width), ()]
    lines += [((f" {line}", "plain"),) for line in wrap(value, width - 2)]
    return [Row(str(at), line) for at, line in enumerate(lines)]


def field(name: str, value: str, width: int, tone: Tone = "plain") -> list[Line]:
    """A name and what belongs to it, over as many lines as that needs."""
    lines = wrap(value, max(10, width - LABEL - 2))
    return [(cell(f" {name if at == 0 else ''}", LABEL + 1, "muted"), (line, tone)) for at, line in enumerate(lines)]


def _times(task: TaskView, now: float, width: int) -> list[Line]:
    """What happened when, each with the time since what came before it."""
    happened = [
        ("cue", task.cue_at, "the participant's turn had ended"),
        ("key", task.key_at, "pressed on a console"),
        ("accepted", task.submitted, ""),
        ("started", task.started, ""),
        ("robot", task.robot_at, "the robot took the first action"),
        ("ended", task.ended, ""),
    ]
    lines: list[Line] = []
    before: float | None = None
    for name, when, said in happened:
        if when is None:
            continue
        since = f"+{duration(when - before)}" if before is not None else ""
        lines.append(
            (
                cell(f" {name}", LABEL + 1, "muted"),
                (clock(when, tenths=True), "plain"),
                cell(since, 10, "plain", right=True),
                (f"  {said}", "muted"),
            )
        )
        before = when
    if task.started is not None:
        end = task.ended if task.ended is not None else now
        lines += field("took" if task.ended is not None else "so far", duration(end - task.started), width)
    elif task.ended is None:
        lines += field("waits for", duration(now - task.submitted), width)
    return lines


def _action(action: ActionView, now: float, width: int) -> list[Line]:
    state = action_state(action)
    took = duration((action.ended if action.ended is not None else now) - action.since)
    kind = f"{action.type} → {action.sent_as}" if action.sent_as else action.type
    lines: list[Line] = [
        (
            cell(f" {action.action}", LABEL + 1, "strong"),
            (f"{kind}  ", "plain"),
            (f"{state.glyph} {state.word}  ", state.tone),
            (f"{clock(action.since, tenths=True)}  {took}", "muted"),
        )
    ]
    for name, value in action.parameters.items():
        text = as_text(value) if not isinstance(value, (dict, list)) else json.dumps(value, ensure_ascii=False)
        lines += field(f"  {name}", text, width)
    return lines + (field("  reason", action.reason, width, "fault") if action.reason else [])
