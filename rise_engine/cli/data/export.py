"""`rise-engine export`: the selection of sessions, their destination, and the messages about them."""

from __future__ import annotations

import signal
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import click
from msgspec import Struct, field

from rise_engine.base.exit_status import INTERRUPTED, OK, PARTIAL, USAGE
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import pluralize
from rise_engine.cli.options import ALL_SESSIONS, PRIVATE, STUDIES_OR_SESSIONS, without_file
from rise_engine.cli.terminal import print_notes, refusing, standard_output
from rise_engine.privacy.levels import LEVELS, ExportLevel
from rise_engine.results.analysis.session_records import SessionRecords
from rise_engine.results.export.format import (
    HAS_WITHDRAWN,
    ExportError,
    ExportFormat,
    OmittedSession,
    format_names,
    load_format,
)
from rise_engine.results.export.records import RecordFormat, write_records
from rise_engine.results.export.writing import export_context, export_sessions, new_export
from rise_engine.session.folder import find_session
from rise_engine.study.labels import copied_sessions
from rise_engine.study.model import StudyStanding
from rise_engine.study.sessions import NOT_IN_SESSIONS, StudySession
from rise_engine.study.state import read_state
from rise_engine.study.study_log import read_log_and_damage
from rise_engine.study.study_toml import STUDY_FILE, is_study
from rise_engine.study.traces import WORK_FOLDER, is_withdrawn, owner_of, study_of_session, wizard_names

Command = TypeVar("Command", bound=Callable[..., Any])
RECORD_FORMATS: tuple[RecordFormat, ...] = ("csv", "jsonl")
"""Formats that can also write one session to standard output."""


class ExportRequest(Struct, frozen=True):
    """The user's request on the command line."""

    named: tuple[str, ...]
    """Studies and sessions."""
    format: str
    out: str | None = None
    level: ExportLevel = "full"
    private: tuple[str, ...] = ()
    all: bool = False
    """For a study, also sessions that do not count or did not end."""
    spreadsheet_safe: bool = False
    """Whether cells that a spreadsheet would run as a formula get an apostrophe."""
    wide: bool = False
    """For tables: also a table with a row for each participant."""


class Selection(Struct):
    """The selected sessions."""

    folders: list[Path] = field(default_factory=list)
    """In the order of their starts, study by study."""
    standing: StudyStanding | None = None
    """The state of the study, if only a study was named."""
    several: bool = False
    """Whether a study, or more than one session, was named."""
    omitted: list[OmittedSession] = field(default_factory=list)
    """Sessions that are in no export."""
    uncounted: dict[Path, Counter[str]] = field(default_factory=dict)
    """The number of sessions of each study that are omitted because they are not data, by the reason in a word."""
    notes: list[str] = field(default_factory=list)
    """Remarks on selected sessions, in sentences."""
    problems: list[str] = field(default_factory=list)
    """Problems of their studies, in sentences."""

    @property
    def remarks(self) -> list[str]:
        """Sentences on omitted sessions."""
        uncounted = [uncounted_text(counts, f" of {path}") for path, counts in self.uncounted.items()]
        return [*(str(each) for each in self.omitted if not each.unread), *uncounted]

    @property
    def unread(self) -> list[str]:
        """Sentences on unreadable sessions, which are omitted."""
        return [str(each) for each in self.omitted if each.unread]


def level_option(default: ExportLevel, about: str) -> Callable[[Command], Command]:
    """Make the option `level`: the amount of data for others."""
    return click.option("--level", type=click.Choice(LEVELS), default=default, show_default=True, help=about)


LEVEL = level_option("full", "Choose how much to include. shared: for other researchers; public: for everybody.")


def _known_format(ctx: click.Context, param: click.Parameter, value: str) -> str:
    if value not in (names := format_names()):
        raise click.BadParameter(f"there is no format {value!r}{did_you_mean(value, names)}", ctx, param)
    return value


class _ExportCommand(click.Command):
    """The command with a list of all formats in its help."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        rows = []
        for name in format_names():
            try:
                rows.append((name, load_format(name).about))
            except ExportError as error:
                rows.append((name, str(error)))
        with formatter.section("Formats"):
            formatter.write_dl(rows)


@click.command(cls=_ExportCommand)
@STUDIES_OR_SESSIONS
@click.option("--format", metavar="FORMAT", callback=_known_format, required=True, help="Choose the format; see below.")
@click.option("-o", "--output", metavar="NEW", type=click.Path(), help="Write to this new file or folder.")
@LEVEL
@PRIVATE
@ALL_SESSIONS
@click.option(
    "--spreadsheet-safe",
    is_flag=True,
    help="In tables and csv, put an apostrophe before what a spreadsheet would run as a formula.",
)
@click.option(
    "--wide", is_flag=True, help="With tables, also write wide.csv: a row for each participant, with their trials."
)
@refusing(USAGE)
def export(
    named: tuple[str, ...],
    format: str,
    output: str | None,
    level: ExportLevel,
    private: tuple[str, ...],
    all_sessions: bool,
    spreadsheet_safe: bool,
    wide: bool,
) -> int:
    """Write what happened in sessions for other programs: for a STUDY, its sessions that count and have ended; and each
    SESSION, even if it is running, torn or damaged.

    SESSION is a session's folder, or its name in the sessions folder ($RISE_SESSIONS, or ~/rise-sessions). One session
    becomes a file. Several become a folder or one file, depending on the format. csv and jsonl of one session go to
    standard output unless you give -o. Existing files are never overwritten.

    Exit status: 0; 1 if something could not be read, and the rest was exported; 2 if nothing was.
    """
    request = ExportRequest(named, format, output, level, private, all_sessions, spreadsheet_safe, wide)
    if spreadsheet_safe and not load_format(format).spreadsheet_safe:
        raise ExportError(f"--spreadsheet-safe goes with the formats tables and csv, not with {format}")
    if wide and format != "tables":
        raise ExportError("--wide adds a table to --format tables; other formats have no tables")
    selection = select_sessions(named, all=all_sessions)
    if format in RECORD_FORMATS and not selection.several:
        return _export_records(selection, request)
    with ended_by_signals():
        return _export(selection, load_format(format), request)


def select_sessions(named: Sequence[str], *, all: bool = False) -> Selection:
    """Select the sessions of named studies, and named sessions.

    :param named: folders of studies (or their study.toml), and sessions as `find_session` accepts them.
    :param all: for studies, also the sessions that do not count or did not end.
    :raises ExportError: nothing is left to export, the participant of a session has withdrawn, or a withdrawal was
        interrupted.
    :raises SessionError: one is not a session.
    :raises FileError: a study's files have errors.
    :raises StudyLogError: a study's log cannot be read.
    """
    selection = Selection(several=len(named) > 1)
    for name in named:
        path = without_file(name, STUDY_FILE)
        if is_study(path):
            _select_study(selection, path, all=all, alone=len(named) == 1)
        else:
            folder = find_session(name)
            _refuse_withdrawn(selection, folder)
            selection.folders.append(folder)
    unique = {folder.resolve(): folder for folder in reversed(selection.folders)}
    selection.folders = list(reversed(unique.values()))
    if not selection.folders:
        raise ExportError("there is no session to export", *selection.remarks, *selection.unread)
    return selection


def _refuse_withdrawn(selection: Selection, folder: Path) -> None:
    """Refuse a session of a withdrawn participant, which a backup may have restored, or which is being erased."""
    if folder.resolve().parent.parent.name == WORK_FOLDER:
        raise ExportError(f"{folder.name} is not exported: its participant withdraws")
    study = study_of_session(folder)
    if study is None:
        return
    log, damaged = read_log_and_damage(study)
    selection.problems += [each for each in damaged if each not in selection.problems]
    if is_withdrawn(owner_of(folder), log):
        raise ExportError(f"{folder.name} is not exported: its participant has withdrawn")


def _select_study(selection: Selection, path: Path, *, all: bool, alone: bool) -> None:
    state = read_state(path)
    if state.interrupted:
        raise ExportError("nothing was exported", *state.interrupted)
    selection.several = True
    selection.problems += [each for each in state.damaged if each not in selection.problems]
    selection.problems += [f"{name}: {each}" for name, each in state.repeated.items()]
    if alone:
        selection.standing = state.standing
    copies = copied_sessions(path, state.log)
    selection.omitted += [
        OmittedSession(name, "it is a copy of another session", each) for name, each in copies.items()
    ]
    selection.omitted += [OmittedSession(name, HAS_WITHDRAWN) for name in state.returned]
    omitted: Counter[str] = Counter()
    for session in state.sessions:
        why = _why_omitted(session)
        if session.info is None:
            missing, unread = f"it {session.missing}", session.missing != NOT_IN_SESSIONS
            selection.omitted.append(OmittedSession(session.name, missing.partition(":")[0], missing, unread))
        elif why and not all:
            omitted[why] += 1
        else:
            selection.folders.append(session.path)
            selection.notes += [f"{session.name} {session.without_end}"] if session.without_end else []
    if omitted:
        selection.uncounted[path] = omitted


def uncounted_text(omitted: Counter[str], of: str = "") -> str:
    """Return how many sessions are omitted because they are not data.

    >>> uncounted_text(Counter(pilot=2))
    '2 sessions are not in the export (2 pilot): --all includes them'

    :param omitted: their number by the reason in a word.
    :param of: the study, after a space and "of"; empty: none.
    """
    counts = ", ".join(f"{count} {why}" for why, count in omitted.items())
    verb = "is" if omitted.total() == 1 else "are"
    return f"{pluralize(omitted.total(), 'session')}{of} {verb} not in the export ({counts}): --all includes them"


def _why_omitted(session: StudySession) -> str:
    """Return in a word why a session is not data of the study; empty: it is."""
    entry = session.entry
    if entry.purpose != "counted":
        return entry.purpose
    return "" if entry.status == "ended" else entry.status


def _export(selection: Selection, format: ExportFormat, request: ExportRequest) -> int:
    if request.out is None or request.out == "-":
        folder = selection.several and format.shape == "file-per-session"
        what = f"file, such as sessions{format.suffix}" if format.suffix and not folder else "folder"
        raise ExportError(f"use -o with the name of a new {what}")
    folders = selection.folders
    context = export_context(folders, request.level)
    context.standing = selection.standing
    context.spreadsheet_safe = request.spreadsheet_safe
    context.wide = request.wide
    out = Path(request.out)
    report = export_sessions(format, out, folders, context, private=request.private, several=selection.several)
    print_notes(*(f"note: {sentence}" for sentence in (*selection.remarks, *selection.notes, *report.warnings)))
    status = _print_problems([*selection.unread, *report.problems], selection.problems)
    print_notes(f"{pluralize(report.sessions, 'session')} exported to {out}")
    return status


def _print_problems(problems: Sequence[str], of_studies: Sequence[str]) -> int:
    """Print what could not be read of sessions and studies; return the exit status."""
    print_notes(*(f"warning: {problem}" for problem in (*of_studies, *problems)))
    print_notes(*["Everything else was exported."] * bool(problems))
    return PARTIAL if problems or of_studies else OK


def _export_records(selection: Selection, request: ExportRequest) -> int:
    """Write the records of one session to a file or to standard output."""
    folder = selection.folders[0]
    out, format = request.out, RECORD_FORMATS[RECORD_FORMATS.index(request.format)]
    wizards = wizard_names(study_of_session(folder))
    source = SessionRecords(folder, level=request.level, private=request.private, wizards=wizards)
    if out is None or out == "-":
        with standard_output() as file:
            write_records(source, format, file, spreadsheet_safe=request.spreadsheet_safe)
    else:
        with ended_by_signals(), new_export(Path(out), [folder], format, request.level) as export:
            print_notes(*(f"warning: {problem}" for problem in export.problems))
            with export.here.open("xb") as file:
                write_records(source, format, file, spreadsheet_safe=request.spreadsheet_safe)
    return _print_problems(source.problems, selection.problems)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """End the program by an exception on a signal, so that an interrupted write leaves nothing incomplete."""

    def end(number: int, frame: FrameType | None) -> None:
        sys.exit(INTERRUPTED)

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
