"""The text of a row of the log in the available room, and a task in full. Pure, without widgets."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

from msgspec.structs import replace

from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.kernel.task_view import ActionView, TaskView
from rise_engine.scenario.speech.ssml import plain_words
from rise_engine.scenario.speech.template import spoken_text
from rise_tui.model.filtering import InvalidFilter
from rise_tui.model.log_rows import NOTE, ROBOT
from rise_tui.model.notice import FUNCTION_LABELS, short_name
from rise_tui.model.states import StateLabel, action_state, task_state
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    TextRole,
    crop,
    fixed_span,
    format_clock,
    format_duration,
    format_seconds,
    line_width,
    shorten,
    wrap,
)

CALLING = {"Blocking": "block", "None": "none"}
NARROW = 56
"""Below this width a row has fewer columns: time, function, description, state."""
TIME, FUNCTION, STATE = 7, 8, 11
"""Columns of a narrow row; the description has the rest."""
BRIEF = {"stopAll": "STOP", "stopCommunicationRobotAct": "stop", "stopInteractionRule": "stop", "recording": "rec"}
"""Functions in one word, for narrow rows."""
ABOUT_TASKS = frozenset({"cancelTask", "moveTask", "markMistake", "repeatAct", "goOn", "stopRuleOfAct"})
"""Functions whose behaviour begins with the number of a task."""
REASON = 10
"""Minimum cells for a reason, which is omitted otherwise."""
WIDE = 96
"""From this width on, times have tenths, and calling types have a column."""


def log_line(task: TaskView, width: int) -> StyledLine:
    """One row in one line of at most `width` cells."""
    narrow, state = width < NARROW, task_state(task)
    head = _narrow_head(task) if narrow else _wide_head(task, width)
    if task.function == NOTE:
        author: StyledLine = ((f"{short_name(task.source)}: ", "muted"),) if narrow else ()
        return crop((*head, *author, (task.behavior, "strong")), width)
    return _narrow_line(head, task, state, width) if narrow else _wide_line(head, task, state, width)


def with_task_name(task: TaskView, tasks: Mapping[int, TaskView]) -> TaskView:
    """A task about another task, with the other one's name in place of its number: `R_Praise wrong`."""
    number, _, rest = task.behavior.partition(" ")
    other = tasks.get(int(number)) if task.function in ABOUT_TASKS and number.isdecimal() else None
    return task if other is None else replace(task, behavior=f"{_task_name(other)} {rest}".strip())


def search_text(task: TaskView) -> str:
    """The text that a filter searches: everything that the widest row could show."""
    return (
        f"{format_clock(task.submitted, tenths=True)} {task.source} {_function_label(task)} {task.calling_type} "
        f"{task.behavior} {task_state(task).word} {mistake_text(task)}{task.reason}"
    )


def _source_width(width: int) -> int:
    return min(20, max(12, _free_width(width) // 3))


def _free_width(width: int) -> int:
    """Cells for person and description, beside the columns of fixed width."""
    return width - (47 if width >= WIDE else 38)


def _wide_head(task: TaskView, width: int) -> StyledLine:
    """Time, person and function."""
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
        crop((*head, *_failure_spans(task, state, width - line_width(head))), width)
        if _is_problem(task, state)
        else line
    )


def _narrow_head(task: TaskView) -> StyledLine:
    """Time, and function or mistake; no person."""
    word = BRIEF.get(task.function, _function_label(task))
    label = (
        fixed_span(mistake_text(task), FUNCTION, "wait")
        if task.mark
        else fixed_span(word, FUNCTION, _function_role(task))
    )
    return fixed_span(f" {short_clock(task.submitted)}", TIME, "muted"), label


def _narrow_line(head: StyledLine, task: TaskView, state: StateLabel, width: int) -> StyledLine:
    """A narrow row. After a failure the reason follows, as far as it fits."""
    room = width - TIME - FUNCTION
    if _is_problem(task, state):
        return crop((*head, *_failure_spans(task, state, room)), width)
    name = fixed_span(_task_name(task) or short_name(task.source), room - STATE)
    return (*head, name, (f" {state.glyph} ", state.role), fixed_span(state.word, STATE - 3, state.role))


def _failure_spans(task: TaskView, state: StateLabel, room: int) -> StyledLine:
    """The failure and its reason, in a row without a column for reasons."""
    word, name = f"{state.glyph} {state.word}", _task_name(task) or short_name(task.source)
    return (
        (f"{shorten(name, max(6, room - len(word) - 1))} ", "plain"),
        (word, state.role),
        (f": {task.reason}", state.role),
    )


def _is_problem(task: TaskView, state: StateLabel) -> bool:
    return bool(task.reason) and state.role in ("fault", "wait")


def _function_label(task: TaskView) -> str:
    return FUNCTION_LABELS.get(task.function, task.function)


def _function_role(task: TaskView) -> TextRole:
    return "fault" if task.function == "stopAll" else "plain"


def _task_name(task: TaskView) -> str:
    """The description. For the robot it is its link, whose state contains the rest."""
    return "link" if task.function == ROBOT else describe_behavior(task.function, task.behavior)


def short_clock(value: float) -> str:
    """Session time in few cells: ` 4:05`, `74:05`."""
    minutes, rest = divmod(int(max(0.0, value)), 60)
    return f"{minutes:2}:{rest:02}"


def mistake_text(task: TaskView) -> str:
    """The word for a marked mistake: `! late `."""
    return f"! {task.mark} " if task.mark else ""


LABEL = 13
"""Cells for the name of a field."""
CALLING_MEANINGS = {
    "Blocking": "Blocking: waits its turn",
    "None": "None: runs beside others",
    "Interrupt": "Interrupt: goes first",
}
MARKS = {"wrong": "the wrong act", "late": "too late", "early": "too early", "double": "started twice"}


def task_rows(task: TaskView | None, now: float, width: int) -> list[ListRow]:
    """Everything known of a task at session time `now`, in rows of at most `width` cells; none if it is gone."""
    if task is None:
        return []
    state = task_state(task)
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
        lines += field_lines("calling type", CALLING_MEANINGS.get(task.calling_type, task.calling_type), width)
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
    """A name and its value, on the lines that the value needs."""
    lines = wrap(value, max(10, width - LABEL - 2))
    return [
        (fixed_span(f" {name if at == 0 else ''}", LABEL, "muted"), (f" {line}", role)) for at, line in enumerate(lines)
    ]


def _time_lines(task: TaskView, now: float, width: int) -> list[StyledLine]:
    """The times of the events, each with the time since the previous one."""
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


_CLOCK = re.compile(r"(?:(\d{1,3}):)?(\d{1,3}):(\d{1,2}(?:\.\d+)?)")
_PARTS = re.compile(r"(?:(\d+(?:\.\d+)?)h)?(?:(\d+(?:\.\d+)?)m(?:in)?)?(?:(\d+(?:\.\d+)?)s?)?")
EXAMPLES = "14:32, 1:14:32, 90s, -30s, -2m, now"


def parse_moment(text: str, now: float) -> float | None:
    """Return session time in seconds; None: `now`, which moves on. Raises InvalidFilter.

    `14:32` is 14 minutes 32 seconds on the session's clock; with `-` in front, that long ago.
    """
    bare = text.strip().casefold().replace(" ", "")
    if bare in ("now", "end"):
        return None
    ago = bare.startswith(("-", "−"))
    seconds = _parse_seconds(bare[1:] if ago or bare.startswith("+") else bare)
    return max(0.0, now - seconds) if ago else seconds


def _parse_seconds(text: str) -> float:
    if (found := _CLOCK.fullmatch(text)) is not None:
        hours, minutes, seconds = found[1], float(found[2]), float(found[3])
        if seconds >= 60 or (hours is not None and minutes >= 60):
            raise InvalidFilter(f"{text}: minutes and seconds go up to 59")
        return int(hours or 0) * 3600 + minutes * 60 + seconds
    if text and (found := _PARTS.fullmatch(text)) is not None:
        hours, minutes, rest = (float(part or 0) for part in found.groups())
        return hours * 3600 + minutes * 60 + rest
    raise InvalidFilter(f"type a time of the session: {EXAMPLES}")
