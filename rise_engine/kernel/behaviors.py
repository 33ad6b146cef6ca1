"""Behaviours of tasks in JSON, for functions that need more than a name (semantics.md 1.1).

Any client can write such a behaviour. So each reader refuses an invalid one with a sentence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, TypeAlias, TypeVar

import msgspec
from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.typed_values import format_value
from rise_engine.scenario.durations import MAX_SECONDS, parse_time

Content = TypeVar("Content", bound=Struct)
Resumption: TypeAlias = Literal["enter", "wait", "leave"]
"""What happens to a rule that a stop ended: it enters its state again, waits there without onEntry, or stays ended."""


class BehaviorError(RiseError, ValueError):
    """A behaviour cannot be read; the message is a sentence for a person."""


class RuleStart(Struct, frozen=True, forbid_unknown_fields=True):
    """The behaviour of startInteractionRule: a rule and its first state (`rule_start_behavior` writes it)."""

    rule: str
    state: str | None = None
    """Null: the initial state."""
    enter: bool = True
    """False: the rule waits there without running `onEntry`."""


class StepBack(Struct, frozen=True, forbid_unknown_fields=True):
    """The behaviour of stepBack: a rule, and what else is undone."""

    rule: str
    take_back: tuple[str, ...] = ()
    """Memory keys that get back their values from the entry of the previous state."""
    enter: bool = True
    """False: the rule waits there without running `onEntry`."""
    stop_acts: bool = False
    """Whether to stop the acts that the rule has started."""


_STEP_BACK = '{"rule": "Table setting", "take_back": ["task"], "enter": true, "stop_acts": false}'
_RELEASE = '{"Table setting": "enter", "Wizard": "wait", "stop": 1}'
_RULE_START = '{"rule": "Table setting", "state": "After the welcome", "enter": false}'


def read_rule_start(behavior: str) -> RuleStart:
    """Read a rule's name, or JSON with `rule`, `state` and `enter`. Raises BehaviorError."""
    if not is_object(behavior):
        return RuleStart(behavior)
    return read_object(behavior, RuleStart, f"a rule's name, or JSON such as {_RULE_START}")


class Release(Struct, frozen=True):
    """The behaviour of releaseStop (`release_behavior` writes it)."""

    rules: dict[str, Resumption]
    """The resumption of each rule; other rules stay stopped."""
    stop: int | None = None
    """The number of the stop that the person has seen, from 1; None: any."""


def read_release(behavior: str) -> Release:
    """Read the behaviour of releaseStop; empty: all rules stay stopped. Raises BehaviorError."""
    try:
        given = msgspec.json.decode(behavior, type=dict[str, Resumption | int]) if behavior else {}
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        raise BehaviorError(f"the behaviour is empty, or JSON such as {_RELEASE} ({error})") from None
    rules = {name: how for name, how in given.items() if not isinstance(how, int)}
    numbers = {name: number for name, number in given.items() if isinstance(number, int)}
    if numbers.keys() - {"stop"}:
        raise BehaviorError(f"the behaviour is empty, or JSON such as {_RELEASE}")
    return Release(rules, numbers.get("stop"))


def release_behavior(rules: Mapping[str, str], stop: int | None = None) -> str:
    """Write the behaviour of releaseStop; empty: every rule stays stopped, and any stop is meant."""
    resumed: dict[str, str | int] = {name: how for name, how in rules.items() if how != "leave"}
    if stop is not None and "stop" not in resumed:  # a rule named `stop` takes this place
        resumed["stop"] = stop
    return msgspec.json.encode(resumed).decode() if resumed else ""


def read_step_back(behavior: str) -> StepBack:
    """Read a rule's name, or JSON with the fields of `StepBack`. Raises BehaviorError."""
    if not is_object(behavior):
        return StepBack(behavior)
    return read_object(behavior, StepBack, f"a rule's name, or JSON such as {_STEP_BACK}")


def started_rule(behavior: str) -> str:
    """The name of the rule that a startInteractionRule starts. An unreadable behaviour counts as a name."""
    try:
        return read_rule_start(behavior).rule
    except BehaviorError:
        return behavior


class EventRaise(Struct, frozen=True, forbid_unknown_fields=True):
    """The behaviour of raiseEventTopic: an event, and how long it is kept (`event_behavior` writes it)."""

    event: str
    keep: str | None = None
    """As written: `2s`; null: not kept."""

    @property
    def seconds(self) -> float | None:
        """Seconds for which it is kept; None: not kept. Raises BehaviorError."""
        seconds = parse_time(self.keep) if self.keep is not None else None
        if self.keep is not None and (seconds is None or not 0.001 <= seconds <= MAX_SECONDS):
            raise BehaviorError(f'`keep` is a time from 1ms to 24 hours, such as "2s", not "{self.keep}"')
        return seconds


def read_event_raise(behavior: str) -> EventRaise:
    """Read the event, or JSON with `event` and `keep`. Raises BehaviorError."""
    if not is_object(behavior):
        return EventRaise(behavior)
    return read_object(behavior, EventRaise, 'an event, or JSON such as {"event": "/x", "keep": "2s"}')


def describe_behavior(function: str, behavior: str) -> str:
    """Describe a behaviour for people: JSON in words, other texts as written."""
    describe = _DESCRIPTIONS.get(function)
    if describe is None or not is_object(behavior):
        return behavior
    try:
        return describe(behavior)
    except BehaviorError:
        return behavior


def _describe_start(behavior: str) -> str:
    start = read_rule_start(behavior)
    place = "" if start.state is None else f", in {start.state}"
    return f"{start.rule}{place}{'' if start.enter else ', without onEntry'}"


def _describe_release(behavior: str) -> str:
    return ", ".join(f"{rule}: {how}" for rule, how in read_release(behavior).rules.items())


def _describe_step_back(behavior: str) -> str:
    step = read_step_back(behavior)
    keys = f", takes back {', '.join(step.take_back)}" if step.take_back else ""
    return f"{step.rule}{keys}{'' if step.enter else ', without onEntry'}{', stops its acts' if step.stop_acts else ''}"


def _describe_assignment(behavior: str) -> str:
    try:
        values: dict[str, Any] = msgspec.json.decode(behavior, type=dict[str, Any])
    except (msgspec.DecodeError, RecursionError, UnicodeError):
        return behavior
    return ", ".join(f"{key} = {format_value(value)}" for key, value in values.items())


_DESCRIPTIONS: dict[str, Callable[[str], str]] = {
    "assignValue": _describe_assignment,
    "startInteractionRule": _describe_start,
    "raiseEventTopic": lambda behavior: read_event_raise(behavior).event,
    "releaseStop": _describe_release,
    "stepBack": _describe_step_back,
}


def is_object(behavior: str) -> bool:
    """Whether a behaviour is written as a JSON object."""
    return behavior.lstrip().startswith("{")


def read_object(behavior: str, kind: type[Content], form: str) -> Content:
    """Read a behaviour as a value of `kind`. `form` ends the sentence about an error. Raises BehaviorError."""
    try:
        fields: dict[str, Any] = msgspec.json.decode(behavior, type=dict[str, Any])
        for name in fields:
            if name not in kind.__struct_fields__:
                near = did_you_mean(name, kind.__struct_fields__)
                raise BehaviorError(f"there is no field `{name}`{near}; the behaviour is {form}")
        return msgspec.convert(fields, kind)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        raise BehaviorError(f"the behaviour is {form} ({error})") from None
