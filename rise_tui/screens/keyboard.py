"""The way of a key through the console: what may go on, what is done at once, and what when nobody else took it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual import events
from textual.widgets import Input

from rise_tui.actions import BY_ID, key_in_words, keys_of
from rise_tui.model.armed import LOCKED_ACTIONS, why_not
from rise_tui.widgets.mistake import MistakeLine

if TYPE_CHECKING:
    from rise_tui.screens.console import ConsoleScreen

OPENERS = ("say", "note", "mistake")
"""Actions that open a line in which letters are not the scenario's keys."""
OPENING = 2.0
"""Seconds for which such a line may take to open."""


class Keyboard:
    """All keys of one console."""

    def __init__(self, console: ConsoleScreen) -> None:
        self._console = console
        self._opening_at = float("-inf")
        """When a key was pressed that opens a line for letters, until that is done; monotonic."""

    @property
    def _typing(self) -> bool:
        return isinstance(self._console.app.focused, Input)

    def seen(self, event: events.Key, together: bool | None) -> None:
        """Every key, whatever has the focus, before anything acts on it."""
        console, typing = self._console, self._typing
        console.painting.key_pressed()
        console.acting.key_seen(event.key, event.time, typing=typing, together=together)
        if not typing and console.app.screen is console and _opener(event.key):
            self._opening_at = event.time

    def passes(self, event: events.Event) -> bool:
        """Whether an event of the keyboard or the mouse may go on; all of them come by here, dialogs or not.

        Text that is pasted where nobody types is no row of commands and answers. While it is LOCKED only stopping,
        leaving and unlocking go on, and the answer to the question about leaving.
        """
        console = self._console
        is_key = isinstance(event, events.Key)
        if isinstance(event, events.MouseDown):
            console.acting.mouse_seen()
        pasted = console.acting.gate.pasting and not self._typing
        if isinstance(event, events.Key) and pasted and (event.is_printable or event.key == "enter"):
            return False
        guard = console.session.store.guard
        if guard != "LOCKED" or console.app.screen.has_class("-quit"):
            return True
        if isinstance(event, events.Key) and any(event.key in keys_of(BY_ID[id]) for id in LOCKED_ACTIONS):
            return True
        if is_key or isinstance(event, events.MouseDown | events.Paste):
            console.say(why_not(guard, key_in_words("safe"), key_in_words("lock")))
        return False

    def takes(self, event: events.Key) -> bool:
        """Do at once what a scenario's key asks for, without its way through the focused list and all around it.

        So are lines opened in which letters mean something else: the next key is theirs, however soon it comes. Only
        when no dialog, field or first press of two is there that the key could be meant for.
        """
        console, opener = self._console, _opener(event.key)
        if not (opener or event.key in console.session.store.scenario.keys) or console.acting.gate.armed is not None:
            return False
        if console.app.screen is not console or isinstance(console.focused, Input | MistakeLine):
            return False
        if opener:
            console.action_do(opener)
        else:
            self.left(event)
        return True

    def opened(self) -> None:
        """What the last key asked for has been done."""
        self._opening_at = float("-inf")

    def left(self, event: events.Key) -> None:
        """Keys that no text field has taken: those of the scenario, Enter for an armed act, Esc."""
        console = self._console
        if isinstance(console.focused, Input):
            return
        console.mistake.close()
        gate = console.acting.gate
        if event.key == "enter" and gate.armed is not None:
            if console.selected_act == gate.armed.behavior:
                gate.press(gate.armed, event.time)
            else:
                gate.confirm()
        elif event.key == "escape":
            console.escape()
        elif (binding := console.session.store.scenario.keys.get(event.key)) is not None:
            if event.time - self._opening_at < OPENING:  # meant for the line that is just being opened
                console.say(f"{binding.label} came before the line was open: it did nothing")
            else:
                console.acting.scenario_key(binding, event.time)
        else:
            return
        event.stop()
        event.prevent_default()


def _opener(key: str) -> str:
    return next((id for id in OPENERS if key in keys_of(BY_ID[id])), "")
