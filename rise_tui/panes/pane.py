"""The common base of all lists and panes: a title bar that shows the focus, rows, and a filter."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from typing import ClassVar, cast

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widget import Widget

from rise_tui.actions import BY_ID, KeyScope
from rise_tui.model.filtering import Filter, InvalidFilter, filter_rows, mark_line
from rise_tui.model.store import Store, StorePart
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, align_at_both_ends, line_width
from rise_tui.requests import ConsoleHost
from rise_tui.widgets.fields import PromptBar
from rise_tui.widgets.lines import FOCUS_MARK, RowList, RowView, StaticLines

ROW_KEYS = frozenset({"enter", "delete"})
"""Keys for the row under the cursor."""
PaneTab = tuple[str, str]
"""A pane's id and its title."""


class TitleBar(StaticLines):
    """A pane's title, or the tabs of its group. It is brighter while the pane has the focus."""

    DEFAULT_CSS = """
    TitleBar { background: $rise-bar; }
    TitleBar.-focused { background: $rise-bar-focused; }
    """

    def __init__(self, pane: str, title: str) -> None:
        super().__init__(id=f"{pane}-title")
        self.tabs: tuple[PaneTab, ...] = ((pane, title),)
        self._pane = pane
        self._right: StyledLine = ()
        self._tab_spans: list[tuple[int, int, str]] = []
        """The first and last cell of each pane's tab."""

    def show_tabs(self, tabs: tuple[PaneTab, ...]) -> None:
        self.tabs = tabs
        self.draw()

    def show_note(self, right: StyledLine) -> None:
        self._right = right
        spans: list[StyledSpan] = []
        self._tab_spans.clear()
        column = 0
        for pane, title in self.tabs:
            own = pane == self._pane
            lead = FOCUS_MARK if own and self.has_class("-focused") else " "
            text = f"{lead}{title.upper()} " if own else f" {title.lower()} "
            spans.append((text, "accent" if own else "muted"))
            self._tab_spans.append((column, column + len(text), pane))
            column += len(text)
        note: StyledLine = (*right, (" ", "plain")) if right else ()
        if line_width(spans) + line_width(note) > self.size.width:
            # Tabs come before notes, but not before important notes.
            if any(role == "wait" for _, role in right):
                spans, self._tab_spans = [span for span in spans if span[1] == "accent"], []
            else:
                note = ()
        self.show(align_at_both_ends(tuple(spans), note, self.size.width))

    def draw(self) -> None:
        """Make the line again."""
        self.show_note(self._right)

    def on_resize(self, event: events.Resize) -> None:
        self.draw()

    def on_click(self, event: events.Click) -> None:
        for start, end, pane in self._tab_spans:
            if start <= event.x < end:
                cast(ConsoleHost, self.screen).focus_pane(pane)


class Pane(Vertical):
    """A list or pane of the console.

    Its text comes from `make_rows` (in the log: `make_line`), `subtitle` (right of its title) and EMPTY. `carry_out`
    handles its keys.
    """

    SCOPE: ClassVar[KeyScope]
    TITLE: ClassVar[str]
    PARTS: ClassVar[frozenset[StorePart]]
    """The parts of the store that it shows."""
    EMPTY: ClassVar[str] = ""
    """The text when there is nothing to show."""

    DEFAULT_CSS = "Pane { height: 1fr; width: 1fr; }"

    def __init__(self, store: Store) -> None:
        super().__init__(id=self.SCOPE)
        self.store = store
        self.filter: Filter | None = None
        """The last valid filter; None while every row is shown."""
        self.filter_problem = ""
        """Why the typed text is no filter."""
        self.title = TitleBar(self.SCOPE, self.TITLE)
        self._filled = False
        self.filter_bar = PromptBar("find ", "words, !not, /regular expression; esc clears")

    @property
    def host(self) -> ConsoleHost:
        """The console around it."""
        return cast(ConsoleHost, self.screen)

    @property
    @abstractmethod
    def row_view(self) -> RowView:
        """The list that takes the pane's focus."""

    def compose(self) -> ComposeResult:
        if self.display:
            self._filled = True
            yield from self._contents()

    def mount_contents(self) -> None:
        """Create the pane's contents, once. A pane that is hidden at the start has none yet."""
        if not self._filled:
            self._filled = True
            self.mount(*self._contents())

    def _contents(self) -> Iterator[Widget]:
        yield self.title
        yield from self.body_widgets()

    def body_widgets(self) -> Sequence[Widget]:
        return [self.row_view]

    def is_affected_by(self, changed: set[StorePart]) -> bool:
        """Whether this change may require a repaint."""
        return bool(changed & self.PARTS)

    @abstractmethod
    def repaint(self) -> None:
        """Make the pane's rows again from the store. Only differences reach the terminal."""

    def subtitle(self) -> StyledLine:
        """The text right of the title."""
        return ()

    def show_title(self) -> None:
        self.title.show_note(self.subtitle())

    def carry_out(self, action: str) -> None:
        """Carry out one of the pane's actions from the registry, if it has any."""

    def action_do(self, action: str) -> None:
        """Like `carry_out`, but only once the wizard can have seen the affected row."""
        if self.row_view.was_just_displaced and "delete" in BY_ID[action].keys:
            self.host.show_notice("the list has just changed; press again")
        elif ROW_KEYS.intersection(BY_ID[action].keys) and self.row_view.bring_into_view():
            self.host.show_notice("the row was out of view; press again")
        else:
            self.carry_out(action)

    def leave_transient(self) -> bool:
        """Handle Esc: leave the pane's transient state. False: there is none."""
        if self.filter is not None or self.filter_bar.is_open:
            self.close_filter(keep=False)
            return True
        return False

    # --- focus and filter ---

    def on_descendant_focus(self) -> None:
        self.title.set_class(True, "-focused")
        self.title.draw()

    def on_descendant_blur(self) -> None:
        self.title.set_class(False, "-focused")
        self.title.draw()

    @property
    def filter_text(self) -> str:
        """The text of the filter; empty if all rows are shown."""
        return self.filter.text if self.filter is not None else ""

    def set_filter(self, text: str) -> None:
        """Filter by a text from now or an earlier session. If it is not valid, the last filter stays."""
        try:
            found = Filter(text)
        except InvalidFilter as broken:
            self.filter_problem = str(broken)
        else:
            self.filter_problem, self.filter = "", found or None
        self.repaint()

    def refuse_filter(self, broken: InvalidFilter) -> None:
        """Drop a filter that turned out to be unusable."""
        self.filter_problem, self.filter = str(broken), None

    def filter_note(self, shown: int, total: int, more: str = "") -> StyledLine:
        """The title's text about the filter: `find word  3 of 12`; `more` follows the numbers."""
        if self.filter_problem:
            return ((f"{self.filter_problem}  ", "wait"), (f"{shown} of {total}{more}", "wait"))
        return ((f"find {self.filter_text}  {shown} of {total}{more}", "wait"),)

    def open_filter(self) -> None:
        self.open_bar(self.filter_bar, self.filter_text)
        self.filter_bar.field.select_all()

    def open_bar(self, bar: PromptBar, text: str = "") -> None:
        """Open a bar at the bottom of the pane, beginning with `text`."""
        if not bar.is_attached:
            self.mount(bar)
        bar.open(text)

    def close_filter(self, *, keep: bool) -> None:
        self.filter_bar.close()
        self.filter_problem = ""
        if not keep:
            self.filter = None
        self.screen.set_focus(self.row_view)
        self.repaint()

    @on(PromptBar.Edited)
    def _filter_edited(self, event: PromptBar.Edited) -> None:
        if event.bar is self.filter_bar:
            event.stop()
            self.set_filter(event.bar.text)

    @on(PromptBar.Accepted)
    def _filter_accepted(self, event: PromptBar.Accepted) -> None:
        if event.bar is self.filter_bar:
            event.stop()
            if self.filter_problem:
                self.host.show_notice(f"not a valid filter yet: {self.filter_problem}")
            else:
                self.close_filter(keep=True)

    @on(PromptBar.Cancelled)
    def _filter_cancelled(self, event: PromptBar.Cancelled) -> None:
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
        self.row_list = RowList(id=f"{self.SCOPE}-rows")

    @property
    def row_view(self) -> RowList:
        return self.row_list

    @abstractmethod
    def make_rows(self, width: int) -> list[ListRow]:
        """The rows in `width` cells."""

    def repaint(self) -> None:
        width = self.row_list.row_width
        if width <= 0:
            return
        made = self.make_rows(width)
        rows = self.filter_rows(made)
        if self.filter is not None or self.filter_problem:
            self.title.show_note(self.filter_note(len(rows), sum(row.selectable for row in made)))
        else:
            self.show_title()
        if not rows:
            empty = "nothing matches; esc clears the filter" if self.filter is not None else self.EMPTY
            rows = [ListRow("", ((f" {empty}", "muted"),), selectable=False)]
        self.row_list.show(rows)

    def filter_rows(self, rows: list[ListRow]) -> list[ListRow]:
        """The rows that the filter shows, with matches marked."""
        if self.filter is None:
            return rows
        try:
            return filter_rows(rows, self.filter)
        except InvalidFilter as broken:
            self.refuse_filter(broken)
            return rows

    def mark_matches(self, rows: list[ListRow]) -> list[ListRow]:
        """All rows, with the filter's matches marked. A picture with gaps would have no meaning."""
        return [row._replace(line=mark_line(row.line, self.filter)) for row in rows]
