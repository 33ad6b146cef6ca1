"""Files that are written completely or not at all, and locks on them.

Locks are those of the operating system (flock): they end with their process, however it ends. Journals, logs and plans
reach the disk through `Disk`, so that tests can make any operation fail.
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
"""Bytes that are written or copied at once."""
_LOCKED_ERRORS = frozenset({errno.EAGAIN, errno.EACCES})
_NO_LOCKS = frozenset({errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL, errno.EBADF})

# --- locks ----------------------------------------------------------------------------------------------------------


def take_lock(descriptor: int, *, shared: bool = False, wait: bool = False) -> bool:
    """Lock an open file or folder. Returns False if another process has locked it.

    :param shared: share the lock with other shared locks.
    :param wait: wait until the other process releases it.
    :raises OSError: it cannot be locked, perhaps because the file system has no locks (`has_no_locks`).
    """
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
    except OSError as error:
        if error.errno not in _LOCKED_ERRORS:
            raise
        return False
    return True


def has_no_locks(error: OSError) -> bool:
    """Whether a lock failed because the file system does not support locks."""
    return error.errno in _NO_LOCKS


def is_locked(path: Path) -> bool:
    """Whether a process has locked a file, as far as this computer knows. Does not wait."""
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
    """Call `done` repeatedly until it is true, for at most this many seconds. Returns whether it became true."""
    end = time.monotonic() + seconds
    while not done():
        if time.monotonic() > end:
            return False
        time.sleep(every)
    return True


# --- files ----------------------------------------------------------------------------------------------------------


class Disk:
    """The real disk."""

    def open(self, path: Path, *, create: bool) -> int:
        flags = os.O_RDWR | os.O_CLOEXEC | (os.O_CREAT | os.O_EXCL if create else 0)
        return os.open(path, flags, 0o600)

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        """Write all of `data` at `offset`."""
        view = memoryview(data)
        while view:
            written = os.pwrite(descriptor, view, offset)
            if written == 0:
                raise OSError(errno.EIO, "nothing was written")
            view, offset = view[written:], offset + written

    def sync(self, descriptor: int) -> None:
        """Return when the written data survives a power cut, as far as the system knows."""
        if sys.platform == "darwin":
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)
        else:
            os.fdatasync(descriptor)

    def close(self, descriptor: int) -> None:
        os.close(descriptor)

    def sync_folder(self, path: Path) -> None:
        """Make the names in a folder survive a power cut, too."""
        sync(path)

    def write_new(self, path: Path, data: bytes | Iterable[bytes]) -> int:
        """Write a new file durably and return its size in bytes. Replaces a file of a killed program.

        :raises OSError: it was not written. No file remains.
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
            path.unlink(missing_ok=True)  # half a file would only confuse
            raise
        finally:
            self.close(descriptor)
        return size + len(block)

    def write_whole(self, path: Path, data: bytes) -> None:
        """Replace a file atomically."""
        new = path.with_name(f"{path.name}.new")
        self.write_new(new, data)
        new.replace(path)
        self.sync_folder(path.parent)


def sync(path: Path) -> None:
    """Return when a file, or the names in a folder, survive a power cut. Raises OSError."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def durable_file(path: Path, *, new: bool = False, mode: int = 0o666) -> Iterator[BinaryIO]:
    """A file for a `with` statement that survives a power cut once the statement ends. Raises OSError.

    :param new: the file must not exist yet.
    :param mode: its permissions, before the umask.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | (os.O_EXCL if new else os.O_TRUNC)
    with os.fdopen(os.open(path, flags, mode), "wb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def write_private_file(path: Path, data: bytes) -> None:
    """Write a file durably that only its owner can read, whatever the umask. Raises OSError."""
    with durable_file(path, mode=0o600) as file:
        os.fchmod(file.fileno(), 0o600)  # an existing file would keep its mode
        file.write(data)


def write_whole(path: Path, data: bytes, *, beside: Path | None = None, private: bool = True) -> None:
    """Replace a file atomically. Raises OSError.

    :param beside: the path at which the new file is written first. It must differ between concurrent processes.
    :param private: whether only its owner can read it; otherwise the umask applies.
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
    """Make a folder, and its parent folders, for their owner alone. Raises OSError."""
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
    """Describe an error in words."""
    return _MESSAGES.get(error.errno or 0, f"the disk does not take it ({error.strerror or error})")


def file_hash(path: Path) -> str:
    """SHA-256 of a file in hexadecimal digits. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


_END_BYTES = 1 << 20


def fingerprint(path: Path) -> str:
    """One hash of the size, first and last MiB of a file, or of all files in a folder. Raises OSError.

    It identifies a long film immediately, which `tree_hash` would read for minutes.
    """
    return tree_hash(path, _hash_ends)


def _hash_ends(path: Path) -> str:
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        digest = hashlib.sha256(f"{size} bytes\n".encode())
        digest.update(file.read(_END_BYTES))
        file.seek(max(0, size - _END_BYTES))
        digest.update(file.read(_END_BYTES))
    return digest.hexdigest()


def tree_hash(path: Path, hash_file: Callable[[Path], str] = file_hash) -> str:
    """One hash of a file, or of a folder with the names, contents and link targets in it. Raises OSError."""
    if path.is_symlink():
        return hashlib.sha256(f"link to {path.readlink()}".encode()).hexdigest()
    if not path.is_dir():
        return hash_file(path)
    digest = hashlib.sha256()
    for each in sorted(path.iterdir()):
        digest.update(f"{each.name!r} {tree_hash(each, hash_file)}\n".encode("utf-8", "surrogateescape"))
    return digest.hexdigest()


_SMALL = 5_000_000
"""Maximum bytes of files without text (films) in which `lines_with` searches."""
_TEXTS = (".jsonl", ".csv", ".json", ".toml", ".txt", ".md")


def lines_with(path: Path, is_found: Callable[[str], object]) -> list[int]:
    """The numbers, from 1, of the lines with a match. Large files that are not text are not searched.

    :raises OSError: the file cannot be read.
    """
    if path.suffix not in _TEXTS and path.stat().st_size > _SMALL:
        return []
    lines = path.read_bytes().decode("utf-8", "replace").splitlines()
    return [number for number, line in enumerate(lines, 1) if is_found(line)]
