"""The types of fields of ROS messages, and their valid values (docs/reference/robots.md)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias

from msgspec.structs import astuple

from rise_adapters.ros2.transport.interfaces.definitions import INTEGER_RANGES, InterfaceFieldType, read_field_type
from rise_adapters.ros2.transport.port import PortError
from rise_engine.base.nearest_name import did_you_mean

FieldKind: TypeAlias = Literal["integer", "float", "text", "boolean", "message"]
ReadFields: TypeAlias = Callable[[str], Mapping[str, str]]
"""`Transport.fields`: the fields of a message type. Raises PortError if the type is unknown."""

DURATION = "builtin_interfaces/msg/Duration"
TIME = "builtin_interfaces/msg/Time"
QUATERNION = "geometry_msgs/msg/Quaternion"

_INTEGERS = {"byte": (0, 255), **INTEGER_RANGES}
_FLOATS = {"float32": 3.4028234663852886e38, "float64": math.inf}
"""The largest number of each type."""
_TEXTS = ("string", "wstring")
_ROUNDING_ERROR = 1e-9
"""Relative error within which a number counts as whole: 0.3 s in ms is 300, in spite of binary rounding."""


class MessageFieldType(InterfaceFieldType, frozen=True):
    """The type of a field, and its meaning for values."""

    @property
    def is_list(self) -> bool:
        return bool(self.container)

    @property
    def kind(self) -> FieldKind:
        """The kind of one item."""
        if self.base in _INTEGERS:
            return "integer"
        if self.base in _FLOATS:
            return "float"
        if self.base in _TEXTS:
            return "text"
        return "boolean" if self.base == "bool" else "message"

    @property
    def item(self) -> MessageFieldType:
        return MessageFieldType(self.base, self.length)

    @property
    def travels_as_bytes(self) -> bool:
        """Whether a list of this type travels as `bytes` (rise_adapters.ros2.transport.port.Message)."""
        return self.is_list and self.base in ("uint8", "byte")

    @property
    def zero(self) -> Any:
        """The default of one item."""
        return {"integer": 0, "float": 0.0, "text": "", "boolean": False, "message": {}}[self.kind]


def parse_field_type(text: str) -> MessageFieldType:
    """Read a type in ROS's form. Raises PortError for anything else."""
    return MessageFieldType(*astuple(read_field_type(text, "a field")))


class FieldTypes:
    """The fields of message types, each requested once. Without `fields` (no transport yet), all types are unknown."""

    def __init__(self, fields: ReadFields | None) -> None:
        self._fields = fields
        self._known: dict[str, dict[str, MessageFieldType] | str] = {}

    def fields_of(self, type: str) -> dict[str, MessageFieldType] | None:
        """The fields of a type; None: unknown, and `why_unknown` may give the reason."""
        known = self._look_up(type)
        return known if isinstance(known, dict) else None

    def why_unknown(self, type: str) -> str:
        """Why a type is unknown, in a sentence; empty: it is known, or no types are available."""
        known = self._look_up(type)
        return known if isinstance(known, str) else ""

    def find(self, type: str, path: Sequence[str]) -> MessageFieldType | None:
        """The type of a message's field, or of a nested one; None: types are unknown here. Raises ValueError if the
        field does not exist or cannot be checked."""
        inside = MessageFieldType(type)
        for name in path:
            fields = self.fields_of(inside.base)
            if fields is None:
                if missing := self.why_unknown(inside.base):
                    raise PortError(f"cannot be checked: {missing}")
                return None
            if name not in fields:
                raise ValueError(f"names `{name}`, which is not a field of {inside.base}{did_you_mean(name, fields)}")
            inside = fields[name]
        return inside

    def _look_up(self, type: str) -> dict[str, MessageFieldType] | str | None:
        if self._fields is None:
            return None
        if type not in self._known:
            try:
                self._known[type] = {name: parse_field_type(text) for name, text in self._fields(type).items()}
            except PortError as error:
                self._known[type] = str(error) or f"the type {type} is not known"
        return self._known[type]


# --- values ---------------------------------------------------------------------------------------------------------


def fit_value(value: Any, field: MessageFieldType) -> Any:
    """Convert one plain value for the field (not a message). Raises ValueError with the accepted values."""
    fitted: Any
    match field.kind:
        case "integer":
            fitted = _fit_integer(value, field.base)
        case "float":
            fitted = _fit_float(value, field.base)
        case "text":
            fitted = _fit_text(value, field)
        case _:
            fitted = value if isinstance(value, bool) else None
    if fitted is None:
        raise ValueError(f"takes {describe_field_type(field)}, and {describe_value(value)} is not")
    return fitted


def duration_message(seconds: float) -> dict[str, int]:
    """Return a `builtin_interfaces/msg/Duration`. Raises ValueError for a time that is too long."""
    if not math.isfinite(seconds) or not -(2**31) <= seconds < 2**31:
        raise ValueError(f"takes a time of at most 68 years, and {seconds:g} s is more")
    whole, nanoseconds = divmod(round(seconds * 1_000_000_000), 1_000_000_000)
    return {"sec": whole, "nanosec": nanoseconds}


def describe_field_type(field: MessageFieldType) -> str:
    """The type for a person: `a whole number from 0 to 255`."""
    if field.is_list:
        return f"a list ({field}): [...]"
    match field.kind:
        case "integer":
            least, most = _INTEGERS[field.base]
            return f"a whole number from {least} to {most}"
        case "float":
            return "a number" if field.base == "float64" else "a number of single precision"
        case "text":
            return f"a text of at most {field.length} bytes" if field.length else "a text"
        case "boolean":
            return "true or false"
        case _:
            return "a time" if field.base == DURATION else f"a {field.base}"


def describe_value(value: Any) -> str:
    """Describe a value in a sentence, always briefly."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"the text `{value}`" if len(value) <= 60 else f"the text `{value[:59]}…`"
    if isinstance(value, int) and abs(value) >= 10**30:
        return "a number of more than 30 digits"
    return "a list" if isinstance(value, list) else "a table" if isinstance(value, dict) else f"`{value}`"


def _fit_integer(value: Any, name: str) -> int | None:
    if isinstance(value, float):
        if not math.isfinite(value) or abs(value - round(value)) > _ROUNDING_ERROR * max(1.0, abs(value)):
            return None
        value = round(value)
    if not isinstance(value, int):
        return None
    least, most = _INTEGERS[name]
    return int(value) if least <= value <= most else None


def _fit_float(value: Any, name: str) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) and abs(number) <= _FLOATS[name] else None


def _fit_text(value: Any, field: MessageFieldType) -> str | None:
    if not isinstance(value, str):
        return None
    if "\0" in value:
        raise ValueError("takes a text without the character NUL, which would end it too early")
    try:
        size = len(value.encode())
    except UnicodeEncodeError:
        raise ValueError("takes a text of Unicode characters, and half of a surrogate pair is none") from None
    return value if not field.length or size <= field.length else None
