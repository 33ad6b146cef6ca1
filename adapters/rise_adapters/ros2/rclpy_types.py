"""The message types of an installed ROS, found by import, and their messages as the port's plain values.

rclpy itself checks nothing of what is put into a message (and a wrong value can end the process in its C code), so all
of it is checked here, and what does not fit is said with the path of the field: `pose.position.x`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from math import isfinite
from pathlib import Path
from typing import Any

from rise_adapters.ros2.port import Message, PortError

_NAME = re.compile(
    r"(?P<package>[a-z][a-z0-9_]*)/(?P<kind>msg|srv|action)/(?P<base>[A-Za-z][A-Za-z0-9]*)(_(?P<part>\w+))?"
)
_PARTS = {
    ("srv", "Request"): "Request",
    ("srv", "Response"): "Response",
    ("action", "Goal"): "Goal",
    ("action", "Result"): "Result",
    ("action", "Feedback"): "Feedback",
    ("action", "FeedbackMessage"): "Impl.FeedbackMessage",
    ("action", "SendGoal"): "Impl.SendGoalService",
    ("action", "SendGoal_Request"): "Impl.SendGoalService.Request",
    ("action", "SendGoal_Response"): "Impl.SendGoalService.Response",
    ("action", "GetResult"): "Impl.GetResultService",
    ("action", "GetResult_Request"): "Impl.GetResultService.Request",
    ("action", "GetResult_Response"): "Impl.GetResultService.Response",
}
"""Where the class that a service or an action implies stands below its own class."""

_INTEGERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
_FLOATS = {"float": "float32", "double": "float64"}
_LARGEST_FLOAT32 = 3.4028235677973366e38
"""Everything below it (in size) is rounded to a finite float32."""

Read = Callable[[Any], Any]
Write = Callable[[Any, str], Any]


class Value:
    """How one field (or one element of an array) is read from a message of rclpy, and written into it."""

    def __init__(
        self, text: str, write: Write, read: Read | None = None, zero: Callable[[], Any] | None = None
    ) -> None:
        self.text = text
        """Its type as ROS writes it."""
        self.write = write
        self.read = read
        """None: as it is."""
        self.zero = zero
        """Makes the zero value where rclpy would not have it by itself."""


class Form:
    """One message type, made ready once."""

    def __init__(
        self, type: str, maker: Callable[[], Any], values: Mapping[str, Value], defaults: Sequence[str]
    ) -> None:
        self.type = type
        self.maker = maker
        self.fields = {name: value.text for name, value in values.items()}
        self._read = [(name, value.read) for name, value in values.items()]
        self._write = {name: value.write for name, value in values.items()}
        self._zero = {
            name: value.zero or _zero(value.text)
            for name, value in values.items()
            if name in defaults or value.zero is not None
        }

    @property
    def defaults(self) -> bool:
        """Whether a new message of rclpy holds something else than zero."""
        return bool(self._zero)

    def read(self, message: Any) -> Message:
        """A message of rclpy as plain values."""
        return {
            name: getattr(message, name) if read is None else read(getattr(message, name)) for name, read in self._read
        }

    def write(self, message: Any, path: str = "") -> Any:
        """Plain values as a message of rclpy. Raises PortError when they do not fit."""
        if not isinstance(message, Mapping):
            raise _misfit(path, f"{self.type} is written as its fields by name, not as {_shown(message)}")
        made = self.maker()
        for name, zero in self._zero.items():
            if name not in message:
                setattr(made, name, zero())
        for name, value in message.items():
            write = self._write.get(name)
            if write is None:
                known = ", ".join(self._write) or "no fields"
                raise _misfit(path, f"{self.type} has no field {name!r}; it has {known}")
            setattr(made, name, write(value, f"{path}.{name}" if path else name))
        return made


class Types:
    """The types that can be imported. Every method raises PortError, naming what is missing and where to get it."""

    def __init__(self) -> None:
        self._forms: dict[str, Form] = {}
        self._hashes: dict[str, dict[str, str]] = {}

    def message(self, type: str) -> tuple[Any, Form]:
        """rclpy's class of a message type, and how to convert it."""
        found = self._find(type)
        if not hasattr(found, "SLOT_TYPES"):
            raise PortError(f"{type} is not a message")
        return found, self._form(type, found)

    def service(self, type: str) -> tuple[Any, Form, Form]:
        """rclpy's class of a service type, and how to convert its request and its response."""
        found = self._find(type)
        if not hasattr(found, "Request") or not hasattr(found, "Response"):
            raise PortError(f"{type} is not a service")
        return found, self._form(f"{type}_Request", found.Request), self._form(f"{type}_Response", found.Response)

    def hash(self, type: str) -> str:
        """`RIHS01_...` as rosidl wrote it next to the definition; empty when it cannot be had."""
        match = _NAME.fullmatch(type)
        if match is None:
            return ""
        whole = f"{match['package']}/{match['kind']}/{match['base']}"
        if whole not in self._hashes:
            self._hashes[whole] = _read_hashes(match["package"], f"{match['kind']}/{match['base']}.json")
        return self._hashes[whole].get(type, "")

    def _find(self, type: str) -> Any:
        match = _NAME.fullmatch(type)
        if match is None:
            raise PortError(f"{type!r} is not the name of a type; one is written like std_msgs/msg/String")
        package, kind, base, part = match["package"], match["kind"], match["base"], match["part"]
        try:
            found = getattr(import_module(f"{package}.{kind}"), base, None)
        except ImportError as error:
            raise PortError(_missing(type, package, kind, error)) from None
        path = _PARTS.get((kind, part), "?") if part else ""
        for name in path.split(".") if path else ():
            found = getattr(found, name, None)
        if found is None:
            raise PortError(f"The ROS package {package} that is installed here has no {type}.")
        return found

    def _form(self, type: str, found: Any) -> Form:
        if type not in self._forms:
            names = list(found.get_fields_and_field_types())
            values = {name: self._value(slot) for name, slot in zip(names, found.SLOT_TYPES, strict=True)}
            defaults = [name for name in names if hasattr(found, f"{name.upper()}__DEFAULT")]
            self._forms[type] = Form(type, found, values, defaults)
        return self._forms[type]

    def _value(self, slot: Any) -> Value:
        """From the definition's own syntax tree, which rosidl keeps with each class."""
        kind = type(slot).__name__
        if kind == "BasicType":
            return _basic(slot.typename)
        if kind in ("UnboundedString", "UnboundedWString"):
            return _text("string" if kind == "UnboundedString" else "wstring", None)
        if kind in ("BoundedString", "BoundedWString"):
            return _text("string" if kind == "BoundedString" else "wstring", slot.maximum_size)
        if kind == "NamespacedType":
            return self._nested("/".join((*slot.namespaces, slot.name)))
        if kind == "Array":
            return _array(self._value(slot.value_type), f"[{slot.size}]", fixed=slot.size)
        if kind == "BoundedSequence":
            return _array(self._value(slot.value_type), f"[<={slot.maximum_size}]", most=slot.maximum_size)
        if kind == "UnboundedSequence":
            return _array(self._value(slot.value_type), "[]")
        raise PortError(f"a field of the type {slot} cannot be used here")

    def _nested(self, type: str) -> Value:
        _, form = self.message(type)
        return Value(type, form.write, form.read, (lambda: form.write({})) if form.defaults else None)


def fields(type: str) -> Mapping[str, str]:
    """As `port.Transport.fields`, without a node."""
    return dict(Types().message(type)[1].fields)


# --- one value --------------------------------------------------------------------------------------------------------


def _basic(name: str) -> Value:
    if name in _INTEGERS:
        bits = int(name.removeprefix("u").removeprefix("int"))
        low, high = (0, 2**bits - 1) if name.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return Value(name, _integer(name, low, high))
    if name in _FLOATS:
        return Value(_FLOATS[name], _float(_FLOATS[name]))
    if name == "boolean":
        return Value("bool", _boolean)
    if name == "octet":  # rclpy keeps it as `bytes` of length one
        check = _integer("byte", 0, 255)
        return Value("byte", lambda value, path: bytes((check(value, path),)), lambda value: value[0])
    raise PortError(f"a field of the type {name} cannot be used here")


def _integer(name: str, low: int, high: int) -> Write:
    def write(value: Any, path: str) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise _misfit(path, f"{name} needs a whole number, not {_shown(value)}")
        if not low <= value <= high:
            raise _misfit(path, f"{value} is outside of {name}, which goes from {low} to {high}")
        return value

    return write


def _float(name: str) -> Write:
    def write(value: Any, path: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _misfit(path, f"{name} needs a number, not {_shown(value)}")
        try:
            number = float(value)
        except OverflowError:
            raise _misfit(path, f"{_shown(value)} is too large for {name}") from None
        if name == "float32" and isfinite(number) and abs(number) >= _LARGEST_FLOAT32:
            raise _misfit(path, f"{number:g} is too large for float32")
        return number

    return write


def _boolean(value: Any, path: str) -> bool:
    if not isinstance(value, bool):
        raise _misfit(path, f"bool needs true or false, not {_shown(value)}")
    return value


def _text(name: str, most: int | None) -> Value:
    text = name if most is None else f"{name}<={most}"

    def write(value: Any, path: str) -> str:
        if not isinstance(value, str):
            raise _misfit(path, f"{text} needs a text, not {_shown(value)}")
        if "\0" in value:
            raise _misfit(path, "a text may not hold the character NUL")
        try:
            size = len(value.encode())
        except UnicodeEncodeError:
            raise _misfit(path, "the text holds half a character (a lone surrogate)") from None
        if most is not None and size > most:
            raise _misfit(path, f"the text has {size} bytes; {text} takes {most}")
        return value

    return Value(text, write)


def _array(value: Value, suffix: str, fixed: int | None = None, most: int | None = None) -> Value:
    text = value.text + suffix
    whole = fixed if fixed is not None else most

    def check(size: int, path: str) -> None:
        if (fixed is not None and size != fixed) or (most is not None and size > most):
            raise _misfit(path, f"{size} elements do not fit into {text}, which takes {whole}")

    def octets(given: Any, path: str) -> bytes:
        if isinstance(given, bytes | bytearray | memoryview):
            found = bytes(given)
        else:
            found = bytes(_numbers(given, path, text))
        check(len(found), path)
        return found

    def elements(given: Any, path: str) -> list[Any]:
        if not isinstance(given, Sequence) or isinstance(given, str | bytes | bytearray):
            raise _misfit(path, f"{text} needs a list, not {_shown(given)}")
        check(len(given), path)
        return [value.write(one, f"{path}[{number}]") for number, one in enumerate(given)]

    zero_element = value.zero
    zero = None if zero_element is None or fixed is None else lambda: [zero_element() for _ in range(fixed)]
    if value.text == "uint8":  # an array.array or a numpy array in rclpy; both take a bytearray
        return Value(text, lambda given, path: bytearray(octets(given, path)), lambda held: held.tobytes(), zero)
    if value.text == "byte":
        return Value(text, lambda given, path: [bytes((one,)) for one in octets(given, path)], b"".join, zero)
    read_element = value.read
    if read_element is not None:
        return Value(text, elements, lambda held: [read_element(one) for one in held], zero)
    # An array.array or a numpy array, or else a list already.
    return Value(text, elements, lambda held: held.tolist() if hasattr(held, "tolist") else list(held), zero)


def _numbers(given: Any, path: str, text: str) -> list[int]:
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise _misfit(path, f"{text} needs bytes, not {_shown(given)}")
    check = _integer("uint8", 0, 255)
    return [check(one, f"{path}[{number}]") for number, one in enumerate(given)]


def _zero(text: str) -> Callable[[], Any]:
    """Makes the zero value of a field that has a default: a number, a text, a truth value or an array of those."""
    array = re.search(r"\[(<=)?(\d*)\]$", text)
    if array is not None:
        element = _zero(text[: array.start()])()
        count = 0 if array[1] or not array[2] else int(array[2])
        return lambda: [element] * count
    if text.startswith(("string", "wstring")):
        return str
    if text == "byte":
        return lambda: b"\0"
    return {"bool": bool, "float32": float, "float64": float}.get(text, int)


def _misfit(path: str, why: str) -> PortError:
    return PortError(f"{path}: {why}" if path else why)


def _shown(value: Any) -> str:
    shown = repr(value)
    return shown if len(shown) <= 60 else shown[:57] + "..."


# --- what is not there ------------------------------------------------------------------------------------------------


def _missing(type: str, package: str, kind: str, error: ImportError) -> str:
    name = getattr(error, "name", None)
    if name == f"{package}.{kind}":
        return f"The ROS package {package} that is installed here has no {type}."
    if name != package:
        return f"The ROS package {package} is here, but it cannot be used ({error}); build it again for this Python."
    return (
        f"{type} cannot be used: the ROS package {package} is not installed, or not sourced. Install it with "
        f"`sudo apt install ros-jazzy-{package.replace('_', '-')}` where it is released; otherwise build it with "
        "colcon and source its install/setup.bash before this program is started."
    )


def _read_hashes(package: str, file: str) -> dict[str, str]:
    try:
        share = import_module("ament_index_python.packages").get_package_share_directory(package)
        content = json.loads((Path(share) / file).read_text("utf-8"))
        return {entry["type_name"]: entry["hash_string"] for entry in content["type_hashes"]}
    except (ImportError, LookupError, OSError, ValueError, TypeError):
        return {}
