"""Messages as bytes: CDR, version 1, little endian, with its 4-byte header, as ROS 2 sends them.

A type's codec is built once from a pair of small functions for each field, one to write and one to read it. Alignment
is relative to the end of the header, and zeros fill the gaps. Source: OMG, Common Object Request Broker Architecture
(CORBA) 3.3, part 2, 9.3 "CDR Transfer Syntax".

For the reasons against the codec of the library `rosbags`, see docs/decisions/archive.md, 26.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple, TypeAlias

from rise_adapters.ros2.transport.interfaces.definitions import (
    INTEGER_RANGES,
    InterfaceDefinition,
    InterfaceFieldType,
)
from rise_adapters.ros2.transport.port import Message, PortError

HEADER = b"\x00\x01\x00\x00"
"""CDR, little endian, no options."""

_CODES = {
    **dict(zip(INTEGER_RANGES, "bBhHiIqQ", strict=True)),
    "bool": "?",
    "byte": "B",
    "float32": "f",
    "float64": "d",
}
"""The numbers, with their `struct` codes."""
_NO_NUMBERS = (struct.error, TypeError, ValueError, OverflowError)
"""The errors of `struct` for values that do not fit the type."""
_COUNT = struct.Struct("<I")

Write: TypeAlias = Callable[[bytearray, Any], None]
"""Appends a value to the bytes. Raises `_FieldMismatch`."""
Read: TypeAlias = Callable[[bytes, int], tuple[Any, int]]
"""Returns the value at a position, and the next position. Raises struct.error or ValueError if bytes are missing."""


class _FieldMismatch(PortError):
    """A value that does not fit. Each caller adds its part of the field's path."""

    def __init__(self, sentence: Callable[[str], str]) -> None:
        """`sentence` receives the path of the field; empty: the message itself."""
        self._sentence = sentence
        self._path = ""

    def within(self, field: str) -> _FieldMismatch:
        self._path = field + ("." if self._path and self._path[0] != "[" else "") + self._path
        return self

    def __str__(self) -> str:
        return self._sentence(self._path)


def _mismatch(what: str) -> _FieldMismatch:
    return _FieldMismatch(lambda path: f"{f'the field {path!r}' if path else 'the message'} takes {what}")


class _FieldCodec(NamedTuple):
    """Functions that write and read one field, or one element of it."""

    write: Write
    read: Read
    zero: Any
    """The value of an omitted field."""


class MessageCodec:
    """Converts one type's messages to bytes and back."""

    def __init__(self, type: str, message: Callable[[str], InterfaceDefinition]) -> None:
        """`message` returns definitions. Every nested type must be known, and none may be a `wstring`."""
        self.type = type
        self._whole = _CodecBuilder(message).codec(type)

    def pack(self, message: Message, head: bytes = b"") -> bytes:
        """Return the bytes of a message, padded to a multiple of 4. `head` comes before it, after the CDR header (its
        length is a multiple of 8). Raises PortError that names the field that does not fit."""
        out = bytearray(head)
        self._whole.write(out, message)
        out += bytes(-len(out) & 3)
        return HEADER + out

    def unpack(self, data: bytes, start: int = 4) -> Message:
        """Return the message in `data`, from `start` on (4 more than a multiple of 8). Raises PortError if it is
        none."""
        if data[:2] != HEADER[:2]:
            raise PortError(f"a message of {self.type} came in an encoding that is not understood: {data[:4].hex()}")
        try:
            message, end = self._whole.read(data[start:], 0)
        except (struct.error, ValueError) as error:
            raise PortError(f"{len(data)} bytes that came are no {self.type}: {error}") from None
        if start + end > len(data):
            raise PortError(f"{len(data)} bytes that came are no {self.type}: {start + end} would be needed")
        return message  # type: ignore[no-any-return]


class _CodecBuilder:
    """Builds codecs, each type once."""

    def __init__(self, message: Callable[[str], InterfaceDefinition]) -> None:
        self._definition = message
        self._messages: dict[str, _FieldCodec] = {}

    def codec(self, type: str) -> _FieldCodec:
        if type not in self._messages:
            fields = self._definition(type).fields
            self._messages[type] = _message_codec(type, {field.name: self._field_codec(field.type) for field in fields})
        return self._messages[type]

    def _field_codec(self, type: InterfaceFieldType) -> _FieldCodec:
        text = type.base == "string"
        element = self.codec(type.base) if type.is_nested else _text_codec(type) if text else _number_codec(type.base)
        return _list_codec(type, element) if type.container else element


def _message_codec(type: str, fields: dict[str, _FieldCodec]) -> _FieldCodec:
    writers = [(name, part.write, part.zero) for name, part in fields.items()]
    readers = [(name, part.read) for name, part in fields.items()]
    known = fields.keys()

    def write(out: bytearray, message: Any) -> None:
        if not isinstance(message, dict):
            raise _mismatch(f"the fields of a {type}, not {message!r:.80}")
        if not message.keys() <= known:
            wrong = next(name for name in message if name not in known)
            raise _FieldMismatch(
                lambda path: (
                    f"{type} has no field {wrong!r}{f' ({path})' if path else ''}; it has {', '.join(known) or 'none'}"
                )
            )
        if not writers:
            out.append(0)  # a message without fields has one byte on the wire
        for name, write_field, zero in writers:
            try:
                write_field(out, message.get(name, zero))
            except _FieldMismatch as mismatch:
                raise mismatch.within(name) from None

    def read(data: bytes, at: int) -> tuple[Any, int]:
        message = {}
        for name, read_field in readers:
            message[name], at = read_field(data, at)
        return message, at if readers else at + 1

    return _FieldCodec(write, read, {})


def _number_codec(base: str) -> _FieldCodec:
    form = struct.Struct(f"<{_CODES[base]}")
    pack, unpack, size, mask = form.pack, form.unpack_from, form.size, form.size - 1
    kind = "a number" if base.startswith("float") else "a whole number"

    def write(out: bytearray, value: Any) -> None:
        out += bytes(-len(out) & mask)
        try:
            out += pack(value)
        except _NO_NUMBERS:
            raise _mismatch(f"{kind} ({base}), not {value!r:.80}") from None

    def write_truth(out: bytearray, value: Any) -> None:
        if value not in (True, False):
            raise _mismatch(f"true or false, not {value!r:.80}")
        out.append(bool(value))

    def read(data: bytes, at: int) -> tuple[Any, int]:
        at += -at & mask
        return unpack(data, at)[0], at + size

    return _FieldCodec(write_truth if base == "bool" else write, read, 0)


def _text_codec(type: InterfaceFieldType) -> _FieldCodec:
    def write(out: bytearray, value: Any) -> None:
        if not isinstance(value, str):
            raise _mismatch(f"a text, not {value!r:.80}")
        if "\0" in value:
            raise _mismatch("a text without zero characters")
        try:
            octets = value.encode()
        except UnicodeEncodeError:
            raise _mismatch(f"a text that UTF-8 can hold, not {value!r:.80}") from None
        if type.length and len(octets) > type.length:
            raise _mismatch(f"a text of at most {type.length} bytes, not {len(octets)}")
        _write_count(out, len(octets) + 1)
        out += octets
        out.append(0)

    def read(data: bytes, at: int) -> tuple[Any, int]:
        size, at = _read_count(data, at)
        # The length includes the final zero. Some writers send an empty text as no bytes at all.
        return str(data[at : at + size - 1], "utf-8", "replace") if size else "", at + size

    return _FieldCodec(write, read, "")


def _list_codec(type: InterfaceFieldType, element: _FieldCodec) -> _FieldCodec:
    """The codec of an array or a sequence of elements."""
    code = "" if type.is_nested else _CODES.get(type.base, "")
    plain = code not in ("", "?")
    size = struct.calcsize(f"<{code or 'B'}")
    fixed = type.count if type.container == "array" else None

    def write(out: bytearray, values: Any) -> None:
        if isinstance(values, str) or not hasattr(values, "__len__") or not hasattr(values, "__iter__"):
            raise _mismatch(f"a list ({type}), not {values!r:.80}")
        if len(values) != fixed if fixed is not None else type.count and len(values) > type.count:
            raise _mismatch(f"{'exactly' if fixed is not None else 'at most'} {type.count} values, not {len(values)}")
        if fixed is None:
            _write_count(out, len(values))
        if plain and len(values):
            out += bytes(-len(out) & (size - 1))
            with suppress(*_NO_NUMBERS):  # the loop below names the element
                out += bytes(values) if code == "B" else struct.pack(f"<{len(values)}{code}", *values)
                return
        for index, value in enumerate(values):
            try:
                element.write(out, value)
            except _FieldMismatch as mismatch:
                raise mismatch.within(f"[{index}]") from None

    def read(data: bytes, at: int) -> tuple[Any, int]:
        count, at = (fixed, at) if fixed is not None else _read_count(data, at)
        if not code:
            values = []
            for _ in range(count):
                value, at = element.read(data, at)
                values.append(value)
                if at > len(data):
                    raise ValueError("a sequence is longer than the message")
            return values, at
        at += -at & (size - 1) if count else 0
        end = at + count * size
        if end > len(data):
            raise ValueError("a sequence is longer than the message")
        return data[at:end] if code == "B" else list(struct.unpack_from(f"<{count}{code}", data, at)), end

    return _FieldCodec(write, read, (element.zero,) * (fixed or 0))


def _write_count(out: bytearray, count: int) -> None:
    out += bytes(-len(out) & 3)
    out += _COUNT.pack(count)


def _read_count(data: bytes, at: int) -> tuple[int, int]:
    at += -at & 3
    return _COUNT.unpack_from(data, at)[0], at + 4
