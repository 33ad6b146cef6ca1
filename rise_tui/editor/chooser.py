"""Lists to choose from, in which typing filters, and a line to type in."""

from __future__ import annotations

from collections.abc import Sequence

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
"""The id of the row that makes what was typed."""
WHOLE = 3
"""Lines for all that is said of a choice."""


IN_WORDS = 2


def _distance(choice: FieldChoice, typed: str) -> int:
    """0: the choice's name begins so; 1: that stands in its name; IN_WORDS: only in what is said of it."""
    title, wanted = choice.title.casefold(), typed.casefold()
    return 0 if title.startswith(wanted) else 1 if wanted in title else IN_WORDS


class Chooser(SearchDialog[str]):
    """One of several; the result is its value. What is typed and is none of them is offered as a new one."""

    DEFAULT_CSS = """
    Chooser #box { max-width: 92; height: auto; }
    Chooser FoundList { height: auto; max-height: 14; min-height: 4; }
    Chooser StaticLines { height: 3; background: $panel; margin: 1 0 0 0; }
    """

    def __init__(self, title: str, choices: Sequence[FieldChoice], *, now: str = "", new: str = "") -> None:
        """`now`: the value on which the cursor stands first. `new`: what is made of a name that is not there yet."""
        super().__init__(title, "type to filter · ↑↓ · enter takes it · esc closes", "type to filter")
        self._choices, self._now, self._new = choices, now, new
        self._whole = StaticLines()

    def draw(self) -> None:
        typed, wanted = self.search.value.strip(), self.typed_filter()
        width = self.list.row_width
        found = [each for each in self._choices if self.is_found(wanted, f"{each.title} {each.help}")]
        if typed:  # who types the beginning of a name means that name, not another in whose words it stands
            found.sort(key=lambda each: _distance(each, typed))
        rows = [ListRow(each.value, self._line(each, width)) for each in found]
        if self._new and typed and all(each.value != typed for each in self._choices):
            by_title = sum(_distance(each, typed) < IN_WORDS for each in found)
            rows.insert(by_title, ListRow(NEW, ((f" make “{typed}”, {self._new}", "accent"),)))
        self.list.show(rows or [ListRow("", ((" nothing found", "muted"),), selectable=False)])
        self.list.move_cursor(0 if rows else -1, by_wizard=False)
        if not typed:
            self.list.select(self._now)
        self._show_whole()

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, self._keys):
            yield self.search
            yield self.list
            yield self._whole

    @on(RowView.CursorMoved)
    def _show_whole(self) -> None:
        """All that is said of the row under the cursor, in a list that has no room for what is said."""
        width = self.list.row_width
        room = width - self._title_width(width) - 4
        self._whole.display = any(cell_width(each.help) > room for each in self._choices)
        chosen = next((each.help for each in self._choices if each.value == self.list.current_id), "")
        lines = wrap(chosen, max(20, width - 4))[:WHOLE] if cell_width(chosen) > room else []
        self._whole.show(*(((f"   {line}", "plain"),) for line in [*lines, *[""] * (WHOLE - len(lines))]))

    def _line(self, choice: FieldChoice, width: int) -> tuple[StyledSpan, ...]:
        mark: StyledSpan = (" • " if choice.value == self._now else "   ", "accent")
        return crop((mark, fixed_span(choice.title, self._title_width(width)), (f" {choice.help}", "muted")), width)

    def _title_width(self, width: int) -> int:
        longest = max((cell_width(each.title) for each in self._choices), default=0)
        return max(10, min(longest + 1, 36, width // 2))

    def carry_out_key(self, key: str) -> bool:
        if key == "enter":
            chosen = self.list.current_id
            if self.list.cursor >= 0:
                self.dismiss(self.search.value.strip() if chosen == NEW else chosen)
        elif key in ("up", "down"):
            self.list.action_step(-1 if key == "up" else 1)
        elif key in ("pageup", "pagedown"):
            self.list.action_page(-1 if key == "pageup" else 1)
        else:
            return False
        return True


class OneWordField(TextField):
    """A field in which space is no letter: it belongs to the dialog around it."""

    def on_key(self, event: events.Key) -> None:
        if event.key == "space":
            event.prevent_default()


class ManyChooser(SearchDialog[tuple[str, ...]]):
    """Any number of several: space takes one in or out, enter takes them all."""

    DEFAULT_CSS = """
    ManyChooser #box { max-width: 92; height: auto; }
    ManyChooser FoundList { height: auto; max-height: 16; min-height: 4; }
    """

    def __init__(self, title: str, choices: Sequence[FieldChoice], now: Sequence[str]) -> None:
        super().__init__(title, "space: yes or no · enter done · esc as it was", "type to filter")
        self.search = OneWordField(placeholder="type to filter", select_on_focus=False)
        self._choices, self._chosen = choices, set(now)

    def draw(self) -> None:
        wanted, width = self.typed_filter(), self.list.row_width
        found = [each for each in self._choices if self.is_found(wanted, f"{each.title} {each.help}")]
        rows = [
            ListRow(
                each.value,
                crop(
                    (
                        (" [x] " if each.value in self._chosen else " [ ] ", "accent"),
                        fixed_span(each.title, max(18, min(30, width // 3))),
                        (f" {each.help}", "muted"),
                    ),
                    width,
                ),
            )
            for each in found
        ]
        before = self.list.cursor
        self.list.show(rows or [ListRow("", ((" nothing found", "muted"),), selectable=False)])
        if before < 0 and rows:
            self.list.move_cursor(0, by_wizard=False)

    def carry_out_key(self, key: str) -> bool:
        if key == "space":
            if self.list.current_id:
                self._chosen ^= {self.list.current_id}
                self.draw()
        elif key == "enter":
            self.dismiss(tuple(each.value for each in self._choices if each.value in self._chosen))
        elif key in ("up", "down"):
            self.list.action_step(-1 if key == "up" else 1)
        else:
            return False
        return True


class AskText(SingleDismissModal[str]):
    """A line to type in; the result is what was typed, without blanks around it."""

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
