"""A scrollbar that repaints when it looks different, and row by row."""

from __future__ import annotations

import asyncio
from typing import Self

from rich.segment import Segment
from rich.style import Style
from textual.geometry import Region
from textual.reactive import Reactive
from textual.scrollbar import ScrollBar, ScrollBarRender
from textual.strip import Strip


class QuietScrollBar(ScrollBar):
    """The stock one repaints whole at every step of a list, also where its thumb stays where it is: 2 ms each."""

    window_virtual_size: Reactive[int] = Reactive(100, repaint=False)
    window_size: Reactive[int] = Reactive(0, repaint=False)
    position: Reactive[float] = Reactive(0, repaint=False)

    _bar: tuple[object, list[Segment]] = None, []
    """What it was painted for, and a segment for each row."""
    _following = False

    def watch_window_virtual_size(self) -> None:
        self._follow()

    def watch_window_size(self) -> None:
        self._follow()

    def watch_position(self) -> None:
        self._follow()

    def refresh(self, *regions: Region, repaint: bool = True, layout: bool = False, recompose: bool = False) -> Self:
        """Lists ask for this whenever their length changes: it costs the rows that look different, usually none."""
        if regions or layout or recompose or not repaint or not self.is_attached or not self.size:
            return super().refresh(*regions, repaint=repaint, layout=layout, recompose=recompose)
        self._follow()
        return self

    def _follow(self) -> None:
        """Look soon, and once, however many of its values change at a step."""
        if not self._following:
            self._following = True
            asyncio.get_running_loop().call_soon(self._look)

    def _look(self) -> None:
        """Repaint the rows that look different."""
        self._following = False
        if not self.size:
            return
        before, after = self._bar[1], self._segments(self.size.height)
        rows = [y for y, (old, new) in enumerate(zip(before, after, strict=False)) if old != new]
        if len(before) != len(after):
            super().refresh()
        elif rows:
            self.refresh(Region(0, rows[0], self.size.width, rows[-1] + 1 - rows[0]))

    def _segments(self, height: int) -> list[Segment]:
        bar = self.render()
        assert isinstance(bar, ScrollBarRender)
        look = bar.style
        ground = self.visual_style.rich_style
        what = height, bar.virtual_size, bar.window_size, bar.position, look, ground
        if self._bar[0] != what:
            assert isinstance(look, Style) and look.color is not None and look.bgcolor is not None
            made = bar.render_bar(
                height, bar.virtual_size, bar.window_size, bar.position, bar.thickness, True, look.bgcolor, look.color
            )
            self._bar = what, [Segment(text, ground + style if style else ground) for text, style, _ in made.segments]
        return self._bar[1]

    def render_line(self, y: int) -> Strip:
        segments = self._segments(self.size.height)
        return Strip([segments[y]] if y < len(segments) else [], self.size.width)
