"""Choosing a name from those that there are: typing filters, a new one is taken when the field takes new ones."""

from __future__ import annotations

from collections.abc import Sequence

from rise_tui.editing.model.study_names import NameChoice
from rise_tui.rendering.text import ListRow, StyledLine, fit, highlight_matches, plain_text
from rise_tui.screens.search_dialog import SearchDialog

NAME_SHARE = 0.5
"""Of the width, what the names take at most."""


class NameChooser(SearchDialog[str | None]):
    """Up and down choose, enter takes; esc leaves the field as it was."""

    def __init__(self, title: str, choices: Sequence[NameChoice], current: str = "") -> None:
        super().__init__(title, "typing filters · ↑ ↓ · enter takes it · esc leaves", "part of a name")
        self._choices, self._current = tuple(choices), current

    def draw(self) -> None:
        wanted = self.typed_filter()
        width = self.list.row_width
        longest = max((len(choice.name) for choice in self._choices), default=0) + 2
        cells = min(longest, int(width * NAME_SHARE))
        rows = []
        for choice in self._choices:
            text = f"{choice.name} {choice.note}"
            if self.is_found(wanted, text):
                line: StyledLine = ((f" {fit(choice.name, cells)}", "plain"), (choice.note, "muted"))
                spans = wanted.match_spans(plain_text(line)) if wanted is not None else ()
                rows.append(ListRow(choice.name, highlight_matches(line, spans)))
        if not rows:
            rows = [ListRow("", ((" nothing is called so; esc goes back to the field", "muted"),), selectable=False)]
        first = self.list.count == 0
        self.list.show(rows)
        if first and self._current:
            self.list.select(self._current)
        elif wanted is not None:
            self.list.move_cursor(0, by_wizard=False)

    def carry_out_key(self, key: str) -> bool:
        match key:
            case "up" | "down":
                self.list.action_step(-1 if key == "up" else 1)
            case "pageup" | "pagedown":
                self.list.action_page(-1 if key == "pageup" else 1)
            case "enter":
                self.dismiss(self.list.current_id or None)
            case _:
                return False
        return True
