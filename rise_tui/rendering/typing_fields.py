"""Fields in which letters are text. Many letters at once are a paste there; elsewhere they are refused as commands."""

from __future__ import annotations

from textual.widgets import Input


class TakesText:
    """Mixed into text fields other than `Input`."""


def takes_text(widget: object) -> bool:
    """Whether letters that are typed or pasted into the widget are text."""
    return isinstance(widget, Input | TakesText)
