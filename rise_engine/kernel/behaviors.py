"""Behaviours of tasks that are JSON: what a task is about when a name alone does not say it (semantics.md 1.1).

Whoever submits a task may write such a behaviour, so each reader refuses what it does not understand, in a sentence.
"""

from __future__ import annotations

from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from rise_engine.errors import RiseError
from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.durations import MAX_SECONDS, parse_time

Content = TypeVar("Content", bound=Struct)


class BehaviorError(RiseError, ValueError):
    """A behaviour that cannot be read; the message is a sentence for a person."""


class RuleStart(Struct, frozen=True, forbid_unknown_fields=True):
    """The behaviour of startInteractionRule: which rule, and where it begins (`rule_start_behavior` writes it)."""

    rule: str
    state: str | None = None
    """Null: in its initial state."""
    enter: bool = True
    """False: it waits there without running `onEntry`."""


_RULE_START = '{"rule": "Table setting", "state": "After the welcome", "enter": false}'


def read_rule_start(behavior: str) -> RuleStart:
    """The rule's name, or JSON with `rule`, `state` and `enter`. Raises BehaviorError."""
    if not is_object(behavior):
        return RuleStart(behavior)
    return read_object(behavior, RuleStart, f"a rule's name, or JSON such as {_RULE_START}")


def started_rule(behavior: str) -> str:
    """The name of the rule that a startInteractionRule is about; what cannot be read counts as a name."""
    try:
        return read_rule_start(behavior).rule
    except BehaviorError:
        return behavior


class EventRaise(Struct, frozen=True, forbid_unknown_fields=True):
    """The behaviour of raiseEventTopic: which event, and how long it is kept (`event_behavior` writes it)."""

    event: str
    keep: str | None = None
    """As it is written: `2s`; null: it is not kept."""

    @property
    def seconds(self) -> float | None:
        """For how long it is kept; null: not at all. Raises BehaviorError."""
        seconds = parse_time(self.keep) if self.keep is not None else None
        if self.keep is not None and (seconds is None or not 0.001 <= seconds <= MAX_SECONDS):
            raise BehaviorError(f'`keep` is a time from 1ms to 24 hours, such as "2s", not "{self.keep}"')
        return seconds


def read_event_raise(behavior: str) -> EventRaise:
    """The event, or JSON with `event` and `keep`. Raises BehaviorError."""
    if not is_object(behavior):
        return EventRaise(behavior)
    return read_object(behavior, EventRaise, 'an event, or JSON such as {"event": "/x", "keep": "2s"}')


def describe_behavior(function: str, behavior: str) -> str:
    """A behaviour for people: what is JSON in words, anything else as it is written."""
    if function == "startInteractionRule" and is_object(behavior):
        try:
            start = read_rule_start(behavior)
        except BehaviorError:
            return behavior
        place = "" if start.state is None else f", in {start.state}"
        return f"{start.rule}{place}{'' if start.enter else ', without onEntry'}"
    if function == "raiseEventTopic" and is_object(behavior):
        try:
            return read_event_raise(behavior).event
        except BehaviorError:
            return behavior
    return behavior


def is_object(behavior: str) -> bool:
    """Whether a behaviour is meant as a JSON object."""
    return behavior.lstrip().startswith("{")


def read_object(behavior: str, kind: type[Content], form: str) -> Content:
    """A behaviour as a value of `kind`. `form` ends the sentence about one that is none. Raises BehaviorError."""
    try:
        fields: dict[str, Any] = msgspec.json.decode(behavior, type=dict[str, Any])
        for name in fields:
            if name not in kind.__struct_fields__:
                near = did_you_mean(name, kind.__struct_fields__)
                raise BehaviorError(f"there is no field `{name}`{near}; the behaviour is {form}")
        return msgspec.convert(fields, kind)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        raise BehaviorError(f"the behaviour is {form} ({error})") from None
