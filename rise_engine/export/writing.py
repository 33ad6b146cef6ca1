"""Writing an export: whole or not at all, never over anything, and noted in the study before anything is written."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from msgspec import Struct, field

from rise_engine.analysis.model import SessionData
from rise_engine.analysis.reading import read_sessions
from rise_engine.analysis.session_records import SessionRecords
from rise_engine.export.format import ExportContext, ExportError, ExportFormat
from rise_engine.scenario.file_names import SCENARIO_FILE
from rise_engine.session.disk import error_message
from rise_engine.session.errors import SessionError
from rise_engine.session.folder import SCENARIO_COPY, read_info
from rise_engine.session.levels import ExportLevel
from rise_engine.session.unfinished_files import unfinished
from rise_engine.study.study_log import LockedLog, StudyLogError
from rise_engine.study.study_toml import load_study
from rise_engine.study.traces import MANIFEST_FILE, owner_of, study_of_session


class ExportReport(Struct):
    """What came of an export."""

    sessions: int = 0
    """How many are in it."""
    problems: list[str] = field(default_factory=list)
    """What could not be read, in sentences."""
    warnings: list[str] = field(default_factory=list)
    """What else whoever exports should know, in sentences."""


def export_sessions(
    format: ExportFormat,
    out: Path,
    folders: Sequence[Path],
    context: ExportContext,
    *,
    private: Iterable[str] = (),
    several: bool = True,
) -> ExportReport:
    """Export sessions in one format. The study's log says so first.

    :param format: which.
    :param out: a new file, or a new folder where the format has several files.
    :param folders: the sessions', in the order in which they are to stand.
    :param context: as `export_context` gives it.
    :param private: further private memory keys.
    :param several: False: with a file for each session, `out` is the file of the only one.
    :raises ExportError: it could not be made; nothing of it is there.
    """
    report = ExportReport()
    with new_path(out, folders) as here:
        folder = format.shape == "folder" or (format.shape == "file-per-session" and (several or not format.suffix))
        report.warnings += note_export(folders, out, format.name, context.level, folder=folder)
        context.folder = (out if folder else out.parent).absolute()
        sessions = _read(folders, context.level, private, report)
        try:
            if format.shape != "file-per-session":
                format.write(here, sessions, context)
            elif several:
                _write_each(format, here, sessions, context)
            else:
                for data in sessions:
                    format.write(here, [data], context)
        except SessionError as error:
            raise ExportError(str(error)) from None
        for _ in sessions:
            """A format that has not asked for all of them has not told of all."""
        if not report.sessions:
            raise ExportError("\n".join([*report.problems, "no session could be read, so nothing was exported"]))
    report.warnings += context.warnings
    return report


def export_context(folders: Iterable[Path], level: ExportLevel) -> ExportContext:
    """What is the same for sessions that are exported together: their study, when all are of the same, and factors.

    :param folders: the sessions'.
    :param level: how much is told.
    """
    studies: dict[Path | None, None] = {}
    columns: dict[str, None] | None = None
    factors: dict[str, None] = {}
    for folder in folders:
        studies[study_of_session(folder)] = None
        factors.update(dict.fromkeys(_factors_of(folder)))
        declared = _trial_columns_of(folder)
        columns = columns if declared is None else (columns or {}) | dict.fromkeys(declared)
    where = next(iter(studies)) if len(studies) == 1 else None
    study = load_study(where, check_scenarios=False).study if where is not None else None
    planned = dict.fromkeys(factor.name for factor in study.factors) if study is not None else {}
    return ExportContext(
        level, study, factors=tuple(planned | factors), trial_columns=None if columns is None else tuple(columns)
    )


def _factors_of(folder: Path) -> Iterable[str]:
    """Which factors a session knows."""
    try:
        return read_info(folder).factors
    except SessionError:
        with suppress(SessionError):  # whoever reads it is told
            begun = SessionRecords(folder).begun
            return begun.factors if begun is not None else ()
        return ()


def _trial_columns_of(folder: Path) -> list[str] | None:
    """What the scenario of a session declares as columns of trials; None: it has no trials, or cannot be read."""
    try:
        said = tomllib.loads((folder / SCENARIO_COPY / SCENARIO_FILE).read_text("utf-8"))["trials"]
        return [text for text in said.get("columns", ()) if isinstance(text, str)]
    except (OSError, ValueError, KeyError, AttributeError, TypeError):  # whoever reads the session is told
        return None


@contextmanager
def new_path(path: Path, folders: Iterable[Path] = ()) -> Iterator[Path]:
    """As `rise_engine.session.unfinished_files.unfinished`, with errors in sentences.

    :param path: where it is to be.
    :param folders: of the sessions that it tells of. When one of their participants withdraws meanwhile, it is refused.
    :raises ExportError: something is there, it cannot be written, or somebody has withdrawn.
    """
    by_study = _by_study(folders)
    try:
        with ExitStack() as until_it_is_in_place, unfinished(path) as here:
            yield here
            for study, theirs in by_study.items():
                with suppress(StudyLogError):  # `note_export` has said so
                    until_it_is_in_place.enter_context(LockedLog(study))
                _refuse_gone(theirs)
    except FileExistsError:
        raise ExportError(f"{path} is there already, and nothing is ever written over: name another one") from None
    except OSError as error:
        if isinstance(error, FileNotFoundError | NotADirectoryError) and not path.parent.is_dir():
            raise ExportError(f"{path} cannot be made: there is no folder {path.parent}") from None
        raise ExportError(f"{path} could not be written: {error_message(error)}") from None


def _by_study(sessions: Iterable[Path]) -> dict[Path, list[Path]]:
    """Sessions by the study whose log knows of exports."""
    found: dict[Path, list[Path]] = {}
    for session in sessions:
        study = study_of_session(session)
        if study is not None and not (study / MANIFEST_FILE).is_file():  # a bundle stays as its check sums have it
            found.setdefault(study, []).append(session)
    return found


def _refuse_gone(sessions: Iterable[Path]) -> None:
    """A withdrawal takes the sessions out of the study while it has the log locked."""
    if gone := [each.name for each in sessions if not each.is_dir()]:
        raise ExportError(
            f"{', '.join(gone)}: gone while this was made, because the participant has withdrawn or somebody has moved "
            "it. Nothing of it was kept: make it again"
        )


def note_export(
    folders: Iterable[Path], out: Path, format: str, level: ExportLevel, *, folder: bool = False
) -> list[str]:
    """Note an export in the log of each study whose sessions are in it, before it is written: so that a participant
    who withdraws is taken out of it, too.

    :param folders: the sessions'; those of no study are passed over.
    :param out: what is about to be written.
    :param format: its name, for people.
    :param level: how much it tells.
    :param folder: whether it is a folder, which a withdrawal erases with everything in it.
    :return: sentences about studies that could not be told.
    :raises ExportError: a session is gone meanwhile.
    """
    path = out.resolve()
    problems = []
    for study, theirs in _by_study(folders).items():
        named = str(path.relative_to(study)) if path.is_relative_to(study) else str(path)
        try:
            fields = {
                "path": named,
                "format": format,
                "level": level,
                "sessions": [session.resolve().name for session in theirs],
                "participants": [*dict.fromkeys(filter(None, map(owner_of, theirs)))],
            }
            with LockedLog(study) as log:
                _refuse_gone(theirs)
                log.append("exported", **fields, **({"folder": True} if folder else {}))
        except StudyLogError as error:
            problems.append(f"the study does not know of {out}, so a withdrawal will not erase it: {error}")
    return problems


def _read(
    folders: Sequence[Path], level: ExportLevel, private: Iterable[str], report: ExportReport
) -> Iterator[SessionData]:
    """The sessions one after the other; what cannot be read goes to the report."""

    def note_unreadable(folder: Path, error: SessionError) -> None:
        report.problems.append(f"{folder.name} is not in it: {error}")

    for data in read_sessions(folders, level=level, private=private, on_unreadable=note_unreadable):
        report.sessions += 1
        report.problems += [f"{data.folder.name}: {problem}" for problem in data.problems]
        yield data


def _write_each(format: ExportFormat, folder: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    folder.mkdir(0o700)
    for data in sessions:
        format.write(folder / f"{data.facts.session}{format.suffix}", [data], context)
