"""Finds the action and the parameters behind a goal's message, for a simulated robot that prints its behaviour."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeAlias

from msgspec.structs import replace
from rise_adapters.ros2.mapping.action_mapping import field_at
from rise_adapters.ros2.mapping.poses import pose_fields
from rise_adapters.ros2.mapping.templates import Placeholder, parse_template, seconds_per_unit, unit_factors
from rise_adapters.ros2.transport.port import Message

from rise_engine.scenario.model import ActionSpec, Parameter
from rise_engine.scenario.parameters import accepts_any_name, listed_names

Places: TypeAlias = Mapping[str, Mapping[str, Any]]
"""The known values of each place, by its name."""


class GoalReader:
    """Reads the messages under one name, which several actions of a profile may share."""

    def __init__(self, specs: Sequence[ActionSpec], places: Places) -> None:
        """`specs` have carriers, all written out and accepted by `read_mappings`; `places` are those of the profile."""
        self._actions = [_ActionPattern(spec, places) for spec in specs]

    def read(self, message: Message) -> tuple[ActionSpec, dict[str, Any]]:
        """The most likely action of this message, and its parameters, without empty ones."""
        candidates = [
            (action.spec, action.read_parameters(message)) for action in self._actions if action.matches(message)
        ]
        for spec, parameters in candidates:
            if _is_complete(spec, parameters):
                return spec, parameters
        return candidates[0] if candidates else (self._actions[0].spec, self._actions[0].read_parameters(message))


class _ActionPattern:
    def __init__(self, spec: ActionSpec, places: Places) -> None:
        self.spec = spec
        self._places = places
        self._values: dict[str, dict[str, Any]] = spec.carrier.get("values", {})
        parts = [spec.carrier[part] for part in ("goal", "message", "request") if part in spec.carrier]
        self._fields = list(_list_fields(parts[0] if parts else {}))

    def matches(self, message: Message) -> bool:
        """Whether the message has its constants."""
        return all(
            field_at(message, path) == value
            for path, value in self._fields
            if not any(isinstance(piece, Placeholder) for piece in _parse_pieces(value))
        )

    def read_parameters(self, message: Message) -> dict[str, Any]:
        found: dict[str, Any] = {}
        given: dict[str, dict[str, Any]] = {}
        """By the parameter that names a place, the place's values in the message."""
        for path, written in self._fields:
            self._read_field(_parse_pieces(written), field_at(message, path), found, given)
        for name, values in given.items():
            if (place := self._find_place(values)) is not None:
                found.setdefault(name, place)
        return found

    def _read_field(
        self, pieces: tuple[Any, ...], value: Any, found: dict[str, Any], given: dict[str, dict[str, Any]]
    ) -> None:
        for slot in (piece for piece in pieces if isinstance(piece, Placeholder)):
            if slot.special:
                found.update(_parse_json_object(value) if slot.name == "parameters" else {})
                continue
            parameter = self.spec.parameters[slot.name]
            if slot.function and isinstance(value, dict):
                value = 2 * math.atan2(value.get("z", 0.0), value.get("w", 1.0))
                slot = replace(slot, unit=None if slot.key else "rad")
            if slot.key:
                given.setdefault(slot.name, {})[slot.key] = value
            elif parameter.place and isinstance(value, dict):
                for path, written in _list_fields(pose_fields(_type_of_pose(value), slot.name) or {}):
                    self._read_field(_parse_pieces(written), field_at(value, path), found, given)
            else:
                alone = len(pieces) == 1
                read = self._read_parameter(parameter, slot, value) if alone else _whole_text(parameter, value)
                if read is not None:
                    found.setdefault(slot.name, read)

    def _find_place(self, given: Mapping[str, Any]) -> str | None:
        """The first place that may have these values."""
        return next(
            (
                name
                for name, place in self._places.items()
                if all(_is_near(place[key], value) for key, value in given.items() if key in place)
            ),
            None,
        )

    def _read_parameter(self, parameter: Parameter, slot: Placeholder, value: Any) -> Any:
        """The value of a parameter; None: the sender left it to the robot."""
        for written, sent in self._values.get(parameter.name, {}).items():
            if sent == value or (
                isinstance(value, float) and isinstance(sent, float | int) and _round_single(value) == sent
            ):
                return _round_single(float(written)) if parameter.type in ("number", "integer") else written
        if isinstance(value, dict) and {"sec", "nanosec"} <= set(value):
            size = seconds_per_unit(parameter) or 1.0
            value = _round_single((value["sec"] + value["nanosec"] / 1e9) / size)
        elif isinstance(value, float | int) and not isinstance(value, bool):
            if slot.unit is not None:
                times, by = unit_factors(parameter, slot.unit)
                value = value * by / times
            value = _round_single(float(value))
            if parameter.type == "name":
                return next((name for name, code in parameter.codes.items() if code == value), value)
        # A value that means the same as no value.
        left_out = not parameter.required and (value in (0, "", None) or value == parameter.default)
        return None if left_out else value


def _type_of_pose(value: Mapping[str, Any]) -> str:
    kind = "PoseStamped" if "header" in value else "Pose" if "position" in value else "Point"
    return f"geometry_msgs/msg/{kind}"


def _is_near(one: Any, other: Any) -> bool:
    if isinstance(one, str) or isinstance(other, str):
        return bool(one == other)
    return math.isclose(one, other, rel_tol=1e-5, abs_tol=1e-5)


def _is_complete(spec: ActionSpec, parameters: Mapping[str, Any]) -> bool:
    """Whether the names that it needs are there and known."""
    for each in spec.parameters.values():
        if each.type != "name":
            continue
        name = parameters.get(each.name)
        if name is None and each.required:
            return False
        if name is not None and not accepts_any_name(each) and name not in listed_names(each):
            return False
    return True


def _list_fields(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for key, value in table.items():
        inside = (*path, *key.split("."))
        if isinstance(value, dict):
            yield from _list_fields(value, inside)
        elif isinstance(value, list):  # only parameters: a list's numbers may be rounded on the way
            items = {str(number): item for number, item in enumerate(value)}
            yield from (each for each in _list_fields(items, inside) if isinstance(each[1], str) and "{" in each[1])
        else:
            yield inside, value


def _parse_pieces(value: Any) -> tuple[Any, ...]:
    return parse_template(value) if isinstance(value, str) else (value,)


def _whole_text(parameter: Parameter, value: Any) -> str | None:
    """A parameter within a longer text: the whole text represents it."""
    return value if isinstance(value, str) and parameter.type == "text" else None


def _parse_json_object(text: Any) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except (TypeError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _round_single(number: float) -> int | float:
    """The number without the extra digits of single precision: 0.30000001 is 0.3."""
    rounded = round(number, 6)
    return int(rounded) if rounded == int(rounded) else rounded
