"""A report independent of its output: sections of facts, tables and figures.

`session_report` and `study_report` make it. `page` writes it as HTML, and `plain_text` as lines for a terminal, so that
both show the same numbers. Texts are as recorded; the output modules make them safe.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.results.analysis.course import PARTLY_WITH
from rise_engine.results.analysis.model import ActorKind, InterruptionKind
from rise_engine.results.analysis.statistics import Share

Voice: TypeAlias = Literal["plain", "note", "warning"]
"""note: an aside in small print. warning: a fact that every user of the numbers must know."""


class Paragraph(Struct, frozen=True):
    """A few sentences."""

    text: str
    voice: Voice = "plain"


class Facts(Struct, frozen=True):
    """Names with their values."""

    rows: tuple[tuple[str, str], ...]


class ReportTable(Struct, frozen=True, kw_only=True):
    """Rows under named columns."""

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numbers: frozenset[int] = frozenset()
    """The columns with numbers, which are aligned on the right."""
    marked: frozenset[int] = frozenset()
    """Rows that a person should check."""
    note: str = ""
    folded: bool = False
    """Whether it is long and optional. A page then shows its caption, and the rest on demand."""
    page_only: bool = False
    """Whether a terminal only shows where to find it."""


class Figure(Struct, frozen=True, kw_only=True):
    """A drawing, with a text for people who cannot see it."""

    caption: str
    """How to read it on the page."""
    svg: tuple[str, ...]
    """Whole `<svg>` elements, made by `rise_engine.results.report.page`. A page can break between them."""
    text: Callable[[int], list[str]] | None = None
    """Makes lines with the same content, for a width in characters. None: tables beside it contain them."""


Block: TypeAlias = Paragraph | Facts | ReportTable | Figure


class Section(Struct, frozen=True):
    """A part of a report under a title."""

    title: str
    blocks: tuple[Block, ...]


class Document(Struct, frozen=True, kw_only=True):
    """A whole report."""

    title: str
    kind: str
    """The kind of report, above the title: `Session report`."""
    summary: str = ""
    """One or two sentences with the most important facts."""
    banner: str = ""
    """A fact that must not be overlooked, such as a simulated robot."""
    facts: tuple[tuple[str, str], ...] = ()
    """The facts in its head."""
    sections: tuple[Section, ...] = ()
    colophon: str = ""
    """The program that made it, and its sources."""


def number_text(value: float | None, digits: int = 2) -> str:
    """Write a number with `digits` decimal places. Empty: there is none.

    >>> number_text(0.6155)
    '0.62'
    """
    if value is None:
        return ""
    text = f"{value:.{digits}f}"
    return text.replace("-", "\u2212") if float(text) else text.lstrip("-")


def seconds_text(value: float | None) -> str:
    """Write a time in seconds: `0.62 s`. An en dash: there is none."""
    return "\u2013" if value is None else f"{number_text(value)}\u00a0s"


def length_text(seconds: float) -> str:
    """Write a duration for people: `42 s`, `3 min 20 s`, `1 h 02 min`.

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
    """Write a session time, or a length, rounded as by `length_text`: `4:07`, `1:04:07`.

    >>> clock_text(247.4), clock_text(69.997)
    ('4:07', '1:10')
    """
    sign, whole = ("\u2212", -seconds) if seconds < 0 else ("", seconds)
    minutes, rest = divmod(round(whole), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{sign}{hours}:{minutes:02d}:{rest:02d}" if hours else f"{sign}{minutes}:{rest:02d}"


def share_text(count: int, n: int) -> str:
    """Write a share: `3 of 12 (25 %)`. `none` if the total is 0."""
    return f"{count} of {n} ({percent_text(count / n)})" if n else "none"


def percent_text(fraction: float) -> str:
    """Write a percentage: `25 %`. Below 10 %, it has one decimal place to distinguish rare events."""
    percent = fraction * 100
    digits = 1 if 0 < percent < 10 else 0
    return f"{percent:.{digits}f}\u00a0%"


# --- wording ----------------------------------------------------------------------------------------------------------

ACTOR_NAMES: Mapping[ActorKind, str] = {
    "wizard": "wizard",
    "rule": "rule by itself",
    "program": "program",
    "engine": "engine by itself",
}


def actor_shares(actors: Mapping[ActorKind, int]) -> list[str]:
    """Write `wizard 12 of 20 (60 %)` for each kind of actor with any acts."""
    whole = sum(actors.values())
    return [f"{ACTOR_NAMES[actor]} {share_text(number, whole)}" for actor, number in actors.items() if number]


def source_name(source: str) -> str:
    """Return a source for people: a wizard without the kind, a rule with it.

    >>> source_name("wizard:anna"), source_name("rule:Greeting"), source_name("engine")
    ('anna', 'rule Greeting', 'engine')
    """
    kind, colon, name = source.partition(":")
    if not colon or not name:
        return source
    return name if kind == "wizard" else f"{kind} {name}"


def cause_text(by: str, via: Sequence[str]) -> str:
    """Return who caused an act, and the rules in between.

    >>> cause_text("wizard:anna", ("Greeting", "Quiz")), cause_text("rule:Greeting", ())
    ('anna, through Greeting > Quiz', 'rule Greeting')
    """
    return f"{source_name(by)}, through {' > '.join(via)}" if via else source_name(by)


def with_interruption(text: str, outage: float | None, kind: InterruptionKind | None = None) -> str:
    """Add the interruption to a duration in words.

    >>> with_interruption("12.0 s", None), with_interruption("12.0 s", None, "stop")
    ('12.0 s', '12.0 s, partly with everything stopped')
    """
    if kind in PARTLY_WITH:
        return f"{text}, partly with {PARTLY_WITH[kind]}"
    return f"{text} and {length_text(outage)} without an engine" if outage else text


def interval_text(share: Share) -> str:
    """Write the 95 % interval of a share in percent: `(1.2–14)`. Empty: the total is 0."""
    if share.interval is None:
        return ""
    low, high = (_percent_number(each) for each in share.interval)
    return f"({low}\u2013{high})"


def per_hundred(share: Share) -> str:
    """Write a share in percent. `none`: the total is 0."""
    return "none" if share.fraction is None else _percent_number(share.fraction)


def marks_text(marks: Mapping[str, int]) -> str:
    """Write marks: `2 late, 1 wrong`."""
    return ", ".join(f"{number} {mark}" for mark, number in marks.items())


def moment_text(moment: str) -> str:
    """Write a date with time of day for people. Empty: there is none."""
    try:
        return f"{datetime.fromisoformat(moment):%Y-%m-%d %H:%M %z}".rstrip()
    except ValueError:
        return moment


def _percent_number(fraction: float) -> str:
    percent = fraction * 100
    return number_text(percent, 1 if 0 < percent < 10 else 0)
