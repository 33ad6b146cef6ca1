"""study.jsonl: the events of a study, one JSON object a line, appended and never changed (docs/reference/study.md).

Programs lock the file to write, so that two that begin a session simultaneously see each other's entries. A program
that is killed while writing leaves half a line. The next program moves it to another file and recovers its contents
from the session folders.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.base.errors import StudyError
from rise_engine.base.files import Disk, error_message, has_no_locks, take_lock
from rise_engine.base.json_codec import JsonError, decode, encode
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import Json, SourceLocation

LOG_FILE = "study.jsonl"
SET_ASIDE_FILE = "study.jsonl.torn"
"""Incomplete lines that killed programs left in the log."""
WITHDRAWN_PREFIX = "withdrawn:"
"""The start of the hash that replaces a pseudonym in the log. No pseudonym has a colon."""
WRITTEN = ("reason", "text", "value")
"""Fields with text that people wrote."""
_SOURCE = "source"
"""The field with the author of an action: `wizard:anna`, or a word for a program."""
EntryKind: TypeAlias = Literal[
    "planned",
    "taken",
    "session",
    "checked",
    "outcome",
    "reassigned",
    "excluded",
    "withdrawn",
    "redacted",
    "exported",
    "written",
]
WAIT_SECONDS, TRY_SECONDS = 10.0, 0.01
"""Seconds to wait for another program's lock, which it holds for milliseconds, and between attempts."""


class StudyLogError(StudyError):
    """The study's log cannot be read or written."""


class LogEntry(Struct, frozen=True):
    """One line of the log."""

    kind: str
    """An EntryKind, or one of a newer program."""
    at: str
    """When it was written (ISO 8601 with offset)."""
    fields: dict[str, Json]
    """All other fields."""
    line: int
    """The number of its line, from 1."""

    def get(self, name: str, otherwise: Any = None) -> Any:
        """Return a field's value, or `otherwise`."""
        return self.fields.get(name, otherwise)

    def with_written(self, change: Callable[[str], str], *, sources: bool = False) -> LogEntry:
        """Return the entry with changed texts in the fields that people wrote (`WRITTEN`).

        :param change: maps an old text to a new one.
        :param sources: also change the names of people in `source`.
        """
        fields = {name: _change_written(value, change, name, sources) for name, value in self.fields.items()}
        return LogEntry(self.kind, self.at, fields, self.line)


def _change_written(value: Any, change: Callable[[str], str], name: str, sources: bool) -> Any:
    if isinstance(value, dict):
        return {field: _change_written(each, change, field, sources) for field, each in value.items()}
    if isinstance(value, list):
        return [_change_written(each, change, name, sources) for each in value]
    if not isinstance(value, str):
        return value
    if sources and name == _SOURCE:
        kind, colon, who = value.partition(":")
        return kind + colon + change(who)
    return change(value) if name in WRITTEN else value


def read_log(folder: Path, diagnostics: Diagnostics | None = None) -> list[LogEntry]:
    """Read all entries of a study's log in their order. Empty: there is no log.

    A torn last line is omitted with a warning; the next program that writes moves it away. Other invalid lines are
    omitted with an error.

    :param folder: the study's folder.
    :param diagnostics: gets the problems; None: they are ignored.
    :raises StudyLogError: it cannot be read.
    """
    try:
        data = (folder / LOG_FILE).read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StudyLogError(f"{folder / LOG_FILE} cannot be read: {error.strerror or error}") from None
    entries, problems, torn = _parse(data)
    if diagnostics is not None:
        for line, problem in problems:
            diagnostics.error("log-line", SourceLocation(LOG_FILE, line), problem)
        if torn:
            line = data[: len(data) - len(torn)].count(b"\n") + 1
            message = "the last line is torn: a program was ended while it wrote it; the next session sets it aside"
            diagnostics.warning("log-torn", SourceLocation(LOG_FILE, line), message)
    return entries


def read_log_and_damage(folder: Path) -> tuple[list[LogEntry], list[str]]:
    """Read a study's log, with a sentence for each invalid line.

    Conclusions from the other lines may be wrong, so callers must show these sentences.

    :raises StudyLogError: it cannot be read.
    """
    diagnostics = Diagnostics()
    entries = read_log(folder, diagnostics)
    return entries, [
        f"{each.location.file}:{each.location.line}: {each.message}. Until then, what it said is not taken into account"
        for each in diagnostics.sorted()
        if each.severity == "error"
    ]


def read_kept_log(folder: Path) -> Sequence[LogEntry]:
    """Return the result of `read_log`, cached until the file changes.

    :raises StudyLogError: it cannot be read.
    """
    return _read_kept(folder, file_stamp(folder / LOG_FILE))


@lru_cache(maxsize=4)
def _read_kept(folder: Path, stamp: tuple[int, int]) -> Sequence[LogEntry]:
    return tuple(read_log(folder))


def file_stamp(path: Path) -> tuple[int, int]:
    """Return the modification time (ns) and size of a file, to notice changes. Zeros: it does not exist."""
    try:
        found = path.stat()
    except OSError:
        return (0, 0)
    return (found.st_mtime_ns, found.st_size)


def _parse(data: bytes) -> tuple[list[LogEntry], list[tuple[int, str]], bytes]:
    """Return the entries, the problems of other lines, and the torn end."""
    *lines, rest = data.split(b"\n")
    entries: list[LogEntry] = []
    problems: list[tuple[int, str]] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        entry = _parse_line(line, number)
        if isinstance(entry, str):
            problems.append((number, entry))
        else:
            entries.append(entry)
    if rest and isinstance(whole := _parse_line(rest, len(lines) + 1), LogEntry):  # only its line end is missing
        entries.append(whole)
        rest = b""
    return entries, problems, rest


def _parse_line(line: bytes, number: int) -> LogEntry | str:
    """Return the entry of a line, or why it is not one."""
    try:
        values = decode(line.decode())
    except UnicodeDecodeError:
        return "this line is not UTF-8; it was changed by another program: put the line back as it was"
    except JsonError as error:
        return f"this line is not JSON ({error}); it was changed by another program: put the line back as it was"
    if not isinstance(values, dict) or not all(isinstance(values.get(key), str) for key in ("kind", "at")):
        return "this line is not an entry: an object with `kind` and `at`"
    return LogEntry(values.pop("kind"), values.pop("at"), values, number)


class LockedLog:
    """The log of a study, locked against other programs. Hold it for milliseconds only.

    Within `with LockedLog(folder) as log:`, `log.entries()` has all entries, and `log.append` writes one. A missing log
    is created.

    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with LockedLog(folder) as log:
    ...     entry = log.append("taken", slot=1, participant="P01")
    >>> read_log(folder)[0].get("participant")
    'P01'
    """

    def __init__(self, folder: Path, now: Callable[[], datetime] | None = None, disk: Disk | None = None) -> None:
        """
        :param folder: the study's folder.
        :param now: the time of day with its zone; None: the system time.
        :param disk: for tests that let it fail.
        """
        self.folder = folder
        self.path = folder / LOG_FILE
        self._now = now or (lambda: datetime.now().astimezone())
        self._disk = disk or Disk()
        self._descriptor = -1
        self._end = 0
        self._entries: list[LogEntry] = []
        self._lines = 0

    def __enter__(self) -> LockedLog:
        """
        :raises StudyLogError: it cannot be read or locked, or has an invalid line, so that a slot could be taken twice.
        """
        self._lock()
        try:
            self._read()
        except OSError as error:
            self._close()
            raise StudyLogError(f"{self.path} cannot be used: {error_message(error)}") from None
        except BaseException:
            self._close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def entries(self) -> list[LogEntry]:
        """Return all entries, including those just appended."""
        return list(self._entries)

    def now_text(self) -> str:
        return self._now().isoformat(timespec="milliseconds")

    def append(self, kind: EntryKind, **fields: Json) -> LogEntry:
        """Write an entry. It survives a power cut when this returns.

        :param kind: the event.
        :param fields: further details.
        :raises StudyLogError: it cannot be written; then nothing of it is in the log.
        """
        at = self.now_text()
        data = encode({"kind": kind, "at": at, **fields}) + b"\n"
        try:
            self._disk.write(self._descriptor, data, self._end)
            self._disk.sync(self._descriptor)
        except OSError as error:
            self._cut_off()
            raise StudyLogError(f"{self.path} cannot be written: {error_message(error)}") from None
        self._end += len(data)
        self._lines += 1
        entry = LogEntry(kind, at, fields, self._lines)
        self._entries.append(entry)
        return entry

    def rewrite(self, entries: Sequence[LogEntry]) -> None:
        """Replace all entries, to erase a participant's data.

        :param entries: all new entries in order; their lines are numbered again.
        :raises StudyLogError: it cannot be written; then nothing has changed.
        """
        data = b"".join(encode({"kind": each.kind, "at": each.at, **each.fields}) + b"\n" for each in entries)
        new = self.path.with_name(f"{LOG_FILE}.new")
        descriptor = -1
        try:
            new.unlink(missing_ok=True)
            descriptor = self._disk.open(new, create=True)
            _try_lock(descriptor)  # lock it before any other program can know it
            self._disk.write(descriptor, data, 0)
            self._disk.sync(descriptor)
            new.replace(self.path)
            self._disk.sync_folder(self.folder)
        except OSError as error:
            if descriptor >= 0:
                os.close(descriptor)
            raise StudyLogError(f"{self.path} cannot be written: {error_message(error)}") from None
        before, self._descriptor = self._descriptor, descriptor
        os.close(before)
        self._end = len(data)
        self._entries = _parse(data)[0]
        self._lines = len(self._entries)

    def _lock(self) -> None:
        end = time.monotonic() + WAIT_SECONDS
        while True:
            try:
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            except OSError as error:
                raise StudyLogError(f"{self.path} cannot be opened: {error_message(error)}") from None
            try:
                if _try_lock(descriptor) and os.path.samestat(os.fstat(descriptor), self.path.stat()):
                    self._descriptor = descriptor
                    return
            except FileNotFoundError:  # another program just moved it
                pass
            except OSError as error:
                os.close(descriptor)
                raise StudyLogError(f"{self.path} cannot be locked: {error_message(error)}") from None
            os.close(descriptor)
            if time.monotonic() > end:
                raise StudyLogError(f"another program has locked {self.path} for {WAIT_SECONDS:g} s; try again")
            time.sleep(TRY_SECONDS)

    def _read(self) -> None:
        size = os.fstat(self._descriptor).st_size
        data = os.pread(self._descriptor, size, 0)
        self._entries, problems, torn = _parse(data)
        if problems:
            line, problem = problems[0]
            raise StudyLogError(f"{self.path}:{line}: {problem}")
        self._end = size
        if torn:
            self._set_aside(torn)
        elif data and not data.endswith(b"\n"):
            self._disk.write(self._descriptor, b"\n", self._end)
            data += b"\n"
            self._end += 1
        self._lines = data[: self._end].count(b"\n")
        if not data:
            self._disk.sync_folder(self.folder)  # makes the name of a new log survive a power cut, too

    def _set_aside(self, torn: bytes) -> None:
        """Move an incomplete line to another file."""
        aside = os.open(
            self.path.with_name(SET_ASIDE_FILE), os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600
        )
        try:
            os.write(aside, torn + b"\n")
            self._disk.sync(aside)
        finally:
            os.close(aside)
        self._end -= len(torn)
        os.ftruncate(self._descriptor, self._end)
        self._disk.sync(self._descriptor)

    def _cut_off(self) -> None:
        """Remove the written part of an incomplete entry."""
        with suppress(OSError):  # otherwise it is a torn line, which the next program moves away
            os.ftruncate(self._descriptor, self._end)

    def _close(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def _try_lock(descriptor: int) -> bool:
    """Try to take the lock. Returns True also if the file system has no locks."""
    try:
        return take_lock(descriptor)
    except OSError as error:
        if not has_no_locks(error):
            raise
    return True
