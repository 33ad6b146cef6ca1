"""`media.json` in a session's folder: its recordings, with the relation of their time to the session's.

media time = offset + rate * session time          (both in seconds)
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar

import msgspec
from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.base.files import error_message, sync, write_whole
from rise_engine.ports.recorder import MediaKind
from rise_engine.session.lock import one_at_a_time

WAIT_SECONDS = 10.0
"""Maximum wait in seconds for another program that writes the list, which takes milliseconds."""
_Item = TypeVar("_Item")


def read_list(path: Path, item: type[_Item]) -> tuple[_Item, ...]:
    """Read a list in its order; empty: there is no such file.

    :param path: the file.
    :param item: the type of its items.
    :raises SessionError: it cannot be read.
    """
    try:
        return tuple(msgspec.json.decode(path.read_bytes(), type=list[item]))  # type: ignore[valid-type]
    except FileNotFoundError:
        return ()
    except OSError as problem:
        raise SessionError(f"{path} cannot be read: {problem.strerror or problem}") from None
    except (msgspec.DecodeError, UnicodeError) as problem:
        raise SessionError(f"{path} has an error: {problem}. Correct it, or move it away") from None


def list_bytes(items: Sequence[object]) -> bytes:
    """Encode a list as in its file."""
    return msgspec.json.format(msgspec.json.encode(items), indent=1) + b"\n"


def change_list(path: Path, item: type[_Item], change: Callable[[list[_Item]], list[_Item]]) -> list[_Item]:
    """Replace a list by the result of `change`, in one step. Returns the removed items.

    :param path: the file.
    :param item: the type of its items.
    :param change: gets the current list.
    :raises SessionError: it cannot be read or written, and is unchanged.
    """
    busy = f"{path} is held by another program: try again"
    try:
        with one_at_a_time(path.parent, busy, WAIT_SECONDS):  # locks the folder, so that no lock file is left behind
            before = list(read_list(path, item))
            after = change(before)
            write_whole(path, list_bytes(after))
            sync(path.parent)
            return [each for each in before if not any(each is other for other in after)]
    except UnicodeError:
        raise SessionError("a path or name is not a text that can be written: give that file another name") from None
    except OSError as problem:
        raise SessionError(f"{path} cannot be written: {error_message(problem)}") from None


def with_item(items: list[_Item], new: _Item, key: str) -> list[_Item]:
    """Return a list with a new item, in the place of the first one with an equal attribute, or at the end.

    :param key: the attribute's name.
    """
    same = [each for each in items if getattr(each, key) == getattr(new, key)]
    if not same:
        return [*items, new]
    return [new if each is same[0] else each for each in items if not any(each is other for other in same[1:])]


MEDIA_FILE = "media.json"
AlignedBy: TypeAlias = Literal["", "marks", "given", "start"]
"""How a file was aligned. marks: by marks in it; given: by a person; start: by the start of its recorder, which is not
the time of the first frame; empty: not at all."""


class FoundMark(Struct, frozen=True):
    """A mark of the session (`SyncRecord`) in a file, or a moment given by a person."""

    number: int
    """The mark's number; 0: a given moment."""
    session_at: float
    media_at: float
    strength: float
    """Its ratio to all else in the file. Below 3, it is not trusted. 0: a given moment."""


class MediaFile(Struct, frozen=True, kw_only=True):
    """One file, or the folder of one bag."""

    path: str
    """Relative to the session's folder if it is inside, otherwise absolute."""
    kind: MediaKind
    name: str = ""
    """Its recorder; empty: a person added it."""
    bytes: int | None = None
    sha256: str = ""
    fingerprint: str = ""
    """From `rise_engine.base.files.fingerprint`, taken when its recorder ended or the file was added."""
    duration: float | None = None
    """Seconds."""
    offset: float | None = None
    """Media time at session time 0; negative if the recording began after the session; None: unknown."""
    rate: float = 1.0
    """Seconds of the file per second of the session."""
    aligned_by: AlignedBy = ""
    marks: tuple[FoundMark, ...] = ()
    added: str = ""
    """ISO 8601 with offset."""
    fps: float | None = None
    """Frames per second; None: unknown, or no video."""
    within: float | None = None
    """Maximum error in seconds between the marks, as far as their times are known; None: unknown."""

    @property
    def drift_ppm(self) -> float:
        """The relative speed of the file's clock, in parts per million."""
        return (self.rate - 1.0) * 1e6

    @property
    def drift_within_ppm(self) -> float | None:
        """The maximum error of the drift in parts per million; None: unknown, or the drift was not measured."""
        if len(self.marks) < 2 or self.within is None:
            return None
        return 2e6 * self.within / abs(self.marks[-1].session_at - self.marks[0].session_at)

    @property
    def has_drift(self) -> bool:
        """Whether a drift was measured that exceeds its possible error in a short session."""
        within = self.drift_within_ppm
        return len(self.marks) > 1 and (within is None or abs(self.drift_ppm) > within)


def read_media(folder: Path) -> tuple[MediaFile, ...]:
    """Read a session's media.json in its order; empty: there is none.

    :param folder: the session's folder.
    :raises SessionError: it cannot be read.
    """
    return read_list(folder / MEDIA_FILE, MediaFile)


def register_media(folder: Path, file: MediaFile) -> MediaFile | None:
    """Add a file to a session's media.json. It replaces an entry on the same file.

    :param folder: the session's folder.
    :param file: the entry; a path within the folder is made relative to it.
    :return: the replaced entry.
    :raises SessionError: the list cannot be read or written, and is unchanged.
    """
    file = msgspec.structs.replace(file, path=stored_path(folder, file.path))
    replaced = change_list(folder / MEDIA_FILE, MediaFile, lambda files: with_item(files, file, "path"))
    return replaced[0] if replaced else None


def remove_media(folder: Path, named: str) -> MediaFile:
    """Remove a file from a session's media.json. The file itself stays.

    :param folder: the session's folder.
    :param named: its path, also as in the list, or its name if no other file has that name.
    :return: the removed entry.
    :raises SessionError: no file or several files match, or the list cannot be written. It is unchanged.
    """

    def take_out(files: list[MediaFile]) -> list[MediaFile]:
        found = find_media(folder, files, named)
        return [each for each in files if each is not found]

    return change_list(folder / MEDIA_FILE, MediaFile, take_out)[0]


def find_media(folder: Path, files: list[MediaFile], named: str) -> MediaFile:
    """Find a file by its path, its file name or its recorder. Raises SessionError."""
    path = stored_path(folder, named)
    exact = [each for each in files if each.path in (named, path)]
    found = exact or [each for each in files if named in (Path(each.path).name, each.name)]
    if len(found) == 1:
        return found[0]
    listed = ", ".join(each.path for each in found or files) or "none"
    if found:
        raise SessionError(f"{named} can be any of {listed}: say which by its path")
    raise SessionError(f"{MEDIA_FILE} of {folder.name} has no file {named}; it has {listed}")


def media_path(folder: Path, file: MediaFile) -> Path:
    """Return the absolute path of a session's file."""
    return (folder / file.path).absolute()


def stored_path(folder: Path, path: str) -> str:
    """Return a path as in media.json: relative if it is in the session's folder, otherwise absolute."""
    absolute = Path(os.path.normpath(Path(os.path.expanduser(path)).absolute()))  # noqa: PTH111  # no RuntimeError
    root = Path(os.path.normpath(folder.absolute()))
    if Path(path).is_absolute() or absolute.exists() or not (root / path).exists():
        return str(absolute.relative_to(root)) if absolute.is_relative_to(root) else str(absolute)
    return path
