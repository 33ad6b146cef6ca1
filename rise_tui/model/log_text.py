"""What a row of the log says, in the room that there is. Pure; knows no widget."""

from __future__ import annotations

from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.kernel.task_view import TaskView
from rise_tui.model.control import short_name
from rise_tui.model.log_rows import NOTE, ROBOT
from rise_tui.model.states import StateLabel
from rise_tui.model.task_messages import FUNCTION_LABELS
from rise_tui.rendering.text import (
    StyledLine,
    TextRole,
    crop,
    fixed_span,
    format_clock,
    format_seconds,
    line_width,
    shorten,
)

CALLING = {"Blocking": "block", "None": "none"}
NARROW = 56
"""Below this width a row has fewer columns: time, function, what was done, state."""
TIME, FUNCTION, STATE = 7, 8, 11
"""Columns of a narrow row; what was done has the rest."""
BRIEF = {"stopAll": "STOP", "stopCommunicationRobotAct": "stop", "stopInteractionRule": "stop", "recording": "rec"}
"""Functions in a word, for narrow rows."""
REASON = 10
"""A reason that would have less room than this stays out of the row."""
WIDE = 96
"""From this width on, times have tenths and calling types have a column."""


def log_line(task: TaskView, state: StateLabel, width: int) -> StyledLine:
    """One row in one line of at most `width` cells. `state`: what became of the task, as it is shown."""
    narrow = width < NARROW
    head = _narrow_head(task) if narrow else _wide_head(task, width)
    if task.function == NOTE:
        author: StyledLine = ((f"{short_name(task.source)}: ", "muted"),) if narrow else ()
        return crop((*head, *author, (task.behavior, "strong")), width)
    return _narrow_line(head, task, state, width) if narrow else _wide_line(head, task, state, width)


def search_text(task: TaskView, state: StateLabel) -> str:
    """What a filter looks at: all that the widest row could show."""
    return (
        f"{format_clock(task.submitted, tenths=True)} {task.source} {_function_label(task)} {task.calling_type} "
        f"{task.behavior} {state.word} {mistake_text(task)}{task.reason}"
    )


def _source_width(width: int) -> int:
    return min(20, max(12, _free_width(width) // 3))


def _free_width(width: int) -> int:
    """Cells for who and what, beside the columns whose width is fixed."""
    return width - (47 if width >= WIDE else 38)


def _wide_head(task: TaskView, width: int) -> StyledLine:
    """When, who, and which function."""
    wide = width >= WIDE
    return (
        fixed_span(f" {format_clock(task.submitted, tenths=wide)}", 12 if wide else 10, "muted"),
        fixed_span(task.source, _source_width(width) - 1, "muted"),
        (" ", "plain"),
        fixed_span(_function_label(task), 10, _function_role(task)),
    )


def _wide_line(head: StyledLine, task: TaskView, state: StateLabel, width: int) -> StyledLine:
    wide = width >= WIDE
    if wide:
        head = (*head, fixed_span(CALLING.get(task.calling_type, task.calling_type), 7, "muted"))
    took = format_seconds(task.ended - task.started) if task.ended is not None and task.started is not None else ""
    room = min(40, _free_width(width) - _source_width(width) - (20 if wide else 0))
    mistake: StyledLine = ((" ", "plain"), fixed_span(mistake_text(task), 8, "wait")) if task.mark else ()
    line: StyledLine = (
        *head,
        fixed_span(_task_name(task), max(6, room - (9 if mistake else 0))),
        *mistake,
        (f" {state.glyph} ", state.role),
        fixed_span(state.word, 9, state.role),
        fixed_span(took, 6, right=True),
    )
    if not task.reason:
        return line
    if width - line_width(line) >= REASON:
        return crop((*line, (f"  {task.reason}", state.role)), width)
    return (
        crop((*head, *_failure_spans(task, state, width - line_width(head))), width) if _is_bad(task, state) else line
    )


def _narrow_head(task: TaskView) -> StyledLine:
    """When, and which function or mistake; not who it was."""
    word = BRIEF.get(task.function, _function_label(task))
    label = (
        fixed_span(mistake_text(task), FUNCTION, "wait")
        if task.mark
        else fixed_span(word, FUNCTION, _function_role(task))
    )
    return fixed_span(f" {short_clock(task.submitted)}", TIME, "muted"), label


def _narrow_line(head: StyledLine, task: TaskView, state: StateLabel, width: int) -> StyledLine:
    """Of what went wrong the reason follows, as far as there is room."""
    room = width - TIME - FUNCTION
    if _is_bad(task, state):
        return crop((*head, *_failure_spans(task, state, room)), width)
    name = fixed_span(_task_name(task) or short_name(task.source), room - STATE)
    return (*head, name, (f" {state.glyph} ", state.role), fixed_span(state.word, STATE - 3, state.role))


def _failure_spans(task: TaskView, state: StateLabel, room: int) -> StyledLine:
    """What went wrong and why, where a reason has no column of its own."""
    word, name = f"{state.glyph} {state.word}", _task_name(task) or short_name(task.source)
    return (
        (f"{shorten(name, max(6, room - len(word) - 1))} ", "plain"),
        (word, state.role),
        (f": {task.reason}", state.role),
    )


def _is_bad(task: TaskView, state: StateLabel) -> bool:
    return bool(task.reason) and state.role in ("fault", "wait")


def _function_label(task: TaskView) -> str:
    return FUNCTION_LABELS.get(task.function, task.function)


def _function_role(task: TaskView) -> TextRole:
    return "fault" if task.function == "stopAll" else "plain"


def _task_name(task: TaskView) -> str:
    """What was done; of the robot its link, whose state says the rest."""
    return "link" if task.function == ROBOT else describe_behavior(task.function, task.behavior)


def short_clock(value: float) -> str:
    """Session time in few cells: ` 4:05`, `74:05`."""
    minutes, rest = divmod(int(max(0.0, value)), 60)
    return f"{minutes:2}:{rest:02}"


def mistake_text(task: TaskView) -> str:
    """A mistake that somebody marked, in a word: `! late `."""
    return f"! {task.mark} " if task.mark else ""
