"""An act as rows: when each action begins, what it is, and how long it takes as a bar."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from rise_engine.author.edit.outline import WrittenAct, WrittenAction
from rise_engine.scenario.loader import LoadResult
from rise_tui.editor.model.act_times import ActionTime, action_times
from rise_tui.rendering.text import ListRow, StyledLine, clean, crop, fixed_span, line_width

WHEN, BAR = 11, 26


class ActScale(NamedTuple):
    """How bars are drawn."""

    cells: int
    seconds: float
    """Of the whole act; at least a little."""


def when_text(action: WrittenAction) -> str:
    """When it begins."""
    return "after " + " ".join(action.wait_for) if action.wait_for else "at once"


def what_text(action: WrittenAction) -> str:
    """What it does, without its name: what is said, or the values of its parameters."""
    if not action.calls:
        return ""
    values = action.calls[0].parameters
    message = values.get("message")
    text = message.text if message is not None else " ".join(value.text for value in values.values())
    more = f"  (+{len(action.calls) - 1})" if len(action.calls) > 1 else ""
    return clean(text) + more


def all_texts(action: WrittenAction) -> str:
    """Every value of it, of all its wordings: what is searched."""
    return "\n".join(value.text for call in action.calls for value in call.parameters.values())


def action_with(act: WrittenAct, wanted: str) -> str:
    """Number of the first action with this text in it; empty: none has it."""
    sought = wanted.casefold()
    return next((each.id for each in act.actions if sought in all_texts(each).casefold()), "")


def said_text(act: WrittenAct) -> str:
    """What is said in an act; of one in which nothing is, what is done."""
    said = [what_text(each) for each in act.actions if each.calls and "message" in each.calls[0].parameters]
    return " ".join(said or [action_type(each) for each in act.actions])


def action_type(action: WrittenAction) -> str:
    """The name of its action; of wordings, of the first."""
    return action.calls[0].type if action.calls else "?"


def in_time_order(act: WrittenAct, times: Mapping[str, ActionTime]) -> list[WrittenAction]:
    """As they begin; of those that begin together, as they are written."""
    zero = ActionTime(0.0, 0.0)
    return sorted(act.actions, key=lambda action: times.get(action.id, zero).begin)


def action_rows(act: WrittenAct, checked: LoadResult, width: int, *, wrong_lines: frozenset[int]) -> list[ListRow]:
    """One row for each action, as they begin."""
    times = action_times(act, checked)
    scale = ActScale(
        BAR if width >= 74 else max(0, min(BAR, width - 48)), max((each.end for each in times.values()), default=0.0)
    )
    return [
        ListRow(action.id or f"\0{number}", _action_line(action, times, scale, width, wrong=action.line in wrong_lines))
        for number, action in enumerate(in_time_order(act, times))
    ]


def scale_line(act: WrittenAct, checked: LoadResult, width: int) -> StyledLine:
    """The head of the rows: `when`, `what`, and seconds above the bars."""
    times = action_times(act, checked)
    total = max((each.end for each in times.values()), default=0.0)
    head = f"   {'when':{WHEN}}what"
    cells = BAR if width >= 74 else max(0, min(BAR, width - 48))
    if cells < 8 or total <= 0:
        return ((head, "muted"),)
    step = next((each for each in (0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600) if total / each <= 5), 1200)
    ruler = [" "] * (cells + 8)
    at = 0.0
    while at <= total:
        place = round(at / total * (cells - 1))
        ruler[place : place + len(f"{at:g}")] = f"{at:g}"
        at += step
    left = width - cells - 2
    return ((head.ljust(left), "muted"), (" ", "plain"), ("".join(ruler).rstrip()[: cells + 1], "muted"))


def _action_line(
    action: WrittenAction, times: Mapping[str, ActionTime], scale: ActScale, width: int, *, wrong: bool
) -> StyledLine:
    left = max(20, width - scale.cells - 2)
    time = times.get(action.id, ActionTime(0.0, 0.0))
    mark = (" ✗ ", "fault") if wrong else ("   ", "plain")
    line: StyledLine = (
        (mark[0], "fault" if wrong else "plain"),
        fixed_span(when_text(action), WHEN - 1, "muted"),
        (" ", "plain"),
        (f"{action.id:>2} ", "accent"),
        fixed_span(action_type(action), 10, "strong"),
        (" ", "plain"),
        (what_text(action), "muted" if action.reason else "plain"),
    )
    return (*crop(line, left), *_bar(time, scale, left - line_width(crop(line, left))))


def _bar(time: ActionTime, scale: ActScale, room: int) -> StyledLine:
    if scale.cells < 8 or scale.seconds <= 0:
        return ()
    begin = round(time.begin / scale.seconds * (scale.cells - 1))
    end = max(begin + 1, round(time.end / scale.seconds * (scale.cells - 1)) + (1 if time.end > time.begin else 0))
    return ((" " * (room + 1 + begin), "plain"), ("█" * (end - begin), "accent"))
