"""The lines of a journal: a header, then for each step the input and its records, each line with a check sum.

    {"journal":1,"program":"rise-tui 0.2.0","crc":"0f3a..."}
    {"n":1,"input":"session_started","t":0.0,...,"crc":"..."}
    {"kind":"session","seq":1,"t":0.0,"wall":"...",...,"crc":"..."}

Records are those of every other output (semantics, section 9). Inputs are what replay feeds to a fresh kernel. `crc` is
the CRC-32 (IEEE 802.3) of all bytes of the line before `,"crc"`, as eight hexadecimal digits.
"""

from __future__ import annotations

from functools import cache
from typing import Any, TypeAlias
from zlib import crc32

import msgspec
from msgspec import Struct

from rise_engine.json_codec import encode
from rise_engine.kernel.inputs import AnyInput
from rise_engine.kernel.records import AnyRecord
from rise_engine.text import told_all

FORMAT = 1
"""Goes up when older programs could not read what is written."""

_encode = msgspec.json.Encoder().encode


class Header(Struct, frozen=True):
    """The first line."""

    journal: int
    """The format."""
    program: str = ""


class InputLine(Struct, frozen=True):
    """An input, numbered 1, 2, 3, ... without gaps."""

    n: int
    input: AnyInput


class _Number(Struct):
    n: int


class RecordOutline(Struct):
    """Of a record, what finds it."""

    seq: int
    wall: str


Line: TypeAlias = Header | InputLine | AnyRecord
Outline: TypeAlias = Header | InputLine | RecordOutline


class LineError(ValueError):
    """A line is not what was written; the text says what is wrong with it."""


class FutureFormat(LineError):
    """A newer program wrote this."""


def header_line(program: str) -> bytes:
    return _sealed(_encode(Header(FORMAT, program)))


def input_line(number: int, fact: AnyInput) -> bytes:
    """Raises UnicodeEncodeError when a text in it holds half characters, which no file can."""
    return _sealed(b'{"n":%d,' % number + _encode(fact)[1:])


def step_lines(line: bytes, records: list[AnyRecord]) -> bytes:
    """All lines of a step, after its `input_line`."""
    lines = [line]
    for record in records:  # as `record_line` does; written out because every record of a session comes through here
        try:
            body = _encode(record)[:-1]
        except UnicodeEncodeError:
            body = record_bytes(record)[:-1]
        lines.append(body)
        lines.append(b',"crc":"%08x"}\n' % crc32(body))
    return b"".join(lines)


def record_line(record: AnyRecord) -> bytes:
    """The journal's line for a record, with its line end."""
    return _sealed(record_bytes(record))


def record_bytes(record: AnyRecord) -> bytes:
    """A record as JSON, as it stands in every output. Half characters are written as `\\udcff`."""
    return encode(record)


def read_line(data: bytes) -> Line:
    """What a line (without its line end) holds. Raises LineError."""
    return _read(data, AnyRecord)  # type: ignore[no-any-return]


def read_outline(data: bytes) -> Outline:
    """The same, but of a record only what finds it. Raises LineError."""
    return _read(data, RecordOutline)  # type: ignore[no-any-return]


def line_body(data: bytes) -> bytes:
    """A line (without its line end) as it was before its check sum came into it."""
    return data.rpartition(b',"crc":"')[0] + b"}"


def _read(data: bytes, record: Any) -> Any:
    body, mark, rest = data.rpartition(b',"crc":"')
    if not mark or len(rest) != 10 or rest[8:] != b'"}':
        raise LineError("it has no check sum at its end")
    if b"%08x" % crc32(body) != rest[:8]:
        raise LineError("its check sum does not fit: something in it was changed or damaged")
    text = body + b"}"
    try:
        if text.startswith(b'{"kind"'):
            return _decoder(record).decode(text)
        if text.startswith(b'{"n"'):
            return InputLine(_decoder(_Number).decode(text).n, _decoder(AnyInput).decode(text))
        header = msgspec.json.decode(text, type=Header)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise FutureFormat(f"it holds something that this version does not know ({error})") from None
    if header.journal > FORMAT:
        raise FutureFormat(
            f"it was written by a newer version ({header.program or 'unknown'}, format {header.journal}; "
            f"this one reads up to format {FORMAT})"
        )
    return header


writable = told_all
"""JSON-like values with every text such that UTF-8 can hold it: half characters become `\\udcff`."""


@cache
def _decoder(kind: Any) -> msgspec.json.Decoder[Any]:
    """Made when a journal is first read: it takes a few milliseconds, and consoles and new sessions read none."""
    return msgspec.json.Decoder(kind)


def _sealed(encoded: bytes) -> bytes:
    body = encoded[:-1]
    return b'%b,"crc":"%08x"}\n' % (body, crc32(body))
