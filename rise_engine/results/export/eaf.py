"""A session's tiers as files for ELAN (`.eaf`, with links to recordings) and for Praat (TextGrid, for sound).

ELAN: Annotation Format 3.0 with the schema EAFv3.0.xsd (The Language Archive, December 2016). The schema does not state
the following: media time = annotation time + TIME_ORIGIN; TIME_ORIGIN is never negative; a MEDIA_URL is `file:///` and
the unescaped path, without %20 for a blank, because ELAN removes the prefix and opens the rest.

Praat: the long form of its manual ("TextGrid file formats"): intervals without gaps, with empty ones between the
annotations, and doubled quotes in texts. A TextGrid belongs to one sound but does not name it. Its times are those of
the session's first sound file, else of the first video, else session time.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path

from lxml import etree

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.export.format import ExportContext, ExportFormat
from rise_engine.results.export.media_clock import (
    LinkedFile,
    MediaClock,
    Tier,
    TierSet,
    lay_out,
    one_line,
    recording_clock,
    session_clock,
    warn_of_lost,
)
from rise_engine.results.export.spans import spans_of
from rise_engine.session.coded_formats import CLOCK, OWN_ANNOTATOR, OWN_TYPE, SESSION

AUTHOR = OWN_ANNOTATOR
TYPE = OWN_TYPE
NO_DATE = "1970-01-01T00:00:00+00:00"
"""The date if none is known: the format requires one."""
_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_SCHEMA = "http://www.mpi.nl/tools/elan/EAFv3.0.xsd"
_MIME_TYPES = {
    ".wav": "audio/x-wav",
    ".mp4": "video/mp4",
    ".m4v": "video/mp4",
    ".mpg": "video/mpeg",
    ".mpeg": "video/mpeg",
    ".mov": "video/quicktime",
}
"""ELAN's own names for types. For all others, ELAN only gets `video` or `audio`."""
_CONSTRAINTS = {
    "Time_Subdivision": "Parts of the parent annotation that follow each other without gaps",
    "Symbolic_Subdivision": "Parts of the parent annotation in an order, without times",
    "Symbolic_Association": "One annotation for one parent annotation",
    "Included_In": "Annotations with times within those of the parent annotation, gaps allowed",
}
"""ELAN's relations between tiers. Each of its files lists all four."""


def write_eaf(out: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write the transcription of one session to `out`, a path that does not exist."""
    for data in sessions:
        clock = session_clock(data, context.warnings)
        found = lay_out(spans_of(data), clock, data.facts.duration)
        warn_of_lost(data, found.lost, context.warnings)
        folder = context.folder if context.folder is not None else out.absolute().parent
        with out.open("xb") as file:
            with etree.xmlfile(file, encoding="UTF-8") as xml:
                xml.write_declaration()
                _write_document(xml, data, clock, found, folder)
            file.write(b"\n")


def _write_document(
    xml: etree._IncrementalFileWriter, data: SessionData, clock: MediaClock, found: TierSet, folder: Path
) -> None:
    """Write the document piece by piece, because a long session has hundreds of thousands of annotations."""
    attributes = {"AUTHOR": AUTHOR, "DATE": _date(data.facts.started), "FORMAT": "3.0", "VERSION": "3.0"}
    attributes[f"{{{_XSI}}}noNamespaceSchemaLocation"] = _SCHEMA
    slots, numbers = _time_slots(found.tiers)
    with xml.element("ANNOTATION_DOCUMENT", attributes, nsmap={"xsi": _XSI}):
        header = etree.Element("HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
        for linked in clock.linked:
            _add_media(header, linked, folder)
        for name, value in _properties(data, clock, len(slots) // 2):
            etree.SubElement(header, "PROPERTY", NAME=name).text = one_line(value)
        _write(xml, 1, header)
        xml.write(_line(1))
        with xml.element("TIME_ORDER"):
            for slot, at in enumerate(slots, 1):
                _write(xml, 2, etree.Element("TIME_SLOT", TIME_SLOT_ID=f"ts{slot}", TIME_VALUE=str(at)))
            xml.write(_line(1))
        _write_tiers(xml, found.tiers, numbers)
        attributes = {"LINGUISTIC_TYPE_ID": TYPE, "TIME_ALIGNABLE": "true", "GRAPHIC_REFERENCES": "false"}
        _write(xml, 1, etree.Element("LINGUISTIC_TYPE", attributes))
        for stereotype, description in _CONSTRAINTS.items():
            _write(xml, 1, etree.Element("CONSTRAINT", STEREOTYPE=stereotype, DESCRIPTION=description))
        xml.write(_line(0))


def _line(depth: int) -> str:
    """Return a line end with the indentation of the next line."""
    return "\n" + "  " * depth


def _write(xml: etree._IncrementalFileWriter, depth: int, element: etree._Element) -> None:
    etree.indent(element, level=depth)
    xml.write(_line(depth), element)


def _add_media(header: etree._Element, linked: LinkedFile, folder: Path) -> None:
    path = linked.path.as_posix()
    descriptor = etree.SubElement(header, "MEDIA_DESCRIPTOR")
    descriptor.set("MEDIA_URL", _as_text(f"file:///{path.lstrip('/')}"))
    relative = Path(os.path.relpath(linked.path, folder)).as_posix()
    descriptor.set("RELATIVE_MEDIA_URL", _as_text(relative if relative.startswith("../") else f"./{relative}"))
    descriptor.set("MIME_TYPE", _MIME_TYPES.get(linked.path.suffix.lower(), f"{linked.file.kind}/*"))
    if origin := max(0, round(linked.origin * 1000)):
        descriptor.set("TIME_ORIGIN", str(origin))


def _properties(data: SessionData, clock: MediaClock, annotations: int) -> list[tuple[str, str]]:
    """Return ELAN's own properties, and those that identify the session and its time."""
    facts = data.facts
    properties = {
        SESSION: facts.session,
        "rise participant": facts.participant,
        "rise condition": facts.condition,
        "rise study": facts.study,
        "rise scenario": facts.scenario_hash,
        "rise mode": facts.mode,
        CLOCK: clock.as_coded().text(),
    }
    name = "/".join((facts.study, facts.session, facts.scenario_hash, str(facts.seed), str(facts.duration)))
    urn = uuid.uuid5(uuid.NAMESPACE_OID, name.encode("utf-8", "replace").decode())
    return [
        ("URN", f"urn:nl-mpi-tools-elan-eaf:{urn}"),
        ("lastUsedAnnotationId", str(annotations)),
        *((key, value) for key, value in properties.items() if value),
    ]


def _time_slots(tiers: Iterable[Tier]) -> tuple[list[int], list[int]]:
    """Return the sorted times of all slots, as ELAN requires, and the slots of each annotation's start and end."""
    annotations = (annotation for tier in tiers for annotation in tier.annotations)
    moments: list[tuple[int, bool, int]] = []
    for annotation in annotations:
        moments.append((annotation.start, True, len(moments)))
        moments.append((annotation.end, False, len(moments)))
    moments.sort()
    numbers = [0] * len(moments)
    for slot, (_, _, place) in enumerate(moments, 1):
        numbers[place] = slot
    return [at for at, _, _ in moments], numbers


def _write_tiers(xml: etree._IncrementalFileWriter, tiers: Iterable[Tier], numbers: list[int]) -> None:
    """Write the tiers with their annotations. `numbers`: the slot numbers from `_time_slots`."""
    slots = iter(numbers)
    count = 0
    for tier in tiers:
        attributes = {"TIER_ID": tier.name, "LINGUISTIC_TYPE_REF": TYPE, "ANNOTATOR": AUTHOR}
        if tier.actor != "session":
            attributes["PARTICIPANT"] = tier.actor
        xml.write(_line(1))
        with xml.element("TIER", attributes):
            for annotation in tier.annotations:
                count += 1
                row = etree.Element("ANNOTATION")
                holder = etree.SubElement(row, "ALIGNABLE_ANNOTATION", ANNOTATION_ID=f"a{count}")
                holder.set("TIME_SLOT_REF1", f"ts{next(slots)}")
                holder.set("TIME_SLOT_REF2", f"ts{next(slots)}")
                etree.SubElement(holder, "ANNOTATION_VALUE").text = annotation.text
                _write(xml, 2, row)
            xml.write(_line(1))


def _date(started: str) -> str:
    """Return the date for XML Schema, which allows zones of whole minutes up to 14 hours; others become UTC."""
    try:
        date = datetime.fromisoformat(started)
    except ValueError:
        return NO_DATE
    offset = date.utcoffset()
    if offset is None:
        return NO_DATE
    seconds = offset.total_seconds()
    if seconds % 60 or abs(seconds) > 14 * 3600:
        try:
            date = date.astimezone(UTC)
        except OverflowError:
            return NO_DATE
    return date.isoformat(timespec="milliseconds")


def _as_text(path: str) -> str:
    """Make a path valid for XML. Bytes that are not text are lost; ELAN then asks for the file."""
    return one_line(path.encode("utf-8", "replace").decode())


EAF = ExportFormat(
    name="eaf",
    about="ELAN: what robot, wizard and rules did as tiers, with the recordings that belong to the session",
    shape="file-per-session",
    suffix=".eaf",
    write=write_eaf,
)


# --- Praat ------------------------------------------------------------------------------------------------------------


def write_textgrid(out: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write the TextGrid of one session to `out`, a path that does not exist."""
    for data in sessions:
        clock = recording_clock(data, context.warnings, first="audio", alone=True)
        found = lay_out(spans_of(data), clock, data.facts.duration)
        warn_of_time(data, clock, context.warnings)
        warn_of_lost(data, found.lost, context.warnings)
        end = max(found.end, *(round((each.file.duration or 0.0) * 1000) for each in clock.linked), 0)
        with out.open("x", encoding="utf-8", newline="\n") as file:
            file.writelines(f"{line}\n" for line in _lines(found.tiers, end))


def warn_of_time(data: SessionData, clock: MediaClock, warnings: list[str]) -> None:
    """Warn which recording's time a file has, because the file cannot contain this."""
    if clock.linked:
        warnings.append(
            f"{data.facts.session}: its times are those of {clock.linked[0].file.path}, in which the session "
            f"begins at {clock.shift:.3f} s"
        )


def _lines(tiers: tuple[Tier, ...], end: int) -> Iterator[str]:
    yield from ('File type = "ooTextFile"', 'Object class = "TextGrid"', "")
    yield from ("xmin = 0", f"xmax = {_seconds(end)}", "tiers? <exists>", f"size = {len(tiers)}", "item []:")
    for number, tier in enumerate(tiers, 1):
        intervals = list(_intervals(tier, end))
        yield f"    item [{number}]:"
        yield '        class = "IntervalTier"'
        yield f"        name = {_quoted(tier.name)}"
        yield from ("        xmin = 0", f"        xmax = {_seconds(end)}")
        yield f"        intervals: size = {len(intervals)}"
        for place, (start, stop, text) in enumerate(intervals, 1):
            yield f"        intervals [{place}]:"
            yield from (f"            xmin = {_seconds(start)}", f"            xmax = {_seconds(stop)}")
            yield f"            text = {_quoted(text)}"


def _intervals(tier: Tier, end: int) -> Iterator[tuple[int, int, str]]:
    """Give the annotations and the gaps between them, from 0 to `end`."""
    at = 0
    for annotation in tier.annotations:
        if annotation.start > at:
            yield at, annotation.start, ""
        yield annotation.start, annotation.end, annotation.text
        at = annotation.end
    if at < end:
        yield at, end, ""


def _seconds(ms: int) -> str:
    return f"{ms // 1000}.{ms % 1000:03d}".rstrip("0").rstrip(".")


def _quoted(text: str) -> str:
    doubled = text.replace('"', '""')
    return f'"{doubled}"'


TEXTGRID = ExportFormat(
    name="textgrid",
    about="Praat: the same tiers as a TextGrid, in the time of the session's sound file",
    shape="file-per-session",
    suffix=".TextGrid",
    write=write_textgrid,
)
