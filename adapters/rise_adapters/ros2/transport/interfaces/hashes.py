"""Type hashes `RIHS01_...` (https://ros.org/reps/rep-2016.html): by them two nodes see whether they mean the same type
by one name. A hash covers names, fields and everything nested; comments, constants and defaults do not count."""

from __future__ import annotations

import json
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from rise_adapters.ros2.transport.interfaces.definitions import (
    INTEGER_RANGES,
    InterfaceDefinition,
    InterfaceFieldType,
)

_IDS = {
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
    "wstring": 18,
    **{name: id for id, name in enumerate(INTEGER_RANGES, 2)},
}
_NESTED = 1
_BOUNDED_TEXT = {"string": 21, "wstring": 22}
_MANY = {"": 0, "array": 48, "bounded": 96, "sequence": 144}

PLACEHOLDER_FIELD = "structure_needs_at_least_one_member"
"""The one field (a `uint8`) that a message without fields has on the wire and in hashes."""


def type_hash(name: str, definition: Callable[[str], InterfaceDefinition]) -> str:
    """The hash of a type. `definition` gives the types nested in it; what it raises passes through."""
    described: dict[str, dict[str, Any]] = {}

    def describe(type: str) -> None:
        if type in described:
            return
        fields = definition(type).fields
        described[type] = {
            "type_name": type,
            "fields": [_describe_field(field.name, field.type) for field in fields]
            or [_describe_field(PLACEHOLDER_FIELD, InterfaceFieldType("uint8"))],
        }
        for field in fields:
            if field.type.is_nested:
                describe(field.type.base)

    describe(name)
    whole = {
        "type_description": described.pop(name),
        "referenced_type_descriptions": [described[type] for type in sorted(described)],
    }
    # The hash is one of text: this separator and this order of keys are part of the standard.
    return f"RIHS01_{sha256(json.dumps(whole, separators=(', ', ': ')).encode()).hexdigest()}"


def read_built_hashes(file: Path) -> dict[str, str]:
    """By type, the hashes that rosidl wrote beside a definition when its package was built; none if they cannot be
    read."""
    try:
        return {each["type_name"]: each["hash_string"] for each in json.loads(file.read_text("utf-8"))["type_hashes"]}
    except (OSError, ValueError, LookupError, TypeError):
        return {}


def _describe_field(name: str, type: InterfaceFieldType) -> dict[str, Any]:
    id = _NESTED if type.is_nested else _BOUNDED_TEXT[type.base] if type.length else _IDS[type.base]
    return {
        "name": name,
        "type": {
            "type_id": id + _MANY[type.container],
            "capacity": type.count,
            "string_capacity": type.length,
            "nested_type_name": type.base if type.is_nested else "",
        },
    }
