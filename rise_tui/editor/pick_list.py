"""Dialogs: a list that filters as you type, and a line to type in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from textual import events, on
from textual.app import ComposeResult
from textual.widgets import Input

from rise_tui.editor.model.fields import FieldChoice
from rise_tui.rendering.modal import SingleDismissModal, TitledBox
from rise_tui.rendering.text import ListRow, StyledSpan, cell_width, crop, fixed_span, wrap
from rise_tui.screens.search_dialog import SearchDialog
from rise_tui.widgets.prompt_bar import TextField
from rise_tui.widgets.row_list import RowView
from rise_tui.widgets.static_lines import StaticLines

NEW = "\0new"
"""The id of the row that creates what was typed."""
WHOLE = 3
"""Lines for the full help of a choice."""
IN_WORDS = 2


def _distance(choice: FieldChoice, typed: str) -> int:
    """0: the choice's name begins with the text; 1: the name contains it; IN_WORDS: only the help contains it."""
    title, wanted = choice.title.casefold(), typed.casefold()
    return 0 if title.startswith(wanted) else 1 if wanted in title else IN_WORDS


class Picked(NamedTuple):
    """The author's choice."""

    value: str
    """The value under the cursor."""
    ticked: tuple[str, ...] = ()
    """All ticked values, in the order of the list."""
    is_tab: bool = False
    """Whether the author pressed Tab instead of Enter."""


class OneWordField(TextField):
    """A field that leaves the space key to the dialog around it."""

    def on_key(self, event: events.Key) -> None:
        if event.key == "space":
            event.prevent_default()


class PickList(SearchDialog[Picked]):
    """Lets the author choose one or any number. It can offer to create a name that is not in the list."""

    DEFAULT_CSS = """
    PickList #box { max-width: 92; height: auto; }
    PickList FoundList { height: auto; max-height: 14; min-height: 4; }
    PickList StaticLines { height: 3; background: $panel; margin: 1 0 0 0; }
    """

    def __init__(
        self,
        title: str,
        choices: Sequence[FieldChoice],
        *,
        now: str = "",
        new: str = "",
        ticked: Sequence[str] | None = None,
        enter: str = "takes it",
        tab: Mapping[str, str] | None = None,
    ) -> None:
        """
        :param now: the value where the cursor begins.
        :param new: what a name becomes that is not in the list; empty: nothing.
        :param ticked: the values that are ticked first; None: a list to choose one value, without ticks.
        :param enter: what Enter does. :param tab: what Tab does, for each value that has an entry.
        """
        super().__init__(title, "", "type to filter")
        if ticked is not None:
            self.search = OneWordField(placeholder="type to filter", select_on_focus=False)
        self._choices, self._now, self._new = choices, now, new
        self._ticked = None if ticked is None else set(ticked)
        self._enter, self._tab = enter, tab or {}
        self._whole = StaticLines()

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, self._keys_line()):
            yield self.search
            yield self.list
            yield self._whole

    def draw(self) -> None:
        typed = self.search.value.strip()
        self._draw_rows()
        self.list.move_cursor(0 if self.list.count and self.list.row_at(0).selectable else -1, by_wizard=False)
        if not typed:
            self.list.select(self._now)
        self._show_whole()

    def _draw_rows(self) -> None:
        typed, wanted, width = self.search.value.strip(), self.typed_filter(), self.list.row_width
        found = [each for each in self._choices if self.is_found(wanted, f"{each.title} {each.help}")]
        if typed:  # the beginning of a name beats a name that contains it, and help that does
            found.sort(key=lambda each: _distance(each, typed))
        rows = [ListRow(each.value, self._line(each, width)) for each in found]
        if self._new and typed and all(each.value != typed for each in self._choices):
            by_title = sum(_distance(each, typed) < IN_WORDS for each in found)
            rows.insert(by_title, ListRow(NEW, ((f" make “{typed}”, {self._new}", "accent"),)))
        self.list.show(rows or [ListRow("", ((" nothing found", "muted"),), selectable=False)])

    @on(RowView.CursorMoved)
    def _show_whole(self) -> None:
        """Show the keys of the row under the cursor, and its full help if the list has no room for it."""
        self.query_one("#box").border_subtitle = f" {self._keys_line()} "
        width = self.list.row_width
        room = width - self._title_width(width) - 4
        self._whole.display = any(cell_width(each.help) > room for each in self._choices)
        chosen = next((each.help for each in self._choices if each.value == self.list.current_id), "")
        lines = wrap(chosen, max(20, width - 4))[:WHOLE] if cell_width(chosen) > room else []
        self._whole.show(*(((f"   {line}", "plain"),) for line in [*lines, *[""] * (WHOLE - len(lines))]))

    def _keys_line(self) -> str:
        if self._ticked is not None:
            return "space: yes or no · enter done · esc as it was"
        tab = self._tab.get(self.list.current_id, "")
        arrows = "↑↓ · " if not self._tab else ""
        return f"type to filter · {arrows}enter {self._enter}{f' · tab {tab}' if tab else ''} · esc closes"

    def _line(self, choice: FieldChoice, width: int) -> tuple[StyledSpan, ...]:
        mark: StyledSpan = (" • " if choice.value == self._now else "   ", "accent")
        if self._ticked is not None:
            mark = (" [x] " if choice.value in self._ticked else " [ ] ", "accent")
        return crop((mark, fixed_span(choice.title, self._title_width(width)), (f" {choice.help}", "muted")), width)

    def _title_width(self, width: int) -> int:
        if not any(each.help for each in self._choices):
            return max(10, width - 5)
        longest = max((cell_width(each.title) for each in self._choices), default=0)
        return max(10, min(longest + 1, 36, width // 2))

    def carry_out_key(self, key: str) -> bool:
        current = self.list.current_id
        if key == "enter" or (key == "tab" and self._tab.get(current)):
            self._dismiss_with(current, is_tab=key == "tab")
        elif key == "space" and self._ticked is not None:
            if current:
                self._ticked ^= {current}
                self._draw_rows()
        else:
            return super().carry_out_key(key) or key == "tab"
        return True

    def _dismiss_with(self, current: str, *, is_tab: bool) -> None:
        if self._ticked is not None:
            ticked = tuple(each.value for each in self._choices if each.value in self._ticked)
            self.dismiss(Picked(current, ticked))
        elif self.list.cursor >= 0:
            self.dismiss(Picked(self.search.value.strip() if current == NEW else current, is_tab=is_tab))


class AskText(SingleDismissModal[str]):
    """A line to type in. The result is the text without blanks around it."""

    DEFAULT_CSS = """
    AskText {
        align: center middle; background: transparent;
        #box { width: 70; }
        StaticLines { background: $panel; }
        TextField, TextField:focus { background: $surface; margin: 0 0 1 0; }
    }
    """

    def __init__(self, title: str, text: str, hint: str = "") -> None:
        super().__init__()
        self._title, self._hint = title, hint
        self._field = TextField(text, select_on_focus=False)
        self._line = StaticLines()

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, "enter takes it · esc closes"):
            yield self._field
            yield self._line

    def on_mount(self) -> None:
        self.set_focus(self._field)
        self._line.show(((self._hint, "muted"),))

    @on(Input.Submitted)
    def _submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self.dismiss(event.value.strip())

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            self.dismiss("")
