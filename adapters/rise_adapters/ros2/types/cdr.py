"""Messages as bytes: CDR, version 1, little endian, with its 4-byte header, as ROS 2 puts them on the wire.

For each type two functions are written in Python once and compiled; they go straight from a mapping to bytes and back,
with one `struct` call for each stretch of fields whose place is known. That makes a small message a matter of
microseconds, which counts where feedback comes a thousand times a second. Alignment is relative to the end of the
header.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from rise_adapters.ros2.port import Message, PortError
from rise_adapters.ros2.types.definitions import Definition, Field, FieldType

HEADER = b"\x00\x01\x00\x00"
"""CDR, little endian, no options."""

_CODES = dict(
    zip(
        (
            "bool",
            "byte",
            "int8",
            "uint8",
            "int16",
            "uint16",
            "int32",
            "uint32",
            "int64",
            "uint64",
            "float32",
            "float64",
        ),
        "?BbBhHiIqQfd",
        strict=True,
    )
)
_OCTETS = ("byte", "uint8")
_MISFITS = (struct.error, TypeError, ValueError, KeyError, AttributeError, OverflowError, IndexError)
_Lookup = Callable[[str], Definition]


class Codec:
    """Makes bytes of one type's messages, and messages of bytes."""

    def __init__(self, type: str, message: _Lookup) -> None:
        """`message` gives definitions; every nested type must be known. Raises PortError for `wstring`."""
        self.type = type
        self._message = message
        self._pack = _compile(_Packer, type, message)
        self._unpack = _compile(_Unpacker, type, message)

    def pack(self, message: Mapping[str, Any], head: bytes = b"") -> bytes:
        """The bytes of a message; `head` comes before it, after the CDR header (its length a multiple of 8). Filled up
        to a multiple of 4. Raises PortError naming the field that does not fit."""
        parts = [HEADER, head]
        try:
            size = self._pack(parts, 4 + len(head), message)
        except _MISFITS as error:
            raise PortError(self.problem(message) or f"the message does not fit {self.type}: {error}") from None
        parts.append(bytes(-size & 3))
        return b"".join(parts)

    def unpack(self, data: bytes, start: int = 4) -> Message:
        """The message in `data`, from `start` on. Raises PortError when the bytes are no such message."""
        if data[:2] != HEADER[:2]:
            raise PortError(f"a message of {self.type} came in an encoding that is not understood: {data[:4].hex()}")
        try:
            message, end = self._unpack(data, start)
        except _MISFITS as error:
            raise PortError(f"{len(data)} bytes that came are no {self.type}: {error}") from None
        if end > len(data):
            raise PortError(f"{len(data)} bytes that came are no {self.type}: {end} would be needed")
        return message  # type: ignore[no-any-return]

    def problem(self, message: object) -> str:
        """Why a message does not fit its type, in a sentence; empty when it does."""
        return next(_problems(self.type, message, "", self._message), "")


def _compile(emitter: type[_Emitter], type: str, message: _Lookup) -> Callable[..., Any]:
    space: dict[str, Any] = {
        "bools": {False: False, True: True},
        "misfit": ValueError,
        "nothing": {},
        "octets": _octets,
        "pads": tuple(bytes(n) for n in range(8)),
        "struct": struct,
    }
    names: dict[str, str] = {}
    source = [*emitter(message, space, names).function("main", type, 8)]
    todo = list(names)
    for nested in todo:  # grows while types nested in types are found
        source += emitter(message, space, names).function(names[nested], nested, 1)
        todo += [name for name in names if name not in todo]
    exec(compile("\n".join(source), f"<CDR of {type}>", "exec"), space)
    function: Callable[..., Any] = space["main"]
    return function


class _Emitter:
    """Writes one function. It knows as much about the place in the stream as can be known beforehand: that it is
    `_offset` more than a multiple of `_modulus`."""

    def __init__(self, message: _Lookup, space: dict[str, Any], names: dict[str, str]) -> None:
        self._message = message
        self._space = space
        self._names = names
        """Of the functions of types that come in arrays and sequences, by type."""
        self._lines: list[str] = []
        self._indent = 1
        self._modulus, self._offset = 8, 0
        self._format = ""
        self._size = 0
        self._count = 0

    def function(self, name: str, type: str, modulus: int) -> list[str]:
        self._modulus = modulus
        return [self.signature(name), *self.body(type)]

    def signature(self, name: str) -> str:
        raise NotImplementedError

    def body(self, type: str) -> list[str]:
        raise NotImplementedError

    def run_over(self) -> None:
        """Write the stretch of fixed fields that has gathered."""
        raise NotImplementedError

    def skip_to(self, alignment: int) -> None:
        """Write the step to the next multiple of `alignment`."""
        raise NotImplementedError

    def line(self, text: str) -> None:
        self._lines.append("    " * self._indent + text)

    def new(self, prefix: str) -> str:
        self._count += 1
        return f"{prefix}{self._count}"

    def keep(self, prefix: str, value: Any) -> str:
        name = f"{prefix}{len(self._space)}"
        self._space[name] = value
        return name

    def align(self, alignment: int) -> None:
        if self._modulus >= alignment:
            if pad := -self._offset % alignment:
                self.fixed(f"{pad}x", pad)
        else:
            self.flush()
            self.skip_to(alignment)
            self._modulus, self._offset = alignment, 0

    def fixed(self, code: str, size: int) -> None:
        self._format += code
        self._size += size
        self._offset = (self._offset + size) % self._modulus

    def flush(self) -> None:
        if self._format:
            self.run_over()
            self._format, self._size = "", 0

    def unknown(self, modulus: int = 1) -> None:
        """After something whose length is not known: at a multiple of `modulus`, no more is sure."""
        self._modulus, self._offset = modulus, 0

    def nested(self, type: str) -> str:
        return self._names.setdefault(type, f"nested{len(self._names)}")

    def code(self, base: str) -> tuple[str, int]:
        if base == "wstring":
            raise PortError("the type wstring (texts of two bytes a letter) is not supported by the dds transport")
        return _CODES[base], struct.calcsize("<" + _CODES[base])


class _Unpacker(_Emitter):
    """`(bytes, place) -> (message, place)`. Values of a stretch are in a tuple."""

    _values = ""
    _index = 0

    def signature(self, name: str) -> str:
        return f"def {name}(b, p):"

    def body(self, type: str) -> list[str]:
        result = self.message(type)
        self.flush()
        self.line(f"return {result}, p")
        return self._lines

    def message(self, type: str) -> str:
        fields = self._message(type).fields
        if not fields:
            self.fixed("x", 1)
        return "{" + ", ".join([f"{field.name!r}: {self.value(field.type)}" for field in fields]) + "}"

    def value(self, type: FieldType) -> str:
        """The expression that will give the value."""
        if type.many in ("bounded", "sequence"):
            return self.sequence(type)
        if type.many == "array" and (type.nested or type.base == "string"):
            return self.loop(type, str(type.count))
        if type.nested:
            return self.message(type.base)
        if type.base == "string":
            return self.text()
        code, size = self.code(type.base)
        if not type.many:
            return self.taken(code, size)
        if type.base in _OCTETS:
            return self.taken(f"{type.count}s", 1, type.count)
        self.align(size)
        self.start()
        first, self._index = self._index, self._index + type.count
        self.fixed(f"{type.count}{code}", size * type.count)
        return f"list({self._values}[{first}:{self._index}])"

    def start(self) -> None:
        if not self._values:
            self._values, self._index = self.new("t"), 0

    def taken(self, code: str, size: int, count: int = 1) -> str:
        self.align(size)
        self.start()
        self.fixed(code, size * count)
        self._index += 1
        return f"{self._values}[{self._index - 1}]"

    def run_over(self) -> None:
        take = self.keep("take", struct.Struct("<" + self._format).unpack_from)
        self.start()
        self.line(f"{self._values} = {take}(b, p)")
        self.line(f"p += {self._size}")
        self._values = ""

    def skip_to(self, alignment: int) -> None:
        self.line(f"p += (4 - p) & {alignment - 1}")

    def text(self) -> str:
        length = self.taken("I", 4)
        self.flush()
        name = self.new("s")
        # The length counts the zero at the end; some writers give an empty text as no bytes at all.
        self.line(f"e = p + {length}")
        self.line(f"{name} = str(b[p:e - 1], 'utf-8', 'replace') if e > p else ''")
        self.line("p = e")
        self.unknown()
        return name

    def sequence(self, type: FieldType) -> str:
        length = self.taken("I", 4)
        self.flush()
        if type.nested or type.base == "string":
            return self.loop(type, length)
        code, size = self.code(type.base)
        count, name = self.new("n"), self.new("v")
        self.line(f"{count} = {length}")
        if size == 8:
            self.line(f"if {count}: p += (4 - p) & 7")
        self.line(f"e = p + {count} * {size}")
        self.line("if e > len(b): raise misfit('a sequence is longer than the message')")
        if type.base in _OCTETS:
            self.line(f"{name} = b[p:e]")
        else:
            self.line(f"{name} = list(struct.unpack_from(f'<{{{count}}}{code}', b, p))")
        self.line("p = e")
        self.unknown(min(size, 4))
        return name

    def loop(self, type: FieldType, count: str) -> str:
        self.flush()
        name = self.new("v")
        self.line(f"{name} = []")
        self.line(f"for _ in range({count}):")
        self._indent += 1
        self.unknown()
        if type.nested:
            self.line(f"x, p = {self.nested(type.base)}(b, p)")
            self.line(f"{name}.append(x)")
        else:
            self.line(f"{name}.append({self.text()})")
        self.line("if p > len(b): raise misfit('a sequence is longer than the message')")
        self._indent -= 1
        self.unknown()
        return name


class _Packer(_Emitter):
    """`(parts, place, message) -> place`, adding to the parts."""

    def __init__(self, message: _Lookup, space: dict[str, Any], names: dict[str, str]) -> None:
        super().__init__(message, space, names)
        self._arguments: list[str] = []

    def signature(self, name: str) -> str:
        return f"def {name}(out, p, m):"

    def body(self, type: str) -> list[str]:
        self.message(type, "m")
        self.flush()
        self.line("return p")
        return self._lines

    def message(self, type: str, mapping: str) -> None:
        fields = self._message(type).fields
        keys = self.keep("keys", {field.name for field in fields})
        self.line(f"if not {mapping}.keys() <= {keys}: raise misfit('unknown field')")
        if not fields:
            self.fixed("x", 1)
        for field in fields:
            self.value(field.type, f"{mapping}.get({field.name!r}, %s)")

    def value(self, type: FieldType, get: str) -> None:
        if type.many:
            self.many(type, get)
        elif type.nested:
            name = self.new("m")
            self.line(f"{name} = {get % 'nothing'}")
            self.message(type.base, name)
        elif type.base == "string":
            name = self.new("s")
            self.line(f"{name} = {get % repr('')}")
            self.text(name, type.length)
        else:
            code, size = self.code(type.base)
            self.give(code, size, f"bools[{get % 'False'}]" if type.base == "bool" else get % "0")

    def give(self, code: str, size: int, argument: str, count: int = 1) -> None:
        self.align(size)
        self.fixed(code, size * count)
        self._arguments.append(argument)

    def run_over(self) -> None:
        give = self.keep("give", struct.Struct("<" + self._format).pack)
        self.line(f"out.append({give}({', '.join(self._arguments)}))")
        self.line(f"p += {self._size}")
        self._arguments = []

    def skip_to(self, alignment: int) -> None:
        self.line(f"n = (4 - p) & {alignment - 1}")
        self.line("if n:")
        self.line("    out.append(pads[n])")
        self.line("    p += n")

    def text(self, name: str, most: int) -> None:
        self.line(f"{name} = {name}.encode() + b'\\0'")
        self.line(f"if {name}.find(0) != len({name}) - 1: raise misfit('a text with a zero in it')")
        if most:
            self.line(f"if len({name}) > {most + 1}: raise misfit('a text that is too long')")
        self.give("I", 4, f"len({name})")
        self.flush()
        self.line(f"out.append({name})")
        self.line(f"p += len({name})")
        self.unknown()

    def many(self, type: FieldType, get: str) -> None:
        name = self.new("v")
        simple = not type.nested and type.base != "string"
        if type.many == "array":
            zeros = self.keep("zeros", self.zeros(type))
            self.line(f"{name} = {get % zeros}")
        else:
            self.line(f"{name} = {get % repr(())}")
        if simple and type.base in _OCTETS:
            self.line(f"{name} = octets({name})")
        elif simple and type.base == "bool":
            self.line(f"{name} = [bools[x] for x in {name}]")
        else:
            self.line(f"if {name}.__class__ is str: raise misfit('a text, not several values')")
        wrong = {"array": f"!= {type.count}", "bounded": f"> {type.count}", "sequence": "> 0xFFFFFFFF"}[type.many]
        self.line(f"if len({name}) {wrong}: raise misfit('the wrong number of values')")
        if simple:
            self.simple(type, name)
            return
        if type.many != "array":
            self.give("I", 4, f"len({name})")
        self.flush()
        self.line(f"for x in {name}:")
        self._indent += 1
        self.unknown()
        if type.nested:
            self.line(f"p = {self.nested(type.base)}(out, p, x)")
        else:
            self.text("x", type.length)
        self._indent -= 1
        self.unknown()

    def simple(self, type: FieldType, name: str) -> None:
        code, size = self.code(type.base)
        if type.many == "array":
            if type.base in _OCTETS:
                self.give(f"{type.count}s", 1, name, type.count)
            else:
                self.give(f"{type.count}{code}", size, f"*{name}", type.count)
            return
        self.give("I", 4, f"len({name})")
        self.flush()
        if type.base in _OCTETS:
            self.line(f"out.append({name})")
            self.line(f"p += len({name})")
        else:
            self.line(f"if {name}.__len__():")
            self._indent += 1
            if size == 8:
                self.skip_to(8)
            self.line(f"out.append(struct.pack(f'<{{len({name})}}{code}', *{name}))")
            self.line(f"p += len({name}) * {size}")
            self._indent -= 1
        self.unknown(min(size, 4))

    def zeros(self, type: FieldType) -> Any:
        if type.nested:
            return ({},) * type.count
        if type.base == "string":
            return ("",) * type.count
        return bytes(type.count) if type.base in _OCTETS else (0,) * type.count


def _octets(values: Any) -> bytes:
    if isinstance(values, bytes | bytearray | memoryview):
        return bytes(values)
    return bytes(list(values))


def _problems(type: str, message: object, path: str, lookup: _Lookup) -> Iterator[str]:
    if not isinstance(message, Mapping):
        yield f"{_at(path)} takes the fields of a {type}, not {message!r:.80}"
        return
    fields = {field.name: field for field in lookup(type).fields}
    for name, value in message.items():
        if name not in fields:
            yield f"{type} has no field {name!r}{f' ({path})' if path else ''}; it has {', '.join(fields) or 'none'}"
            continue
        yield from _field_problems(fields[name], value, f"{path}.{name}" if path else name, lookup)


def _field_problems(field: Field, value: Any, path: str, lookup: _Lookup) -> Iterator[str]:
    type = field.type
    if not type.many:
        yield from _value_problems(type, value, path, lookup)
        return
    if isinstance(value, str) or not hasattr(value, "__len__") or not hasattr(value, "__iter__"):
        yield f"{_at(path)} takes a list ({type}), not {value!r:.80}"
        return
    if (type.many == "array" and len(value) != type.count) or (type.many == "bounded" and len(value) > type.count):
        amount = "exactly" if type.many == "array" else "at most"
        yield f"{_at(path)} takes {amount} {type.count} values, not {len(value)}"
    for index, element in enumerate(value):
        yield from _value_problems(type, element, f"{path}[{index}]", lookup)


def _value_problems(type: FieldType, value: Any, path: str, lookup: _Lookup) -> Iterator[str]:
    if type.nested:
        yield from _problems(type.base, value, path, lookup)
    elif type.base == "string":
        if not isinstance(value, str):
            yield f"{_at(path)} takes a text, not {value!r:.80}"
        elif "\0" in value:
            yield f"{_at(path)} takes a text without zero characters"
        elif not _encodes(value):
            yield f"{_at(path)} takes a text that UTF-8 can hold, not {value!r:.80}"
        elif type.length and len(value.encode()) > type.length:
            yield f"{_at(path)} takes a text of at most {type.length} bytes, not {len(value.encode())}"
    elif type.base == "bool":
        if value not in (True, False):
            yield f"{_at(path)} takes true or false, not {value!r:.80}"
    else:
        try:
            struct.pack("<" + _CODES[type.base], value)
        except _MISFITS:
            kind = "a number" if type.base.startswith("float") else "a whole number"
            yield f"{_at(path)} takes {kind} ({type.base}), not {value!r:.80}"


def _encodes(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _at(path: str) -> str:
    return f"the field {path!r}" if path else "the message"
