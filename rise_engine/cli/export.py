"""`rise-engine export`: which sessions are meant, where they go, and what is said of it."""

from __future__ import annotations

import signal
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import click
from msgspec import Struct, field

from rise_engine.cli.terminal import discard_rest
from rise_engine.exit_status import BROKEN_PIPE, INTERRUPTED, OK, PARTIAL, USAGE
from rise_engine.export.format import ExportError, ExportFormat
from rise_engine.export.formats import format_names, load_format
from rise_engine.export.records import RecordFormat, SessionExport
from rise_engine.export.writing import export_context, export_sessions, new_export
from rise_engine.nearest_name import did_you_mean
from rise_engine.session.disk import error_message
from rise_engine.session.errors import SessionError
from rise_engine.session.folder import find_session
from rise_engine.session.levels import LEVELS, ExportLevel
from rise_engine.study.model import StudyStanding
from rise_engine.study.sessions import StudySession
from rise_engine.study.state import StudyUnusable, read_state
from rise_engine.study.study_log import StudyLogError, read_log
from rise_engine.study.study_toml import STUDY_FILE, is_study
from rise_engine.study.traces import owner_of, study_of_session, wizard_names
from rise_engine.study.withdrawn import is_withdrawn
from rise_engine.text import clean, pluralize

RECORD_FORMATS: tuple[RecordFormat, ...] = ("csv", "jsonl")
"""Of one session, these go to standard output as well, however long it is."""


class ExportRequest(Struct, frozen=True):
    """What somebody asks for on the command line."""

    named: tuple[str, ...]
    """Studies and sessions."""
    format: str
    out: str | None = None
    level: ExportLevel = "full"
    private: tuple[str, ...] = ()
    all: bool = False
    """Of a study, also sessions that do not count or did not end."""
    spreadsheet_safe: bool = False
    """Whether cells that a spreadsheet would carry out get an apostrophe."""
    wide: bool = False
    """Tables: also one with a row for each participant."""


class Selection(Struct):
    """The sessions that are meant."""

    folders: list[Path] = field(default_factory=list)
    """In the order in which they began, study by study."""
    standing: StudyStanding | None = None
    """Of the study, when it is all that was named."""
    several: bool = False
    """Whether a study, or more than one session, was named."""
    remarks: list[str] = field(default_factory=list)
    """What is left out, in sentences."""


def _known_format(ctx: click.Context, param: click.Parameter, value: str) -> str:
    if value not in (names := format_names()):
        raise click.BadParameter(f"there is no format {value!r}{did_you_mean(value, names)}", ctx, param)
    return value


class _ExportCommand(click.Command):
    """Its help lists every format with what it is."""

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
@click.argument("named", metavar="STUDY|SESSION...", type=click.Path(), nargs=-1, required=True)
@click.option(
    "--format", metavar="FORMAT", callback=_known_format, required=True, help="For which programs; see below."
)
@click.option("-o", "--output", metavar="NEW", type=click.Path(), help="A new file, or a new folder.")
@click.option(
    "--level",
    type=click.Choice(LEVELS),
    default="full",
    show_default=True,
    help="How much is told. shared: for other researchers; public: for everybody.",
)
@click.option("--private", metavar="KEY", multiple=True, help="A memory key that is private, too. Repeatable.")
@click.option("--all", "all_sessions", is_flag=True, help="Of a study, also what does not count or did not end.")
@click.option(
    "--spreadsheet-safe",
    is_flag=True,
    help="Of tables and csv: an apostrophe before what a spreadsheet would carry out.",
)
@click.option("--wide", is_flag=True, help="Of tables, also wide.csv: a row for each participant, with their trials.")
def export(
    named: tuple[str, ...],
    format: str,
    output: str | None,
    level: ExportLevel,
    private: tuple[str, ...],
    all_sessions: bool,
    spreadsheet_safe: bool,
    wide: bool,
) -> None:
    """Write what happened in sessions for other programs: of a STUDY, those that count and have ended; and each
    SESSION, also one that is running, torn or damaged.

    SESSION is a session's folder, or its name in the sessions folder ($RISE_SESSIONS, or ~/rise-sessions). One session
    becomes a file, several a folder or one file, as the format is; csv and jsonl of one session go to standard output
    unless -o says otherwise. Nothing is ever written over.

    Exit status: 0; 1 when something could not be read, and the rest was exported; 2 when nothing was.
    """
    request = ExportRequest(named, format, output, level, private, all_sessions, spreadsheet_safe, wide)
    sys.exit(export_report(request))


def export_report(request: ExportRequest) -> int:
    """Export what is asked for, and say on standard error what of it is to be said; the exit status."""
    try:
        if request.spreadsheet_safe and not load_format(request.format).spreadsheet_safe:
            raise ExportError(f"--spreadsheet-safe goes with the formats tables and csv, not with {request.format}")
        if request.wide and request.format != "tables":
            raise ExportError("--wide is a table more of --format tables; the other formats have none")
        selection = select_sessions(request.named, all=request.all)
        if request.format in RECORD_FORMATS and not selection.several:
            return _export_records(selection.folders[0], request)
        with ended_by_signals():
            return _export(selection, load_format(request.format), request)
    except (ExportError, SessionError, StudyUnusable, StudyLogError) as error:
        _print_error(*(f"error: {line}" for line in str(error).splitlines()))
        return USAGE


def select_sessions(named: Sequence[str], *, all: bool = False) -> Selection:
    """The sessions that are meant with the names of studies and sessions.

    :param named: folders of studies (or their study.toml), and sessions as `find_session` takes them.
    :param all: of studies, also the sessions that do not count or did not end.
    :raises ExportError: nothing is left to export, or one is the session of somebody who has withdrawn.
    :raises SessionError: one is no session.
    :raises StudyUnusable: a study's files are not right.
    :raises StudyLogError: a study's log cannot be read.
    """
    selection = Selection(several=len(named) > 1)
    for name in named:
        path = Path(name).parent if Path(name).name == STUDY_FILE else Path(name)
        if is_study(path):
            _select_study(selection, path, all=all, alone=len(named) == 1)
        else:
            folder = find_session(name)
            _refuse_withdrawn(folder)
            selection.folders.append(folder)
    unique = {folder.resolve(): folder for folder in reversed(selection.folders)}
    selection.folders = list(reversed(unique.values()))
    if not selection.folders:
        raise ExportError("\n".join(["there is no session to export", *selection.remarks]))
    return selection


def _refuse_withdrawn(folder: Path) -> None:
    """What a backup has brought back of somebody who has withdrawn is nobody's data."""
    study = study_of_session(folder)
    if study is not None and is_withdrawn(owner_of(folder), read_log(study)):
        raise ExportError(f"{folder.name} is not exported: its participant has withdrawn")


def _select_study(selection: Selection, path: Path, *, all: bool, alone: bool) -> None:
    state = read_state(path)
    selection.several = True
    if alone:
        selection.standing = state.standing
    left_out: Counter[str] = Counter()
    for session in state.sessions:
        why = _why_left_out(session)
        if session.info is None:
            selection.remarks.append(f"{session.name} is not in the export: it {session.missing}")
        elif session.entry.participant in state.places.withdrawn:
            selection.remarks.append(f"{session.name} is not in the export: its participant has withdrawn")
        elif why and not all:
            left_out[why] += 1
        else:
            selection.folders.append(session.path)
    if left_out:
        told = ", ".join(f"{count} {why}" for why, count in left_out.items())
        sessions = pluralize(left_out.total(), "session")
        verb = "is" if left_out.total() == 1 else "are"
        selection.remarks.append(f"{sessions} of {path} {verb} not in the export ({told}): --all takes them in")


def _why_left_out(session: StudySession) -> str:
    """In a word, why a session is not data of the study; empty: it is."""
    entry = session.entry
    if entry.purpose != "counted":
        return entry.purpose
    return "" if entry.status == "ended" else entry.status


def _export(selection: Selection, format: ExportFormat, request: ExportRequest) -> int:
    if request.out is None or request.out == "-":
        folder = selection.several and format.shape == "file-per-session"
        what = f"file, such as sessions{format.suffix}" if format.suffix and not folder else "folder"
        raise ExportError(f"say where: -o names a new {what}")
    folders = selection.folders
    context = export_context(folders, request.level)
    context.standing = selection.standing
    context.spreadsheet_safe = request.spreadsheet_safe
    context.wide = request.wide
    out = Path(request.out)
    report = export_sessions(format, out, folders, context, private=request.private, several=selection.several)
    for sentence in (*selection.remarks, *report.warnings):
        _print_error(f"note: {sentence}")
    for problem in report.problems:
        _print_error(f"warning: {problem}")
    if report.problems:
        _print_error("Everything else was exported.")
    _print_error(f"{pluralize(report.sessions, 'session')} exported to {out}")
    return PARTIAL if report.problems else OK


def _export_records(folder: Path, request: ExportRequest) -> int:
    """The records of one session, one after the other, to a file or to standard output."""
    out, format = request.out, RECORD_FORMATS[RECORD_FORMATS.index(request.format)]
    wizards = wizard_names(study_of_session(folder))
    exporter = SessionExport(folder, level=request.level, private=request.private, wizards=wizards)
    if out is None or out == "-":
        try:
            sys.stdout.flush()
            exporter.write(format, sys.stdout.buffer, spreadsheet_safe=request.spreadsheet_safe)
        except BrokenPipeError:
            discard_rest(sys.stdout)
            return BROKEN_PIPE
        except OSError as error:
            raise ExportError(f"standard output could not be written: {error_message(error)}") from None
    else:
        with ended_by_signals(), new_export(Path(out), [folder], format, request.level) as export:
            for problem in export.problems:
                _print_error(f"warning: {problem}")
            with export.here.open("xb") as file:
                exporter.write(format, file, spreadsheet_safe=request.spreadsheet_safe)
    for problem in exporter.problems:
        _print_error(f"warning: {problem}")
    if exporter.problems:
        _print_error("Everything else was exported.")
    return PARTIAL if exporter.problems else OK


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Whoever ends the program while it writes leaves nothing half behind."""

    def end(number: int, frame: FrameType | None) -> None:
        sys.exit(INTERRUPTED)

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _print_error(*lines: str) -> None:
    for line in lines:
        sys.stderr.write(clean(line) + "\n")


COMMANDS = {"export": export}
