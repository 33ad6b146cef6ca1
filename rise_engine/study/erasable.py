"""What a withdrawal may erase beside session folders, and why it leaves the rest to people, in sentences.

A line of study.jsonl, and what a session calls its recording, can name any file. So an export is erased only where
exports can be, and only if it is what was written; a recording only if it is what was recorded.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from datetime import datetime
from pathlib import Path

from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.base.files import tree_hash
from rise_engine.scenario.file_names import SCENARIO_FILE
from rise_engine.session.folder import INFO, JOURNAL, read_info
from rise_engine.study.kept_rows import FILE as KEPT_FILE
from rise_engine.study.plan_file import PLAN_FILE
from rise_engine.study.sessions import SESSIONS
from rise_engine.study.study_log import LOG_FILE, SET_ASIDE_FILE
from rise_engine.study.traces import MANIFEST_FILE, PARTICIPANTS_FILE, STUDY_FILE, questionnaire_files

_STUDYS_OWN = frozenset({SESSIONS, STUDY_FILE, PARTICIPANTS_FILE, PLAN_FILE, LOG_FILE, SET_ASIDE_FILE, KEPT_FILE})
_OF_SOMEBODY = (INFO, JOURNAL, STUDY_FILE, LOG_FILE)


class KnownBy(Struct):
    """What a recording is known by: files of these sizes and check sums."""

    sizes: list[int] = []
    """Bytes, also of a folder with everything in it."""
    hashes: list[str] = []
    """As `rise_engine.base.files.tree_hash` has them."""


def why_not_export(study: Path, export: str) -> str:
    """Why an export is left to people because of where it lies, or empty: the study may be a copy, and what lies
    elsewhere somebody else's.

    :param study: the study's folder.
    :param export: its path, from there on or absolute.
    """
    if "\0" in export:
        return f"{export} was named as an export of them, and is no path"
    path, root = study / export, Path(os.path.realpath(study))
    real = _real_place(path)
    if root not in real.parents:
        return f"{path} was exported of them, and lies outside of the study's folder: erase it yourself"
    first = real.relative_to(root).parts[0]
    own = first in _STUDYS_OWN or first.startswith(".") or str(real.relative_to(root)) in questionnaire_files(study)
    if own or path.is_symlink() or _is_of_scenario(real, root):
        return f"{path} is named as an export of them, and is a part of the study: look what it is"
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
        return f"{path} is a folder, and no bag: erase what is theirs in it"
    if not (facts.sizes or facts.hashes):
        return f"{path}: nothing says how large it was, so it may be another file; look what it is, and erase it"
    if facts.sizes and _size(path) not in facts.sizes:
        return f"{path} has another size than what was recorded: look what it is, and erase it"
    if not facts.hashes and _is_older(path, session):
        return f"{path} is older than the session that names it: look what it is"
    return ""


def why_not_place(study: Path, path: Path) -> str:
    """Why a recording is left to people because of where it lies, or empty.

    :param study: the study's folder.
    :param path: what a session has registered, absolute.
    """
    if path.is_symlink():
        return f"{path} is a link to {path.resolve()}: erase what is theirs there"
    real, root = _real_place(path), Path(os.path.realpath(study))
    if real == root or root in real.parents or real in root.parents:
        return f"{path} is no file that a recorder made, but a part of the study: look what it is"
    if any((parent / name).exists() for parent in real.parents for name in _OF_SOMEBODY):
        return f"{path} lies in the folder of another session or study: look what it is"
    return ""


def why_other(path: Path, hashes: Collection[str]) -> str:
    """Why what lies at a path is not what was once written there, or empty. Raises OSError."""
    if hashes and tree_hash(path) in hashes:
        return ""
    if hashes:
        return f"{path} was changed since it was written: erase what is theirs in it"
    return f"{path}: nothing says what was written there, so it may be another file; look what it is, and erase it"


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
