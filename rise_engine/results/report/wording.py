"""How numbers and names read in reports."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime

from rise_engine.results.analysis.model import ActorKind
from rise_engine.results.analysis.statistics import Share
from rise_engine.results.report.document import number_text, share_text

ACTOR_NAMES: Mapping[ActorKind, str] = {
    "wizard": "wizard",
    "rule": "rule by itself",
    "program": "program",
    "engine": "engine by itself",
}


def actor_shares(actors: Mapping[ActorKind, int]) -> list[str]:
    """`wizard 12 of 20 (60 %)`, one for each kind of actor that caused anything."""
    whole = sum(actors.values())
    return [f"{ACTOR_NAMES[actor]} {share_text(number, whole)}" for actor, number in actors.items() if number]


def source_name(source: str) -> str:
    """Who did something, without what kind of source it is, where that is a wizard or a rule.

    >>> source_name("wizard:anna"), source_name("rule:Greeting"), source_name("engine")
    ('anna', 'rule Greeting', 'engine')
    """
    kind, colon, name = source.partition(":")
    if not colon or not name:
        return source
    return name if kind == "wizard" else f"{kind} {name}"


def interval_text(share: Share) -> str:
    """Its 95 % interval, per hundred: `(1.2–14)`; empty of nothing."""
    if share.interval is None:
        return ""
    low, high = (_hundred(each) for each in share.interval)
    return f"({low}\u2013{high})"


def per_hundred(share: Share) -> str:
    """A share per hundred; `none` of nothing."""
    return "none" if share.fraction is None else _hundred(share.fraction)


def marks_text(marks: Mapping[str, int]) -> str:
    """`2 late, 1 wrong`."""
    return ", ".join(f"{number} {mark}" for mark, number in marks.items())


def moment_text(moment: str) -> str:
    """A date and a time of day for people; empty where there is none."""
    try:
        return f"{datetime.fromisoformat(moment):%Y-%m-%d %H:%M %z}".rstrip()
    except ValueError:
        return moment


def _hundred(fraction: float) -> str:
    percent = fraction * 100
    return number_text(percent, 1 if 0 < percent < 10 else 0)
