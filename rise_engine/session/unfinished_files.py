"""Something new that is put in its place only when it is whole, and what a killed program has left of it.

Until then it lies beside its place, in a folder for its owner alone: `.p07.csv.unfinished-x1y2`. Whoever writes it has
that folder locked, so that nobody takes for a leftover what is being written. Leftovers are erased (`erase_folder`).
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rise_engine.base.files import sync, take_lock

_CANNOT_LINK = frozenset({errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK})


@contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """A path for whoever makes a new file or folder, within a `with` statement; what is made there is put at `path`
    when the statement ends without an error, and erased when it ends with one.

    What is there already is never replaced. Everything is for its owner alone, and survives a power cut.

    :param path: where it is to be; nothing is there yet.
    :return: the path at which it is to be made; nothing is there, either.
    :raises FileExistsError: something is there, or was put there meanwhile.
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
        _put(here, path)
        sync(path.parent)


@contextmanager
def private_folder(path: Path) -> Iterator[Path]:
    """A folder for its owner alone beside `path`, within a `with` statement; it goes with all that is in it.

    What killed programs have left of such a folder for this path goes first. Raises OSError.
    """
    erase_unfinished(path)
    work, lock = _locked_folder(path)
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)
        os.close(lock)


def _locked_folder(path: Path) -> tuple[Path, int]:
    """A new folder, and the descriptor that has it locked. One that somebody took for a leftover is made again."""
    while True:
        work = Path(tempfile.mkdtemp(prefix=_prefix(path), dir=path.parent))
        try:
            lock = os.open(work, os.O_RDONLY | os.O_CLOEXEC)
        except FileNotFoundError:
            continue
        with suppress(OSError):  # where nothing can be locked, nothing is cleared up after a kill, either
            take_lock(lock, wait=True)
        if work.exists():
            return work, lock
        os.close(lock)


def erase_unfinished(path: Path, erase: Callable[[Path], object] | None = None) -> list[Path]:
    """Erase what killed programs have left of something that was to be at `path`.

    :param path: where it was to be.
    :param erase: what erases a folder; None: it is deleted.
    :return: what is being written just now, and was left.
    """
    try:
        beside = [Path(each.path) for each in os.scandir(path.parent) if each.name.startswith(_prefix(path))]
    except OSError:  # who makes something there is told so
        return []
    return _erase_unlocked(beside, erase)


def erase_all_unfinished(root: Path, erase: Callable[[Path], object] | None = None) -> list[Path]:
    """As `erase_unfinished`, for whatever was to be anywhere below a folder. Raises OSError, if `erase` does."""
    found: list[Path] = []
    for where, folders, _ in os.walk(root):
        found += [Path(where, name) for name in folders if _IS_UNFINISHED.fullmatch(name)]
        folders[:] = [name for name in folders if not _IS_UNFINISHED.fullmatch(name)]
    return _erase_unlocked(found, erase)


def _erase_unlocked(folders: Iterable[Path], erase: Callable[[Path], object] | None) -> list[Path]:
    busy: list[Path] = []
    for work in folders:
        try:
            lock = os.open(work, os.O_RDONLY | os.O_CLOEXEC | os.O_DIRECTORY | os.O_NOFOLLOW)
        except OSError:
            continue
        try:
            if not _is_free(lock):
                busy.append(work)
            elif erase is not None:
                erase(work)
            else:
                shutil.rmtree(work, ignore_errors=True)
        finally:
            os.close(lock)
    return busy


def _is_free(lock: int) -> bool:
    try:
        return take_lock(lock)
    except OSError:
        return False


_IS_UNFINISHED = re.compile(r"\..+\.unfinished-[a-z0-9_]{8}")
"""As `_locked_folder` names them."""


def _prefix(path: Path) -> str:
    return f".{path.name}.unfinished-"


def _secure(made: Path) -> None:
    """For its owner alone, and on the disk."""
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


def _put(here: Path, path: Path) -> None:
    """Unlike a renaming, a link never puts itself in the place of another file."""
    if here.is_dir():
        if os.path.lexists(path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
        here.rename(path)
        return
    try:
        os.link(here, path)
    except OSError as error:
        if error.errno not in _CANNOT_LINK:
            raise
        if os.path.lexists(path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
        here.rename(path)


def has_other_names(path: Path) -> bool:
    """Whether the file has further names (hard links): then it stays under those, because they may be a backup's."""
    return path.lstat().st_nlink > 1


def erase_folder(folder: Path) -> int:
    """Remove every file in a folder and below, then the folder; how many files there were. Links are not followed.

    What is gone already is passed over, so that one that was interrupted can be called again. Raises OSError.
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
