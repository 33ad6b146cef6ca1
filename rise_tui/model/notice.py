"""One sentence for the wizard, in the line above the key hints."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct


class Notice(Struct, frozen=True):
    """A sentence, and how much it matters: told, to be attended to, wrong."""

    text: str
    level: Literal["info", "wait", "fault"] = "info"
