"""Times, angles and places in the fields of a message: `{@now}`, `{@yaw(angle)}`, `{place.x}`, and a whole pose from a
parameter's place (docs/reference/robots.md, "What fills a field")."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from rise_adapters.ros2.mapping.field_sources import NO_VALUE, FieldSource, FillContext, fit_literal
from rise_adapters.ros2.mapping.field_types import (
    QUATERNION,
    TIME,
    MessageFieldType,
    describe_field_type,
    describe_value,
)
from rise_adapters.ros2.mapping.templates import Placeholder, special_fallback
from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.model import Parameter

PLACE_FRAME = "map"
"""The coordinate frame of a place without one (REP 105)."""

_POINT = {"x": "{%s.x}", "y": "{%s.y}", "z": "{%s.z|0}"}
_POSE = {"position": _POINT, "orientation": "{@yaw(%s.yaw|0)}"}
_POSES: dict[str, dict[str, Any]] = {
    "geometry_msgs/msg/Point": _POINT,
    "geometry_msgs/msg/Pose": _POSE,
    "geometry_msgs/msg/PoseStamped": {
        "header": {"frame_id": "{%s.frame|" + PLACE_FRAME + "}", "stamp": "{@now}"},
        "pose": _POSE,
    },
}


def pose_fields(type: str, parameter: str) -> dict[str, Any] | None:
    """The message fields for a place, as in a carrier; None: the type is not for places."""
    table = _POSES.get(type)
    return None if table is None else _insert(table, parameter)


def _insert(table: dict[str, Any], parameter: str) -> dict[str, Any]:
    return {
        key: _insert(value, parameter) if isinstance(value, dict) else value.replace("%s", parameter)
        for key, value in table.items()
    }


# --- the time ---------------------------------------------------------------------------------------------------------


class NowSource(Struct, frozen=True):
    """The time of sending."""

    in_seconds: bool

    def fill(self, context: FillContext) -> Any:
        seconds, nanoseconds = divmod(context.now, 1_000_000_000)
        return context.now / 1e9 if self.in_seconds else {"sec": seconds, "nanosec": nanoseconds}


def compile_now(type: MessageFieldType | None, *, in_text: bool) -> NowSource:
    """The source for `@now`. Raises ValueError with a sentence if the field cannot hold a time."""
    if in_text or (type is not None and (type.is_list or (type.base not in (TIME, "float64")))):
        takes = "is a text" if in_text or type is None else f"takes {describe_field_type(type)}"
        raise ValueError(f"{takes}, and @now is a {TIME}, or seconds since 1970 in a float64")
    return NowSource(type is not None and type.base != TIME)


# --- an angle ---------------------------------------------------------------------------------------------------------


class YawSource(Struct, frozen=True):
    """The quaternion of a rotation about the vertical axis."""

    field: str
    angle: FieldSource
    """In radians; without a value, no rotation."""

    def fill(self, context: FillContext) -> Any:
        angle = self.angle.fill(context)
        if angle is NO_VALUE:
            angle = 0.0
        elif isinstance(angle, bool) or not isinstance(angle, int | float):
            raise ValueError(f"`{self.field}` takes an angle in radians, and {describe_value(angle)} is not")
        return {"x": 0.0, "y": 0.0, "z": math.sin(angle / 2), "w": math.cos(angle / 2)}


def check_quaternion(type: MessageFieldType | None, *, in_text: bool) -> None:
    """Check that the field can hold a quaternion. Raises ValueError with a sentence if not."""
    if in_text or (type is not None and (type.is_list or type.base != QUATERNION)):
        takes = "is a text" if in_text or type is None else f"takes {describe_field_type(type)}"
        raise ValueError(f"{takes}, and @yaw gives a {QUATERNION}")


# --- a place ----------------------------------------------------------------------------------------------------------


class PlaceSource(Struct, frozen=True):
    """One value of the place that a parameter names."""

    field: str
    parameter: Parameter
    key: str
    values: dict[str, Any]
    """By the place's name; places without that value are omitted."""
    places: frozenset[str]
    absent: Any
    special: str | None
    type: MessageFieldType | None

    def fill(self, context: FillContext) -> Any:
        place = context.parameters.get(self.parameter.name, self.parameter.default)
        if place is not None and place not in self.places:
            known = did_you_mean(str(place), self.places)
            raise ValueError(f"`{self.field}` needs a place, and `{place}` is none{known}")
        if place in self.values:
            return self.values[place]
        return self.absent if self.special is None else fit_literal(context.specials[self.special], self.type)


def compile_place_value(
    slot: Placeholder,
    parameter: Parameter,
    places: Mapping[str, Mapping[str, Any]],
    type: MessageFieldType | None,
    where: str,
) -> PlaceSource:
    """Return the source for a place's value. Raises ValueError with a sentence if the parameter names no places, the
    field cannot hold the value, or a value may be missing: the robot would be sent to the origin."""
    if not parameter.place:
        raise ValueError(
            f"has `{{{slot.name}.{slot.key}}}`, and `{slot.name}` names no places; declare it with `place = true`"
        )
    if slot.unit is not None:
        raise ValueError(f"has `{{{slot.name}.{slot.key}:{slot.unit}}}`; a property of a place has no unit")
    keys = dict.fromkeys(key for place in places.values() for key in place)
    if places and slot.key not in keys and slot.fallback is None:
        raise ValueError(f"takes `{slot.key}`, which no place has{did_you_mean(slot.key, keys)}")
    if slot.key == "frame" and slot.fallback is None:
        slot = replace(slot, fallback=PLACE_FRAME)
    if slot.fallback is None:
        how = f"write `{{{slot.name}.{slot.key}|VALUE}}` for the others"
        if lacking := [name for name, place in places.items() if slot.key not in place]:
            raise ValueError(f"takes `{slot.key}`, and {in_backquotes(lacking)} lacks it; add it there, or {how}")
        if not parameter.required and parameter.default is None:
            raise ValueError(
                f"takes `{slot.key}` of a place, and an act need not name one; write `required = true` or a "
                f"`default` in `parameters.{slot.name}`, or {how}"
            )
    values = {}
    for name, place in places.items():
        if slot.key in place:
            try:
                values[name] = fit_literal(place[slot.key], type)
            except ValueError as error:
                raise ValueError(f"{error} (`places.{name}.{slot.key}`)") from None
    special = special_fallback(slot)
    absent: Any = NO_VALUE
    if slot.fallback is not None and special is None:
        try:
            absent = fit_literal(_read_fallback(slot.fallback, type), type)
        except ValueError as error:
            raise ValueError(f"{error} (the fallback of `{slot.name}.{slot.key}`)") from None
    return PlaceSource(where, parameter, slot.key, values, frozenset(places), absent, special, type)


def _read_fallback(written: str, type: MessageFieldType | None) -> str | float:
    if type is not None and type.kind == "text":
        return written
    try:
        return float(written)
    except ValueError:
        return written
