"""One sentence for the wizard, in the line above the key hints."""

from __future__ import annotations

from typing import Literal, TypeAlias

from msgspec import Struct

Level: TypeAlias = Literal["info", "wait", "fault"]
"""Told, to be attended to, wrong."""


class Notice(Struct, frozen=True):
    """A sentence, and how much it matters."""

    text: str
    level: Level = "info"
