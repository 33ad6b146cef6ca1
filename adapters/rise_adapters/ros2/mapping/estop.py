"""The emergency stop of a laboratory that a profile names (`options.estop`): where it is heard, when it is pressed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from rise_adapters.ros2.mapping.action_mapping import EstopMapping
from rise_adapters.ros2.mapping.compiler import ProfileMistakes
from rise_adapters.ros2.mapping.field_sources import fit_literal
from rise_adapters.ros2.mapping.field_types import FieldTypes
from rise_adapters.ros2.transport.names import is_ros_name
from rise_adapters.ros2.transport.port import PortError
from rise_engine.scenario.durations import MAX_SECONDS

WHERE = "options.estop"
_TYPE = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*", re.ASCII)
_OF_TOPIC = ("topic", "type", "when", "silent_after")


def parse_estop(table: Any, types: FieldTypes, mistakes: ProfileMistakes) -> EstopMapping | None:
    """What `options.estop` says; None when it says nothing that can be used. What is wrong goes into `mistakes`."""
    if not isinstance(table, dict) or ("topic" in table) == ("service" in table):
        mistakes.add(WHERE, 'is a table with a `topic` or a `service`: { topic = "/estop", type = ..., when = ... }')
        return None
    kind = "topic" if "topic" in table else "service"
    mistakes.add_unknown_keys(WHERE, table, _OF_TOPIC if kind == "topic" else ("service",))
    name = table[kind]
    if not is_ros_name(name):
        mistakes.add(f"{WHERE}.{kind}", "is a ROS name such as `/estop_pressed`")
        return None
    if kind == "service":
        return EstopMapping(name)
    type = table.get("type")
    if not isinstance(type, str) or not _TYPE.fullmatch(type):
        mistakes.add(f"{WHERE}.type", "is the type of its messages, such as `std_msgs/msg/Bool`")
        return None
    seconds = table.get("silent_after", 0)
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not 0 <= seconds <= MAX_SECONDS:
        mistakes.add(f"{WHERE}.silent_after", f"is a number of seconds, up to {MAX_SECONDS:.0f} (24 hours)")
        seconds = 0
    when = table.get("when")
    if not isinstance(when, dict) or not when:
        mistakes.add(f"{WHERE}.when", "says which values mean that it is pressed: { data = true }")
        return None
    fields = tuple((path, _read_values(path, value, type, types, mistakes)) for path, value in _flatten(when))
    return EstopMapping(name, type, fields, float(seconds))


def _flatten(table: Mapping[str, Any], before: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """By the path of each field, what is written for it: `{ a.b = 1 }` and `{ "a.b" = 1 }` are the same."""
    for key, value in table.items():
        path = (*before, *key.split("."))
        if isinstance(value, dict):
            yield from _flatten(value, path)
        else:
            yield path, value


def _read_values(
    path: tuple[str, ...], written: Any, type: str, types: FieldTypes, mistakes: ProfileMistakes
) -> tuple[Any, ...]:
    """One value or a list of them, as the field has them."""
    values = tuple(written) if isinstance(written, list) else (written,)
    try:
        field = types.find(type, path)
        if not values or not all(isinstance(value, bool | int | float | str) for value in values):
            raise ValueError("is a value, or a list of values: [3, 6, 7]")
        if field is not None and field.is_list:
            raise ValueError(f"is a list ({field}), and lists are not compared")
        return tuple(fit_literal(value, field) for value in values)
    except (ValueError, PortError) as error:
        is_missing = isinstance(error, PortError)
        mistakes.add(f"{WHERE}.when.{'.'.join(path)}", str(error), "missing" if is_missing else "wrong")
        return ()
