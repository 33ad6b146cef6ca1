"""Behaviours with more in them than a name, written as JSON (semantics.md 1.1): `{"event": "/x", "keep": "2s"}`."""

from __future__ import annotations

from typing import Any

import msgspec

from rise_engine.errors import RiseError
from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.durations import MAX_SECONDS, parse_time


class BehaviorError(RiseError, ValueError):
    """A behaviour that cannot be read; says what was expected."""


def event_behavior(event: str, keep: float) -> str:
    """The behaviour that asks for an event to be kept for so many seconds."""
    return msgspec.json.encode({"event": event, "keep": f"{keep:g}s"}).decode()


def parse_event(behavior: str) -> tuple[str, float | None]:
    """The event that a behaviour names, and for how many seconds it is kept; null: not at all. Raises BehaviorError."""
    if not behavior.lstrip().startswith("{"):
        return behavior, None
    fields = _read_fields(behavior, ("event", "keep"), 'write {"event": "/x", "keep": "2s"}')
    event, keep = fields.get("event"), fields.get("keep")
    if not isinstance(event, str):
        raise BehaviorError('`event` is missing; write {"event": "/x", "keep": "2s"}')
    if keep is None:
        return event, None
    seconds = parse_time(keep) if isinstance(keep, str) else None
    if seconds is None or not 0.001 <= seconds <= MAX_SECONDS:
        raise BehaviorError('`keep` is a time from 1ms to 24 hours, such as "2s"')
    return event, seconds


def plain_behavior(function: str, behavior: str) -> str:
    """What a task is about, in one word: the event, whether or not more is asked for with it."""
    if function != "raiseEventTopic":
        return behavior
    try:
        return parse_event(behavior)[0]
    except BehaviorError:
        return behavior


def _read_fields(behavior: str, known: tuple[str, ...], example: str) -> dict[str, Any]:
    """The fields of a behaviour. Raises BehaviorError for what is no JSON, and for fields that nobody reads."""
    try:
        fields = msgspec.json.decode(behavior, type=dict[str, Any])
    except (msgspec.DecodeError, RecursionError):
        raise BehaviorError(f"this is no JSON object; {example}") from None
    for name in fields:
        if name not in known:
            raise BehaviorError(f"there is no field `{name}`{did_you_mean(name, known)}; {example}")
    return fields
