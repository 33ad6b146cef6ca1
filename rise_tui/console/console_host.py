"""What the parts of the console ask of the screen that holds them."""

from __future__ import annotations

from typing import Any, Protocol

from textual.app import App

from rise_engine.run.protocol.client import ControlVerb
from rise_tui.model.key_action import KeyAction
from rise_tui.model.notice import Level
from rise_tui.model.store import Store


class ConsoleHost(Protocol):
    """For what opens over the console: questions, help, palette, tour."""

    @property
    def app(self) -> App[Any]: ...

    @property
    def store(self) -> Store: ...

    def show_notice(self, text: str, level: Level = "info") -> None:
        """Tell the wizard something."""

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry, or say why not."""

    def start(self, action: KeyAction) -> None:
        """Ask for a start, with all care against accidents."""

    def send(self, function: str, behavior: str = "") -> None:
        """Give a task to the engine, without waiting."""

    def request_control(self, verb: ControlVerb) -> None:
        """Take, ask for, give or release control, without waiting."""
