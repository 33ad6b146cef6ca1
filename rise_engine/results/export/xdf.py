"""A session as an XDF file, as from LabRecorder, to align with an EEG that was recorded without a live stream.

Extensible Data Format 1.0 (https://github.com/sccn/xdf/wiki/Specifications): `XDF:`, then chunks, each with its length,
a tag and its content. There is one file header. Each stream has a header, its samples, and a footer that counts them.
Boundaries before each stream's samples, and at least every ten seconds, let readers continue in a damaged file.

There are two streams. `rise`, type `Markers`, has the markers of the live stream
(`rise_engine.results.analysis.markers`); `rise-records`, type `Records`, has every record as JSON. Stamps are session
seconds. The file and both streams share this clock, so their offsets are 0. Without any, they count as unsynchronised.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import BinaryIO

from lxml import etree

from rise_engine.base.text import escape_surrogates
from rise_engine.results.analysis.course import records_by_wall_clock
from rise_engine.results.analysis.markers import describe_session, recorded_markers, source_id
from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.export.format import ExportContext, ExportFormat, started_text
from rise_engine.session.journal_format import encode_record

MAGIC = b"XDF:"
BOUNDARY = bytes.fromhex("43a546dccbf5410fb30ed5467383cbe4")
"""The 16 bytes at which a reader resumes after damage."""
FILE_HEADER, STREAM_HEADER, SAMPLES, CLOCK_OFFSET, BOUNDARY_TAG, STREAM_FOOTER = range(1, 7)
SECONDS_AT_ONCE = 10.0
SAMPLES_AT_ONCE = 1000
"""Maximum number of samples in a chunk, which a damaged byte can destroy."""
MARKERS, RECORDS = "rise", "rise-records"

Sample = tuple[float, str]
"""A stamp in seconds, and a text."""


def write_xdf(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write the one session of `sessions` to the new file `path`. Raises OSError."""
    for data in sessions:
        with path.open("xb") as file:
            write_session(file, data)


def write_session(file: BinaryIO, data: SessionData) -> None:
    """Write a session to a binary file that is open for writing."""
    file.write(MAGIC)
    _write_chunk(file, FILE_HEADER, _xml(_info({"version": "1.0", **_file_time(data.facts)})))
    streams: tuple[tuple[str, str, Sequence[Sample]], ...] = (
        (MARKERS, "Markers", recorded_markers(data)),
        (RECORDS, "Records", [(at, encode_record(record).decode()) for at, record in records_by_wall_clock(data)]),
    )
    for number, (name, type, _) in enumerate(streams, 1):
        _write_chunk(file, STREAM_HEADER, _stream_header(name, type, data.facts), number)
    for number, (_, _, samples) in enumerate(streams, 1):
        _write_samples(file, number, samples)
    looks = (0.0, max(1.0, data.facts.duration + (data.facts.downtime or 0.0)))
    for number, (_, _, samples) in enumerate(streams, 1):
        for at in looks:
            _write_chunk(file, CLOCK_OFFSET, struct.pack("<dd", at, 0.0), number)
        _write_chunk(file, STREAM_FOOTER, _stream_footer(samples, looks), number)


def _stream_header(name: str, type: str, facts: SessionFacts) -> bytes:
    values = {
        "name": name,
        "type": type,
        "channel_count": "1",
        "nominal_srate": "0",
        "channel_format": "string",
        "source_id": source_id(facts.study, facts.session),
        "version": "1.0",
        "created_at": "0",
    }
    return _xml(_info(values, {**describe_session(facts), "clock": "session seconds, and those without an engine"}))


def _stream_footer(samples: Sequence[Sample], looks: Sequence[float]) -> bytes:
    first, last = (samples[0][0], samples[-1][0]) if samples else (0.0, 0.0)
    info = _info(
        {
            "first_timestamp": repr(first),
            "last_timestamp": repr(last),
            "sample_count": str(len(samples)),
            "measured_srate": "0",
        }
    )
    offsets = etree.SubElement(info, "clock_offsets")
    for at in looks:
        offset = etree.SubElement(offsets, "offset")
        etree.SubElement(offset, "time").text = repr(at)
        etree.SubElement(offset, "value").text = "0"
    return _xml(info)


def _file_time(facts: SessionFacts) -> dict[str, str]:
    """Return the time of recording in LabRecorder's form, if the level shows it."""
    started = started_text(facts.started, lambda at: f"{at:%Y-%m-%dT%H:%M:%S}.{at.microsecond // 1000:03d}{at:%z}")
    return {"datetime": started} if started else {}


def _write_samples(file: BinaryIO, stream: int, samples: Sequence[Sample]) -> None:
    _write_boundary(file)
    begin = 0
    while begin < len(samples):
        end = begin + 1
        until = samples[begin][0] + SECONDS_AT_ONCE
        while end < len(samples) and end - begin < SAMPLES_AT_ONCE and samples[end][0] < until:
            end += 1
        chunk = bytearray(_count(end - begin))
        for stamp, text in samples[begin:end]:
            value = _text_bytes(text)
            chunk += b"\x08" + struct.pack("<d", stamp) + _count(len(value)) + value
        _write_chunk(file, SAMPLES, bytes(chunk), stream)
        _write_boundary(file)
        begin = end


def _write_boundary(file: BinaryIO) -> None:
    _write_chunk(file, BOUNDARY_TAG, BOUNDARY)


def _write_chunk(file: BinaryIO, tag: int, content: bytes, stream: int | None = None) -> None:
    body = struct.pack("<H", tag) + (b"" if stream is None else struct.pack("<I", stream)) + content
    file.write(_count(len(body)) + body)


def _count(number: int) -> bytes:
    """Encode a number after the count of its bytes: 1, 4 or 8."""
    if number < 1 << 8:
        return struct.pack("<BB", 1, number)
    return struct.pack("<BI", 4, number) if number < 1 << 32 else struct.pack("<BQ", 8, number)


def _text_bytes(text: str) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError:  # a lone surrogate, from a byte of a file name that is not text
        return escape_surrogates(text).encode()


def _info(values: dict[str, str], description: dict[str, str] | None = None) -> etree._Element:
    """Make an `info` element with an element for each name, and `desc` if there is a description."""
    info = etree.Element("info")
    for name, value in values.items():
        etree.SubElement(info, name).text = _xml_text(value)
    if description is not None:
        inner = etree.SubElement(info, "desc")
        for name, value in description.items():
            etree.SubElement(inner, name).text = _xml_text(value)
    return info


def _xml(info: etree._Element) -> bytes:
    return etree.tostring(info, xml_declaration=True, encoding="UTF-8")


def _xml_text(text: str) -> str:
    """Replace characters that XML cannot contain (https://www.w3.org/TR/xml/#charsets)."""
    return "".join(
        each
        if each in "\t\n\r" or " " <= each < "\ud800" or "\ue000" <= each < "\ufffe" or each > "\uffff"
        else "\ufffd"
        for each in text
    )


FORMAT = ExportFormat(
    name="xdf",
    about="markers and records as an XDF file, for EEG labs (MNE, EEGLAB, pyxdf)",
    shape="file-per-session",
    suffix=".xdf",
    write=write_xdf,
)
