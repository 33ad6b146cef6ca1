"""From the message of a goal back to the action and the parameters that a carrier made it from, as well as that can be
told: for a robot that is only simulated, and says what it would do.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rise_adapters.ros2.mapping.action_mapping import field_at
from rise_adapters.ros2.mapping.templates import Placeholder, parse_template, seconds_per_unit, unit_factors
from rise_adapters.ros2.transport.port import Message
from rise_engine.scenario.model import ActionSpec, Parameter
from rise_engine.scenario.parameters import accepts_any_name, listed_names


class GoalReader:
    """Reads what arrives under one name; several actions of a profile may share it."""

    def __init__(self, specs: Sequence[ActionSpec]) -> None:
        """`specs` have carriers, all written out, that `read_mappings` has found right."""
        self._actions = [_ActionPattern(spec) for spec in specs]

    def read(self, message: Message) -> tuple[ActionSpec, dict[str, Any]]:
        """The action that this message is most likely of, and its parameters; those that say nothing are left out."""
        candidates = [
            (action.spec, action.read_parameters(message)) for action in self._actions if action.matches(message)
        ]
        for spec, parameters in candidates:
            if _is_complete(spec, parameters):
                return spec, parameters
        return candidates[0] if candidates else (self._actions[0].spec, self._actions[0].read_parameters(message))


class _ActionPattern:
    def __init__(self, spec: ActionSpec) -> None:
        self.spec = spec
        self._values: dict[str, dict[str, Any]] = spec.carrier.get("values", {})
        self._fields = list(_list_fields(spec.carrier.get("goal") or spec.carrier.get("message") or {}))

    def matches(self, message: Message) -> bool:
        """Whether its constants are there."""
        return all(
            field_at(message, path) == value
            for path, value in self._fields
            if not isinstance(value, list) and not any(isinstance(piece, Placeholder) for piece in _parse_pieces(value))
        )

    def read_parameters(self, message: Message) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for path, written in self._fields:
            pieces, value = _parse_pieces(written), field_at(message, path)
            for slot in (piece for piece in pieces if isinstance(piece, Placeholder)):
                if slot.special:
                    found.update(_parse_json_object(value) if slot.name == "parameters" else {})
                    continue
                parameter = self.spec.parameters[slot.name]
                alone = len(pieces) == 1
                read = self._read_parameter(parameter, slot, value) if alone else _whole_text(parameter, value)
                if read is not None:
                    found.setdefault(slot.name, read)
        return found

    def _read_parameter(self, parameter: Parameter, slot: Placeholder, value: Any) -> Any:
        """None: the sender left it to the robot."""
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
        # What is not said at all, and what would be so if it were not said.
        left_out = not parameter.required and (value in (0, "", None) or value == parameter.default)
        return None if left_out else value


def _is_complete(spec: ActionSpec, parameters: Mapping[str, Any]) -> bool:
    """Whether the names that it needs are there, and are names that it has."""
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
        else:
            yield inside, value


def _parse_pieces(value: Any) -> tuple[Any, ...]:
    return parse_template(value) if isinstance(value, str) else (value,)


def _whole_text(parameter: Parameter, value: Any) -> str | None:
    """A parameter within a longer text: that text stands for it."""
    return value if isinstance(value, str) and parameter.type == "text" else None


def _parse_json_object(text: Any) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except (TypeError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _round_single(number: float) -> int | float:
    """Without the digits that single precision makes up: 0.30000001 is 0.3."""
    rounded = round(number, 6)
    return int(rounded) if rounded == int(rounded) else rounded
