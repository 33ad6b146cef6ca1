"""The lines of a journal: a header, then the input and the records of each step. Each line has a checksum.

    {"journal":1,"program":"rise-tui 0.2.0","crc":"0f3a..."}
    {"n":1,"input":"session_started","t":0.0,...,"crc":"..."}
    {"kind":"session","seq":1,"t":0.0,"wall":"...",...,"crc":"..."}

The records are those of every other output (semantics.md 11). A replay gives the inputs to a fresh kernel. `crc` is the
CRC-32 (IEEE 802.3) of all bytes of the line before `,"crc"`, as eight hexadecimal digits.
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
"""The file's name in a session's folder."""
FORMAT = 1
"""The format's number. It increases when programs of an earlier release could not read new journals."""


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

INPUT_START = b'{"n"'
"""The start of the line of an input, and of no other line."""
_CHECKSUM_BYTES = len(b',"crc":"01234567"}')
"""The length of the checksum at the end of a line."""

JournalLine: TypeAlias = JournalHeader | InputLine | AnyRecord


class LineError(RiseError):
    """A line is not as it was written. The text names the reason."""

    def __init__(self, why: str, *, newer: bool = False) -> None:
        """`newer`: a newer program wrote it."""
        super().__init__(why)
        self.newer = newer


def encode_header(program: str) -> bytes:
    """Encode the first line, with its line end. `program`: name and version of the program that writes the journal."""
    return with_checksum(msgspec.json.encode(JournalHeader(FORMAT, program)))


def encode_input(number: int, input: AnyInput) -> bytes:
    """Encode input `number` as a line, with its line end.

    Raises UnicodeEncodeError if a text in it has lone surrogates, which UTF-8 cannot encode.
    """
    return with_checksum(b'{"n":%d,' % number + msgspec.json.encode(input)[1:])


def encode_record(record: AnyRecord) -> bytes:
    """Encode a record as JSON without a line end: the same bytes for the journal, the socket, ROS and exports.

    Lone surrogates, which UTF-8 cannot encode, are written as `\\udcff`.
    """
    return encode(record)


def with_checksum(encoded: bytes) -> bytes:
    """Make a line, with its line end, from a JSON object such as that of `encode_record`."""
    body = encoded[:-1]
    return b'%b,"crc":"%08x"}\n' % (body, crc32(body))


def encode_line(line: JournalLine) -> bytes:
    """Encode the result of `read_line` as a line, with its line end."""
    match line:
        case JournalHeader():
            return with_checksum(msgspec.json.encode(line))
        case InputLine():
            return encode_input(line.n, line.input)
    return with_checksum(encode_record(line))


def join_step(line: bytes, encoded: Iterable[bytes]) -> bytes:
    """Join all lines of a step: that of `encode_input`, and those of the encoded records."""
    return b"".join((line, *map(with_checksum, encoded)))


def read_line(data: bytes) -> JournalLine:
    """Decode a line without its line end. Raises LineError."""
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
        if text.startswith(INPUT_START):
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
