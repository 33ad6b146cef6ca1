"""`media.json` in a session's folder: the recordings that belong to it, and where they lie against its clock.

media time = offset + rate * session time          (both in seconds)
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar

import msgspec
from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.base.files import error_message, sync, take_lock, wait_until, write_whole
from rise_engine.ports.recorder import MediaKind

WAIT_SECONDS = 10.0
"""How long somebody waits for another program that writes it just now. That takes milliseconds."""
_Item = TypeVar("_Item")


def read_list(path: Path, item: type[_Item]) -> tuple[_Item, ...]:
    """What stands in a list, in its order; nothing when there is no such file.

    :param path: the file.
    :param item: what it holds.
    :raises SessionError: it cannot be read.
    """
    try:
        return tuple(msgspec.json.decode(path.read_bytes(), type=list[item]))  # type: ignore[valid-type]
    except FileNotFoundError:
        return ()
    except OSError as problem:
        raise SessionError(f"{path} cannot be read: {problem.strerror or problem}") from None
    except (msgspec.DecodeError, UnicodeError) as problem:
        raise SessionError(f"{path} is not what was written there: {problem}. Correct it, or move it away") from None


def list_bytes(items: Sequence[object]) -> bytes:
    """A list as it stands in its file."""
    return msgspec.json.format(msgspec.json.encode(items), indent=1) + b"\n"


def change_list(path: Path, item: type[_Item], change: Callable[[list[_Item]], list[_Item]]) -> None:
    """Replace a list by what `change` makes of it, in one step.

    :param path: the file.
    :param item: what it holds.
    :param change: gets what stands there.
    :raises SessionError: it cannot be read or written; then nothing is changed.
    """
    try:
        with _locked(path):
            data = list_bytes(change(list(read_list(path, item))))
            write_whole(path, data)
            sync(path.parent)
    except UnicodeError:
        raise SessionError("a path or name is not a text that can be written: give that file another name") from None
    except OSError as problem:
        raise SessionError(f"{path} cannot be written: {error_message(problem)}") from None


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Nobody else changes the list meanwhile. The lock is the folder's own, so that no file is left of it."""
    descriptor = os.open(path.parent, os.O_RDONLY | os.O_CLOEXEC)
    try:
        with suppress(OSError):  # a file system without locks: then the last one who writes wins
            if not wait_until(lambda: take_lock(descriptor), WAIT_SECONDS):
                raise SessionError(f"{path} is held by another program: try again")
        yield
    finally:
        os.close(descriptor)


MEDIA_FILE = "media.json"
AlignedBy: TypeAlias = Literal["", "marks", "given", "start"]
"""How a file was laid against the session's clock. marks: by marks that were found in it; given: somebody said it;
start: by when its recorder was started, which is no time of the first frame; empty: not at all."""


class FoundMark(Struct, frozen=True):
    """A mark of the session (`SyncRecord`) that was found in a file, or a moment that somebody has given."""

    number: int
    """0: a moment that somebody has given, and that is no mark."""
    session_at: float
    media_at: float
    strength: float
    """How far it stands above all else in the file, as a ratio; below 3 it is not believed. 0: it was given."""


class MediaFile(Struct, frozen=True, kw_only=True):
    """One file, or one folder of a bag."""

    path: str
    """Absolute, or relative to the session's folder when it lies in there."""
    kind: MediaKind
    name: str = ""
    """Of the recorder that made it; empty: somebody added it."""
    bytes: int | None = None
    sha256: str = ""
    duration: float | None = None
    """Seconds."""
    offset: float | None = None
    """Media time at session time 0: negative when it began after the session. None: not known."""
    rate: float = 1.0
    """Seconds of the file for one second of the session."""
    aligned_by: AlignedBy = ""
    marks: tuple[FoundMark, ...] = ()
    added: str = ""
    """ISO 8601 with offset."""
    fps: float | None = None
    """Frames per second; None: not known, or no video."""
    within: float | None = None
    """Seconds by which all this is wrong at most between the marks, as far as the marks' own times are known; None: not
    known."""

    @property
    def drift_ppm(self) -> float:
        """How much faster its clock runs, in millionths."""
        return (self.rate - 1.0) * 1e6

    @property
    def drift_within_ppm(self) -> float | None:
        """Millionths by which that is wrong at most; None: not known, or it was not measured."""
        if len(self.marks) < 2 or self.within is None:
            return None
        return 2e6 * self.within / abs(self.marks[-1].session_at - self.marks[0].session_at)

    @property
    def has_drift(self) -> bool:
        """Whether it was measured, and is more than the marks of a short session can be wrong by."""
        within = self.drift_within_ppm
        return len(self.marks) > 1 and (within is None or abs(self.drift_ppm) > within)


def read_media(folder: Path) -> tuple[MediaFile, ...]:
    """What stands in a session's media.json, in its order; nothing when there is none.

    :param folder: the session's.
    :raises SessionError: it cannot be read.
    """
    return read_list(folder / MEDIA_FILE, MediaFile)


def register_media(folder: Path, file: MediaFile) -> MediaFile | None:
    """Put a file into a session's media.json, in the place of what stands there about the same file.

    :param folder: the session's.
    :param file: a path within that folder is made relative to it.
    :return: what stood there before.
    :raises SessionError: it cannot be read or written; then nothing is changed.
    """
    file = msgspec.structs.replace(file, path=stored_path(folder, file.path))
    before: list[MediaFile] = []

    def put(files: list[MediaFile]) -> list[MediaFile]:
        before.extend(each for each in files if each.path == file.path)
        if not before:
            return [*files, file]
        return [file if each is before[0] else each for each in files if each not in before[1:]]

    change_list(folder / MEDIA_FILE, MediaFile, put)
    return before[0] if before else None


def remove_media(folder: Path, named: str) -> MediaFile:
    """Take a file out of a session's media.json; the file itself stays where it is.

    :param folder: the session's.
    :param named: its path, also as it stands there, or its name, if no other file has that.
    :return: what stood there.
    :raises SessionError: there is none of that name, or several; or it cannot be written. Then nothing is changed.
    """
    removed: list[MediaFile] = []

    def take_out(files: list[MediaFile]) -> list[MediaFile]:
        removed.append(find_media(folder, files, named))
        return [each for each in files if each is not removed[0]]

    change_list(folder / MEDIA_FILE, MediaFile, take_out)
    return removed[0]


def find_media(folder: Path, files: list[MediaFile], named: str) -> MediaFile:
    """The file that somebody means, by its path, the end of it, or its recorder. Raises SessionError."""
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
    """Where a file of a session lies, absolute."""
    return (folder / file.path).absolute()


def stored_path(folder: Path, path: str) -> str:
    """A path as media.json has it: relative for what lies in the session's folder, else absolute."""
    absolute = Path(os.path.normpath(Path(os.path.expanduser(path)).absolute()))  # noqa: PTH111  # no RuntimeError
    root = Path(os.path.normpath(folder.absolute()))
    if Path(path).is_absolute() or absolute.exists() or not (root / path).exists():
        return str(absolute.relative_to(root)) if absolute.is_relative_to(root) else str(absolute)
    return path
