"""Painting in pieces: a few rows at a time, and of each widget only what is to be seen of those."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

from textual._compositor import Compositor, ReflowResult
from textual._context import visible_screen_stack
from textual.geometry import Region, Size
from textual.screen import Screen
from textual.strip import Strip
from textual.widget import Widget

Painter: TypeAlias = Callable[..., list[Strip]]
Span: TypeAlias = tuple[int, int]
"""Columns, from and to."""


class RowCompositor(Compositor):
    """Whatever is to be painted can be taken in pieces of a few rows.

    The stock one cuts each widget that touches the rectangle around all changes at every border of any other: 3 ms for
    two lines at the two ends of the screen, 10 ms for a list. Pieces go from the top to the bottom and from the top
    again, so that what changes all the time keeps nothing else waiting.
    """

    def __init__(self) -> None:
        super().__init__()
        self._next_row = 0
        self._painters: dict[Widget, Painter] = {}

    @property
    def has_more(self) -> bool:
        """Whether something is still to be painted."""
        return bool(self._dirty_regions)

    def paint_piece(self, rows: int, behind: Sequence[Screen[Any]], put: Callable[[int, int, Strip], None]) -> None:
        """Paint so many rows: `put` gets each strip and its place. `behind`: the screens below this one."""
        visible_screen_stack.set(list(behind))
        spans = self._take_spans(rows)
        for widget, (region, clip) in self.visible_widgets.items():  # the foremost first
            shown = region.intersection(clip)
            mine = [y for y in spans if shown.y <= y < shown.bottom and _overlap(spans[y], shown)]
            if not mine:
                continue
            top = mine[0]
            lines = Region(shown.x - region.x, top - region.y, shown.width, mine[-1] + 1 - top)
            strips = self._painter(widget)(crop=lines)
            for y in mine:
                strip = strips[y - top]
                for start, end in _within(spans[y], shown):
                    put(start, y, strip.crop(start - shown.x, end - shown.x))
                spans[y] = _outside(spans[y], shown)
                if not spans[y]:
                    del spans[y]
            if not spans:
                break
        if not self._dirty_regions:
            self._painters.clear()

    def update_widgets(self, widgets: set[Widget]) -> None:
        if widgets:
            self._painters.clear()
        super().update_widgets(widgets)

    def reflow(self, parent: Widget, size: Size) -> ReflowResult:
        self._painters.clear()
        return super().reflow(parent, size)

    def reflow_visible(self, parent: Widget, size: Size) -> set[Widget]:
        self._painters.clear()
        return super().reflow_visible(parent, size)

    def _painter(self, widget: Widget) -> Painter:
        """What gives a widget's lines, as `Widget.render_lines` does.

        That looks up its colours and sizes each time, which takes three times as long as a line; here it is done once
        for all pieces of a frame in which nothing else becomes due.
        """
        painter = self._painters.get(widget)
        if painter is None:
            painter = self._painters[widget] = _painter_of(widget)
        return painter

    def _take_spans(self, rows: int) -> dict[int, list[Span]]:
        """What is to be painted in the next rows where there is anything, by row from the top."""
        regions = [region for each in self._dirty_regions if (region := each.intersection(self.size.region))]
        ahead = [max(region.y, self._next_row) for region in regions if region.bottom > self._next_row]
        top = min(ahead or (region.y for region in regions), default=0)
        bottom = self._next_row = top + rows
        spans: dict[int, list[Span]] = {}
        self._dirty_regions = set()
        for x, y, width, height in regions:
            for row in range(max(y, top), min(y + height, bottom)):
                spans.setdefault(row, []).append((x, x + width))
            if y < top:
                self._dirty_regions.add(Region(x, y, width, min(y + height, top) - y))
            if y + height > bottom:
                self._dirty_regions.add(Region(x, max(y, bottom), width, y + height - max(y, bottom)))
        return {y: _merged(spans[y]) for y in sorted(spans)}


def _painter_of(widget: Widget) -> Painter:
    known = type(widget).render_lines is Widget.render_lines
    titled = widget._border_title is not None or widget._border_subtitle is not None
    if not known or widget.BLANK or titled or widget.hover_style._link_id:
        return widget.render_lines
    cache = widget._styles_cache
    cache._simple_strip = None
    return partial(
        cache.render,
        widget.styles,
        widget.region.size,
        *widget.background_colors,
        widget.render_line,
        widget.get_line_filters(),
        None,
        None,
        content_size=widget.content_region.size,
        padding=widget.styles.padding,
        opacity=widget.opacity,
        ansi_theme=widget.app.ansi_theme,
        native_ansi=widget.app.native_ansi_color,
    )


def _merged(spans: list[Span]) -> list[Span]:
    """The same columns, each once, from left to right."""
    found: list[Span] = []
    for start, end in sorted(spans):
        if found and start <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((start, end))
    return found


def _overlap(spans: list[Span], region: Region) -> bool:
    return any(start < region.right and end > region.x for start, end in spans)


def _within(spans: list[Span], region: Region) -> list[Span]:
    cut = ((max(start, region.x), min(end, region.right)) for start, end in spans)
    return [(start, end) for start, end in cut if start < end]


def _outside(spans: list[Span], region: Region) -> list[Span]:
    left = ((start, min(end, region.x)) for start, end in spans)
    right = ((max(start, region.right), end) for start, end in spans)
    return [(start, end) for start, end in (*left, *right) if start < end]
