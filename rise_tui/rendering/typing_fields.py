"""Fields in which letters are text: many at once are a paste there, and elsewhere a row of commands that is refused."""

from __future__ import annotations

from textual.widgets import Input


class TakesText:
    """Mixed into fields that are no `Input`."""


def takes_text(widget: object) -> bool:
    """Whether letters that are typed or pasted into it are text."""
    return isinstance(widget, Input | TakesText)
