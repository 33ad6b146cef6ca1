"""A report before anybody knows where it is shown: sections of facts, tables and figures.

What makes reports (`session_report`, `study_report`) makes these; `page` writes them as HTML and `plain_text` as lines
for a terminal, so that both give the same numbers. All texts are as they were recorded; whoever writes them out makes
them safe.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from msgspec import Struct

Voice: TypeAlias = Literal["plain", "note", "warning"]
"""note: an aside in small print. warning: something that somebody must know who uses the numbers."""


class Paragraph(Struct, frozen=True):
    """A few sentences."""

    text: str
    voice: Voice = "plain"


class Facts(Struct, frozen=True):
    """Names and what is true of them."""

    rows: tuple[tuple[str, str], ...]


class ReportTable(Struct, frozen=True, kw_only=True):
    """Rows under named columns."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers: frozenset[int] = frozenset()
    """The columns whose values are numbers, which stand under one another to the right."""
    marked: frozenset[int] = frozenset()
    """Rows that somebody should look at."""
    note: str = ""
    folded: bool = False
    """Whether it is long, and nobody has to read it: a page shows its caption, and the rest when it is asked for."""
    page_only: bool = False
    """Whether a terminal only says where it stands."""


class Figure(Struct, frozen=True, kw_only=True):
    """A drawing, and the same for who cannot see one."""

    caption: str
    """On the page, how to read it."""
    svg: tuple[str, ...]
    """Whole `<svg>` elements, made by `rise_engine.results.report.svg`; a page can break between them."""
    text: Callable[[int], list[str]] | None = None
    """Lines that say the same, for a width in characters, and how to read them; None: the tables beside it do."""


Block: TypeAlias = Paragraph | Facts | ReportTable | Figure


class Section(Struct, frozen=True):
    """A part of a report, under a title."""

    title: str
    blocks: tuple[Block, ...]


class Document(Struct, frozen=True, kw_only=True):
    """A whole report."""

    title: str
    kind: str
    """What it is, above the title: `Session report`."""
    summary: str = ""
    """One or two sentences with what matters most."""
    banner: str = ""
    """What must not be overlooked, such as that the robot was simulated."""
    facts: tuple[tuple[str, str], ...] = ()
    """What stands in its head."""
    sections: tuple[Section, ...] = ()
    colophon: str = ""
    """What made it, and from what."""


def number_text(value: float | None, digits: int = 2) -> str:
    """A number with that many places, empty when there is none.

    >>> number_text(0.6155)
    '0.62'
    """
    if value is None:
        return ""
    text = f"{value:.{digits}f}"
    return text.replace("-", "\u2212") if float(text) else text.lstrip("-")


def seconds_text(value: float | None) -> str:
    """A time in seconds: `0.62 s`; an en dash when there is none."""
    return "\u2013" if value is None else f"{number_text(value)}\u00a0s"


def length_text(seconds: float) -> str:
    """How long something took, for people: `42 s`, `3 min 20 s`, `1 h 02 min`.

    >>> length_text(3750).replace(chr(160), " ")
    '1 h 02 min'
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole}\u00a0s"
    if whole < 3600:
        return f"{whole // 60}\u00a0min {whole % 60:02d}\u00a0s"
    return f"{whole // 3600}\u00a0h {whole % 3600 // 60:02d}\u00a0min"


def clock_text(seconds: float) -> str:
    """A moment of the session: `4:07`, `1:04:07`.

    >>> clock_text(247.4)
    '4:07'
    """
    sign, whole = ("\u2212", -seconds) if seconds < 0 else ("", seconds)
    minutes, rest = divmod(int(whole), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{sign}{hours}:{minutes:02d}:{rest:02d}" if hours else f"{sign}{minutes}:{rest:02d}"


def share_text(count: int, n: int) -> str:
    """`3 of 12 (25 %)`; `none` of nothing."""
    return f"{count} of {n} ({percent_text(count / n)})" if n else "none"


def percent_text(fraction: float) -> str:
    """`25 %`, with a place below 10 % so that rare things can be told apart."""
    percent = fraction * 100
    digits = 1 if 0 < percent < 10 else 0
    return f"{percent:.{digits}f}\u00a0%"
