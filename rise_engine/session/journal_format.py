"""The lines of a journal: a header, then for each step the input and its records, each line with a check sum.

    {"journal":1,"program":"rise-tui 0.2.0","crc":"0f3a..."}
    {"n":1,"input":"session_started","t":0.0,...,"crc":"..."}
    {"kind":"session","seq":1,"t":0.0,"wall":"...",...,"crc":"..."}

Records are those of every other output (semantics.md 11). Inputs are what replay feeds to a fresh kernel. `crc` is
the CRC-32 (IEEE 802.3) of all bytes of the line before `,"crc"`, as eight hexadecimal digits.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TypeAlias
from zlib import crc32

import msgspec
from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.base.json_codec import encode
from rise_engine.kernel.inputs import AnyInput
from rise_engine.kernel.records import AnyRecord

JOURNAL = "journal.jsonl"
"""The file, in a session's folder."""
FORMAT = 1
"""Goes up, after a release, when programs of that release could not read what is written."""


class JournalHeader(Struct, frozen=True):
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


_read_number = msgspec.json.Decoder(_Number).decode
_read_input = msgspec.json.Decoder(AnyInput).decode
_read_record = msgspec.json.Decoder(AnyRecord).decode

_CHECKSUM_BYTES = len(b',"crc":"01234567"}')
"""At the end of a line."""

JournalLine: TypeAlias = JournalHeader | InputLine | AnyRecord


class LineError(RiseError):
    """A line is not what was written; the text says what is wrong with it."""

    def __init__(self, why: str, *, newer: bool = False) -> None:
        """`newer`: a newer program wrote this."""
        super().__init__(why)
        self.newer = newer


def encode_header(program: str) -> bytes:
    """The first line, with its line end. `program`: name and version of who writes the journal."""
    return with_checksum(msgspec.json.encode(JournalHeader(FORMAT, program)))


def encode_input(number: int, input: AnyInput) -> bytes:
    """The line of input `number`, with its line end.

    Raises UnicodeEncodeError when a text in it holds half characters, which no file can.
    """
    return with_checksum(b'{"n":%d,' % number + msgspec.json.encode(input)[1:])


def encode_record(record: AnyRecord) -> bytes:
    """A record as JSON without a line end, the same bytes in the journal, on the socket, on ROS and in exports.

    Half characters, which no output can hold, are written as `\\udcff`.
    """
    return encode(record)


def with_checksum(encoded: bytes) -> bytes:
    """The line, with its line end, for a JSON object such as `encode_record` gives."""
    body = encoded[:-1]
    return b'%b,"crc":"%08x"}\n' % (body, crc32(body))


def encode_line(line: JournalLine) -> bytes:
    """A line, with its line end, from what `read_line` gives."""
    match line:
        case JournalHeader():
            return with_checksum(msgspec.json.encode(line))
        case InputLine():
            return encode_input(line.n, line.input)
    return with_checksum(encode_record(line))


def join_step(line: bytes, encoded: Iterable[bytes]) -> bytes:
    """All lines of a step: its `encode_input`, then those of its encoded records."""
    return b"".join((line, *map(with_checksum, encoded)))


def read_line(data: bytes) -> JournalLine:
    """What a line (without its line end) holds. Raises LineError."""
    body = data[:-_CHECKSUM_BYTES]
    if data[-_CHECKSUM_BYTES:] != b',"crc":"%08x"}' % crc32(body):
        if re.fullmatch(rb',"crc":".{8}"}', data[-_CHECKSUM_BYTES:], re.DOTALL) is None:
            raise LineError("it has no check sum at its end")
        raise LineError("its check sum does not fit: something in it was changed or damaged")
    text = body + b"}"
    try:
        if text.startswith(b'{"kind"'):
            record: AnyRecord = _read_record(text)
            return record
        if text.startswith(b'{"n"'):
            return InputLine(_read_number(text).n, _read_input(text))
        header = msgspec.json.decode(text, type=JournalHeader)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise LineError(f"it holds something that this version does not know ({error})", newer=True) from None
    if header.journal > FORMAT:
        raise LineError(
            f"it was written by a newer version ({header.program or 'unknown'}, format {header.journal}; "
            f"this one reads up to format {FORMAT})",
            newer=True,
        )
    return header
