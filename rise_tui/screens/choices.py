"""A question with a choice for each of several things, and keys that choose for all of them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, NamedTuple

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widgets import Static

from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.widgets.titled_box import TitledBox

LINES_AROUND = 12
"""Rows of the terminal that the dialog needs beside its lines and choices."""


class Choice(NamedTuple):
    """One thing to choose for."""

    name: str
    options: Sequence[str]
    """What can be chosen; the first is what holds if nobody chooses."""


class ChoicesDialog(Dialog):
    """Up and down select one thing, left and right choose for it; other keys choose for all."""

    DEFAULT_CSS = """
    ChoicesDialog {
        #box { max-height: 95%; }
        #lines { margin: 0; }
        #choices { height: auto; margin: 1 0; }
    }
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "select(-1)", show=False),
        Binding("down", "select(1)", show=False),
        Binding("left", "change(-1)", show=False),
        Binding("right", "change(1)", show=False),
    ]

    def __init__(
        self,
        title: str,
        lines: Sequence[str],
        choices: Sequence[Choice],
        all_keys: Mapping[str, str],
        *answers: DialogChoice,
        hint: str,
        no: str,
        repeat_keys: Sequence[str] = (),
    ) -> None:
        """`all_keys`: for each key, the option that it chooses wherever there is such a one."""
        super().__init__(title, lines, *answers, no=no, repeat_keys=repeat_keys)
        self._choices, self._all_keys, self._hint = choices, all_keys, hint
        self.selected = 0
        self.chosen = {choice.name: choice.options[0] for choice in choices}

    @abstractmethod
    def choice_lines(self, width: int, rows: int) -> list[str]:
        """The things with what is chosen, in at most so many rows of this width."""

    def compose(self) -> ComposeResult:
        with TitledBox(self._title):
            yield Static("\n".join(self._lines), id="lines", markup=False)
            yield Static("", id="choices", markup=False)
            with Horizontal(id="buttons"):
                yield from self.buttons()

    def on_mount(self) -> None:
        super().on_mount()
        self.call_after_refresh(self._show_choices)

    def on_resize(self) -> None:
        self.call_after_refresh(self._show_choices)

    def on_key(self, event: events.Key) -> None:
        if (option := self._all_keys.get(event.key)) is not None:
            event.stop()
            for choice in self._choices:
                if option in choice.options:
                    self.chosen[choice.name] = option
            self._show_choices()
        else:
            super().on_key(event)

    def action_select(self, step: int) -> None:
        self.selected = min(max(self.selected + step, 0), len(self._choices) - 1)
        self._show_choices()

    def action_change(self, step: int) -> None:
        if self._choices:
            choice = self._choices[self.selected]
            now = choice.options.index(self.chosen[choice.name])
            self.chosen[choice.name] = choice.options[(now + step) % len(choice.options)]
            self._show_choices()

    def _show_choices(self) -> None:
        shown = self.query_one("#choices", Static)
        rows = max(2, self.app.size.height - LINES_AROUND - len(self._lines))
        shown.update("\n".join([*self.choice_lines(max(20, shown.size.width), rows), self._hint]))


def first_shown(selected: int, count: int, most: int) -> int:
    """The first of `count` things to show, so that of `most` the selected one is in the middle."""
    return max(0, min(selected - most // 2, count - most))
