"""What all lists and panes have in common: a title bar that shows the focus, rows, and a filter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widget import Widget

from rise_tui.actions import BY_ID, Place
from rise_tui.messages import PaneAsked, Told
from rise_tui.model.filtering import BrokenFilter, Filter
from rise_tui.model.store import Store, Topic
from rise_tui.text import Line, Row, Span, marked, plain, spread, width_of
from rise_tui.widgets.ask import AskBar
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
        self.filter: Filter | None = None
        """The last one that could be used; None when every row is shown."""
        self.problem = ""
        """Why what is typed now cannot be used as a filter."""
        self.title = TitleBar(self.PLACE, self.TITLE)
        self._filled = False
        self.filter_bar = AskBar("find ", "words, !not, /regular expression; esc clears")

    @property
    def rows(self) -> RowView:
        """The list that takes the pane's focus."""
        raise NotImplementedError

    def compose(self) -> ComposeResult:
        if self.display:
            self._filled = True
            yield from self._contents()

    def fill(self) -> None:
        """Make what it consists of, unless that has been done: a pane that nobody sees at the start does without."""
        if not self._filled:
            self._filled = True
            self.mount(*self._contents())

    def _contents(self) -> Iterator[Widget]:
        yield self.title
        yield from self.body()

    def body(self) -> Sequence[Widget]:
        return [self.rows]

    def looks_different(self, changed: set[Topic]) -> bool:
        """Whether it may have to be repainted after this has changed."""
        return bool(changed & self.TOPICS)

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
        if self.filter is not None or self.filter_bar.is_open:
            self.close_filter(keep=False)
            return True
        return False

    # --- focus and filter ---

    def on_descendant_focus(self) -> None:
        self.title.add_class("-focused")

    def on_descendant_blur(self) -> None:
        self.title.remove_class("-focused")

    @property
    def filter_text(self) -> str:
        """What the rows are filtered by; empty when all are shown."""
        return self.filter.text if self.filter is not None else ""

    def set_filter(self, text: str) -> None:
        """Filter by what was typed, now or in an earlier session. When it cannot be used, the last one stays."""
        try:
            found = Filter(text)
        except BrokenFilter as broken:
            self.problem = str(broken)
        else:
            self.problem, self.filter = "", found or None
        self.repaint()

    def refuse_filter(self, broken: BrokenFilter, before: Filter | None) -> None:
        """The filter has turned out to be unusable while it was used."""
        self.problem, self.filter = str(broken), before

    def filter_note(self, shown: int, total: int, more: str = "") -> Line:
        """What the title says about the filter: `find word  3 of 12`; `more` follows the numbers."""
        if self.problem:
            return ((f"{self.problem}  ", "wait"), (f"{shown} of {total}{more}", "wait"))
        return ((f"find {self.filter_text}  {shown} of {total}{more}", "wait"),)

    def open_filter(self) -> None:
        self.ask(self.filter_bar, self.filter_text)

    def ask(self, bar: AskBar, text: str = "") -> None:
        """Open a bar at the pane's foot, beginning with `text`."""
        if not bar.is_attached:
            self.mount(bar)
        bar.open(text)

    def close_filter(self, *, keep: bool) -> None:
        self.filter_bar.close()
        self.problem = ""
        if not keep:
            self.filter = None
        self.screen.set_focus(self.rows)
        self.repaint()

    @on(AskBar.Typed)
    def _filter_typed(self, event: AskBar.Typed) -> None:
        if event.bar is self.filter_bar:
            event.stop()
            self.set_filter(event.bar.text)

    @on(AskBar.Taken)
    def _filter_taken(self, event: AskBar.Taken) -> None:
        if event.bar is self.filter_bar:
            event.stop()
            if self.problem:
                self.post_message(Told(f"this is no filter yet: {self.problem}"))
            else:
                self.close_filter(keep=True)

    @on(AskBar.Left)
    def _filter_left(self, event: AskBar.Left) -> None:
        if event.bar is self.filter_bar:
            event.stop()
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
        made = self.make_rows(width)
        rows = self.narrowed(made)
        if self.filter is not None or self.problem:
            self.title.draw(self.filter_note(len(rows), sum(row.selectable for row in made)))
        else:
            self.title.draw(self.subtitle())
        if not rows:
            empty = "nothing matches; esc clears the filter" if self.filter is not None else self.EMPTY
            rows = [Row("", ((f" {empty}", "muted"),), selectable=False)]
        self.list.show(rows)

    def narrowed(self, rows: list[Row]) -> list[Row]:
        """The rows that the filter lets through, with what it found marked."""
        if self.filter is None:
            return rows
        try:
            kept = [row for row in rows if row.selectable and self.filter.matches(row.full or plain(row.line))]
            return self.marked(kept)
        except BrokenFilter as broken:
            self.refuse_filter(broken, None)
            return rows

    def marked(self, rows: list[Row]) -> list[Row]:
        """All the rows, with what the filter finds in them marked: for a picture, which would be none with gaps."""
        if self.filter is None:
            return rows
        return [row._replace(line=marked(row.line, self.filter.places(plain(row.line)))) for row in rows]
