"""Every key and what it does, made from the registry and the scenario; typing searches."""

from __future__ import annotations

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Input

from rise_tui.actions import PLACES, at
from rise_tui.quiet import QuietModal
from rise_tui.store import Store, describe
from rise_tui.text import Line, Row, cell, crop, plain, wrap
from rise_tui.widgets.editor import Field
from rise_tui.widgets.rows import RowList, RowView


class HelpScreen(QuietModal[None]):
    """Opens over the console; Esc closes it."""

    DEFAULT_CSS = """
    HelpScreen {
        align: center bottom; background: transparent;
        #box { width: 100%; max-width: 110; height: 1fr; max-height: 44; margin: 4 0 1 0; padding: 0 1;
               background: $panel; border: round $primary; border-title-style: bold; }
        Field, Field:focus { background: $surface; margin: 0 0 1 0; }
    }
    """

    def __init__(self, store: Store) -> None:
        super().__init__()
        self._store = store
        self.search = Field(placeholder="search")
        self.list = RowList(id="help-rows")

    def compose(self) -> ComposeResult:
        box = Vertical(id="box")
        box.border_title = " Help "
        box.border_subtitle = " type to search · ↑↓ scroll · esc closes "
        with box:
            yield self.search
            yield self.list

    def on_mount(self) -> None:
        self.search.focus()

    @on(Input.Changed)
    @on(RowView.Resized)
    def _draw(self) -> None:
        wanted = self.search.value.casefold()
        rows = [row for row in self._rows(self.list.row_width) if not wanted or _matches(row, wanted)]
        self.list.show(rows or [Row("", ((" nothing found", "muted"),), selectable=False)])

    def _rows(self, width: int) -> list[Row]:
        rows: list[Row] = []
        scenario = self._store.scenario
        if scenario.keys:
            rows.append(Row("", ((" Keys of this scenario", "accent"),), selectable=False))
            for key in scenario.keys.values():
                hold = scenario.settings_of(key.behavior).hold and "CommunicationRobotAct" in key.function
                does = describe(key.function, key.behavior) + ("  (hold: needs a second key)" if hold else "")
                rows.append(Row(f"k:{key.key}", (cell(f"  {key.label}", 12, "key"), (does, "plain"))))
        for place, title in PLACES:
            actions = list(at(place))
            if actions:
                rows.append(Row("", ((f" {title}", "accent"),), selectable=False))
            for action in actions:
                why = action.unavailable(self._store)
                keys = cell(f"  {action.all_keys}", 12, "muted" if why else "key")
                head = (keys, cell(action.title, 26, "muted" if why else "plain"))
                rows += _wrapped(action.id, head, action.help + (f" Not now: {why}." if why else ""), width)
        return rows

    def on_key(self, event: events.Key) -> None:
        moves = {"up": -1, "down": 1, "pageup": -10, "pagedown": 10}
        if event.key == "escape":
            event.stop()
            self.dismiss(None)
        elif event.key in moves:
            event.stop()
            event.prevent_default()
            self.list.scroll_relative(y=moves[event.key], animate=False)


def _matches(row: Row, wanted: str) -> bool:
    return not row.selectable or wanted in plain(row.line).casefold()


def _wrapped(action: str, head: Line, text: str, width: int) -> list[Row]:
    """A help text over as many rows as it needs."""
    lead = 38
    room = max(20, width - lead - 1)
    lines = wrap(text, room)
    rows = [Row(action, crop((*head, (lines[0], "muted")), width))]
    rows += [Row(action, crop(((" " * lead, "plain"), (more, "muted")), width)) for more in lines[1:]]
    return rows
