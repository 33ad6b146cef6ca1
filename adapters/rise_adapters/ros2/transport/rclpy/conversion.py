"""Converts messages of an installed ROS to the port's plain values, and back.

rclpy does not check the values of a message, and a wrong one can end the process in its C code. So this module checks
everything, and names the path of a field that does not fit: `pose.position.x`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple, TypeAlias

from rise_adapters.ros2.transport.interfaces.definitions import INTEGER_RANGES
from rise_adapters.ros2.transport.port import Message, PortError

_FLOATS = {"float": "float32", "double": "float64"}
_LARGEST_FLOAT32 = 3.4028235677973366e38
"""Smaller values (in size) are rounded to a finite float32."""

Read: TypeAlias = Callable[[Any], Any]
Write: TypeAlias = Callable[[Any, str], Any]
"""Receives the value and the path of its field. Raises PortError if it does not fit."""


class FieldConverter(NamedTuple):
    """Functions that read one field (or one element of an array) from a message of rclpy, and write it."""

    type: str
    """The type in ROS's spelling."""
    write: Write
    zero: Callable[[], Any]
    """Makes the zero value."""
    read: Read | None = None
    """None: unchanged."""
    has_default: bool = False
    """Whether this field is not zero in a new message of rclpy."""


class MessageConverter:
    """The converter of one message type, prepared once."""

    def __init__(
        self, type: str, maker: Callable[[], Any], converters: Mapping[str, FieldConverter], defaults: Sequence[str]
    ) -> None:
        """`maker`: rclpy's class of the type. `converters`: by field. `defaults`: fields that are not zero at first."""
        self.type = type
        self._maker = maker
        self.fields = {name: converter.type for name, converter in converters.items()}
        self._read = [(name, converter.read) for name, converter in converters.items()]
        self._write = {name: converter.write for name, converter in converters.items()}
        self._zero = {
            name: converter.zero for name, converter in converters.items() if name in defaults or converter.has_default
        }

    @property
    def has_defaults(self) -> bool:
        """Whether a new message of rclpy has fields that are not zero."""
        return bool(self._zero)

    def read(self, message: Any) -> Message:
        """Convert a message of rclpy to plain values."""
        return {
            name: getattr(message, name) if read is None else read(getattr(message, name)) for name, read in self._read
        }

    def write(self, message: Any, path: str = "") -> Any:
        """Convert plain values to a message of rclpy. Raises PortError if they do not fit."""
        if not isinstance(message, Mapping):
            raise _mismatch(path, f"{self.type} is written as its fields by name, not as {_shorten(message)}")
        written = self._maker()
        for name, zero in self._zero.items():
            if name not in message:
                setattr(written, name, zero())
        for name, value in message.items():
            write = self._write.get(name)
            if write is None:
                known = ", ".join(self._write) or "no fields"
                raise _mismatch(path, f"{self.type} has no field {name!r}; it has {known}")
            setattr(written, name, write(value, f"{path}.{name}" if path else name))
        return written


# --- one value --------------------------------------------------------------------------------------------------------


def number_converter(name: str) -> FieldConverter:
    if name in INTEGER_RANGES:
        return FieldConverter(name, _integer_writer(name, *INTEGER_RANGES[name]), int)
    if name in _FLOATS:
        return FieldConverter(_FLOATS[name], _float_writer(_FLOATS[name]), float)
    if name == "boolean":
        return FieldConverter("bool", _write_boolean, bool)
    if name == "octet":  # in rclpy, `bytes` of length one
        check = _integer_writer("byte", 0, 255)
        return FieldConverter(
            "byte", lambda value, path: bytes((check(value, path),)), lambda: b"\0", lambda value: value[0]
        )
    raise PortError(f"a field of the type {name} cannot be used here")


def _integer_writer(name: str, low: int, high: int) -> Write:
    def write(value: Any, path: str) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise _mismatch(path, f"{name} needs a whole number, not {_shorten(value)}")
        if not low <= value <= high:
            raise _mismatch(path, f"{value} is outside of {name}, which goes from {low} to {high}")
        return value

    return write


def _float_writer(name: str) -> Write:
    def write(value: Any, path: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _mismatch(path, f"{name} needs a number, not {_shorten(value)}")
        try:
            number = float(value)
        except OverflowError:
            raise _mismatch(path, f"{_shorten(value)} is too large for {name}") from None
        if name == "float32" and isfinite(number) and abs(number) >= _LARGEST_FLOAT32:
            raise _mismatch(path, f"{number:g} is too large for float32")
        return number

    return write


def _write_boolean(value: Any, path: str) -> bool:
    if not isinstance(value, bool):
        raise _mismatch(path, f"bool needs true or false, not {_shorten(value)}")
    return value


def text_converter(name: str, most: int | None) -> FieldConverter:
    text = name if most is None else f"{name}<={most}"

    def write(value: Any, path: str) -> str:
        if not isinstance(value, str):
            raise _mismatch(path, f"{text} needs a text, not {_shorten(value)}")
        if "\0" in value:
            raise _mismatch(path, "a text may not hold the character NUL")
        try:
            size = len(value.encode())
        except UnicodeEncodeError:
            raise _mismatch(path, "the text holds half a character (a lone surrogate)") from None
        if most is not None and size > most:
            raise _mismatch(path, f"the text has {size} bytes; {text} takes {most}")
        return value

    return FieldConverter(text, write, str)


def list_converter(
    element: FieldConverter, suffix: str, fixed: int | None = None, most: int | None = None
) -> FieldConverter:
    text = element.type + suffix
    whole = fixed if fixed is not None else most

    def check_size(size: int, path: str) -> None:
        if (fixed is not None and size != fixed) or (most is not None and size > most):
            raise _mismatch(path, f"{size} elements do not fit into {text}, which takes {whole}")

    def write_octets(given: Any, path: str) -> bytes:
        if isinstance(given, bytes | bytearray | memoryview):
            found = bytes(given)
        else:
            found = bytes(_check_octets(given, path, text))
        check_size(len(found), path)
        return found

    def write_elements(given: Any, path: str) -> list[Any]:
        if not isinstance(given, Sequence) or isinstance(given, str | bytes | bytearray):
            raise _mismatch(path, f"{text} needs a list, not {_shorten(given)}")
        check_size(len(given), path)
        return [element.write(one, f"{path}[{number}]") for number, one in enumerate(given)]

    def make_zeros() -> list[Any]:
        return [element.zero() for _ in range(fixed or 0)]

    def read(held: Any) -> Any:
        if element.read is not None:
            return [element.read(one) for one in held]
        return held.tolist() if hasattr(held, "tolist") else list(held)  # an array.array, a numpy array, or a list

    converter = FieldConverter(text, write_elements, make_zeros, read, element.has_default and bool(fixed))
    if element.type == "uint8":  # in rclpy an array.array or a numpy array; both accept a bytearray
        return converter._replace(
            write=lambda given, path: bytearray(write_octets(given, path)), read=lambda held: held.tobytes()
        )
    if element.type == "byte":
        return converter._replace(
            write=lambda given, path: [bytes((one,)) for one in write_octets(given, path)], read=b"".join
        )
    return converter


def _check_octets(given: Any, path: str, text: str) -> list[int]:
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise _mismatch(path, f"{text} needs bytes, not {_shorten(given)}")
    check = _integer_writer("uint8", 0, 255)
    return [check(one, f"{path}[{number}]") for number, one in enumerate(given)]


def _mismatch(path: str, why: str) -> PortError:
    return PortError(f"{path}: {why}" if path else why)


def _shorten(value: Any) -> str:
    shown = repr(value)
    return shown if len(shown) <= 60 else shown[:57] + "..."
