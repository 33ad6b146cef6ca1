"""The requests of panes and bars to the screen around them."""

from __future__ import annotations

from typing import Any, Protocol

from textual.app import App

from rise_engine.run.protocol.client import ControlVerb
from rise_tui.model.control import KeyAction
from rise_tui.model.notice import Level
from rise_tui.model.store import Store


class ActionHost(Protocol):
    """A screen with actions of the registry."""

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry, or show why not."""


class ConsoleHost(ActionHost, Protocol):
    """The console, for its panes and bars, and for screens above it."""

    @property
    def app(self) -> App[Any]: ...

    @property
    def store(self) -> Store: ...

    def show_notice(self, text: str, level: Level = "info") -> None:
        """Show the wizard a notice."""

    def start(self, action: KeyAction) -> None:
        """Request a start with all protection against accidents, like a key of the scenario."""

    def send(self, function: str, behavior: str = "") -> None:
        """Send a task to the engine immediately, without waiting."""

    def ignore_keys(self) -> None:
        """Let no key start anything for a moment, after a question has closed by itself."""

    def request_control(self, verb: ControlVerb) -> None:
        """Take, ask for, give or release control, without waiting."""

    def focus_pane(self, name: str) -> None:
        """Bring a pane to the front and give it the focus."""

    def show_selection(self, pane: str, name: str) -> None:
        """Show another act or rule in its pane, because the wizard has selected it in the list `pane`."""

    def ask_to_start(self, rule: str, state: str) -> None:
        """Ask whether to start a rule in one of its states, and show the effect."""

    def ask_to_step_back(self, rule: str) -> None:
        """Ask whether a rule should go back one step."""
