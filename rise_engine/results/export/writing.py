"""Writes exports: completely or not at all, never over existing files, and logged in the study before anything else."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import compress, count
from pathlib import Path

from msgspec import Struct, field

from rise_engine.base.errors import SessionError
from rise_engine.base.files import error_message, tree_hash
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.analysis.session_records import SessionRecords
from rise_engine.results.export.format import ExportContext, ExportError, ExportFormat
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_engine.scenario.model import Json
from rise_engine.session.folder import SCENARIO_COPY, read_info
from rise_engine.session.unfinished_files import unfinished
from rise_engine.study.study_log import LockedLog, LogEntry, StudyLogError
from rise_engine.study.study_toml import load_study
from rise_engine.study.traces import MANIFEST_FILE, is_withdrawn, owner_of, study_of_session


class ExportReport(Struct):
    """The result of an export."""

    sessions: int = 0
    """The number of exported sessions."""
    problems: list[str] = field(default_factory=list)
    """Sentences about unreadable parts."""
    warnings: list[str] = field(default_factory=list)
    """Other sentences for the person who exports."""


def export_sessions(
    format: ExportFormat,
    out: Path,
    folders: Sequence[Path],
    context: ExportContext,
    *,
    private: Iterable[str] = (),
    several: bool = True,
) -> ExportReport:
    """Export sessions in one format. The study's log gets an entry first.

    :param format: the format.
    :param out: a new file, or a new folder if the format has several files.
    :param folders: the sessions' folders in the wanted order.
    :param context: from `export_context`.
    :param private: private memory keys in addition to the scenario's.
    :param several: False: with a file for each session, `out` is the file of the only one.
    :raises ExportError: it could not be made. Nothing of it remains.
    """
    report = ExportReport()
    folder = format.shape == "folder" or (format.shape == "file-per-session" and (several or not format.suffix))
    with new_export(out, folders, format.name, context.level, folder=folder) as export:
        here = export.here
        report.warnings += export.problems
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
            """Read the rest too, in case the format did not: the report counts them all."""
        if not report.sessions:
            raise ExportError(*report.problems, "no session could be read, so nothing was exported")
    report.warnings += context.warnings
    return report


def export_context(folders: Iterable[Path], level: ExportLevel) -> ExportContext:
    """Collect the settings for sessions that are exported together: factors, and the study if all have the same.

    :param folders: the sessions' folders.
    :param level: the export level.
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
    try:
        return read_info(folder).factors
    except SessionError:
        with suppress(SessionError):  # reading the session reports the error
            begun = SessionRecords(folder).begun
            return begun.factors if begun is not None else ()
        return ()


def _trial_columns_of(folder: Path) -> list[str] | None:
    """Return the columns of trials that a session's scenario declares. None: it has no trials, or is unreadable."""
    try:
        settings = tomllib.loads((folder / SCENARIO_COPY / SCENARIO_FILE).read_text("utf-8"))["trials"]
        return [text for text in settings.get("columns", ()) if isinstance(text, str)]
    except (OSError, ValueError, KeyError, AttributeError, TypeError):  # reading the session reports the error
        return None


class NewExport(Struct):
    """An export that is being written."""

    here: Path
    """The path to write to. It does not exist yet."""
    problems: list[str] = field(default_factory=list)
    """Sentences about studies whose logs could not get an entry."""


@contextmanager
def new_export(
    path: Path,
    folders: Iterable[Path],
    format: str,
    level: ExportLevel,
    *,
    folder: bool = False,
    people: Mapping[Path, Iterable[str]] | None = None,
) -> Iterator[NewExport]:
    """Make a file or folder with data of sessions. It appears only if the `with` statement succeeds.

    The log of each study gets an entry first, so that withdrawals and redactions know of the export even after a kill.
    Therefore read its data within the statement. At the end, the log gets the export's hash, because a withdrawal
    erases only unchanged exports.

    :param path: the final place.
    :param folders: the sessions' folders; sessions without a study are not logged.
    :param format: the format's name, for people.
    :param level: the export level.
    :param folder: whether it is a folder.
    :param people: further participants in it, by the folder of their study.
    :raises ExportError: something exists there, it cannot be written, or a participant has withdrawn meanwhile.
    """
    notes = [_Note(study, theirs, path, (people or {}).get(study, ())) for study, theirs in _by_study(folders).items()]
    for study in set(people or ()) - {note.study for note in notes}:
        if not (study / MANIFEST_FILE).is_file():
            notes.append(_Note(study, [], path, (people or {})[study]))
    try:
        with ExitStack() as until_it_is_in_place, unfinished(path) as here:
            problems = [problem for note in notes if (problem := note.write(format, level, folder=folder))]
            yield NewExport(here, problems)
            digest = tree_hash(here) if any(note.is_inside for note in notes) else ""
            for note in notes:
                note.confirm(until_it_is_in_place, digest)
    except FileExistsError:
        raise ExportError(f"{path} is there already, and files are never overwritten: name another one") from None
    except OSError as error:
        if isinstance(error, FileNotFoundError | NotADirectoryError) and not path.parent.is_dir():
            raise ExportError(f"{path} cannot be made: there is no folder {path.parent}") from None
        raise ExportError(f"{path} could not be written: {error_message(error)}") from None


def _by_study(sessions: Iterable[Path]) -> dict[Path, list[Path]]:
    """Group the sessions by studies whose logs note exports."""
    found: dict[Path, list[Path]] = {}
    for session in sessions:
        study = study_of_session(session)
        if study is not None and not (study / MANIFEST_FILE).is_file():  # a bundle must match its checksums
            found.setdefault(study, []).append(session)
    return found


class _Note:
    """The entry of one study's log about an export."""

    def __init__(self, study: Path, sessions: Sequence[Path], path: Path, people: Iterable[str]) -> None:
        path = path.resolve()
        self.study = study
        self.is_inside = path.is_relative_to(study.resolve())
        """Whether it will be in the study's folder, where a withdrawal can erase it."""
        self._sessions = sessions
        self._path = str(path.relative_to(study.resolve()) if self.is_inside else path)
        self._out = path
        self._people = list(dict.fromkeys([*filter(None, map(owner_of, sessions)), *people]))
        self._noted: LogEntry | None = None

    def write(self, format: str, level: ExportLevel, *, folder: bool) -> str:
        """Write the entry. Returns why it failed, or an empty text. Raises ExportError after a withdrawal."""
        fields = {"path": self._path, "format": format, "level": level, **self._sessions_and_people()}
        try:
            with LockedLog(self.study) as log:
                self._refuse_gone(log)
                self._noted = log.append("exported", **fields, **({"folder": True} if folder else {}))
        except StudyLogError as error:
            return f"the study does not know of {self._out}, so a withdrawal will not erase it: {error}"
        return ""

    def confirm(self, stack: ExitStack, digest: str) -> None:
        """Keep the log locked until the export is in place. Raises ExportError after a withdrawal."""
        log = LockedLog(self.study)
        try:
            stack.enter_context(log)
        except StudyLogError:  # `write` has reported it
            self._refuse_gone(None)
            return
        self._refuse_gone(log)
        if self._noted is not None and self.is_inside:
            with suppress(StudyLogError):  # a withdrawal then reports that the hash is unknown
                log.append("written", path=self._path, sha256=digest, **self._sessions_and_people())

    def _sessions_and_people(self) -> dict[str, Json]:
        return {"sessions": [session.resolve().name for session in self._sessions], "participants": [*self._people]}

    def _refuse_gone(self, log: LockedLog | None) -> None:
        """Refuse if a withdrawal has removed the sessions and their log entries, which it does with the log locked."""
        gone = [each.name for each in self._sessions if not each.is_dir()]
        entries = log.entries() if log is not None else []
        gone += [each for each in self._people if is_withdrawn(each, entries)]
        if not gone and self._noted is not None and log is not None:
            at, path = self._noted.at, self._path
            noted = (each.kind == "exported" and each.at == at and each.get("path") == path for each in entries)
            place = next(compress(count(1), noted), None)
            if place is None:
                gone.append(self._out.name)
            else:
                self._refuse_redacted(entries[place:])
        if gone:
            raise ExportError(
                f"{', '.join(gone)}: gone while this was made, because the participant has withdrawn or somebody has "
                "moved it. Nothing of it was kept: make it again"
            )

    def _refuse_redacted(self, since: Sequence[LogEntry]) -> None:
        names = {session.resolve().name for session in self._sessions}
        redacted = [name for each in since if each.kind == "redacted" and (name := each.get("session")) in names]
        if redacted:
            raise ExportError(
                f"{', '.join(dict.fromkeys(redacted))}: words were taken out of it while this was made. Nothing of it "
                "was kept: make it again"
            )


def _read(
    folders: Sequence[Path], level: ExportLevel, private: Iterable[str], report: ExportReport
) -> Iterator[SessionData]:
    """Read the sessions one after the other. The report gets sentences about unreadable ones."""

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
