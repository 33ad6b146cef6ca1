"""The box of a dialog: its title above, what its keys do below."""

from __future__ import annotations

from textual.containers import Vertical


class TitledBox(Vertical):
    """Fills with what is composed inside it; its dialog says how large it is (`#box`)."""

    DEFAULT_CSS = """
    TitledBox {
        height: auto; max-width: 96%; padding: 0 1; background: $panel;
        border: round $primary; border-title-style: bold;
    }
    """

    def __init__(self, title: str, keys: str = "") -> None:
        """`keys`: what the keys do, in a few words; empty where buttons say it."""
        super().__init__(id="box")
        self.border_title = f" {title} "
        self.border_subtitle = f" {keys} " if keys else None
