"""Makes the type descriptions that Cyclone DDS wants of each topic, from ROS definitions.

Only described here: the bytes themselves are made by `interfaces.cdr`. Cyclone checks what comes in against the
description, and sends it along for nodes that look at types (those of ROS do not).
"""

from __future__ import annotations

from typing import Any

from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl import types as idl

from rise_adapters.ros2.transport.dds.names import dds_type
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog, InterfaceDefinition, InterfaceFieldType
from rise_adapters.ros2.transport.interfaces.definitions import INTEGER_RANGES
from rise_adapters.ros2.transport.interfaces.hashes import PLACEHOLDER_FIELD

_PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "string": str,
    "byte": idl.byte,
    **{name: getattr(idl, name) for name in (*INTEGER_RANGES, "float32", "float64")},
}
_LARGEST_BOUND = 65535
"""Cyclone's descriptions know no larger; such a sequence is described as one without a bound."""
_HEADER = {"rmw_writer_guid": idl.uint64, "rmw_sequence_number": idl.int64}


class IdlTypes:
    """Types for Cyclone DDS, made when they are first wanted."""

    def __init__(self, types: InterfaceCatalog) -> None:
        self._types = types
        self._made: dict[tuple[str, bool], type[IdlStruct]] = {}

    def find_or_make(self, type: str, headed: bool = False) -> type[IdlStruct]:
        """The description of a message; `headed`: of a request or reply, which begins with whose and which it is."""
        found = self._made.get((type, headed))
        if found is None:
            definition = self._types.message_definition(type)
            found = self._made[type, headed] = self._make_type(definition, _HEADER if headed else {})
        return found

    def _make_type(self, definition: InterfaceDefinition, header: dict[str, Any]) -> type[IdlStruct]:
        fields = {field.name: self._field_type(field.type) for field in definition.fields}
        return make_idl_struct(
            definition.name.replace("/", "_"),
            dds_type(definition.name),
            {**header, **(fields or {PLACEHOLDER_FIELD: idl.uint8})},
            dataclassify=False,
        )

    def _field_type(self, type: InterfaceFieldType) -> Any:
        element = self.find_or_make(type.base) if type.is_nested else _PRIMITIVES[type.base]
        if type.length:
            element = idl.bounded_str[type.length]  # type: ignore[misc]
        if type.container == "array":
            return idl.array[element, type.count]  # type: ignore[misc]
        if type.container == "bounded" and type.count <= _LARGEST_BOUND:
            return idl.sequence[element, type.count]  # type: ignore[misc]
        return idl.sequence[element] if type.container else element  # type: ignore[misc]
