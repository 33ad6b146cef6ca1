"""The list of what a withdrawal erases, and the erasing: both can be killed at any moment, and the next run goes on."""

from __future__ import annotations

import os
from collections.abc import Collection
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import msgspec
from msgspec import Struct, field

from rise_engine.base.errors import SessionError, StudyError
from rise_engine.scenario.file_names import SCENARIO_FILE
from rise_engine.session.disk import Disk, error_message, replace_file, tree_hash
from rise_engine.session.folder import INFO, JOURNAL, read_info
from rise_engine.session.unfinished_files import erase_all_unfinished, erase_folder, has_other_names
from rise_engine.study.plan_file import PLAN_FILE
from rise_engine.study.sessions import SESSIONS
from rise_engine.study.study_log import LOG_FILE, SET_ASIDE_FILE
from rise_engine.study.traces import (
    MANIFEST_FILE,
    PARTICIPANTS_FILE,
    STUDY_FILE,
    WORK_FOLDER,
    folders_in,
    questionnaire_files,
)
from rise_engine.study.withdrawn import FILE as KEPT_FILE
from rise_engine.study.withdrawn import add_rows

_STUDYS_OWN = frozenset({SESSIONS, STUDY_FILE, PARTICIPANTS_FILE, PLAN_FILE, LOG_FILE, SET_ASIDE_FILE, KEPT_FILE})
_OF_SOMEBODY = (INFO, JOURNAL, STUDY_FILE, LOG_FILE)


class KnownBy(Struct):
    """What a recording is known by: files of these sizes and check sums."""

    sizes: list[int] = []
    """Bytes, also of a folder with everything in it."""
    hashes: list[str] = []
    """As `rise_engine.session.disk.tree_hash` has them."""


def why_not_export(study: Path, export: str) -> str:
    """Why an export is left to people because of where it lies, or empty: the study may be a copy, and what lies
    elsewhere somebody else's.

    :param study: the study's folder.
    :param export: its path, from there on or absolute.
    """
    if "\0" in export:
        return f"{export} was named as an export of their data, and is not a path"
    path, root = study / export, Path(os.path.realpath(study))
    real = _real_place(path)
    if root not in real.parents:
        return f"{path} was exported with their data, and is outside the study's folder: erase it yourself"
    first = real.relative_to(root).parts[0]
    own = first in _STUDYS_OWN or first.startswith(".") or str(real.relative_to(root)) in questionnaire_files(study)
    if own or path.is_symlink() or _is_of_scenario(real, root):
        return f"{path} is named as an export of their data, and is a part of the study: check what it is"
    return ""


def why_not_recording(study: Path, session: Path, path: Path, facts: KnownBy) -> str:
    """Why something that a session has registered as its recording is left to people, or empty.

    :param study: the study's folder.
    :param session: the session's folder.
    :param path: what it has registered, absolute.
    :param facts: what it has registered of it.
    """
    if not os.path.lexists(path):
        return f"{path} is not on this computer: erase it where it was recorded"
    if sentence := why_not_place(study, path):
        return sentence
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        return f"{path} is a folder, but not a bag: erase their data in it"
    if not (facts.sizes or facts.hashes):
        return f"{path}: nothing says how large it was, so it may be another file; check what it is, and erase it"
    if facts.sizes and _size(path) not in facts.sizes:
        return f"{path} has another size than what was recorded: check what it is, and erase it"
    if not facts.hashes and _is_older(path, session):
        return f"{path} is older than the session that names it: check what it is"
    return ""


def why_not_place(study: Path, path: Path) -> str:
    """Why a recording is left to people because of where it lies, or empty.

    :param study: the study's folder.
    :param path: what a session has registered, absolute.
    """
    if path.is_symlink():
        return f"{path} is a link to {path.resolve()}: erase their data there"
    real, root = _real_place(path), Path(os.path.realpath(study))
    if real == root or root in real.parents or real in root.parents:
        return f"{path} is not a recorder's file, but a part of the study: check what it is"
    if any((parent / name).exists() for parent in real.parents for name in _OF_SOMEBODY):
        return f"{path} is in the folder of another session or study: check what it is"
    return ""


def why_other(path: Path, hashes: Collection[str]) -> str:
    """Why what lies at a path is not what was once written there, or empty. Raises OSError."""
    if hashes and tree_hash(path) in hashes:
        return ""
    if hashes:
        return f"{path} was changed since it was written: erase their data in it"
    return f"{path}: nothing says what was written there, so it may be another file; check what it is, and erase it"


def _real_place(path: Path) -> Path:
    """Without links on the way; of a link, the link itself."""
    return Path(os.path.normpath(Path(os.path.realpath(path.parent), path.name)))


def _is_of_scenario(path: Path, root: Path) -> bool:
    """Whether a scenario of the study lies there, or around it. Those in a bundle are the bundle's."""
    if any((each / SCENARIO_FILE).exists() for each in (path, *path.parents) if root in each.parents):
        return True
    return not (path / MANIFEST_FILE).is_file() and any(path.rglob(SCENARIO_FILE))


def _size(path: Path) -> int:
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(each.lstat().st_size for each in files if each.is_file())


def _is_older(path: Path, session: Path) -> bool:
    """Whether it was last written before the session began."""
    try:
        started = datetime.fromisoformat(read_info(session, compare=False).started).timestamp()
    except (SessionError, ValueError):
        return True
    newest = max((each.lstat().st_mtime for each in path.rglob("*")), default=0) if path.is_dir() else 0
    return max(newest, path.lstat().st_mtime) < started - 1


_LIST = "list.json"


class WithdrawalPlan(Struct):
    """What is to be erased."""

    participant: str
    sessions: list[str] = field(default_factory=list)
    """Names of their folders in the study's sessions."""
    recordings: list[str] = field(default_factory=list)
    """Files, and folders of bags, that their sessions have registered; absolute."""
    exports: dict[str, list[str]] = field(default_factory=dict)
    """What was exported of their sessions into the study's folder, from there on, and who else is in each."""
    unreachable: list[str] = field(default_factory=list)
    """What their sessions have registered and cannot be erased, in sentences."""
    export_folders: list[str] = field(default_factory=list)
    """Those of `exports` that were written as folders: they are erased with everything in them."""
    kept: list[dict[str, str]] = field(default_factory=list)
    """Rows that stay in the study's `anonymous.csv`."""
    hashes: dict[str, list[str]] = field(default_factory=dict)
    """Of exports and recordings, by their paths: what was written there."""
    begun: list[str] = field(default_factory=list)
    """Those that were found to be what was written, and are being erased."""


class WithdrawalReport(Struct):
    """What was done, and what is left for people."""

    erased: list[str] = field(default_factory=list)
    make_again: list[str] = field(default_factory=list)
    """Exports that held others, too."""
    remains: list[str] = field(default_factory=list)
    """Where they are still named in the study's folder, in sentences."""
    unreached: list[str] = field(default_factory=list)
    """What is known of and was not erased, and why, in sentences."""
    beyond: list[str] = field(default_factory=list)
    """What nobody can reach or know of from here, in sentences."""


# --- the list of what is to go --------------------------------------------------------------------------------------


def left_work(study: Path, participant: str) -> Path | None:
    """What an earlier run has left."""
    for folder in folders_in(study / WORK_FOLDER):
        try:
            if read_list(folder).participant == participant:
                return folder
        except (FileNotFoundError, msgspec.DecodeError):
            continue
    return None


def erase_unlisted(study: Path) -> None:
    """What was left by a run that was ended before its list was written, or while that was erased, as the last of all.

    The list is written in one step, so one that cannot be read is half erased.
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
    return msgspec.json.decode((work / _LIST).read_bytes(), type=WithdrawalPlan)


def write_list(work: Path, plan: WithdrawalPlan, disk: Disk) -> None:
    replace_file(work / _LIST, msgspec.json.encode(plan), disk)


def join_plans(before: WithdrawalPlan, now: WithdrawalPlan) -> WithdrawalPlan:
    """What an earlier run has left, and what has come since."""
    moved = tuple(f"session {name} " for name in before.sessions)  # the log says that these are not there any more
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
    """Erases what a list names. What cannot be erased is told, and stays on the list for the next time.

    :param study: the study's folder.
    :param work: the folder of the list, with the session folders that were moved there.
    :param disk: what writes.
    """

    def __init__(self, study: Path, work: Path, disk: Disk) -> None:
        self._study = study
        self._work = work
        self._disk = disk
        self._plan = read_list(work)
        self._failed = False
        self.report = WithdrawalReport(unreached=list(self._plan.unreachable))

    def run(self) -> WithdrawalReport:
        """What was done. Raises OSError: not even the list can be written."""
        plan, report = self._plan, self.report
        add_rows(self._study, plan.kept, self._disk)  # first: from here on they stand nowhere else
        for text in plan.recordings:
            self._erase_if_same(text, why_not_place(self._study, Path(text)), proved=text in plan.hashes)
        for text, others in plan.exports.items():
            if self._erase_if_same(text, why_not_export(self._study, text)) and others:
                report.make_again.append(f"{self._study / text} (with {', '.join(others)})")
        for name in plan.sessions:
            report.unreached += [
                f"{each} had another name on this disk (a hard link, as backups make them): it is there still"
                for each in _linked_files(self._work / name)
            ]
            self._erase(self._work / name, f"{SESSIONS}/{name}")
        if not self._failed:
            erase_folder(self._work)  # with the list: from here on nothing is left to do
            with suppress(OSError):  # somebody else's are being erased, too
                (self._study / WORK_FOLDER).rmdir()
        self._disk.sync_folder(self._study)
        return report

    def _erase_if_same(self, text: str, why: str, *, proved: bool = True) -> bool:
        path, plan = self._study / text, self._plan
        if not why and text not in plan.begun:
            if not os.path.lexists(path):
                return False
            try:
                why = why_other(path, plan.hashes.get(text, [])) if proved else ""
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
            if path.is_dir() and not path.is_symlink():
                erase_folder(path)
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            return self._fail(path, error)
        self.report.erased.append(name)
        return True

    def _fail(self, path: Path, error: OSError) -> bool:
        self._failed = True
        where = error.filename or path
        self.report.unreached.append(
            f"{where} could not be erased: {error_message(error)}. Repeat the command when it can be"
        )
        return False


def _linked_files(folder: Path) -> list[Path]:
    return [each for each in sorted(folder.rglob("*")) if not each.is_dir() and has_other_names(each)]


def erase_leftovers(study: Path, report: WithdrawalReport) -> None:
    """What killed exports have left, of whomever."""

    def erase(folder: Path) -> None:
        try:
            erase_folder(folder)
        except OSError as error:
            report.unreached.append(f"{error.filename or folder} could not be erased: {error_message(error)}")

    busy = erase_all_unfinished(study, erase)
    report.unreached += [f"{each} is being written just now: erase what becomes of it" for each in busy]
