"""New files and folders that move into place when they are complete, and the leftovers of killed programs.

Until then, they are in a private folder beside their place: `.p07.csv.unfinished-x1y2`. Its writer locks this folder;
an unlocked one is a leftover, and is erased (`erase_folder`).
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from rise_engine.base.files import sync, take_lock

_CANNOT_LINK = frozenset({errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EACCES})
"""Errors of file systems without links, such as exFAT."""


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """Yield a path for a new file or folder within a `with` statement. It moves to `path` if the statement succeeds.

    After an error, it is erased. An existing file is never replaced. The result is readable by its owner only and
    survives a power cut.

    :param path: the final place; nothing may exist there.
    :return: the path to write to; nothing exists there yet.
    :raises FileExistsError: something exists at `path`, or appeared there meanwhile.
    :raises OSError: it cannot be made.

    >>> folder = Path(tempfile.mkdtemp())
    >>> with unfinished(folder / "new.txt") as here:
    ...     _ = here.write_text("whole")
    ...     [each.name for each in folder.iterdir() if not each.name.startswith(".")]
    []
    >>> [(each.name, each.read_text()) for each in folder.iterdir()]
    [('new.txt', 'whole')]
    """
    if os.path.lexists(path):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    with private_folder(path) as work:
        here = work / path.name
        yield here
        _secure(here)
        move_new(here, path)
        sync(path.parent)


@contextmanager
def private_folder(path: Path) -> Iterator[Path]:
    """Make a private folder beside `path` for a `with` statement, and erase it with its contents at the end.

    Leftovers of killed programs for this path are erased first. Raises OSError.
    """
    erase_unfinished(path)
    work, lock = _locked_folder(path)
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)
        os.close(lock)


def _locked_folder(path: Path) -> tuple[Path, int]:
    """Make and lock a folder. Returns the lock's descriptor, too. Tries again if another program erased it."""
    while True:
        work = Path(tempfile.mkdtemp(prefix=_prefix(path), dir=path.parent))
        try:
            lock = os.open(work, os.O_RDONLY | os.O_CLOEXEC)
        except FileNotFoundError:
            continue
        with suppress(OSError):  # without locks, leftovers of a kill are not erased
            take_lock(lock, wait=True)
        if work.exists():
            return work, lock
        os.close(lock)


def erase_unfinished(path: Path) -> list[Path]:
    """Erase the leftovers of killed programs that were writing to `path`.

    :param path: the final place.
    :return: the folders in which a program is still writing.
    """
    return _erase_unlocked(find_leftovers(path), partial(shutil.rmtree, ignore_errors=True))


def find_leftovers(path: Path) -> list[Path]:
    """Return the private folders of programs that were writing to `path`, sorted. Some may still write.

    :param path: the final place.
    """
    try:
        return sorted(Path(each.path) for each in os.scandir(path.parent) if each.name.startswith(_prefix(path)))
    except OSError:  # the next attempt to write here reports the error
        return []


def erase_all_unfinished(root: Path, erase: Callable[[Path], object]) -> list[Path]:
    """Erase as `erase_unfinished` does, everywhere below a folder, by `erase`. Raises OSError if that does."""
    found: list[Path] = []
    for where, folders, _ in os.walk(root):
        found += [Path(where, name) for name in folders if _IS_UNFINISHED.fullmatch(name)]
        folders[:] = [name for name in folders if not _IS_UNFINISHED.fullmatch(name)]
    return _erase_unlocked(found, erase)


def _erase_unlocked(folders: Iterable[Path], erase: Callable[[Path], object]) -> list[Path]:
    busy: list[Path] = []
    for work in folders:
        try:
            lock = os.open(work, os.O_RDONLY | os.O_CLOEXEC | os.O_DIRECTORY | os.O_NOFOLLOW)
        except OSError:
            continue
        try:
            if not _is_free(lock):
                busy.append(work)
            else:
                erase(work)
        finally:
            os.close(lock)
    return busy


def _is_free(lock: int) -> bool:
    try:
        return take_lock(lock)
    except OSError:
        return False


_IS_UNFINISHED = re.compile(r"\..+\.unfinished-[a-z0-9_]{8}")
"""The names that `_locked_folder` gives."""


def _prefix(path: Path) -> str:
    return f".{path.name}.unfinished-"


def _secure(made: Path) -> None:
    """Make everything private to its owner and sync it to the disk."""
    if not made.is_dir():
        made.chmod(0o600)
        sync(made)
        return
    for folder, folders, files in os.walk(made):
        for name in files:
            if not (Path(folder) / name).is_symlink():
                (Path(folder) / name).chmod(0o600)
                sync(Path(folder) / name)
        for name in folders:
            (Path(folder) / name).chmod(0o700)
    made.chmod(0o700)


def move_new(here: Path, path: Path) -> None:
    """Move a file or folder to an empty place. Unlike a rename, a link never replaces an existing file.

    :raises FileExistsError: the place is not empty.
    :raises OSError: it cannot be moved.
    """
    if not here.is_dir():
        try:
            os.link(here, path)
        except OSError as error:
            if error.errno not in _CANNOT_LINK:
                raise
        else:
            here.unlink()
            return
    if os.path.lexists(path):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    here.rename(path)


def has_other_names(path: Path) -> bool:
    """Whether the file has further names (hard links), perhaps a backup's, under which it stays available."""
    return path.lstat().st_nlink > 1


def erase_folder(folder: Path) -> int:
    """Delete a folder with all files below it, and return the number of files. Links are not followed.

    Missing files are skipped, so that an interrupted call can be repeated. Raises OSError.
    """
    if folder.is_symlink():
        folder.unlink()
        return 0
    count = 0
    for where, folders, files in os.walk(folder, topdown=False):
        for name in files:
            Path(where, name).unlink(missing_ok=True)
            count += 1
        for name in folders:
            path = Path(where, name)
            if path.is_symlink():
                path.unlink()
            else:
                path.rmdir()
    if folder.exists():
        folder.rmdir()
    return count
