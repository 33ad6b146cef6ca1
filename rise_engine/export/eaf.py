"""ELAN's transcription of a session (`.eaf`): tiers, and the recordings beside them.

ELAN Annotation Format 3.0, as its schema EAFv3.0.xsd has it (The Language Archive, December 2016). What it means and
the schema does not say: media time = annotation time + TIME_ORIGIN; TIME_ORIGIN is never negative; a MEDIA_URL is
`file:///` and the path as it is, without %20 for a blank, because ELAN takes off the prefix and opens the rest.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from lxml import etree

from rise_engine.analysis.model import SessionData
from rise_engine.export.format import ExportContext, ExportFormat
from rise_engine.export.media_clock import LinkedFile, MediaClock, session_clock, warn_of_lost
from rise_engine.export.spans import spans_of
from rise_engine.export.tiers import Tier, TierSet, lay_out, one_line

AUTHOR = "rise-tui"
TYPE = "rise"
NO_DATE = "1970-01-01T00:00:00+00:00"
"""What stands where a date must be, and none is told."""
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
"""Those that ELAN has a name of its own for; of all others it is told whether they are video or audio."""
_CONSTRAINTS = {
    "Time_Subdivision": "Parts of the parent annotation that follow each other without gaps",
    "Symbolic_Subdivision": "Parts of the parent annotation in an order, without times",
    "Symbolic_Association": "One annotation for one parent annotation",
    "Included_In": "Annotations with times within those of the parent annotation, gaps allowed",
}
"""The relations between tiers that ELAN knows; every file of its lists all four."""


def write_eaf(out: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write the transcription of one session to `out`, a path that does not exist."""
    for data in sessions:
        clock = session_clock(data, context.warnings)
        found = lay_out(spans_of(data), clock, data.facts.duration)
        warn_of_lost(data, found.lost, context.warnings)
        folder = context.folder if context.folder is not None else out.absolute().parent
        document = etree.ElementTree(_document(data, clock, found, folder))
        with out.open("xb") as file:
            document.write(file, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _document(data: SessionData, clock: MediaClock, found: TierSet, folder: Path) -> etree._Element:
    root = etree.Element("ANNOTATION_DOCUMENT", nsmap={"xsi": _XSI})
    root.set("AUTHOR", AUTHOR)
    root.set("DATE", _date(data.facts.started))
    root.set("FORMAT", "3.0")
    root.set("VERSION", "3.0")
    root.set(f"{{{_XSI}}}noNamespaceSchemaLocation", _SCHEMA)
    header = etree.SubElement(root, "HEADER", MEDIA_FILE="", TIME_UNITS="milliseconds")
    for linked in clock.linked:
        _add_media(header, linked, folder)
    annotations = sum(len(tier.annotations) for tier in found.tiers)
    for name, value in _properties(data, clock, annotations):
        etree.SubElement(header, "PROPERTY", NAME=name).text = one_line(value)
    slots = etree.SubElement(root, "TIME_ORDER")
    _add_tiers(root, slots, found.tiers)
    etree.SubElement(
        root, "LINGUISTIC_TYPE", LINGUISTIC_TYPE_ID=TYPE, TIME_ALIGNABLE="true", GRAPHIC_REFERENCES="false"
    )
    for stereotype, description in _CONSTRAINTS.items():
        etree.SubElement(root, "CONSTRAINT", STEREOTYPE=stereotype, DESCRIPTION=description)
    return root


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
    """What ELAN keeps for itself, and what tells the session and its time apart from others."""
    facts = data.facts
    told = {
        "rise session": facts.session,
        "rise participant": facts.participant,
        "rise condition": facts.condition,
        "rise study": facts.study,
        "rise scenario": facts.scenario_hash,
        "rise mode": facts.mode,
        "rise time": f"annotation seconds = {clock.shift:.6f} + {clock.rate:.9f} * session seconds"
        + "".join(f"; {gap.seconds:.3f} s more from session second {gap.at:.3f} on" for gap in clock.gaps),
    }
    name = "/".join((facts.study, facts.session, facts.scenario_hash, str(facts.seed), str(facts.duration)))
    urn = uuid.uuid5(uuid.NAMESPACE_OID, name.encode("utf-8", "replace").decode())
    return [
        ("URN", f"urn:nl-mpi-tools-elan-eaf:{urn}"),
        ("lastUsedAnnotationId", str(annotations)),
        *((key, value) for key, value in told.items() if value),
    ]


def _add_tiers(root: etree._Element, slots: etree._Element, tiers: Iterable[Tier]) -> None:
    """Tiers, and the time slots that they refer to, numbered in the order of time as ELAN wants them."""
    moments: list[tuple[int, int, etree._Element, str]] = []
    number = 0
    for tier in tiers:
        row = etree.SubElement(root, "TIER", TIER_ID=tier.name, LINGUISTIC_TYPE_REF=TYPE, ANNOTATOR=AUTHOR)
        if tier.doer != "session":
            row.set("PARTICIPANT", tier.doer)
        for annotation in tier.annotations:
            number += 1
            holder = etree.SubElement(etree.SubElement(row, "ANNOTATION"), "ALIGNABLE_ANNOTATION")
            holder.set("ANNOTATION_ID", f"a{number}")
            moments.append((annotation.start, 1, holder, "TIME_SLOT_REF1"))
            moments.append((annotation.end, 0, holder, "TIME_SLOT_REF2"))
            etree.SubElement(holder, "ANNOTATION_VALUE").text = annotation.text
    moments.sort(key=lambda moment: moment[:2])
    for slot, (at, _, holder, reference) in enumerate(moments, 1):
        etree.SubElement(slots, "TIME_SLOT", TIME_SLOT_ID=f"ts{slot}", TIME_VALUE=str(at))
        holder.set(reference, f"ts{slot}")


def _date(started: str) -> str:
    """The date as XML Schema has it, in UTC where the zone is none of its own (whole minutes, at most 14 hours)."""
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
    return date.isoformat(timespec="seconds")


def _as_text(path: str) -> str:
    """A path that XML can hold; bytes that are no text are lost, and ELAN then asks where the file is."""
    return one_line(path.encode("utf-8", "replace").decode())


FORMAT = ExportFormat(
    name="eaf",
    about="ELAN: what robot, wizard and rules did as tiers, with the recordings that belong to the session",
    shape="file-per-session",
    suffix=".eaf",
    write=write_eaf,
)
