"""Times in BML 1.0: `2.5`, `greet:end + 0.5` (its section on synchronisation)."""

from __future__ import annotations

import re
from decimal import Decimal

from msgspec import Struct

_NUMBER = re.compile(r"\d+(?:\.\d*)?|\.\d+", re.ASCII)
_REFERENCE = re.compile(
    r"(?:(?P<block>[^\s:]+):)?(?P<behavior>[^\s:]+?):(?P<point>[^\s:+]+?)"
    r"\s*(?:(?P<sign>[+-])\s*(?P<offset>\d+(?:\.\d*)?|\.\d+))?",
    re.ASCII,
)
_MILLISECONDS = 1000


class SyncTime(Struct, frozen=True):
    """A time: seconds after a sync point of a behaviour, or after the block's beginning."""

    offset: Decimal
    """Seconds; negative for an earlier time."""
    behavior: str = ""
    """Its id; empty: the block's beginning."""
    point: str = ""
    block: str = ""
    """The id of the block, if it is written."""


def parse_sync(text: str) -> SyncTime | None:
    """Read a time; None when it is not one.

    >>> parse_sync("greet:end + 0.5")
    SyncTime(offset=Decimal('0.5'), behavior='greet', point='end', block='')
    """
    text = text.strip()
    if _NUMBER.fullmatch(text):
        return SyncTime(Decimal(text))
    found = _REFERENCE.fullmatch(text)
    if found is None:
        return None
    offset = Decimal(f"{found['sign'] or ''}{found['offset'] or 0}")
    return SyncTime(offset, found["behavior"], found["point"], found["block"] or "")


def milliseconds(seconds: Decimal) -> str:
    """Seconds as an action's milliseconds.

    >>> milliseconds(Decimal("0.4"))
    '400'
    """
    return _plain(seconds * _MILLISECONDS)


def seconds_text(milliseconds: str) -> str | None:
    """An action's milliseconds as BML's seconds; None when they are not a number that can be written exactly.

    >>> seconds_text("400")
    '0.4'
    """
    if not _NUMBER.fullmatch(milliseconds):
        return None
    return _plain(Decimal(milliseconds) / _MILLISECONDS)


def read_seconds(text: str) -> Decimal | None:
    """A length of time; None when it is not one."""
    return Decimal(text.strip()) if _NUMBER.fullmatch(text.strip()) else None


def _plain(number: Decimal) -> str:
    written = f"{number:f}"
    return written.rstrip("0").rstrip(".") if "." in written else written
