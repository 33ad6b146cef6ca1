"""Everything about one task, in words: what the details of the log and of the scheduler show. Pure."""

from __future__ import annotations

import json

from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.kernel.task_view import ActionView, TaskView
from rise_engine.scenario.ssml import plain_words
from rise_engine.scenario.template import spoken_text
from rise_tui.model.states import StateLabel, action_state
from rise_tui.model.task_messages import FUNCTION_LABELS
from rise_tui.rendering.text import ListRow, StyledLine, TextRole, fixed_span, format_clock, format_duration, wrap

LABEL = 13
"""Cells for the name of a field."""
CALLING = {
    "Blocking": "Blocking: waits its turn",
    "None": "None: runs beside others",
    "Interrupt": "Interrupt: goes first",
}
MARKS = {"wrong": "the wrong act", "late": "too late", "early": "too early", "double": "started twice"}


def task_rows(task: TaskView, state: StateLabel, now: float, width: int) -> list[ListRow]:
    """All that is known of a task at session time `now`, in rows of at most `width` cells."""
    lines: list[StyledLine] = [
        *field_lines(
            FUNCTION_LABELS.get(task.function, task.function),
            describe_behavior(task.function, task.behavior),
            width,
            "strong",
        )
    ]
    if state.word:
        lines += field_lines("state", f"{state.glyph} {state.word}", width, state.role)
    if task.reason:
        lines += field_lines("reason", task.reason, width, state.role)
    if task.mark:
        lines += field_lines("mistake", f"! {task.mark}: {MARKS.get(task.mark, task.mark)}", width, "wait")
    lines += field_lines("from", task.source, width)
    if task.calling_type:
        lines += field_lines("calling type", CALLING.get(task.calling_type, task.calling_type), width)
    if task.id:
        lines += field_lines("task", f"{task.id} · {task.function}", width, "muted")
    lines += [(), *_time_lines(task, now, width)]
    for action in task.actions.values():
        lines += [(), *_action_lines(action, now, width)]
    return [ListRow(str(index), line) for index, line in enumerate(lines)]


def value_rows(name: str, value: str, kind: str, about: str, width: int) -> list[ListRow]:
    """A memory value in full."""
    lines = [
        *field_lines("key", name, width, "strong"),
        *field_lines("type", kind, width),
        *field_lines("changed", about, width),
        (),
    ]
    lines += [((f" {line}", "plain"),) for line in wrap(value, width - 2)]
    return [ListRow(str(index), line) for index, line in enumerate(lines)]


def field_lines(name: str, value: str, width: int, role: TextRole = "plain") -> list[StyledLine]:
    """A name and what belongs to it, over as many lines as that needs."""
    lines = wrap(value, max(10, width - LABEL - 2))
    return [
        (fixed_span(f" {name if at == 0 else ''}", LABEL, "muted"), (f" {line}", role)) for at, line in enumerate(lines)
    ]


def _time_lines(task: TaskView, now: float, width: int) -> list[StyledLine]:
    """What happened when, each with the time since what came before it."""
    happened = [
        ("cue", task.cue_at, "the participant's turn ended"),
        ("key", task.key_at, "pressed on a console"),
        ("accepted", task.submitted, ""),
        ("started", task.started, ""),
        ("robot", task.robot_at, "the robot took the first action"),
        ("voice", task.voice_at, "the robot began to speak"),
        ("ended", task.ended, ""),
    ]
    lines: list[StyledLine] = []
    before: float | None = None
    for name, when, remark in happened:
        if when is None:
            continue
        since = f"+{format_duration(when - before)}" if before is not None else ""
        lines.append(
            (
                fixed_span(f" {name}", LABEL + 1, "muted"),
                (format_clock(when, tenths=True), "plain"),
                fixed_span(since, 10, "plain", right=True),
                (f"  {remark}", "muted"),
            )
        )
        before = when
    if task.started is not None:
        end = task.ended if task.ended is not None else now
        lines += field_lines("took" if task.ended is not None else "so far", format_duration(end - task.started), width)
    elif task.ended is None:
        lines += field_lines("waits for", format_duration(now - task.submitted), width)
    return lines


def _action_lines(action: ActionView, now: float, width: int) -> list[StyledLine]:
    state = action_state(action)
    took = format_duration((action.ended if action.ended is not None else now) - action.since)
    kind = f"{action.type} → {action.sent_as}" if action.sent_as else action.type
    lines: list[StyledLine] = [
        (
            fixed_span(f" {action.action}", LABEL + 1, "strong"),
            (f"{kind}  ", "plain"),
            (f"{state.glyph} {state.word}  ", state.role),
            (f"{format_clock(action.since, tenths=True)}  {took}", "muted"),
        )
    ]
    for name, value in action.parameters.items():
        text = (
            plain_words(spoken_text(value))
            if not isinstance(value, (dict, list))
            else json.dumps(value, ensure_ascii=False)
        )
        lines += field_lines(f"  {name}", text, width)
    return lines + (field_lines("  reason", action.reason, width, "fault") if action.reason else [])
