"""Lists that repaint rows, and not themselves."""

from __future__ import annotations

from textual import events
from textual.geometry import Size
from textual.reactive import Reactive
from textual.scroll_view import ScrollView
from textual.scrollbar import ScrollBar

from rise_tui.quiet.scrollbar import QuietScrollBar


class QuietScrollView(ScrollView):
    """A line-API view whose growth repaints nothing: appending a row of a log costs that row.

    `Widget.virtual_size` is declared with a layout of the whole screen.
    """

    virtual_size: Reactive[Size] = Reactive(Size(0, 0), repaint=False)
    _widths: tuple[object, int, int] | None = None
    """What they were measured for, and those of a painted line and of a row."""

    def resize_content(self, size: Size) -> None:
        """Give the content its size: moves the scrollbar and nothing else."""
        if size == self.virtual_size:
            return
        self.virtual_size = size
        if self.container_size:
            self._scroll_update(size)

    def _on_focus(self, event: events.Focus) -> None:
        """As `Widget._on_focus`, but without repainting all of it: a subclass repaints what shows its focus."""
        event.prevent_default()
        self.has_focus = True
        if self.parent is not None:
            self.parent.post_message(events.DescendantFocus(self))

    def _on_blur(self, event: events.Blur) -> None:
        event.prevent_default()
        self.has_focus = False
        if self.parent is not None:
            self.parent.post_message(events.DescendantBlur(self))

    @property
    def vertical_scrollbar(self) -> ScrollBar:
        """As the stock one, but ours."""
        if self._vertical_scrollbar is None:
            bar = QuietScrollBar(vertical=True, name="vertical", thickness=self.scrollbar_size_vertical)
            self._vertical_scrollbar = bar
            bar.display = False
            self.app._start_widget(self, bar)
        return self._vertical_scrollbar

    def _measured(self) -> tuple[object, int, int]:
        """Working this out takes as long as painting a row, and it is asked for at each."""
        of = self._size, self.show_vertical_scrollbar, self.styles._cache_key
        widths = self._widths
        if widths is None or widths[0] != of:
            widths = self._widths = of, self.size.width, self.scrollable_content_region.width
        return widths

    @property
    def painted_width(self) -> int:
        """Cells of a painted line."""
        return self._measured()[1]

    @property
    def row_width(self) -> int:
        """Cells of one row, without the scrollbar."""
        return self._measured()[2]
