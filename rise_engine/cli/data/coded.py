"""`rise-engine coded`: annotations of a session that people have made."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import click
import msgspec
from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import OK, PARTIAL, USAGE
from rise_engine.base.text import pluralize
from rise_engine.cli.options import JSON, SESSION
from rise_engine.cli.terminal import exit_with_usage, print_lines, print_notes, refusing, show
from rise_engine.kernel.records import SessionRecord, SyncRecord
from rise_engine.privacy.levels import LEVELS, LevelFilter
from rise_engine.results.analysis.course import OutageCollector
from rise_engine.results.analysis.model import Outage, SessionData
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.export.media_clock import clock_of_file
from rise_engine.run.recording.alignment import UNKNOWN_WITHIN, SessionMark, align_by_moments
from rise_engine.session.coded import (
    CODED_FOLDER,
    ClockSource,
    CodedFile,
    add_coded,
    read_bytes,
    read_coded,
    read_spans,
    remove_coded,
)
from rise_engine.session.coded_formats import CodedClock, CodedDocument, read_coded_document, tiers_taken
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.labels import read_labels
from rise_engine.session.media import FoundMark, MediaFile
from rise_engine.study.labels import refuse_relabelled


@click.group("coded")
def coded() -> None:
    """Add people's annotations from ELAN or BORIS to a session. Exports have them beside the record."""


@coded.command("add", short_help="Keep an annotation file with the session.")
@SESSION
@click.argument("file", type=click.Path())
@click.option(
    "--tier", "tiers", metavar="NAME", multiple=True, help="Read only this tier. Repeatable. Default: all of yours."
)
@click.option(
    "--speech",
    metavar="NAME",
    multiple=True,
    help="Take this tier as the participant's speech, for gaps and overlaps. Repeatable.",
)
@click.option("--annotator", metavar="NAME", default="", help="Name the annotator, if the file does not.")
@click.option("--observation", metavar="NAME", default="", help="Choose one observation of a BORIS file.")
@click.option(
    "--at",
    "moments",
    metavar="SECONDS|FILE=SESSION",
    multiple=True,
    help="Align its times, as for `rise-engine media add`. Give it twice to correct drift, too.",
)
@JSON
@refusing(USAGE)
def add(
    session: Path,
    file: str,
    tiers: tuple[str, ...],
    speech: tuple[str, ...],
    annotator: str,
    observation: str,
    moments: tuple[str, ...],
    as_json: bool,
) -> int:
    """Keep FILE (.eaf of ELAN; .boris, or a table of events, of BORIS) with SESSION, on the session's clock.

    A file that `rise-engine export` wrote says how its times relate to the session's. Any other file is aligned by the
    recording that it names (`rise-engine media add`), or by --at. What the program itself wrote into the file is
    ignored. FILE replaces an earlier file of the same name.

    \b
      rise-engine coded add SESSION P07.eaf --speech "participant speech"
      rise-engine coded add SESSION events.tsv --at 14.04=12.34      a clap, at 14.04 s in it, at 12.34 s of the session

    Exit status: 0; 1 it is kept, but something in it could not be read; 2 wrong usage, or nothing was kept.
    """
    path = Path(file).expanduser()
    data = read_bytes(path)
    document = read_coded_document(path.name, data, observation, session.name)
    _refuse_other_session(path, session, document)
    taken = tuple(tiers_taken(document, tiers))
    speech_tiers = tuple(tiers_taken(document, speech)) if speech else ()
    if missing := [each for each in speech_tiers if each not in taken]:
        raise SessionError(f"--speech {missing[0]} is not among the tiers that --tier names")
    if not taken:
        raise SessionError(f"{path} has no tier of yours: everything in it was written by this program")
    clock, by = _find_clock(path, session, document, moments)
    entry = CodedFile(
        name=path.name,
        sha256=hashlib.sha256(data).hexdigest(),
        clock=clock,
        clock_by=by,
        tiers=taken,
        speech=speech_tiers,
        annotator=annotator,
        observation=observation,
        added=datetime.now().astimezone().isoformat(timespec="seconds"),
    )
    was_there = add_coded(session, entry, data)
    lines = [*_lines(session, entry), *["it replaces the earlier one"] * was_there]
    show(lines, {**_values(session, entry), "problems": document.problems}, as_json=as_json)
    print_notes(*(f"warning: {problem}" for problem in document.problems))
    return PARTIAL if document.problems else OK


def _refuse_other_session(path: Path, folder: Path, document: CodedDocument) -> None:
    """Refuse a file that names another session as its source."""
    names = {LevelFilter(level, None).session_name(folder.name) for level in LEVELS}
    if document.session and document.session not in names:
        raise SessionError(f"{path} was made from the session {document.session}, not from {folder.name}")


def _find_clock(
    path: Path, folder: Path, document: CodedDocument, moments: Sequence[str]
) -> tuple[CodedClock, ClockSource]:
    """Determine the clock of the file. Raises SessionError."""
    if moments:
        given = [parse_moment(each, read_marks(folder).marks) for each in moments]
        found = align_by_moments(given)
        if found.offset is None:
            raise SessionError(found.problem)
        laid = MediaFile(path=path.name, kind="other", offset=found.offset, rate=found.rate, marks=found.marks)
        return clock_of_file(laid, read_session(folder).outages).as_coded(), "given"
    if document.clock is not None:
        return document.clock, "file"
    data: SessionData = read_session(folder)
    known = {Path(each.path).name: each for each in data.media if each.offset is not None}
    for name, origin in document.media:
        if name in known:
            return clock_of_file(known[name], data.outages, origin).as_coded(), "media"
    named = (
        f"align the recordings that it names first ({', '.join(name for name, _ in document.media)}; rise-engine media "
        if document.media
        else ""
    )
    raise SessionError(
        f"{path} is not aligned with the session: "
        + (f"{named}add), or use" if named else "use")
        + " --at SECONDS, the session second at which its times begin, or --at FILE=SESSION, one moment in both"
    )


@coded.command("list", short_help="List the annotation files.")
@SESSION
@JSON
@refusing(USAGE)
def list_coded(session: Path, as_json: bool) -> int:
    """List the annotation files of SESSION.

    Exit status: 0; 1 if one cannot be read; 2 if the session cannot be read.
    """
    lines: list[str] = []
    documents, problems = [], []
    for each in read_coded(session):
        try:
            lines += _lines(session, each)
            documents.append(_values(session, each))
        except SessionError as error:
            problems.append(f"error: {error}")
    nothing = f"{session.name} has no annotations: rise-engine coded add SESSION FILE"
    show(lines if lines or problems else [nothing], {"files": documents}, as_json=as_json)
    print_notes(*problems)
    return PARTIAL if problems else OK


@coded.command("remove", short_help="Delete an annotation file.")
@SESSION
@click.argument("file")
def remove(session: Path, file: str) -> None:
    """Delete the annotation file FILE of SESSION.

    Exit status: 0; 1 if there is no such file; 2 if the session cannot be read.
    """
    remove_coded(session, Path(file).name)
    print_lines(f"{Path(file).name} is no longer an annotation file of {session.name}")


def _lines(folder: Path, file: CodedFile) -> list[str]:
    """Describe a file. Raises SessionError."""
    counts = Counter(each.tier for each in read_spans(folder, file))
    by = {"file": "as the file says", "media": "by its recording", "given": "as you have said"}[file.clock_by]
    clock = file.clock
    gaps = f", without {pluralize(len(clock.gaps), 'interruption')}" if clock.gaps else ""
    lines = [
        f"{CODED_FOLDER}/{file.name}: session time = (its time - {clock.shift:.3f} s) / {clock.rate:.6f}{gaps} ({by})"
    ]
    for tier in file.tiers:
        speech = ", the participant's speech" if tier in file.speech else ""
        lines.append(f"   {tier}: {pluralize(counts[tier], 'annotation')}{speech}")
    return lines


def _values(folder: Path, file: CodedFile) -> dict[str, Any]:
    values: dict[str, Any] = msgspec.to_builtins(file)
    return {**values, "annotations": Counter(each.tier for each in read_spans(folder, file))}


_MARK = re.compile(r"mark *(\d+)")
_CLOCK = re.compile(r"(?:(\d+):)?(\d+):(\d+(?:\.\d*)?)")


class MarksAndOutages(Struct):
    """The clock-related contents of a session's journal."""

    marks: list[SessionMark]
    interruptions: list[float]
    """When the session continued after an interruption, in session seconds."""
    outages: list[Outage]
    """The interruptions of known length."""


def read_marks(folder: Path) -> MarksAndOutages:
    """Read a session's marks and interruptions. Raises SessionError."""
    refuse_relabelled(folder)
    marks: list[SessionMark] = []
    interruptions: list[float] = []
    collector = OutageCollector((read_labels(folder / JOURNAL) or {}).get("speed") or 1.0)
    for record in read_journal(folder / JOURNAL).read_records():
        away = collector.add(record)
        if away is not None or (isinstance(record, SessionRecord) and record.status == "recovered"):
            interruptions.append(record.t)
        elif isinstance(record, SyncRecord):
            within = record.within if record.within is not None else UNKNOWN_WITHIN
            at = record.at if record.at is not None else record.t
            marks.append(SessionMark(record.number, at, within, record.medium, len(interruptions)))
    return MarksAndOutages(marks, interruptions, collector.outages)


def parse_moment(text: str, marks: Sequence[SessionMark]) -> FoundMark:
    """Parse `--at`. Ends the command if it is invalid.

    >>> parse_moment("14.5=12", []), parse_moment("-1.5", []).media_at
    (FoundMark(number=0, session_at=12.0, media_at=14.5, strength=0.0), 0.0)
    """
    in_file, equals, in_session = text.partition("=")
    if not equals:
        return FoundMark(0, _parse_seconds(text, text), 0.0, 0.0)
    media_at = _parse_seconds(in_file, text)
    if found := _MARK.fullmatch(in_session.strip()):
        number = int(found[1])
        named = [each for each in marks if each.number == number]
        if len(named) == 1:
            return FoundMark(number, named[0].at, media_at, 0.0)
        known = ", ".join(str(each.number) for each in marks) or "none"
        why = f"has {len(named)} marks {number}: give the session's second" if named else f"has no mark {number}"
        exit_with_usage(f"--at {text}: the session {why}; its marks are {known}")
    return FoundMark(0, _parse_seconds(in_session, text), media_at, 0.0)


def _parse_seconds(part: str, text: str) -> float:
    """Parse seconds, or h:mm:ss."""
    part = part.strip()
    if found := _CLOCK.fullmatch(part):
        return int(found[1] or 0) * 3600 + int(found[2]) * 60 + float(found[3])
    try:
        seconds = float(part)
    except ValueError:
        seconds = float("nan")
    if not abs(seconds) < 1e7:
        exit_with_usage(f"--at {text}: {part!r} is not a time: write seconds (75.2), a clock (1:15.2), or FILE=markN")
    return seconds
