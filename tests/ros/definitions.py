"""The message types of a wire in memory, and what of a message arrives."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from functools import cache
from typing import Any

from rise_adapters.ros2.transport.interfaces import InterfaceCatalog
from rise_adapters.ros2.transport.port import CANCEL_TYPE, STATUS_TYPE, Message, PortError

_INTEGERS = frozenset(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)) | {"byte", "char"}
_ZEROS: dict[str, Any] = {"bool": False, "boolean": False, "string": "", "wstring": "", "float32": 0.0, "float64": 0.0}
_BASIC: dict[str, dict[str, str]] = {
    "builtin_interfaces/msg/Time": {"sec": "int32", "nanosec": "uint32"},
    "builtin_interfaces/msg/Duration": {"sec": "int32", "nanosec": "uint32"},
    "unique_identifier_msgs/msg/UUID": {"uuid": "uint8[16]"},
    "action_msgs/msg/GoalInfo": {"goal_id": "unique_identifier_msgs/msg/UUID", "stamp": "builtin_interfaces/msg/Time"},
    "action_msgs/msg/GoalStatus": {"goal_info": "action_msgs/msg/GoalInfo", "status": "int8"},
    STATUS_TYPE: {"status_list": "action_msgs/msg/GoalStatus[]"},
    f"{CANCEL_TYPE}_Request": {"goal_info": "action_msgs/msg/GoalInfo"},
    f"{CANCEL_TYPE}_Response": {"return_code": "int8", "goals_canceling": "action_msgs/msg/GoalInfo[]"},
}


class Definitions:
    """Message types by name: those given, those that travel with the adapter, and any other, which then may hold
    anything."""

    def __init__(self, given: Mapping[str, Mapping[str, str]]) -> None:
        self._given = {**_BASIC, **{name: dict(fields) for name, fields in given.items()}}
        self._known = _shipped_types()
        self._unknown: set[str] = set()
        self._hashes: dict[str, str] = {}

    def fields(self, type: str) -> Mapping[str, str]:
        found = self._find(type)
        if found is None:
            raise PortError(f"the message type {type} is not known here")
        return found

    def hash(self, type: str) -> str:
        if type not in self._hashes:  # of one that is not known it takes long to find out
            try:
                self._hashes[type] = self._known.type_hash(type)
            except PortError:
                self._hashes[type] = f"RIHS01_{type}"
        return self._hashes[type]

    def complete(self, type: str, message: Message) -> Message:
        """The message as it would arrive: every field there, nothing shared with the sender's. Raises PortError."""
        found = self._find(type)
        if found is None:
            whole: Message = copied(message)
            return whole
        unknown = [name for name in message if name not in found]
        if unknown:
            raise PortError(f"{type} has no field {unknown[0]!r}; it has {', '.join(found) or 'none'}")
        return {name: self._value(kind, message.get(name), f"{type}.{name}") for name, kind in found.items()}

    def _find(self, type: str) -> Mapping[str, str] | None:
        if type in self._given:
            return self._given[type]
        if type not in self._unknown:
            try:
                fields: Mapping[str, str] = self._known.fields(type)
                return fields
            except PortError:  # found out once: it looks through every package that is sourced, for the nearest name
                self._unknown.add(type)
        for ending, implied in _implied(type):
            if type.endswith(ending):
                return implied
        return None

    def _value(self, kind: str, value: Any, where: str) -> Any:
        base, is_array, length = _parts(kind)
        if is_array:
            return self._array(base, length, value, where)
        if base in _INTEGERS:
            return self._fits(value, int, 0, where)
        if base in ("float32", "float64"):
            return float(self._fits(value, (int, float), 0.0, where))
        if base in _ZEROS:
            return self._fits(value, type(_ZEROS[base]), _ZEROS[base], where)
        if value is not None and not isinstance(value, dict):
            raise PortError(f"{where} is a {base}, not {value!r}")
        return self.complete(base, value or {})

    def _array(self, base: str, fixed: int | None, value: Any, where: str) -> Any:
        if base in ("uint8", "byte"):
            whole = bytes(fixed or 0) if value is None else bytes(value)
            if fixed is not None and len(whole) != fixed:
                raise PortError(f"{where} takes {fixed} bytes, not {len(whole)}")
            return whole
        items = [None] * (fixed or 0) if value is None else list(value)
        if fixed is not None and len(items) != fixed:
            raise PortError(f"{where} takes {fixed} values, not {len(items)}")
        return [self._value(base, item, where) for item in items]

    def _fits(self, value: Any, kind: type | tuple[type, ...], zero: Any, where: str) -> Any:
        if value is None:
            return zero
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise PortError(f"{where} cannot be {value!r}")
        return value


def _implied(type: str) -> list[tuple[str, dict[str, str]]]:
    """What an action type implies, for actions whose definition is not known."""
    stem = type
    for ending in ("_SendGoal_Request", "_GetResult_Response", "_FeedbackMessage"):
        stem = stem.removesuffix(ending)
    goal_id = "unique_identifier_msgs/msg/UUID"
    return [
        ("_SendGoal_Request", {"goal_id": goal_id, "goal": f"{stem}_Goal"}),
        ("_SendGoal_Response", {"accepted": "bool", "stamp": "builtin_interfaces/msg/Time"}),
        ("_GetResult_Request", {"goal_id": goal_id}),
        ("_GetResult_Response", {"status": "int8", "result": f"{stem}_Result"}),
        ("_FeedbackMessage", {"goal_id": goal_id, "feedback": f"{stem}_Feedback"}),
    ]


def copied(message: Any) -> Any:
    """The same message, which shares nothing that can change."""
    if isinstance(message, dict):
        return {name: copied(value) for name, value in message.items()}
    if isinstance(message, list):
        return [copied(value) for value in message]
    return message if isinstance(message, (str, bytes, int, float, type(None))) else deepcopy(message)


@cache
def _parts(kind: str) -> tuple[str, bool, int | None]:
    """What a field holds, whether it is an array of that, and of how many: `uint8[16]`."""
    base, bracket, length = kind.partition("[")
    length = length.rstrip("]")
    return base.partition("<=")[0], bool(bracket), int(length) if length.isdigit() else None


@cache
def _shipped_types() -> InterfaceCatalog:
    """Shared by all nodes: nothing of it changes."""
    return InterfaceCatalog()
