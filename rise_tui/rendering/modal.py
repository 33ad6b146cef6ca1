"""Dialogs that close only once, in a box with a title at the top and its keys at the bottom."""

from __future__ import annotations

from typing import Generic

from textual.await_complete import AwaitComplete
from textual.containers import Vertical
from textual.screen import ModalScreen, ScreenResultType


class SingleDismissModal(ModalScreen[ScreenResultType], Generic[ScreenResultType]):
    """A modal screen whose second `dismiss` does nothing.

    The stock one removes whatever is on top. A second key before it has gone would remove the console below.
    """

    def dismiss(self, result: ScreenResultType | None = None) -> AwaitComplete:
        return super().dismiss(result) if self.is_active else AwaitComplete.nothing()  # type: ignore[no-untyped-call]


class TitledBox(Vertical):
    """Contains what is composed inside it. Its dialog sets its size (`#box`)."""

    DEFAULT_CSS = """
    TitledBox {
        height: auto; max-width: 96%; padding: 0 1; background: $panel;
        border: round $primary; border-title-style: bold;
    }
    """

    def __init__(self, title: str, keys: str = "") -> None:
        """`keys`: what the keys do, in a few words; empty if buttons show it."""
        super().__init__(id="box")
        self.border_title = f" {title} "
        self.border_subtitle = f" {keys} " if keys else None
