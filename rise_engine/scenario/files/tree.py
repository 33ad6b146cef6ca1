"""The content of a scenario's folder: on the disk, in memory instead, or from a save that was killed.

A save writes all new contents beside the files, then a note that lists them, and then renames
(`rise_engine.author.edit.study_folder`). Once the note exists, the new contents count, and all readers follow the note.
The note contains names and checksums but no places, so it is also valid in a copy of the folder.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path

import msgspec
from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.scenario.files.study_paths import why_not_read, why_not_written

Held = Mapping[str, bytes | None]
"""Contents by file name relative to a scenario's folder, such as `acts/greet.xml`; None: the file does not exist."""


class UnreadableError(RiseError):
    """A file cannot be read. `code`: the code of the diagnostic."""

    def __init__(self, message: str, code: str = "unreadable") -> None:
        super().__init__(message)
        self.code = code


class FileTree:
    """The files of a scenario. For a held file, the disk is not used.

    >>> tree = FileTree(Path("scenarios/greeting"), {"acts/new.xml": b"<Dialogs/>", "rules/gaze.xml": None})
    >>> tree.read(tree.folder / "acts/new.xml", 100), tree.exists(tree.folder / "rules/gaze.xml")
    (b'<Dialogs/>', False)
    """

    def __init__(self, folder: Path, held: Held | None = None, *, closed: bool = False) -> None:
        """
        :param folder: the scenario's folder. It may be missing on the disk if contents are held in it.
        :param held: contents that replace those on the disk.
        :param closed: for a study: no link in its folder may lead outside.
        """
        self.folder = folder
        self._closed = closed
        self._held = {os.path.normpath(folder / name): data for name, data in (held or {}).items()}
        self._held_folders: dict[str, dict[str, None]] = {}
        """The entries of folders that exist only because of held contents: names of files and folders."""
        top = os.path.normpath(folder)
        for path, data in self._held.items():
            while data is not None and path != top and os.path.dirname(path) != path:  # noqa: PTH120  # texts, often
                path, name = os.path.split(path)
                self._held_folders.setdefault(path, {})[name] = None

    def exists(self, path: Path) -> bool:
        """Whether the path exists, even as a broken link. Raises OSError, and ValueError for an impossible name."""
        if (known := os.path.normpath(path)) in self._held:
            return self._held[known] is not None
        return known in self._held_folders or os.path.lexists(path)

    def is_file(self, path: Path) -> bool:
        """Whether it is a file, or a link to one."""
        if (known := os.path.normpath(path)) in self._held:
            return self._held[known] is not None
        return known not in self._held_folders and path.is_file()

    def is_folder(self, path: Path) -> bool:
        """Whether it is a folder, or a link to one."""
        known = os.path.normpath(path)
        return known in self._held_folders or (known not in self._held and path.is_dir())

    def names(self, path: Path) -> list[str]:
        """The entries of a folder, sorted. Raises OSError."""
        known = os.path.normpath(path)
        held = self._held_folders.get(known, {})
        try:
            names = {each.name: None for each in path.iterdir()}
        except (FileNotFoundError, NotADirectoryError):
            if not held:
                raise
            names = {}
        there = (name for name in names if self._held.get(os.path.join(known, name), b"") is not None)  # noqa: PTH118
        return sorted({*there, *held})

    def read(self, path: Path, most: int) -> bytes:
        """The content of a file of at most `most` bytes. Raises UnreadableError."""
        known = os.path.normpath(path)
        if known in self._held_folders:
            raise UnreadableError("this is a folder; a file is needed here")
        if known in self._held:
            data = self._held[known]
            if data is None:
                raise UnreadableError(f"this file cannot be read: {os.strerror(errno.ENOENT)}")
            size = len(data)
        else:
            is_of_study = self._closed and path.is_relative_to(self.folder)
            if is_of_study and (problem := why_not_read(self.folder, path.relative_to(self.folder))):
                raise UnreadableError(problem, "outside-study")
            data, size = _read_from_disk(path, most)
        if size > most:
            raise UnreadableError(f"this file is larger than {most // 1_000_000} MB", "too-large")
        return data


def _read_from_disk(path: Path, most: int) -> tuple[bytes, int]:
    """Read a file. Returns its content (empty if it is too large) and its size. Raises UnreadableError."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):  # reading a pipe might never end
            kind = "a folder" if stat.S_ISDIR(status.st_mode) else "no regular file"
            raise UnreadableError(f"this is {kind}; a file is needed here")
        return (path.read_bytes() if status.st_size <= most else b""), status.st_size
    except OSError as error:
        reason = f"this file cannot be read: {error.strerror or error}"
        if isinstance(error, FileNotFoundError) and path.is_symlink():
            reason = f"this link leads nowhere: there is no `{os.readlink(path)}`"  # noqa: PTH115  # as written
        raise UnreadableError(reason) from None


# --- an interrupted save ----------------------------------------------------------------------------------------------


NOTE = ".rise-save.json"
NEW_SUFFIX = ".rise-new"
"""The suffix of a new file that is not in its place yet."""


class SavedFile(Struct, frozen=True):
    """One file of a save."""

    name: str
    """Relative to the study's folder."""
    before: str | None
    """SHA-256 of the old content; None: no file."""
    after: str | None
    """SHA-256 of the new content; None: the file is deleted."""


def sum_of(data: bytes | None) -> str | None:
    """The SHA-256 of a content; None for no file."""
    return None if data is None else sha256(data).hexdigest()


def sum_on_disk(path: Path) -> str | None:
    """The SHA-256 of a file; None: there is none. Raises OSError."""
    try:
        return sum_of(path.read_bytes())
    except FileNotFoundError:
        return None


def fresh_path(target: Path) -> Path:
    """The path of new content before it is renamed."""
    return target.with_name(f".{target.name}{NEW_SUFFIX}")


def read_note(folder: Path) -> tuple[SavedFile, ...] | None:
    """The note of an interrupted save; None: there is none. Raises OSError and msgspec.DecodeError."""
    path = folder / NOTE
    if not os.path.lexists(path):
        return None
    note = msgspec.json.decode(path.read_bytes(), type=tuple[SavedFile, ...])
    for file in note:
        if problem := why_not_written(folder, file.name, goes=file.after is None):
            raise msgspec.ValidationError(problem)
    return note


def pending_contents(folder: Path, note: tuple[SavedFile, ...]) -> dict[str, bytes | None]:
    """The contents of a save that are not in their place yet, by name; None for a file to be deleted.

    Omits files that have changed since the save was killed. Raises OSError.
    """
    remaining: dict[str, bytes | None] = {}
    for file in note:
        if file.after == file.before or sum_on_disk(folder / file.name) != file.before:
            continue
        if file.after is None:
            remaining[file.name] = None
            continue
        fresh = fresh_path(Path(os.path.realpath(folder / file.name)))
        if os.path.lexists(fresh) and sum_of(data := fresh.read_bytes()) == file.after:
            remaining[file.name] = data
    return remaining


def contents_of_interrupted_save(folder: Path) -> dict[str, bytes | None]:
    """The contents of an interrupted save that replace the files on the disk."""
    try:
        note = read_note(folder)
        return pending_contents(folder, note) if note else {}
    except (OSError, msgspec.DecodeError, ValueError):  # without a readable note, the files count
        return {}
