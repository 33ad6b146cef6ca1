"""The list of data that a withdrawal erases, and their erasing. Both survive a kill; the next run continues."""

from __future__ import annotations

import os
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

import msgspec
from msgspec import Struct, field

from rise_engine.base.errors import StudyError
from rise_engine.base.files import Disk, error_message, fingerprint, tree_hash
from rise_engine.base.text import name_some
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_engine.session.folder import INFO, JOURNAL
from rise_engine.session.unfinished_files import erase_all_unfinished, erase_folder, find_leftovers, has_other_names
from rise_engine.study.labels import SESSIONS
from rise_engine.study.plan_file import PLAN_FILE
from rise_engine.study.study_log import LOG_FILE, SET_ASIDE_FILE, LockedLog
from rise_engine.study.traces import (
    KEPT_FILE,
    LIST_FILE,
    MANIFEST_FILE,
    PARTICIPANTS_FILE,
    STUDY_FILE,
    WORK_FOLDER,
    add_rows,
    folders_in,
    is_withdrawn,
    questionnaire_files,
)

_STUDY_FILES = frozenset({SESSIONS, STUDY_FILE, PARTICIPANTS_FILE, PLAN_FILE, LOG_FILE, SET_ASIDE_FILE, KEPT_FILE})
_PERSONAL_FILES = (INFO, JOURNAL, STUDY_FILE, LOG_FILE)
_EXPORT_FILES = (MANIFEST_FILE, "dataset_description.json")
"""The files at the top of a bundle and of a BIDS export. Both contain copies of scenarios."""


EXPORTED = frozenset({"exported", "written"})
"""Kinds of log entries about an export."""


def why_not_export(study: Path, export: str) -> str:
    """Return why an export's place forbids erasing it, or an empty text. The study may be a copy, and files elsewhere
    may belong to others.

    :param study: the study's folder.
    :param export: its path, absolute or relative to the study.
    """
    if "\0" in export:
        return f"{export} was named as an export of their data, and is not a path"
    path, root = study / export, Path(os.path.realpath(study))
    real = _real_place(path)
    if root not in real.parents:
        there = [str(path)] * os.path.lexists(real) + [str(each) for each in find_leftovers(real)]
        if not there:
            return f"{path} was exported with their data, and is not there any more: erase it where it is now"
        was = f"was exported with their data{f' to {path}' if str(path) not in there else ''}"
        return f"{' and '.join(there)} {was}, and is outside the study's folder: erase it yourself"
    first = real.relative_to(root).parts[0]
    own = first in _STUDY_FILES or first.startswith(".") or str(real.relative_to(root)) in questionnaire_files(study)
    if own or path.is_symlink() or _is_of_scenario(real, root):
        return f"{path} is named as an export of their data, and is a part of the study: check what it is"
    return ""


def is_there(study: Path, export: str) -> bool:
    """Whether an export, or an incomplete one of a killed program, is still in its place."""
    path = study / export
    return os.path.lexists(path) or bool(find_leftovers(_real_place(path)))


def why_not_recording(study: Path, path: Path, hashes: Collection[str]) -> str:
    """Return why a registered recording must not be erased automatically, or an empty text.

    :param study: the study's folder.
    :param path: the registered absolute path.
    :param hashes: the registered checksums and fingerprints.
    """
    if not os.path.lexists(path):
        return f"{path} is not on this computer: erase it where it was recorded"
    if sentence := why_not_place(study, path):
        return sentence
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        return f"{path} is a folder, but not a bag: erase their data in it"
    try:
        return why_other(path, hashes)
    except OSError as error:
        return f"{path} cannot be read: {error.strerror or error}. Erase it yourself"


def why_not_place(study: Path, path: Path) -> str:
    """Return why a recording's place forbids erasing it, or an empty text.

    :param study: the study's folder.
    :param path: the absolute path that a session has registered.
    """
    if path.is_symlink():
        return f"{path} is a link to {path.resolve()}: erase their data there"
    real, root = _real_place(path), Path(os.path.realpath(study))
    if real == root or root in real.parents or real in root.parents:
        return f"{path} is not a recorder's file, but a part of the study: check what it is"
    if any((parent / name).exists() for parent in real.parents for name in _PERSONAL_FILES):
        return f"{path} is in the folder of another session or study: check what it is"
    return ""


def why_other(path: Path, hashes: Collection[str]) -> str:
    """Return why a path no longer has its original content, or an empty text. Raises OSError."""
    if hashes and (fingerprint(path) in hashes or tree_hash(path) in hashes):
        return ""
    if hashes:
        return f"{path} was changed since it was written: erase their data in it"
    return f"{path}: nothing says what was written there, so it may be another file; check what it is, and erase it"


def _real_place(path: Path) -> Path:
    """Resolve the links in a path's folder, but not the path itself."""
    return Path(os.path.normpath(Path(os.path.realpath(path.parent), path.name)))


def _is_of_scenario(path: Path, root: Path) -> bool:
    """Whether the path is in, or contains, a scenario of the study, unlike the copies in an export."""
    if any((each / SCENARIO_FILE).exists() for each in (path, *path.parents) if root in each.parents):
        return True
    return not any((path / name).is_file() for name in _EXPORT_FILES) and any(path.rglob(SCENARIO_FILE))


class WithdrawalPlan(Struct):
    participant: str
    sessions: list[str] = field(default_factory=list)
    """The names of their folders in the study's sessions."""
    recordings: list[str] = field(default_factory=list)
    """Absolute paths of recorded files and folders that their sessions have registered."""
    exports: dict[str, list[str]] = field(default_factory=dict)
    """Exports of their sessions, relative to the study's folder, each with the other participants in it."""
    unreachable: list[str] = field(default_factory=list)
    """Sentences on registered data that cannot be erased."""
    export_folders: list[str] = field(default_factory=list)
    """The `exports` that were written as folders and are erased with all contents."""
    kept: list[dict[str, str]] = field(default_factory=list)
    """Rows that stay in the study's `anonymous.csv`."""
    hashes: dict[str, list[str]] = field(default_factory=dict)
    """The hashes of exports and recordings as they were written, by path."""
    begun: list[str] = field(default_factory=list)
    """Files that were found unchanged, and whose erasing has begun."""


class WithdrawalReport(Struct):
    """The erased data, and the remaining tasks for people."""

    erased: list[str] = field(default_factory=list)
    make_again: list[str] = field(default_factory=list)
    """Exports with other participants."""
    remains: list[str] = field(default_factory=list)
    """Sentences on where the study's folder still names them."""
    unreached: list[str] = field(default_factory=list)
    """Sentences on known data that were not erased, with the reason."""
    beyond: list[str] = field(default_factory=list)
    """Sentences on data that are out of reach or unknown to the program."""


# --- the list of what is to go --------------------------------------------------------------------------------------


def find_earlier_work(study: Path, participant: str) -> Path | None:
    """Return the folder that an earlier run has left."""
    for folder in folders_in(study / WORK_FOLDER):
        try:
            if read_list(folder).participant == participant:
                return folder
        except (FileNotFoundError, msgspec.DecodeError):
            continue
    return None


def erase_unlisted(study: Path) -> None:
    """Erase folders of runs that were killed before their list was written, or while it was erased at the end.

    Lists are written in one step, so an unreadable list is half erased.
    """
    for folder in folders_in(study / WORK_FOLDER):
        try:
            read_list(folder)
        except (FileNotFoundError, msgspec.DecodeError):
            erase_folder(folder)


def new_work(study: Path) -> Path:
    root = study / WORK_FOLDER
    root.mkdir(0o700, exist_ok=True)
    for number in range(1, 10_000):
        try:
            (root / str(number)).mkdir(0o700)
        except FileExistsError:
            continue
        return root / str(number)
    raise StudyError(f"{root} is full")


def read_list(work: Path) -> WithdrawalPlan:
    return msgspec.json.decode((work / LIST_FILE).read_bytes(), type=WithdrawalPlan)


def write_list(work: Path, plan: WithdrawalPlan, disk: Disk) -> None:
    disk.write_whole(work / LIST_FILE, msgspec.json.encode(plan))


def join_plans(before: WithdrawalPlan, now: WithdrawalPlan) -> WithdrawalPlan:
    """Merge the list of an earlier run with new data."""
    moved = tuple(f"session {name} " for name in before.sessions)  # the log reports these as missing
    unreachable = [*before.unreachable, *(each for each in now.unreachable if not each.startswith(moved))]
    return WithdrawalPlan(
        now.participant,
        list(dict.fromkeys([*before.sessions, *now.sessions])),
        list(dict.fromkeys([*before.recordings, *now.recordings])),
        {**before.exports, **now.exports},
        list(dict.fromkeys(unreachable)),
        list(dict.fromkeys([*before.export_folders, *now.export_folders])),
        [*before.kept, *now.kept],
        {**before.hashes, **now.hashes},
        before.begun,
    )


# --- erasing --------------------------------------------------------------------------------------------------------


class Erasing:
    """Erases the data of a list. It reports data that it cannot erase, which stay listed for the next run.

    :param study: the study's folder.
    :param work: the folder with the list and the moved session folders.
    :param disk: does the writing.
    """

    def __init__(self, study: Path, work: Path, disk: Disk) -> None:
        self._study = study
        self._work = work
        self._disk = disk
        self._plan = read_list(work)
        self._failed = False
        self.report = WithdrawalReport(unreached=list(self._plan.unreachable))

    def run(self) -> WithdrawalReport:
        """Erase everything and return the report. Raises OSError if the list cannot be written."""
        plan, report = self._plan, self.report
        add_rows(self._study, plan.kept, self._disk)  # first, because only the list has them until then
        for text in plan.recordings:
            self._erase_if_same(text, why_not_place(self._study, Path(text)))
        for text, others in plan.exports.items():
            if self._erase_if_same(text, why_not_export(self._study, text)) and others:
                report.make_again.append(f"{self._study / text} (with {', '.join(others)})")
        for name in plan.sessions:
            self._erase(self._work / name, f"{SESSIONS}/{name}")
        self._forget_exports()
        if not self._failed:
            erase_folder(self._work)  # with the list: nothing remains to do
            with suppress(OSError):  # keep it while another participant's data are being erased
                (self._study / WORK_FOLDER).rmdir()
        self._disk.sync_folder(self._study)
        return report

    def _forget_exports(self) -> None:
        """Remove the erased exports from the log. Exports made after the withdrawal may have the same names.

        :raises rise_engine.study.study_log.StudyLogError: the log cannot be read or written.
        """
        plan = self._plan
        gone = {each for each in plan.exports if each in plan.begun and not os.path.lexists(self._study / each)}
        if not gone:
            return
        with LockedLog(self._study, disk=self._disk) as log:
            entries = log.entries()
            end = max((each.line for each in entries if is_withdrawn(plan.participant, [each])), default=0)
            kept = [
                each for each in entries if not (each.kind in EXPORTED and each.get("path") in gone and each.line < end)
            ]
            if len(kept) < len(entries):
                log.rewrite(kept)

    def _erase_if_same(self, text: str, why: str) -> bool:
        path, plan = self._study / text, self._plan
        if not why and text not in plan.begun:
            if not os.path.lexists(path):
                return False
            try:
                why = why_other(path, plan.hashes.get(text, []))
            except OSError as error:
                return self._fail(path, error)
        if why:
            self.report.unreached += [why] if why not in self.report.unreached else []
            return False
        if text not in plan.begun:
            plan.begun.append(text)
            write_list(self._work, plan, self._disk)
        return self._erase(path, str(path))

    def _erase(self, path: Path, name: str) -> bool:
        try:
            linked = _linked_files(path)
            if path.is_dir() and not path.is_symlink():
                erase_folder(path)
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            return self._fail(path, error)
        self.report.erased.append(name)
        if linked:
            what = name if linked == [Path()] else f"{name}: {name_some(list(map(str, linked)), 3)}"
            self.report.unreached.append(
                f"{what} had another name on this disk (a hard link, as backups make them): it is there still"
            )
        return True

    def _fail(self, path: Path, error: OSError) -> bool:
        self._failed = True
        where = error.filename or path
        self.report.unreached.append(
            f"{where} could not be erased: {error_message(error)}. Repeat the command when it can be"
        )
        return False


def _linked_files(path: Path) -> list[Path]:
    """Return the files with several names (hard links) in a folder, or the file itself. Paths are relative to it."""
    if not path.is_dir() or path.is_symlink():
        return [Path()] if os.path.lexists(path) and has_other_names(path) else []
    files = (each for each in sorted(path.rglob("*")) if not each.is_dir())
    return [each.relative_to(path) for each in files if has_other_names(each)]


def erase_leftovers(study: Path, report: WithdrawalReport) -> None:
    """Erase incomplete exports of killed programs, with all participants in them."""

    def erase(folder: Path) -> None:
        try:
            erase_folder(folder)
        except OSError as error:
            report.unreached.append(f"{error.filename or folder} could not be erased: {error_message(error)}")

    busy = erase_all_unfinished(study, erase)
    report.unreached += [f"{each} is being written just now: erase it when it is complete" for each in busy]
