"""Charts of waiting times over the reference bands: histograms, dot plots, and courses over sessions.

All charts of a report share one scale of seconds, so that they can be compared by eye. Values beyond it are counted in
the last bin, or drawn at the edge.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from msgspec import Struct

from rise_engine.base.text import clean
from rise_engine.results.analysis.statistics import Summary, summarise
from rise_engine.results.report.document import Figure, number_text, seconds_text
from rise_engine.results.report.page import Drawing
from rise_engine.results.report.session_facts import BANDS, BIN, LAST_BIN, LatencyFacts, LatencyPart, histogram

WIDTH = 1000.0
_LEVELS = " \u2581\u2582\u2583\u2584\u2585\u2586\u2587\u2588"


class DotRow(Struct, frozen=True):
    """One line of a dot plot."""

    name: str
    values: tuple[float, ...]
    """One dot for each value."""
    hovers: tuple[str, ...]
    note: str = ""
    """The numbers of the row, in words."""


class CourseOfSessions(Struct, frozen=True):
    """A measure of one wizard from session to session."""

    name: str
    summaries: tuple[Summary | None, ...]
    """Summaries of the sessions in their order. None: there is nothing to measure."""
    hovers: tuple[str, ...]


# --- the parts of a latency, one histogram each --------------------------------------------------------------------


def latency_figure(facts: LatencyFacts) -> Figure:
    """Draw small histograms of the parts and a larger one of the whole response, on the same scale."""
    shown = [facts.response, *(part for part in facts.parts if part.values)]
    cell, gap, tall, small = 318.0, 23.0, 136.0, 92.0
    rows = (len(shown) - 1 + 2) // 3
    drawing = Drawing(
        WIDTH,
        tall + 60 + rows * (small + 36),
        "Histograms of the response and its parts",
        "; ".join(f"{part.name}: {_summary_words(part.summary)}" for part in shown),
        name="histograms",
    )
    _draw_histogram(drawing, facts.response, 0, 32, WIDTH, tall, names=True)
    for at, part in enumerate(shown[1:]):
        left, top = (at % 3) * (cell + gap), tall + 84 + (at // 3) * (small + 36)
        _draw_histogram(drawing, part, left, top, cell, small - 16, names=False)
    return Figure(
        caption=f"Each bar counts acts within {BIN:g} s. The last bar counts all from {LAST_BIN:g} s on. The line "
        "is the median. The shades are the reference bands, with their limits above.",
        svg=(drawing.whole(),),
        text=lambda width: _histogram_lines(shown, width),
    )


def _draw_histogram(
    drawing: Drawing, part: LatencyPart, left: float, top: float, width: float, height: float, *, names: bool
) -> None:
    counts = histogram(part.values)
    unit = width / ((len(counts)) * BIN)
    bottom = top + height
    _draw_bands(drawing, left, top, unit, width, height, names=names)
    most = max(counts) or 1
    for at, count in enumerate(counts):
        if count:
            tall = count / most * (height - 12)
            until = f"{(at + 1) * BIN:g}" if at + 1 < len(counts) else "more"
            hover = f"{part.name}: {count} from {at * BIN:g} to {until} s"
            drawing.box(left + at * BIN * unit + 0.75, bottom - tall, BIN * unit - 1.5, tall, "bar", hover)
            if count == most and at == counts.index(most):
                _draw_count(drawing, count, left + at * BIN * unit, BIN * unit, bottom - tall, is_first=at < 2)
    drawing.line(left, bottom, left + width, bottom, "axis-line")
    summary = part.summary
    if summary is not None:
        x = left + min(summary.median, LAST_BIN + BIN / 2) * unit
        drawing.line(x, top, x, bottom, "median", f"median {seconds_text(summary.median)}")
    for second in (1, 2, 4, 6):
        drawing.text(left + second * unit, bottom + 12, f"{second} s" if second < 6 else "6+ s", "axis", "middle")
    drawing.text(left, bottom + 12, "0", "axis")
    if names:
        drawing.text(left, top - 19, f"{part.name}: {part.about}", "chart-title")
        drawing.text(left + width, top - 19, _summary_words(summary), "chart-note", "end")
    else:
        drawing.text(left, top - 5, f"{part.name}: {part.about}", "chart-title")
        drawing.text(
            left + width,
            top - 5,
            f"median {seconds_text(summary.median)}" if summary is not None else "none",
            "chart-note",
            "end",
        )


def _draw_count(drawing: Drawing, count: int, x: float, width: float, top: float, *, is_first: bool) -> None:
    """Write the count of the highest bar above it, or beside it where there is no room to the left."""
    if is_first:
        drawing.text(x + width + 3, top + 9, str(count), "axis")
    else:
        drawing.text(x + width / 2, top - 3, str(count), "axis", "middle")


def _draw_bands(
    drawing: Drawing, left: float, top: float, unit: float, width: float, height: float, *, names: bool = False
) -> None:
    start = 0.0
    for at, band in enumerate(BANDS):
        end = min(band.limit * unit, width)
        if end > start:
            drawing.box(left + start, top, end - start, height, f"band-{at}", f"{band.name}: {band.known}")
            if names:
                name = band.name if end - start > 60 else band.short
                drawing.text(left + (start + end) / 2, top - 4, name, "band-name", "middle")
        start = end


def _summary_words(summary: Summary | None) -> str:
    if summary is None:
        return "none"
    return (
        f"n {summary.n}, median {number_text(summary.median)}, "
        f"middle half {number_text(summary.lower)}\u2013{number_text(summary.upper)} s"
    )


def _histogram_lines(parts: Sequence[LatencyPart], width: int) -> list[str]:
    """Draw a line of blocks for each part. A bin gets as many characters as fit."""
    bins = round(LAST_BIN / BIN) + 1
    label = 11
    each = 2 if width >= label + 2 * bins + 12 else 1
    limits = [" "] * (bins * each)
    ruler = ["\u2500"] * (bins * each)
    for band in BANDS[:-1]:
        place = round(band.limit / BIN) * each
        ruler[place] = "\u253c"
        limits[place : place + len(band.short)] = band.short
    lines = [" " * label + "".join(limits) + " s", " " * label + "".join(ruler)]
    for part in parts:
        counts = histogram(part.values)
        most = max(counts) or 1
        blocks = "".join(_LEVELS[0 if not count else max(1, round(count / most * 8))] * each for count in counts)
        middle = part.summary.median if part.summary is not None else None
        lines.append(f"{part.name:<{label}}{blocks} {seconds_text(middle)}")
    lines.append(f"By seconds, in steps of {BIN:g}; ┼ the limits of the bands. Right: the median.")
    return lines


# --- one dot for each session --------------------------------------------------------------------------------------


def dot_plot(title: str, rows: Sequence[DotRow], caption: str) -> Figure:
    """Draw a line of dots for each row, with the median and the middle half, over the reference bands."""
    line, label, right = 34.0, 190.0, 150.0
    drawing = Drawing(
        WIDTH,
        len(rows) * line + 44,
        title,
        "; ".join(f"{row.name}: {_summary_words(summarise(row.values))}" for row in rows),
        name="dots",
    )
    room, top = WIDTH - label - right, 18.0
    unit = room / _scale([value for row in rows for value in row.values])
    _draw_bands(drawing, label, top, unit, room, len(rows) * line, names=True)
    for at, row in enumerate(rows):
        middle = top + at * line + line / 2
        drawing.line(label, middle, label + room, middle, "base")
        drawing.text(label - 10, middle + 4, clean(row.name), "lane", "end")
        drawing.text(label + room + 10, middle + 4, row.note, "chart-note")
        if (summary := summarise(row.values)) is not None:
            lower, upper = min(room, summary.lower * unit), min(room, summary.upper * unit)
            drawing.box(label + lower, middle - 6, max(1.0, upper - lower), 12, "half", _summary_words(summary))
            x = label + min(room, summary.median * unit)
            drawing.line(x, middle - 11, x, middle + 11, "median", f"median {seconds_text(summary.median)}")
        for value, hover in zip(row.values, row.hovers, strict=True):
            drawing.dot(label + min(room, value * unit), middle, 3.2, "dot", hover)
    bottom = top + len(rows) * line
    drawing.line(label, bottom, label + room, bottom, "axis-line")
    _draw_seconds(drawing, label, bottom + 14, unit, room)
    return Figure(caption=caption, svg=(drawing.whole(),), text=lambda width: _dot_lines(rows, width))


def _draw_seconds(drawing: Drawing, left: float, y: float, unit: float, room: float) -> None:
    second = 0
    while second * unit <= room + 1e-6:
        drawing.text(left + second * unit, y, f"{second} s" if second else "0", "axis", "middle")
        second += 1 if room / unit <= 8 else max(2, round(room / unit / 6))


def _scale(values: Sequence[float]) -> float:
    """Choose how many seconds a drawing shows: 2.5 to 20, so that most bands are visible."""
    return min(20.0, max(2.5, 1.06 * max(values, default=0.0)))


def _dot_lines(rows: Sequence[DotRow], width: int) -> list[str]:
    label = min(24, max((len(clean(row.name)) for row in rows), default=0) + 2)
    room = max(20, width - label - 14)
    scale = _scale([value for row in rows for value in row.values])
    lines = []
    for row in rows:
        cells = ["\u00b7"] * room
        summary = summarise(row.values)
        if summary is not None:
            for at in range(_cell(summary.lower, scale, room), _cell(summary.upper, scale, room) + 1):
                cells[at] = "\u2500"
        for value in row.values:
            cells[_cell(value, scale, room)] = "\u25cf"
        if summary is not None:
            cells[_cell(summary.median, scale, room)] = "\u2503"
        middle = seconds_text(summary.median) if summary is not None else "none"
        lines.append(clean(row.name)[: label - 1].ljust(label) + "".join(cells) + f" {middle}")
    lines.append(" " * label + "0" + f"{scale:.1f} s".rjust(room - 1))
    lines.append("\u25cf a session's median response   \u2503 their median   \u2500 their middle half")
    return lines


def _cell(value: float, scale: float, room: int) -> int:
    return min(room - 1, int(value / scale * room))


# --- from session to session ---------------------------------------------------------------------------------------


def drift_figure(title: str, courses: Sequence[CourseOfSessions], caption: str) -> Figure:
    """Draw the median and the middle half of each wizard's sessions in their order, on the same scale."""
    height, label, gap = 84.0, 190.0, 26.0
    drawing = Drawing(
        WIDTH,
        len(courses) * (height + gap) + 14,
        title,
        "; ".join(
            f"{course.name}: medians {', '.join(seconds_text(each.median) for each in course.summaries if each)}"
            for course in courses
        ),
        name="drift",
    )
    most = _scale([each.upper for course in courses for each in course.summaries if each is not None])
    sessions = max((len(course.summaries) for course in courses), default=1)
    room = WIDTH - label - 10
    step = min(60.0, room / max(1, sessions))
    every = max(1, math.ceil(18 / step))
    for at, course in enumerate(courses):
        top = 8 + at * (height + gap)
        bottom = top + height
        _draw_level_bands(drawing, label, top, step * sessions, height, most)
        drawing.text(label - 34, top + height / 2 + 4, clean(course.name), "lane", "end")
        for second in range(int(most) + 1):
            drawing.text(label - 6, bottom - second / most * height + 3.5, f"{second} s", "axis", "end")
        points = []
        for number, summary in enumerate(course.summaries):
            x = label + (number + 0.5) * step
            if number % every == 0:
                drawing.text(x, bottom + 12, str(number + 1), "axis", "middle")
            if summary is None:
                continue
            y = [bottom - min(most, value) / most * height for value in (summary.lower, summary.median, summary.upper)]
            drawing.line(x, y[0], x, y[2], "whisker", course.hovers[number])
            points.append((x, y[1]))
        drawing.path(points, "trend") if len(points) > 1 else None
        for (x, y_median), hover in zip(
            points, [h for h, s in zip(course.hovers, course.summaries, strict=True) if s is not None], strict=True
        ):
            drawing.dot(x, y_median, 3.2, "dot", hover)
    return Figure(caption=caption, svg=(drawing.whole(),))


def _draw_level_bands(drawing: Drawing, left: float, top: float, width: float, height: float, most: float) -> None:
    start = 0.0
    for at, band in enumerate(BANDS):
        end = min(band.limit, most)
        if end > start:
            y = top + height - end / most * height
            drawing.box(left, y, width, (end - start) / most * height, f"band-{at}", f"{band.name}: {band.known}")
        start = max(start, end)
