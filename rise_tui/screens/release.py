"""The question whether a stop is to be released, and what becomes of the rules that it has ended."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widgets import Button, Static

from rise_engine.kernel.behaviors import Resumption
from rise_tui.model.resumption import RESUMPTIONS, InterruptedRule, release_behavior, resumption_lines
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.widgets.titled_box import TitledBox

ALL_KEYS: dict[str, Resumption] = {"e": "enter", "w": "wait", "l": "leave"}
HINT = "all: e enter again, w wait there, l leave   one: ↑ ↓, ← →"
LINES_AROUND = 12
"""Rows of the terminal that the dialog needs beside its rules."""


class ReleaseDialog(Dialog):
    """Asks once for all rules; each is left stopped unless something else is chosen."""

    DEFAULT_CSS = """
    ReleaseDialog {
        #box { max-height: 95%; }
        #lines { margin: 0; }
        #rules { height: auto; margin: 1 0; }
    }
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "select(-1)", show=False),
        Binding("down", "select(1)", show=False),
        Binding("left", "change(-1)", show=False),
        Binding("right", "change(1)", show=False),
    ]

    def __init__(self, lines: Sequence[str], rules: Sequence[InterruptedRule], repeat_keys: Sequence[str]) -> None:
        release = DialogChoice("r", "Release")
        super().__init__("Release the stop?", lines, release, no="Stay stopped", repeat_keys=repeat_keys)
        self._rules = rules
        self._selected = 0
        self.chosen: dict[str, Resumption] = {rule.name: "leave" for rule in rules}

    @property
    def behavior(self) -> str:
        """Of the task that releases the stop, as it is chosen now."""
        return release_behavior(self.chosen)

    def compose(self) -> ComposeResult:
        with TitledBox(self._title):
            yield Static("\n".join(self._lines), id="lines", markup=False)
            yield Static("", id="rules", markup=False)
            with Horizontal(id="buttons"):
                yield Button(f"{self._no} (esc)", id="no", compact=True)
                yield Button("Release (r)", id="answer-r", name="r", compact=True)

    def on_mount(self) -> None:
        super().on_mount()
        self.call_after_refresh(self._show_rules)

    def on_resize(self) -> None:
        self.call_after_refresh(self._show_rules)

    def on_key(self, event: events.Key) -> None:
        if event.key in ALL_KEYS:
            event.stop()
            self.chosen = dict.fromkeys(self.chosen, ALL_KEYS[event.key])
            self._show_rules()
        else:
            super().on_key(event)

    def action_select(self, step: int) -> None:
        self._selected = min(max(self._selected + step, 0), len(self._rules) - 1)
        self._show_rules()

    def action_change(self, step: int) -> None:
        name = self._rules[self._selected].name
        now = RESUMPTIONS.index(self.chosen[name])
        self.chosen[name] = RESUMPTIONS[(now + step) % len(RESUMPTIONS)]
        self._show_rules()

    def _show_rules(self) -> None:
        shown = self.query_one("#rules", Static)
        rows = max(2, self.app.size.height - LINES_AROUND - len(self._lines))
        width = max(20, shown.size.width)
        lines = resumption_lines(self._rules, self.chosen, self._selected, width, rows)
        shown.update("\n".join([*lines, HINT]))
