"""Reads ROS interface definitions: the text of a `.msg`, `.srv` or `.action` file
(https://docs.ros.org/en/jazzy/Concepts/Basic/About-Interfaces.html).

Names become full names (`PointStamped` of `geometry_msgs` becomes `geometry_msgs/msg/PointStamped`). Types implied by a
service or an action are derived: requests and responses, and for an action the services and messages that carry it
(https://design.ros2.org/articles/actions.html).

Two nodes compare type hashes `RIHS01_...` (https://ros.org/reps/rep-2016.html) to check that they mean the same type by
one name. A hash covers names, fields and everything nested, but no comments, constants and defaults.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

from msgspec import Struct

from rise_adapters.ros2.transport.port import PortError

INTEGER_RANGES = {
    f"{sign}int{bits}": (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for bits in (8, 16, 32, 64)
    for sign in ("", "u")
}
"""The integer types in the order of their ids in type hashes, with the smallest and largest value of each."""
PRIMITIVES = frozenset({"bool", "byte", "float32", "float64", "string", "wstring", *INTEGER_RANGES})
_ALIASES = {"char": "uint8"}
"""ROS 2 keeps `char` as another name for `uint8`. The wire and type hashes have only `uint8`."""
_ROS_1 = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}

_PACKAGE = r"[a-z][a-z0-9_]*"
_NAME = r"[A-Z][A-Za-z0-9_]*"
_TYPE = re.compile(
    rf"(?P<base>(?:{_PACKAGE}/(?:msg/)?)?[A-Za-z][A-Za-z0-9_]*)(?:<=(?P<length>\d+))?"
    r"(?P<array>\[(?P<most><=)?(?P<count>\d*)\])?"
)
_FIELD = re.compile(r"[a-z](?:_?[a-z0-9]+)*")
_CONSTANT = re.compile(r"[A-Z](?:_?[A-Z0-9]+)*")
_FULL = re.compile(rf"(?P<package>{_PACKAGE})/(?P<kind>msg|srv|action)/(?P<name>{_NAME})")


class InterfaceFieldType(Struct, frozen=True):
    """The type of a field."""

    base: str
    """A primitive in ROS's spelling, or the full name of a message: `float64`, `geometry_msgs/msg/Point`."""
    length: int = 0
    """Maximum bytes of a `string<=N`; 0: no limit."""
    container: str = ""
    """Empty: one value; `array` (exactly `count`), `bounded` (at most `count`) or `sequence`."""
    count: int = 0

    @property
    def is_nested(self) -> bool:
        return self.base not in PRIMITIVES

    def __str__(self) -> str:
        text = f"{self.base}<={self.length}" if self.length else self.base
        brackets = {"": "", "array": f"[{self.count}]", "bounded": f"[<={self.count}]", "sequence": "[]"}
        return text + brackets[self.container]


class InterfaceField(Struct, frozen=True):
    name: str
    type: InterfaceFieldType


class InterfaceDefinition(Struct, frozen=True):
    """A message type, or a whole service or action, whose fields are its parts."""

    name: str
    """`std_msgs/msg/String`, `rise_interfaces/action/Speech_Goal`."""
    fields: tuple[InterfaceField, ...]
    origin: str
    """Its source: a file's path, or a few words."""
    is_whole: bool = False
    """Whether it is a service or an action, and no message."""


def split_name(name: str) -> tuple[str, str, str]:
    """Split a type's name into package, kind (`msg`, `srv`, `action`) and name. Raises PortError if it is none."""
    match = _FULL.fullmatch(name)
    if match is None:
        raise PortError(f"{name!r} is not the name of a ROS type; one looks like std_msgs/msg/String")
    return match["package"], match["kind"], match["name"]


def read_definitions(package: str, kind: str, name: str, text: str, origin: str) -> dict[str, InterfaceDefinition]:
    """Read all types that a file defines and implies, by full name. Raises PortError with the place (`origin:line`)."""
    parts: list[list[tuple[int, str]]] = [[]]
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() == "---" and kind != "msg":
            parts.append([])
        else:
            parts[-1].append((number, line))
    wanted = {"msg": ("",), "srv": ("_Request", "_Response"), "action": ("_Goal", "_Result", "_Feedback")}[kind]
    if len(parts) != len(wanted):
        raise PortError(
            f"{origin}: {'a service' if kind == 'srv' else 'an action'} has {len(wanted)} parts with --- between them; "
            f"here are {len(parts)}"
        )
    full = f"{package}/{kind}/{name}"
    found = {}
    for part, lines in zip(wanted, parts, strict=True):
        fields: list[InterfaceField] = []
        for place, content in _strip_comments(lines, origin):
            _read_line(package, place, content, fields)
        found[full + part] = InterfaceDefinition(full + part, tuple(fields), origin)
    if kind == "srv":
        found |= service_definitions(full, origin)
    elif kind == "action":
        found |= action_definitions(full, origin)
    return found


def service_definitions(name: str, origin: str) -> dict[str, InterfaceDefinition]:
    """The types that a service implies, other than its request and response."""
    event = (
        _field("info", "service_msgs/msg/ServiceEventInfo"),
        InterfaceField("request", InterfaceFieldType(f"{name}_Request", container="bounded", count=1)),
        InterfaceField("response", InterfaceFieldType(f"{name}_Response", container="bounded", count=1)),
    )
    whole = (
        _field("request_message", f"{name}_Request"),
        _field("response_message", f"{name}_Response"),
        _field("event_message", f"{name}_Event"),
    )
    return {
        f"{name}_Event": InterfaceDefinition(f"{name}_Event", event, origin),
        name: InterfaceDefinition(name, whole, origin, is_whole=True),
    }


def action_definitions(name: str, origin: str) -> dict[str, InterfaceDefinition]:
    """The types that an action implies, other than its goal, result and feedback."""
    goal_id = _field("goal_id", "unique_identifier_msgs/msg/UUID")
    messages = {
        f"{name}_SendGoal_Request": (goal_id, _field("goal", f"{name}_Goal")),
        f"{name}_SendGoal_Response": (_field("accepted", "bool"), _field("stamp", "builtin_interfaces/msg/Time")),
        f"{name}_GetResult_Request": (goal_id,),
        f"{name}_GetResult_Response": (_field("status", "int8"), _field("result", f"{name}_Result")),
        f"{name}_FeedbackMessage": (goal_id, _field("feedback", f"{name}_Feedback")),
    }
    whole = (
        _field("goal", f"{name}_Goal"),
        _field("result", f"{name}_Result"),
        _field("feedback", f"{name}_Feedback"),
        _field("send_goal_service", f"{name}_SendGoal"),
        _field("get_result_service", f"{name}_GetResult"),
        _field("feedback_message", f"{name}_FeedbackMessage"),
    )
    return {
        **{full: InterfaceDefinition(full, fields, origin) for full, fields in messages.items()},
        **service_definitions(f"{name}_SendGoal", origin),
        **service_definitions(f"{name}_GetResult", origin),
        name: InterfaceDefinition(name, whole, origin, is_whole=True),
    }


def file_stems(kind: str, name: str) -> Iterator[str]:
    """The files that may define a type, likeliest first. Implied types have a name with an ending after `_`."""
    yield name
    while kind != "msg" and "_" in name:
        name = name.rpartition("_")[0]
        yield name


def _field(name: str, base: str) -> InterfaceField:
    return InterfaceField(name, InterfaceFieldType(base))


def _strip_comments(lines: list[tuple[int, str]], origin: str) -> Iterator[tuple[str, str]]:
    """The lines with content, without comments, and their places."""
    for number, line in lines:
        content = line.partition("#")[0].strip()
        if content:
            yield f"{origin}:{number}", content


def _read_line(package: str, place: str, line: str, fields: list[InterfaceField]) -> None:
    words = line.split(maxsplit=1)
    if len(words) != 2:
        raise PortError(f"{place}: {line!r} is neither a field nor a constant")
    type = read_field_type(words[0], place, package)
    name, equals, value = words[1].partition("=")
    if equals and _CONSTANT.fullmatch(name.strip()):
        _check_constant(place, type, value.strip())
        return
    name = words[1].split(maxsplit=1)[0]
    if not _FIELD.fullmatch(name):
        raise PortError(f"{place}: {name!r} cannot be a field's name: small letters, digits and single _ only")
    if any(field.name == name for field in fields):
        raise PortError(f"{place}: the field {name!r} is there twice")
    fields.append(InterfaceField(name, type))


def read_field_type(text: str, place: str, package: str = "") -> InterfaceFieldType:
    """Read a type in ROS's spelling. `package`: for messages without one. Raises PortError with the place."""
    match = _TYPE.fullmatch(text)
    if match is None:
        raise PortError(f"{place}: {text!r} is not a type")
    base = _ALIASES.get(match["base"], match["base"])
    if base in _ROS_1:
        raise PortError(f"{place}: {base!r} is of ROS 1; in ROS 2 it is {_ROS_1[base]}")
    length = int(match["length"] or 0)
    if length and base not in ("string", "wstring"):
        raise PortError(f"{place}: only texts can have a largest length, not {base}")
    if base not in PRIMITIVES:
        base = _qualify_base(package, place, base)
    if not match["array"]:
        return InterfaceFieldType(base, length)
    if match["most"]:
        return InterfaceFieldType(base, length, "bounded", int(match["count"] or 0))
    if match["count"]:
        return InterfaceFieldType(base, length, "array", int(match["count"]))
    return InterfaceFieldType(base, length, "sequence")


def _qualify_base(package: str, place: str, base: str) -> str:
    owner, slash, name = base.rpartition("/")
    owner = owner.removesuffix("/msg") if slash else package
    if not re.fullmatch(_NAME, name):
        raise PortError(f"{place}: there is no type {base!r}; a message's name begins with a capital letter")
    return f"{owner}/msg/{name}"


def _check_constant(place: str, type: InterfaceFieldType, text: str) -> None:
    """Check a constant. Constants are on no wire and in no hash, but ROS would refuse a file with a wrong one."""
    try:
        if (
            type.container
            or type.is_nested
            or (type.base == "bool" and text.lower() not in ("true", "false", "1", "0"))
        ):
            raise ValueError
        if type.base not in ("bool", "string", "wstring"):
            float(text) if type.base.startswith("float") else int(text, 0)
    except ValueError:
        raise PortError(f"{place}: {text!r} is not a value for a constant of type {type}") from None


# --- hashes of types --------------------------------------------------------------------------------------------------

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
"""The one field (a `uint8`) of a message without fields, on the wire and in hashes."""


def type_hash(name: str, definition: Callable[[str], InterfaceDefinition]) -> str:
    """The hash of a type. `definition` returns the nested types; its errors pass through."""
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
    # The hash is that of a text. Its separators and order of keys are part of the standard.
    return f"RIHS01_{sha256(json.dumps(whole, separators=(', ', ': ')).encode()).hexdigest()}"


def read_built_hashes(file: Path) -> dict[str, str]:
    """The hashes, by type, that rosidl wrote beside a definition at build time; empty: unreadable."""
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
