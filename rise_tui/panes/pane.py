"""What all lists and panes have in common: a title bar that shows the focus, rows, and a filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.message import Message
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.actions import BY_ID, Place
from rise_tui.messages import PaneAsked, Told
from rise_tui.store import Store, Topic
from rise_tui.text import Line, Row, Span, plain, spread, width_of
from rise_tui.widgets.line import Lines
from rise_tui.widgets.rows import RowList, RowView

Tab = tuple[str, str]
"""A pane's id and its title."""


class TitleBar(Lines):
    """A pane's title, or the tabs of its group; brighter while the pane has the focus."""

    DEFAULT_CSS = """
    TitleBar { background: $rise-bar; }
    TitleBar.-focused { background: $rise-bar-focused; }
    """

    def __init__(self, pane: str, title: str) -> None:
        super().__init__(id=f"{pane}-title")
        self.tabs: tuple[Tab, ...] = ((pane, title),)
        self._pane = pane
        self._right: Line = ()
        self._places: list[tuple[int, int, str]] = []

    def show_tabs(self, tabs: tuple[Tab, ...]) -> None:
        self.tabs = tabs
        self.draw(self._right)

    def draw(self, right: Line) -> None:
        self._right = right
        spans: list[Span] = []
        self._places.clear()
        column = 0
        for pane, title in self.tabs:
            own = pane == self._pane
            text = f" {title.upper()} " if own else f" {title.lower()} "
            spans.append((text, "accent" if own else "muted"))
            self._places.append((column, column + len(text), pane))
            column += len(text)
        note: Line = (*right, (" ", "plain")) if right else ()
        if width_of(spans) + width_of(note) > self.size.width:  # tabs before notes, but not before what must be seen
            if any(tone == "wait" for _, tone in right):
                spans, self._places = [span for span in spans if span[1] == "accent"], []
            else:
                note = ()
        self.show(spread(tuple(spans), note, self.size.width))

    def on_resize(self, event: events.Resize) -> None:
        self.draw(self._right)

    def on_click(self, event: events.Click) -> None:
        for start, end, pane in self._places:
            if start <= event.x < end:
                self.post_message(PaneAsked(pane))


class FilterBar(Input):
    """Where the filter of a list is typed."""

    DEFAULT_CSS = """
    FilterBar, FilterBar:focus {
        height: 1; border: none; padding: 0 1; background: $panel; display: none;
        &.-open { display: block; }
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("tab", "app.focus_next", show=False)]

    class Left(Message):
        """Esc: the filter is given up."""

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            event.prevent_default()
            self.post_message(self.Left())


class Pane(Vertical):
    """A list or pane of the console."""

    PLACE: ClassVar[Place]
    TITLE: ClassVar[str]
    TOPICS: ClassVar[frozenset[Topic]]
    """What in the store it shows."""
    EMPTY: ClassVar[str] = ""
    """What it says when there is nothing to show."""

    DEFAULT_CSS = """
    Pane { height: 1fr; width: 1fr; }
    """

    def __init__(self, store: Store) -> None:
        super().__init__(id=self.PLACE)
        self.store = store
        self.filter_text = ""
        self.title = TitleBar(self.PLACE, self.TITLE)
        self.filter_bar = FilterBar(placeholder="filter; esc clears", select_on_focus=False)

    @property
    def rows(self) -> RowView:
        """The list that takes the pane's focus."""
        raise NotImplementedError

    def compose(self) -> ComposeResult:
        yield self.title
        yield from self.body()
        yield self.filter_bar

    def body(self) -> Sequence[Widget]:
        return [self.rows]

    def repaint(self) -> None:
        """Make the pane's rows anew from the store; only what differs reaches the terminal."""
        raise NotImplementedError

    def do(self, action: str) -> None:
        """Carry out one of the pane's actions from the registry."""
        raise NotImplementedError

    def action_do(self, action: str) -> None:
        """As `do`, but what ends or deletes something waits until the wizard can have seen which row it would hit."""
        if self.rows.just_fell and "delete" in BY_ID[action].keys:
            self.post_message(Told("the list has just changed; press again"))
        else:
            self.do(action)

    def escape(self) -> bool:
        """Esc: leave the pane's transient state. False when there is none."""
        if self.filter_text or self.filter_bar.has_class("-open"):
            self.close_filter(keep=False)
            return True
        return False

    # --- focus and filter ---

    def on_descendant_focus(self) -> None:
        self.title.add_class("-focused")

    def on_descendant_blur(self) -> None:
        self.title.remove_class("-focused")

    def open_filter(self) -> None:
        self.filter_bar.add_class("-open")
        self.filter_bar.value = self.filter_text
        self.filter_bar.focus()

    def close_filter(self, *, keep: bool) -> None:
        self.filter_bar.remove_class("-open")
        if not keep:
            self.filter_text = ""
        self.rows.focus()
        self.repaint()

    @on(Input.Changed)
    def _filter_typed(self, event: Input.Changed) -> None:
        if event.input is self.filter_bar:
            event.stop()
            if self.filter_bar.has_class("-open") and event.value != self.filter_text:
                self.filter_text = event.value
                self.repaint()

    @on(Input.Submitted)
    def _filter_taken(self, event: Input.Submitted) -> None:
        if event.input is self.filter_bar:
            event.stop()
            self.close_filter(keep=True)

    @on(FilterBar.Left)
    def _filter_left(self) -> None:
        self.close_filter(keep=False)

    @on(RowView.Resized)
    def _resized(self, event: RowView.Resized) -> None:
        event.stop()
        self.repaint()


class ListPane(Pane):
    """A pane that is one list in memory."""

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.list = RowList(id=f"{self.PLACE}-rows")

    @property
    def rows(self) -> RowList:
        return self.list

    def make_rows(self, width: int) -> list[Row]:
        """The rows in `width` cells."""
        raise NotImplementedError

    def subtitle(self) -> Line:
        """What stands at the right of the title."""
        return ()

    def repaint(self) -> None:
        width = self.list.row_width
        if width <= 0:
            return
        rows = self.make_rows(width)
        total = len(rows)
        if self.filter_text:
            wanted = self.filter_text.casefold()
            rows = [row for row in rows if row.selectable and wanted in plain(row.line).casefold()]
            note = f"/{self.filter_text}  {len(rows)} of {total}"
            self.title.draw(((note, "wait"),))
        else:
            self.title.draw(self.subtitle())
        if not rows:
            empty = "nothing matches; esc clears the filter" if self.filter_text else self.EMPTY
            rows = [Row("", ((f" {empty}", "muted"),), selectable=False)]
        self.list.show(rows)
