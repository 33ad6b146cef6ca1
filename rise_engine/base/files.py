"""Files that are written whole or not at all, and locks on them.

A lock is the operating system's (flock): it goes with the process that holds it, however that ends. `Disk` is what
journals, logs and plans ask of the operating system, so that tests can let any of it fail.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

BLOCK = 1_000_000
"""Bytes that are written, or copied, at once."""
_HELD = frozenset({errno.EAGAIN, errno.EACCES})
_NO_LOCKS = frozenset({errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL, errno.EBADF})

# --- locks ----------------------------------------------------------------------------------------------------------


def take_lock(descriptor: int, *, shared: bool = False, wait: bool = False) -> bool:
    """Lock an open file or folder; False: another process has it.

    :param shared: together with others that ask for a shared lock.
    :param wait: until the other process lets go of it.
    :raises OSError: it cannot be locked, perhaps because the file system has no locks (`has_no_locks`).
    """
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
    except OSError as error:
        if error.errno not in _HELD:
            raise
        return False
    return True


def has_no_locks(error: OSError) -> bool:
    """Whether a lock failed because the file system has none."""
    return error.errno in _NO_LOCKS


def is_locked(path: Path) -> bool:
    """Whether a process has locked a file, as far as this computer can see. Does not wait."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        return not take_lock(descriptor, shared=True)
    except OSError:
        return False
    finally:
        os.close(descriptor)


def wait_until(done: Callable[[], bool], seconds: float, every: float = 0.01) -> bool:
    """Ask again and again, for as many seconds at most; whether it is done."""
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            return False
        time.sleep(every)
    return True


# --- files ----------------------------------------------------------------------------------------------------------


class Disk:
    """The real one."""

    def open(self, path: Path, *, create: bool) -> int:
        flags = os.O_RDWR | os.O_CLOEXEC | (os.O_CREAT | os.O_EXCL if create else 0)
        return os.open(path, flags, 0o600)

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        """All of `data` at `offset`."""
        view = memoryview(data)
        while view:
            written = os.pwrite(descriptor, view, offset)
            if written == 0:
                raise OSError(errno.EIO, "nothing was written")
            view, offset = view[written:], offset + written

    def sync(self, descriptor: int) -> None:
        """Returns when what was written survives a power cut, as far as the system knows."""
        if sys.platform == "darwin":
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
        else:
            os.fdatasync(descriptor)

    def close(self, descriptor: int) -> None:
        os.close(descriptor)

    def sync_folder(self, path: Path) -> None:
        """So that the names in a folder survive too."""
        sync(path)

    def write_new(self, path: Path, data: bytes | Iterable[bytes]) -> int:
        """Write a new file, durably, and return its size; one that a killed program has left there goes.

        :raises OSError: and then there is no such file.
        """
        path.unlink(missing_ok=True)
        descriptor = self.open(path, create=True)
        size, block = 0, bytearray()
        try:
            for piece in (data,) if isinstance(data, bytes) else data:
                block += piece
                if len(block) >= BLOCK:
                    self.write(descriptor, bytes(block), size)
                    size += len(block)
                    block.clear()
            self.write(descriptor, bytes(block), size)
            self.sync(descriptor)
        except OSError:
            path.unlink(missing_ok=True)  # half of it would only confuse
            raise
        finally:
            self.close(descriptor)
        return size + len(block)

    def write_whole(self, path: Path, data: bytes) -> None:
        """Replace a file, whole or not at all."""
        new = path.with_name(f"{path.name}.new")
        self.write_new(new, data)
        new.replace(path)
        self.sync_folder(path.parent)


def sync(path: Path) -> None:
    """Returns when a file, or the names in a folder, survive a power cut. Raises OSError."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def durable_file(path: Path, *, new: bool = False, mode: int = 0o666) -> Iterator[BinaryIO]:
    """A file for a `with` statement, at whose end it survives a power cut. Raises OSError.

    :param new: nothing may be there yet.
    :param mode: its permissions, as far as the umask leaves them.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | (os.O_EXCL if new else os.O_TRUNC)
    with os.fdopen(os.open(path, flags, mode), "wb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def write_private_file(path: Path, data: bytes) -> None:
    """Write a file that only its owner can read, durably, whatever the umask says. Raises OSError."""
    with durable_file(path, mode=0o600) as file:
        os.fchmod(file.fileno(), 0o600)  # one that was there keeps its mode otherwise
        file.write(data)


def write_whole(path: Path, data: bytes, *, beside: Path | None = None, private: bool = True) -> None:
    """Replace a file, whole or not at all. Raises OSError.

    :param beside: where the new file lies at first: one for each process, if several may write it at once.
    :param private: only its owner can read it; else the umask says who can.
    """
    new = beside or path.with_name(f"{path.name}.new")
    try:
        if private:
            write_private_file(new, data)
        else:
            with durable_file(new) as file:
                file.write(data)
        new.replace(path)
    except BaseException:
        with suppress(OSError):
            new.unlink()
        raise


def make_private_folder(path: Path) -> None:
    """Make a folder, and those that it lies in, for their owner alone. Raises OSError."""
    if not path.is_dir():
        make_private_folder(path.parent)
        path.mkdir(0o700, exist_ok=True)


_MESSAGES = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "your disk quota is used up",
    errno.EROFS: "the disk is read-only",
    errno.EIO: "the disk reports an error",
    errno.EACCES: "the file may not be written",
    errno.EPERM: "the file may not be written",
}


def error_message(error: OSError) -> str:
    """What went wrong, for a person."""
    return _MESSAGES.get(error.errno or 0, f"the disk does not take it ({error.strerror or error})")


def file_hash(path: Path) -> str:
    """SHA-256 of a file in hexadecimal digits. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def tree_hash(path: Path) -> str:
    """One hash of a file, or of a folder with all names, contents and places of links in it. Raises OSError."""
    if path.is_symlink():
        return hashlib.sha256(f"link to {path.readlink()}".encode()).hexdigest()
    if not path.is_dir():
        return file_hash(path)
    digest = hashlib.sha256()
    for each in sorted(path.iterdir()):
        digest.update(f"{each.name!r} {tree_hash(each)}\n".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()


_SMALL = 5_000_000
"""Bytes: of larger files that are no text, only the name is searched."""
_TEXTS = (".jsonl", ".csv", ".json", ".toml", ".txt", ".md")


def lines_with(path: Path, is_found: Callable[[str], object]) -> list[int]:
    """The lines of a file, from 1, in which something is found. A film is not searched: it is as large as no text is.

    :raises OSError: the file cannot be read.
    """
    if path.suffix not in _TEXTS and path.stat().st_size > _SMALL:
        return []
    lines = path.read_bytes().decode("utf-8", "replace").splitlines()
    return [number for number, line in enumerate(lines, 1) if is_found(line)]
