"""`rise-engine media`: the recordings of a session, and their alignment with its clock."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import click
import msgspec
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import OK, PARTIAL, USAGE
from rise_engine.base.files import fingerprint
from rise_engine.base.text import pluralize
from rise_engine.cli.data.coded import MarksAndOutages, parse_moment, read_marks
from rise_engine.cli.options import JSON, SESSION
from rise_engine.cli.terminal import exit_with_usage, print_lines, print_notes, reason_of, refusing, show, write_json
from rise_engine.kernel.records import RecordingRecord
from rise_engine.results.analysis.model import Outage
from rise_engine.results.export.media_clock import offset_at_start
from rise_engine.run.recording.alignment import (
    Alignment,
    SessionMark,
    align_by_marks,
    align_by_moments,
)
from rise_engine.run.recording.media_files import MediaFacts, Sound, find_marks, hash_file, probe_media
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.media import (
    MEDIA_FILE,
    AlignedBy,
    FoundMark,
    MediaFile,
    media_path,
    read_media,
    register_media,
    remove_media,
    stored_path,
)
from rise_engine.study.traces import registered_recordings

LARGE = 2_000_000_000
"""Size in bytes above which reading a file is announced."""


@click.group("media")
def media() -> None:
    """Manage the recordings of a session: a camera's film, a microphone's sound, a bag."""


class _Addition(Struct, frozen=True):
    """The settings of all files that are added at once."""

    folder: Path
    clock: MarksAndOutages
    given: list[FoundMark]
    """Moments that the user has given."""
    find: bool
    """Whether to search for marks."""
    name: str


class _Added(Struct, frozen=True):
    """The result for one file."""

    file: MediaFile
    found: Alignment
    was_there: bool


@media.command("add", short_help="Register a recording, and align it with the session.")
@SESSION
@click.argument("files", metavar="[FILE]...", nargs=-1, type=click.Path())
@click.option(
    "--at",
    "moments",
    metavar="SECONDS|FILE=SESSION",
    multiple=True,
    help="Align it: the session second at which it begins, or a moment in it = the session's (markN: of that mark). "
    "Give it twice to correct drift, too.",
)
@click.option("--find-marks", is_flag=True, help="Find the session's marks in its sound.")
@click.option("--name", metavar="NAME", default="", help="Name the recording, as in camera.")
@JSON
@refusing(USAGE)
def add(
    session: Path, files: tuple[str, ...], moments: tuple[str, ...], find_marks: bool, name: str, as_json: bool
) -> int:
    """Register FILE (or a bag's folder) as a recording of SESSION, and align it with the session's clock.

    The file stays where it is. A file that is registered already is examined again. Without FILE, this applies to every
    recording in the session's list or record.

    \b
      rise-engine media add SESSION room.mp4 --find-marks
      rise-engine media add SESSION room.mp4 --at 14.04=12.34        a clap, seen at 14.04 s, noted at 12.34 s
      rise-engine media add SESSION room.mp4 --at 3.2=mark1 --at 1:02:10.4=mark2
      rise-engine media add SESSION room.mp4 --at -1.7               it began 1.7 s before the session

    Exit status: 0; 1 it is registered, but not aligned; 2 wrong usage, or nothing was registered.
    """
    if find_marks and moments:
        exit_with_usage("use either --find-marks or --at")
    if len(files) != 1 and (moments or name):
        exit_with_usage("--at and --name are about one file: name it")
    clock = read_marks(session)
    given = [parse_moment(each, clock.marks) for each in moments]
    addition = _Addition(session, clock, given, find_marks, name)
    known = [path for path in map(Path, _known_paths(session)) if path.exists()]
    facts = [(path, _probe(path)) for path in ([Path(each).expanduser() for each in files] or known)]
    if not facts:
        raise SessionError(f"{session.name} has no recordings yet: name a file")
    return _print_added(addition, facts, as_json=as_json)


def _probe(path: Path) -> MediaFacts:
    try:
        return probe_media(path)
    except FileNotFoundError:
        raise SessionError(f"there is no file {path}") from None
    except OSError as error:
        raise SessionError(f"{path} cannot be read: {reason_of(error)}") from None


def _known_paths(folder: Path) -> list[str]:
    """Return the absolute paths of the recordings in the session's list or record."""
    return list(dict.fromkeys([*(str(media_path(folder, each)) for each in read_media(folder)),
                               *registered_recordings(folder, inside=True)]))  # fmt: skip


def _print_added(addition: _Addition, facts: Sequence[tuple[Path, MediaFacts]], *, as_json: bool) -> int:
    documents: list[dict[str, Any]] = []
    status = OK
    for path, each in facts:
        if each.bytes > LARGE and not as_json:
            print_notes(f"reading {path.name}, {size_text(each.bytes)} ...")
        added = _add(addition, path, each)
        file, found = added.file, added.found
        if file.offset is None or found.problem:
            status = PARTIAL
        if as_json:
            values = {"remarks": list(found.remarks), "problem": found.problem}
            documents.append({**_values(addition.folder, file), **values})
            continue
        already = ["it was registered already"] if added.was_there else []
        print_lines(*_lines(file), *_alignment_lines(file, found, addition.clock.outages), *already)
    if as_json:
        write_json({"files": documents})
    return status


def _add(addition: _Addition, path: Path, facts: MediaFacts) -> _Added:
    """Register one file. Raises SessionError if that is not possible."""
    folder = addition.folder
    stored = stored_path(folder, str(path))
    before = next((each for each in read_media(folder) if each.path == stored), None)
    try:
        file = _describe(stored, path, facts, before, addition.name)
    except OSError as error:
        raise SessionError(f"{path} cannot be read: {reason_of(error)}") from None
    by: AlignedBy = "marks" if addition.find else "given"
    if addition.find:
        found = _find(path, facts, addition.clock.marks)
    elif addition.given:
        found = align_by_moments(addition.given)
    elif before is not None and before.offset is not None:
        by, found = before.aligned_by, Alignment(before.offset, before.rate, before.marks, before.within)
    else:
        by, found = "start", _by_start(folder, path)
    if found.offset is not None:
        offset = round(found.offset, 6)
        found = replace(found, remarks=(*found.remarks, *_interruption_remarks(addition.clock.interruptions, found)))
        file = replace(file, offset=offset, rate=found.rate, aligned_by=by, marks=found.marks, within=found.within)
    register_media(folder, file)
    return _Added(file, found, before is not None)


def _describe(stored: str, path: Path, facts: MediaFacts, before: MediaFile | None, name: str) -> MediaFile:
    """Describe a file without its alignment; an earlier alignment stays."""
    file = before or MediaFile(path=stored, kind=facts.kind)
    return replace(
        file,
        kind=facts.kind,
        name=name or file.name,
        bytes=facts.bytes,
        sha256=hash_file(path),
        fingerprint=fingerprint(path),
        duration=facts.duration if facts.duration is not None else file.duration,
        fps=facts.fps,
        added=datetime.now().astimezone().isoformat(timespec="seconds"),
    )


def _interruption_remarks(interruptions: Sequence[float], found: Alignment) -> list[str]:
    """Return for which part of a recovered session the alignment holds."""
    if not interruptions:
        return []
    at = found.marks[0].session_at if found.marks else 0.0
    after, before = [each for each in interruptions if each <= at], [each for each in interruptions if each > at]
    ends = [f"after {after[-1]:.1f} s" if after else "", f"before {before[0]:.1f} s" if before else ""]
    part = " and ".join(filter(None, ends))
    return [f"the session was interrupted, but not the recording: this alignment holds only {part}"]


def _find(path: Path, facts: MediaFacts, marks: Sequence[SessionMark]) -> Alignment:
    """Align a file by the marks in its sound."""
    sounds = [each for each in marks if each.medium == "sound"]
    if not sounds and marks:
        return Alignment(problem="the session's marks are flashes: look for them, and use --at FILE=markN")
    if not sounds:
        return align_by_marks(sounds, [])
    if facts.has_sound is False:
        return Alignment(problem="the file has no sound: use --at FILE=markN for a flash or a clap that can be seen")
    try:
        sound = Sound(path)
        return align_by_marks(sounds, find_marks(sound.blocks(), sound.rate))
    except SessionError as error:
        return Alignment(problem=str(error))


def _by_start(folder: Path, path: Path) -> Alignment:
    """Align a file by the start of its recorder, if a recorder of the session has written it."""
    wanted = path.absolute()
    for record in read_journal(folder / JOURNAL).read_records():
        started = isinstance(record, RecordingRecord) and record.status == "started" and record.path
        if started and (folder / started).absolute() == wanted:
            remark = "by when its recorder was started, which is not the time of its first frame: use --find-marks"
            return Alignment(-record.t, remarks=(remark,))
    return Alignment(problem="no marks or times are given: use --find-marks, or --at FILE=SESSION")


@media.command("list", short_help="List the recordings, and how they are aligned.")
@SESSION
@JSON
@refusing(USAGE)
def list_media(session: Path, as_json: bool) -> int:
    """List the recordings of SESSION, and how they are aligned with its clock.

    Exit status: 0; 1 if a file is not where it was; 2 if the session cannot be read.
    """
    files = read_media(session)
    outages = read_marks(session).outages if files else []
    listed = {str(media_path(session, each)) for each in files}
    others = [path for path in registered_recordings(session, inside=True) if path not in listed]
    missing = [each for each in files if not media_path(session, each).exists()]
    lines: list[str] = []
    for each in files:
        gone = ["   THE FILE IS MISSING: put it back, or use rise-engine media remove"] if each in missing else []
        lines += [*_lines(each), *(f"   {line}" for line in position_lines(each, outages)), *gone]
    if others:
        lines += [f"on record, and not in {MEDIA_FILE} (rise-engine media add):", *(f"   {each}" for each in others)]
    document = {"files": [_values(session, each) for each in files], "on_record_only": others}
    nothing = f"{session.name} has no recordings: rise-engine media add SESSION FILE"
    show(lines or [nothing], document, as_json=as_json)
    return PARTIAL if missing else OK


@media.command("remove", short_help="Remove a recording from the list.")
@SESSION
@click.argument("file")
@JSON
def remove(session: Path, file: str, as_json: bool) -> None:
    """Remove FILE from the list of SESSION's recordings. The file itself stays where it is.

    FILE is its path, its last part, or its name in the list. When the participant withdraws, a file that is not in the
    list is not erased.

    Exit status: 0; 1 there is no such file in the list, or several; 2 if the session cannot be read.
    """
    removed = remove_media(session, file)
    notes = f"{removed.path} is no longer a recording of {session.name}; the file itself was not touched"
    show([notes], _values(session, removed), as_json=as_json)


# --- in words -------------------------------------------------------------------------------------------------------


def _lines(file: MediaFile) -> list[str]:
    about = [file.name, file.kind, size_text(file.bytes) if file.bytes is not None else ""]
    about.append(_length_text(file.duration) if file.duration is not None else "")
    about.append(f"{file.fps:g} frames per second" if file.fps else "")
    return [f"{file.path}: {', '.join(filter(None, about))}"]


def position_lines(file: MediaFile, outages: Sequence[Outage]) -> list[str]:
    """Describe a recording's alignment with the session's clock.

    :param outages: the session's outages, in which the recording continued.
    """
    if file.offset is None:
        return ["it is not aligned with the session"]
    offset = offset_at_start(file, outages)
    begins = f"begins {abs(offset):.3f} s {'before' if offset >= 0 else 'after'} the session"
    drift = ""
    if file.has_drift:
        drift = f", its clock runs {abs(file.drift_ppm):.1f} ppm {'fast' if file.rate >= 1 else 'slow'}"
    elif file.drift_within_ppm is not None:
        drift = f", with no measurable drift (within {file.drift_within_ppm:,.0f} ppm)"
    by = {"marks": "by marks", "given": "as you entered it", "start": "by when it was started", "": ""}
    return [f"{begins}{drift} ({by[file.aligned_by]})"]


def _alignment_lines(file: MediaFile, found: Alignment, outages: Sequence[Outage]) -> list[str]:
    lines = []
    if file.aligned_by == "marks" and found.offset is not None:
        for mark in file.marks:
            lines.append(
                f"mark {mark.number}: {mark.media_at:.4f} s in the file, {mark.session_at:.4f} s of the session, "
                f"{mark.strength:.1f} times as strong as all else"
            )
    lines += position_lines(file, outages) if file.offset is not None else []
    if found.within is not None and found.offset is not None:
        ppm = f", and its drift to {found.rate_within_ppm:.0f} ppm" if found.rate_within_ppm is not None else ""
        lines.append(f"this is accurate to {found.within * 1000:.0f} ms{ppm}, as far as the marks' own times are known")
    if found.offset is not None:
        lines.append(f"time in the file = {file.offset:.4f} s + {file.rate:.8f} x session time")
    lines += [f"note: {each}" for each in found.remarks]
    return lines + ([f"not aligned: {found.problem}"] if found.problem else [])


def size_text(count: int) -> str:
    """Format a number of bytes.

    >>> size_text(999), size_text(1_234_567), size_text(25_000_000_000)
    ('999 bytes', '1.2 MB', '25.0 GB')
    """
    for unit, least in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= least:
            return f"{count / least:.1f} {unit}"
    return pluralize(count, "byte")


def _length_text(seconds: float) -> str:
    minutes, rest = divmod(seconds, 60)
    return f"{int(minutes)} min {rest:.0f} s" if minutes else f"{rest:.1f} s"


def _values(folder: Path, file: MediaFile) -> dict[str, Any]:
    values: dict[str, Any] = msgspec.to_builtins(file)
    ppm = round(file.drift_ppm, 3) if len(file.marks) > 1 else None
    return {**values, "drift_ppm": ppm, "there": media_path(folder, file).exists()}
