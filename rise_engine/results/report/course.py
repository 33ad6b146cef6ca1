"""The course of a session, drawn like music: lanes above one another, in as many rows as it needs to be read."""

from __future__ import annotations

import math

from rise_engine.base.text import clean
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.report.document import Figure, clock_text
from rise_engine.results.report.lanes import Lane, LaneSpan, MomentMark, lanes_of, left_out_rules
from rise_engine.results.report.svg import Drawing

WIDTH, LABELS, RIGHT = 1000.0, 128.0, 8.0
LANE, AXIS = 17.0, 16.0
ROW_SECONDS = (20, 30, 60, 120, 300, 600, 900, 1200, 1800, 3600, 7200, 14400, 28800, 86400)
"""How much of the session a row may show."""
FEW_ROWS, MAX_ROWS, SHORT = 4, 6, 600.0
"""At most so many rows, for sessions of up to `SHORT` seconds and for longer ones."""
CHARACTER = 5.9
"""Units that a character of a label takes, at most."""
_TICKS = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400)


def course_figure(data: SessionData) -> Figure | None:
    """The drawing, and the same in characters; None when nothing happened.

    :param data: one session.
    """
    lanes = lanes_of(data)
    if not lanes or data.facts.duration <= 0:
        return None
    left_out = left_out_rules(data.phases)
    more = f" Rules without a lane: {', '.join(left_out)}." if left_out else ""
    return Figure(
        caption="A cue lasts until its answer; acts from their turn to their end; what the robot did from when it "
        f"confirmed. Point at something to read what it is.{more}",
        svg=_draw(lanes, data.facts.duration),
        text=lambda width: _lines(lanes, data.facts.duration, width),
    )


def row_seconds(duration: float) -> float:
    """How many seconds of the session a row shows: a round number, so that there are few rows."""
    if duration < ROW_SECONDS[0]:
        return max(1.0, math.ceil(duration))
    most = FEW_ROWS if duration <= SHORT else MAX_ROWS
    fitting = next((each for each in ROW_SECONDS if duration <= each * most), None)
    return float(fitting) if fitting is not None else float(math.ceil(duration / most))


def _draw(lanes: list[Lane], duration: float) -> tuple[str, ...]:
    seconds = row_seconds(duration)
    return tuple(
        _draw_row(lanes, row * seconds, min(duration, (row + 1) * seconds), seconds)
        for row in range(max(1, math.ceil(duration / seconds - 1e-9)))
    )


def _draw_row(lanes: list[Lane], start: float, end: float, seconds: float) -> str:
    names = ", ".join(lane.name for lane in lanes)
    drawing = Drawing(
        WIDTH,
        len(lanes) * LANE + AXIS + 2,
        f"Course from {clock_text(start)} to {clock_text(end)}",
        f"Lanes: {names}. The tables of acts, phases and notes say the same in words.",
        name="course",
    )
    top = 1.0
    unit = (WIDTH - LABELS - RIGHT) / seconds
    bottom = top + len(lanes) * LANE

    def x(at: float) -> float:
        return LABELS + (min(max(at, start), end) - start) * unit

    step = next((each for each in _TICKS if seconds / each <= 12), _TICKS[-1])
    tick = math.ceil(start / step - 1e-9) * step
    while tick <= end + 1e-9:
        drawing.line(x(tick), top, x(tick), bottom, "tick")
        drawing.text(x(tick), bottom + 12, clock_text(tick), "axis", "middle")
        tick += step
    for place, lane in enumerate(lanes):
        middle = top + place * LANE + LANE / 2
        drawing.text(LABELS - 8, middle + 3.5, _shorten(lane.name, 22), "lane", "end")
        drawing.line(x(start), middle, x(end), middle, "base")
        for span in lane.spans:
            if span.end >= start and span.start <= end and (span.start < end or span.start == span.end):
                _draw_span(drawing, span, x(span.start), x(span.end), middle)
        for mark in lane.marks:
            if start <= mark.at < end or mark.at == end == start + seconds:
                _draw_mark(drawing, mark, x(mark.at), middle, top, bottom)
    return drawing.whole()


def _draw_span(drawing: Drawing, span: LaneSpan, left: float, right: float, middle: float) -> None:
    if span.kind in ("cue", "unanswered"):
        drawing.line(left, middle - 5, left, middle + 5, f"{span.kind}-mark", span.hover)
        if span.kind == "cue":
            drawing.box(left, middle - 1.5, max(1.5, right - left), 3, "cue", span.hover)
        return
    width = max(1.5, right - left - 0.75)
    drawing.box(left, middle - LANE / 2 + 2, width, LANE - 4, span.kind, span.hover)
    room = int((width - 6) / CHARACTER)
    if span.label and room >= min(4, len(span.label)):
        drawing.text(left + 3, middle + 3.2, _shorten(span.label, room), "on")


def _draw_mark(drawing: Drawing, mark: MomentMark, x: float, middle: float, top: float, bottom: float) -> None:
    if mark.kind == "stop":
        drawing.line(x, top, x, bottom, "stop", mark.hover)
    drawing.dot(x, middle, 3.5, f"mark-{mark.kind}", mark.hover)


def _shorten(text: str, room: int) -> str:
    seen = clean(text)
    return seen if len(seen) <= room else seen[: max(1, room - 1)] + "\u2026"


def _lines(lanes: list[Lane], duration: float, width: int) -> list[str]:
    """The lanes in characters: a block where something lies, a bar where something happened."""
    label = min(16, max(len(clean(lane.name)) for lane in lanes) + 1)
    room = width - label
    lines = []
    for lane in lanes:
        cells = ["\u00b7"] * room
        for span in lane.spans:
            first, last = _cell(span.start, duration, room), _cell(span.end, duration, room)
            sign = {"other-state": "\u2592", "filler": "\u2592", "unanswered": "?"}.get(span.kind, "\u2588")
            cells[first : last + 1] = [sign] * (last - first + 1)
        for mark in lane.marks:
            cells[_cell(mark.at, duration, room)] = {"stop": "!", "mistake": "x", "fault": "!"}.get(mark.kind, "|")
        lines.append(_shorten(lane.name, label - 1).ljust(label) + "".join(cells))
    end = clock_text(duration)
    lines.append(" " * label + "0:00" + end.rjust(room - 4))
    lines += ["", "\u2588 it lasted   \u2592 a filler; a rule's next state   ? a cue without answer"]
    return [*lines, "| a note or mark   x a mistake   ! a stop or fault"]


def _cell(at: float, duration: float, room: int) -> int:
    return min(room - 1, max(0, int(at / duration * room)))
