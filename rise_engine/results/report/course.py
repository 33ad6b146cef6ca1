"""The course of a session, drawn like music: lanes above one another, in as many rows as readability requires."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.base.text import clean
from rise_engine.kernel.record_words import trigger_text
from rise_engine.results.analysis.course import interruption_between, seconds_without_engine
from rise_engine.results.analysis.model import ActorKind, Cue, Outage, Phase, PlayedAct, Point, SessionData
from rise_engine.results.report.document import Figure, cause_text, clock_text, seconds_text, with_interruption
from rise_engine.results.report.page import Drawing

SpanKind: TypeAlias = Literal["cue", "unanswered", "act", "filler", "part", "state", "other-state"]
MarkKind: TypeAlias = Literal["note", "mistake", "stop", "sync", "fault"]
MAX_RULES = 8
"""Maximum number of rules with a lane. Those with the most phases are chosen."""
_CHANNELS = ("speech", "gaze", "face", "body", "arms")
_ORDINARY_STATUSES = ("latched", "connected")
"""Points that are not drawn: a completed stop, and the connected robot."""
_MARKS: dict[str, MarkKind] = {
    "note": "note",
    "mistake": "mistake",
    "stop": "stop",
    "sync": "sync",
    "fault": "fault",
    "robot": "fault",
    "recovery": "fault",
    "scenario": "note",
}


class LaneSpan(Struct, frozen=True):
    """An event with a duration."""

    start: float
    end: float
    label: str
    hover: str
    kind: SpanKind


class MomentMark(Struct, frozen=True):
    """An event without duration."""

    at: float
    hover: str
    kind: MarkKind


class Lane(Struct, frozen=True):
    """One line of the course."""

    name: str
    spans: tuple[LaneSpan, ...] = ()
    marks: tuple[MomentMark, ...] = ()


def lanes_of(data: SessionData) -> list[Lane]:
    """Return every lane that is not empty, from the participant down to the rules."""
    end = data.facts.duration
    cues = (_cue_span(cue, end, data) for cue in data.cues if cue.undone_at is None)
    lanes = [Lane("cues", tuple(cues))]
    lanes += [Lane(f"robot {channel}", _parts_on(channel, data.acts, end)) for channel in _CHANNELS]
    lanes.append(Lane("robot, other", _parts_on("", data.acts, end)))
    actors: tuple[ActorKind, ...] = ("wizard", "rule", "program", "engine")
    lanes += [Lane(f"{actor} acts", _acts_of(actor, data.acts, end)) for actor in actors]
    lanes.append(Lane("marks", marks=tuple(_moments(data.points))))
    lanes += _rule_lanes(data.phases, data.outages)
    return [lane for lane in lanes if lane.spans or lane.marks]


def omitted_rules(phases: Iterable[Phase]) -> list[str]:
    """Return the rules without a lane because there are too many."""
    return _rules_by_size(phases)[MAX_RULES:]


def _cue_span(cue: Cue, end: float, data: SessionData) -> LaneSpan:
    text = f", \u201c{cue.text}\u201d" if cue.text else ""
    if cue.answered_at is None:
        return LaneSpan(cue.at, cue.at, "", f"cue at {clock_text(cue.at)}{text}, not answered", "unanswered")
    waits = with_interruption(
        seconds_text(cue.answered_at - cue.at),
        seconds_without_engine(data.outages, cue.at, cue.answered_at),
        interruption_between(data.interruptions, cue.at, cue.answered_at),
    )
    filled = f", filled after {seconds_text(cue.filled_at - cue.at)}" if cue.filled_at is not None else ""
    hover = f"cue at {clock_text(cue.at)}{text}, answered after {waits}{filled}"
    return LaneSpan(cue.at, min(end, cue.answered_at), "", hover, "cue")


def _parts_on(channel: str, acts: Iterable[PlayedAct], end: float) -> tuple[LaneSpan, ...]:
    """Return the actions that use a channel, or with an empty one, those that use only unknown channels."""
    spans = []
    for act in acts:
        for part in act.parts:
            fits = (
                channel in part.channels if channel else bool(part.channels) and not set(part.channels) & {*_CHANNELS}
            )
            if fits and part.accepted_at is not None:
                until = part.ended_at if part.ended_at is not None else end
                hover = f"{clock_text(part.accepted_at)} {part.type} in {act.act}: {part.text or part.status}"
                spans.append(LaneSpan(part.accepted_at, until, part.text, hover, "part"))
    return tuple(spans)


def _acts_of(actor: ActorKind, acts: Iterable[PlayedAct], end: float) -> tuple[LaneSpan, ...]:
    spans = []
    for act in acts:
        if act.actor == actor and act.started_at is not None:
            until = act.ended_at if act.ended_at is not None else end
            lasted = f"{clock_text(act.started_at)} {act.act}, {seconds_text(until - act.started_at)}"
            status = "" if act.status == "SUCCEEDED" else f", {act.status}"
            waited = seconds_text(act.response_s or 0.0)
            waited = with_interruption(waited, act.response_outage_s, act.response_interrupted)
            answered = f", answers after {waited}" if act.response_s is not None else ""
            filler = ", a filler" if act.filler else ""
            hover = f"{lasted}, by {cause_text(act.by, act.via)}{status}{filler}{answered * (not act.filler)}"
            spans.append(LaneSpan(act.started_at, until, act.act, hover, "filler" if act.filler else "act"))
    return tuple(spans)


def _moments(points: Iterable[Point]) -> Iterable[MomentMark]:
    for point in points:
        if (kind := _MARKS.get(point.kind)) is not None and point.name not in _ORDINARY_STATUSES:
            text = " ".join(filter(None, (point.name, point.value)))
            yield MomentMark(point.at, f"{clock_text(point.at)} {point.kind}: {text}", kind)


def _rule_lanes(phases: Sequence[Phase], outages: Sequence[Outage]) -> list[Lane]:
    lanes = []
    for rule in _rules_by_size(phases)[:MAX_RULES]:
        kinds: tuple[SpanKind, SpanKind] = ("state", "other-state")
        spans: list[LaneSpan] = []
        for phase in phases:
            if phase.rule == rule and phase.end > phase.start:
                time = with_interruption(
                    f"{clock_text(phase.start)} to {clock_text(phase.end)}",
                    seconds_without_engine(outages, phase.start, phase.end),
                )
                hover = f"{rule}: {phase.state}{trigger_text(phase.trigger)}, {time}"
                spans.append(LaneSpan(phase.start, phase.end, phase.state, hover, kinds[len(spans) % 2]))
        lanes.append(Lane(rule, tuple(spans)))
    return lanes


def _rules_by_size(phases: Iterable[Phase]) -> list[str]:
    counts: dict[str, int] = {}
    first: dict[str, float] = {}
    for phase in phases:
        if phase.end > phase.start:
            counts[phase.rule] = counts.get(phase.rule, 0) + 1
            first.setdefault(phase.rule, phase.start)
    most = sorted(counts, key=lambda rule: (-counts[rule], first[rule]))
    shown = sorted(most[:MAX_RULES], key=lambda rule: first[rule])
    return [*shown, *most[MAX_RULES:]]


WIDTH, LABELS, RIGHT = 1000.0, 128.0, 8.0
LANE, AXIS = 17.0, 16.0
ROW_SECONDS = (20, 30, 60, 120, 300, 600, 900, 1200, 1800, 3600, 7200, 14400, 28800, 86400)
"""Possible lengths of a row in seconds."""
FEW_ROWS, MAX_ROWS, SHORT = 4, 6, 600.0
"""The maximum numbers of rows for sessions of up to `SHORT` seconds, and for longer ones."""
CHARACTER = 5.9
"""The maximum width of a label's character, in units."""
_TICKS = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400)


def course_figure(data: SessionData) -> Figure | None:
    """Draw the course, also in characters. None: there are no events.

    :param data: one session.
    """
    lanes = lanes_of(data)
    if not lanes or data.facts.duration <= 0:
        return None
    omitted = omitted_rules(data.phases)
    more = f" Rules without a lane: {', '.join(omitted)}." if omitted else ""
    return Figure(
        caption="A cue lasts until its answer. An act lasts from its turn to its end. An action of the robot begins "
        f"when the robot confirms it. Point at something to read what it is.{more}",
        svg=_draw(lanes, data.facts.duration),
        text=lambda width: _lines(lanes, data.facts.duration, width),
    )


def row_seconds(duration: float) -> float:
    """Choose the seconds of a row: a round number that gives few rows."""
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
    """Draw the lanes in characters: blocks for spans, bars for moments."""
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
