"""The traces of one participant in a study, and the remaining entries of participants who have withdrawn.

Traces are session folders, their registered recordings (in the record or in media.json), and places with the pseudonym.
A salted hash in study.jsonl remains, and rows of `anonymous.csv` if they agreed. The hash only shows whether a new
participant has withdrawn before. With the salt, all pseudonyms could be tried, so it is removed from every study.jsonl
for others (`without_salts`).
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
import re
import secrets
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import Disk, lines_with
from rise_engine.base.text import name_some
from rise_engine.kernel.inputs import RecordingReport, SessionStarted
from rise_engine.kernel.records import RecordingRecord, SessionRecord
from rise_engine.scenario.files.study_paths import PARTICIPANTS_FILE as PARTICIPANTS_FILE
from rise_engine.scenario.files.study_paths import STUDY_FILE as STUDY_FILE
from rise_engine.session.folder import JOURNAL, read_info
from rise_engine.session.journal_format import InputLine, JournalLine, LineError, read_line
from rise_engine.session.labels import read_labels
from rise_engine.session.media import MEDIA_FILE, MediaFile, media_path, read_media
from rise_engine.study.labels import SESSIONS, read_study_id, reassignment_of, session_folders
from rise_engine.study.study_log import LOG_FILE, WITHDRAWN_PREFIX, LogEntry

WORK_FOLDER = ".withdrawing"
"""A folder in the study's folder while data are being erased."""
LIST_FILE = "list.json"
"""The list of data to erase, in a subfolder of it."""
MANIFEST_FILE = "manifest-sha256.txt"
"""The checksums of a bundle (`results.bundle`). A study's folder with this file must not be changed."""


def study_of_session(session: Path) -> Path | None:
    """Return the study around a session's folder in its `sessions`. None: the session is in no study."""
    folder = session.resolve().parent
    study = folder.parent
    if folder.name == SESSIONS and ((study / STUDY_FILE).exists() or (study / LOG_FILE).exists()):
        return study
    return None


def wizard_names(study: Path | None) -> dict[str, str]:
    """Return the code of each wizard in exports from `[wizards]` in study.toml, even if other parts have errors."""
    return {name: str(each) for name, each in _written(study, "wizards").items()} if study is not None else {}


def questionnaire_files(study: Path) -> set[str]:
    """Return the files of questionnaires in study.toml, relative to the study, even if other parts have errors."""
    tables = _written(study, "questionnaire").values()
    return {os.path.normpath(str(each["file"])) for each in tables if isinstance(each, dict) and "file" in each}


def _written(study: Path, table: str) -> dict[str, Any]:
    """Read a table of study.toml unchecked. Empty: there is none."""
    try:
        found = tomllib.loads((study / STUDY_FILE).read_text("utf-8")).get(table)
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def folders_in(sessions: Path) -> list[Path]:
    """Return the subfolders of a folder, sorted. Empty: there is none."""
    try:
        return sorted(Path(each.path) for each in os.scandir(sessions) if each.is_dir(follow_symlinks=False))
    except OSError:
        return []


def interrupted_withdrawals(study: Path, besides: Path | None = None) -> list[str]:
    """Return a sentence for each withdrawal in a study's folder that has not erased everything.

    :param study: the study's folder.
    :param besides: the folder of a withdrawal that is omitted.
    """
    return [
        f"a withdrawal was interrupted: their data are still in {WORK_FOLDER}/{work.name}; `rise-engine study withdraw "
        f"STUDY PSEUDONYM` completes it ({LIST_FILE} there says whose)"
        for work in folders_in(study / WORK_FOLDER)
        if work != besides and (work / LIST_FILE).exists()
    ]


def owner_of(folder: Path) -> str:
    """Return a session's participant, or an empty text. Sources in this order: the reassignment in the study's log,
    session.toml with the journal's labels, the journal, the folder's name."""
    if (moved := reassignment_of(folder)) is not None:
        return moved.participant
    try:
        return read_info(folder, compare=False).participant
    except SessionError:
        pass
    for line in _readable_lines(folder):
        content = line.input if isinstance(line, InputLine) else line
        if isinstance(content, SessionRecord | SessionStarted):
            return content.participant
    parts = folder.name.split("_")
    return parts[2] if len(parts) >= 5 else ""


def other_study_of(study: Path, folder: Path, log: Iterable[LogEntry]) -> str:
    """Return the id of the other study to which a session's folder belongs. Empty: this study, or unknown.

    :param study: the study's folder.
    :param folder: the session's folder.
    :param log: the study's log; sessions in it are the study's own, even if its id was changed.
    """
    try:
        recorded = read_info(folder, compare=False).study
    except SessionError:
        return ""
    id = read_study_id(study / STUDY_FILE)
    is_named = any(folder.name == each.get("folder") for each in log)
    return "" if is_named or not id or recorded == id else recorded


def returned_sessions(study: Path, log: Sequence[LogEntry]) -> dict[str, str]:
    """Find sessions of withdrawn participants that a backup, a synchronised copy or a link has restored.

    :param study: the study's folder.
    :param log: the study's log.
    :return: a sentence on what to do for each, by the folder's name.
    """
    withdrawn = [each for each in log if each.kind == "withdrawn"]
    if not withdrawn:
        return {}
    found: dict[str, str] = {}
    owners = {str(each.get("folder")): str(each.get("participant")) for each in log if each.kind == "session"}
    known = {name for name, owner in owners.items() if not is_withdrawn(owner, withdrawn)}
    for folder in session_folders(study):
        if folder.name in known:
            continue  # the log names no session of theirs, except one of an earlier version of the program
        if is_withdrawn(owner_of(folder), withdrawn) and not other_study_of(study, folder, log):
            linked = f"erase their data in {folder.resolve()}, and this link" if folder.is_symlink() else ""
            erase = "`rise-engine study withdraw STUDY PSEUDONYM`, with theirs, erases it"
            found[folder.name] = f"it is of a participant who has withdrawn, and is there again: {linked or erase}"
    return found


def registered_recordings(folder: Path, *, inside: bool = False) -> list[str]:
    """Return the absolute paths of the recordings in a session's record or media.json.

    :param folder: the session's folder.
    :param inside: also those within the session's folder.
    """
    listed = (os.path.normpath(media_path(folder, each)) for each in _listed(folder))
    found = dict.fromkeys((*_recorded(folder), *listed))
    return [path for path in found if inside or not Path(path).is_relative_to(folder.absolute())]


def recording_hashes(folder: Path, path: str) -> list[str]:
    """Return the checksums and fingerprints that a session has registered for one of its recordings.

    :param folder: the session's folder.
    :param path: from `registered_recordings`.
    """
    listed = [each for each in _listed(folder) if os.path.normpath(media_path(folder, each)) == path]
    return [text for each in listed for text in (each.sha256, each.fingerprint) if text]


def why_media_unknown(folder: Path) -> str:
    """Return why a session's media.json cannot be read. Empty: it is readable or missing."""
    try:
        read_media(folder)
    except SessionError as error:
        return str(error)
    return ""


def _listed(folder: Path) -> tuple[MediaFile, ...]:
    try:
        return read_media(folder)
    except SessionError:
        return ()


def _recorded(folder: Path) -> tuple[str, ...]:
    try:
        changed = (folder / JOURNAL).stat().st_mtime_ns
    except OSError:
        return ()
    return _recorded_in(folder, changed)


@lru_cache(maxsize=1_000)
def _recorded_in(folder: Path, changed: int) -> tuple[str, ...]:
    """Read the recordings in a journal. Cached while the journal is unchanged."""
    found: dict[str, None] = {}
    for line in _readable_lines(folder):
        content = line.input if isinstance(line, InputLine) else line
        if isinstance(content, RecordingReport | RecordingRecord) and (path := content.path):
            found[os.path.normpath((folder / os.path.expanduser(path)).absolute())] = None  # noqa: PTH111
    return tuple(found)


def _readable_lines(folder: Path) -> Iterator[JournalLine]:
    """Give the readable lines of a journal, also of a damaged one."""
    try:
        with (folder / JOURNAL).open("rb") as file:
            for line in file:
                if b'"recording"' in line or b'"kind":"session"' in line or b'"input":"session_started"' in line:
                    try:
                        yield read_line(line.rstrip(b"\n"))
                    except LineError:
                        continue
    except OSError:
        return


def find_names(study: Path, participant: str) -> list[str]:
    """List, in sentences, where a study's folder still has a pseudonym, and what to do about it."""
    found = []
    theirs = {PARTICIPANTS_FILE, *questionnaire_files(study)}
    folders = [each.name for each in folders_in(study / SESSIONS)]

    def is_named_outside_folders(line: str) -> bool:
        return has_name(_without(line, folders), participant)

    for path in sorted(study.rglob("*")):
        name = path.relative_to(study)
        if name.parts[0] == WORK_FOLDER:  # its withdrawal erases or reports it
            continue
        if has_name(path.name, participant):
            kept = _was_run_under(study, name, participant)
            found.append(f"the name of {name}: {_KEPT if kept else 'erase it, or give it another name'}")
        if path.is_symlink() or not path.is_file():
            continue
        lines = lines_naming(path, participant)
        if lines and str(name) == LOG_FILE:  # the names of their folders are already listed
            lines = lines_with(path, is_named_outside_folders)
        if lines:
            advice = _WRITTEN_BY_PEOPLE if str(name) in theirs else _advice(study, name, participant)
            found.append(f"{name}, line{'s' if len(lines) > 1 else ''} {name_some(lines)}: {advice}")
    return found


_KEPT = "the session was run under this name and reassigned; a session keeps the name that it was run under"
_WRITTEN_BY_PEOPLE = "delete the line yourself, because nothing but people writes in this file"


def _advice(study: Path, name: Path, participant: str) -> str:
    if name.parts[0] == SESSIONS and len(name.parts) == 3 and name.name == MEDIA_FILE:
        return f"give that file a name without it, then rise-engine media remove {name.parts[1]} and media add"
    if name.parts[0] == SESSIONS and len(name.parts) > 2:
        if _was_run_under(study, name, participant):
            return _KEPT
        return f"rise-engine redact {name.parts[1]} --replace {participant}=NAME, if it means them"
    return "take it out yourself, if it means them"


def _was_run_under(study: Path, name: Path, participant: str) -> bool:
    """Whether a path is of a session that was run under this participant and reassigned."""
    if name.parts[0] != SESSIONS or len(name.parts) < 2:
        return False
    folder = study / SESSIONS / name.parts[1]
    labels = read_labels(folder / JOURNAL) or {}
    return reassignment_of(folder) is not None and labels.get("participant") == participant


def _without(line: str, folders: Iterable[str]) -> str:
    for folder in folders:
        line = line.replace(folder, "")
    return line


def lines_naming(path: Path, participant: str) -> list[int]:
    """Return the lines of a file with a pseudonym, from 1."""
    try:
        return lines_with(path, name_pattern(participant).search)
    except OSError:
        return []


def name_pattern(participant: str) -> re.Pattern[str]:
    """Return a pattern of a pseudonym that is not a part of another word."""
    return re.compile(rf"(?<![A-Za-z0-9]){re.escape(participant)}(?![A-Za-z0-9])")


def has_name(text: str, participant: str) -> bool:
    """Whether a text contains a pseudonym."""
    return name_pattern(participant).search(text) is not None


# --- who has withdrawn ------------------------------------------------------------------------------------------------


def new_salt() -> str:
    """Return a random salt."""
    return secrets.token_hex(16)


def hash_pseudonym(participant: str, salt: str) -> str:
    """Return the salted hash in hexadecimal digits."""
    return hashlib.sha256(f"{salt}/{participant}".encode()).hexdigest()


def is_withdrawn(participant: str, log: Iterable[LogEntry]) -> bool:
    """Whether a participant has withdrawn.

    :param participant: a pseudonym, or its replacement in the log.
    :param log: all entries of study.jsonl.
    """
    if participant.startswith(WITHDRAWN_PREFIX):
        return True
    entries = [each for each in log if each.kind == "withdrawn"]
    return any(hash_pseudonym(participant, str(each.get("salt"))) == each.get("hash") for each in entries)


class Withdrawn(Struct, frozen=True):
    """The number of withdrawn participants, without any other data."""

    count: int = 0
    begun: int = 0
    """The number of those who had taken a slot."""


def count_withdrawn(log: Iterable[LogEntry]) -> Withdrawn:
    """Count the withdrawn participants in the log."""
    entries = [each for each in log if each.kind == "withdrawn"]
    return Withdrawn(len(entries), sum(each.get("slot") is not None for each in entries))


def without_salts(log: Sequence[LogEntry]) -> list[LogEntry]:
    """Return the log for others, without the salts, which would allow trying all pseudonyms."""
    return [
        replace(each, fields={name: value for name, value in each.fields.items() if name != "salt"}) for each in log
    ]


# --- rows that stay ---------------------------------------------------------------------------------------------------

KEPT_FILE = "anonymous.csv"
KEPT_CONSENT = "anonymous"
"""The column `consent_anonymous` of participants.csv has the date of the consent to keep anonymous rows."""
KEPT_ID = "id"


def new_id() -> str:
    """Return an id that reveals nothing."""
    return f"A{secrets.token_hex(4)}"


def add_rows(study: Path, rows: Sequence[Mapping[str, str]], disk: Disk) -> None:
    """Add rows with new ids to the study's file. The call can be repeated after a kill.

    :param study: the study's folder.
    :param rows: each with an `id`.
    :raises OSError: it cannot be written; then the file is unchanged.
    """
    columns, kept = read_rows(study)
    known = {row.get(KEPT_ID) for row in kept}
    added = [dict(row) for row in rows if row[KEPT_ID] not in known]
    if not added:
        return
    columns = list(dict.fromkeys([KEPT_ID, *columns, *(name for row in added for name in row)]))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(sorted([*kept, *added], key=lambda row: (row.get(KEPT_ID, ""), row.get("run", ""))))
    disk.write_whole(study / KEPT_FILE, text.getvalue().encode())


def read_rows(study: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Read the file's columns and rows. Empty: there is no file. Raises OSError."""
    try:
        text = (study / KEPT_FILE).read_text("utf-8")
    except FileNotFoundError:
        return [], []
    reader = csv.DictReader(io.StringIO(text))
    return list(reader.fieldnames or ()), [dict(row) for row in reader]
