"""The few things that a journal asks of the operating system, in one place, so that tests can let any of them fail."""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

BLOCK = 1_000_000
"""Bytes that are written, or copied, at once."""


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
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def write_new_file(path: Path, data: Iterable[bytes], disk: Disk) -> int:
    """Write a new file, durably; its size.

    Raises OSError, and then there is no such file.
    """
    descriptor = disk.open(path, create=True)
    size, block = 0, bytearray()
    try:
        for piece in data:
            block += piece
            if len(block) >= BLOCK:
                disk.write(descriptor, bytes(block), size)
                size += len(block)
                block.clear()
        disk.write(descriptor, bytes(block), size)
        disk.sync(descriptor)
    except OSError:
        path.unlink(missing_ok=True)  # half of what was to be kept would only confuse
        raise
    finally:
        disk.close(descriptor)
    return size + len(block)


def replace_file(path: Path, data: bytes, disk: Disk) -> None:
    """Put a file in the place of the one that is there, durably: whole or not at all. Raises OSError."""
    new = path.with_name(f"{path.name}.new")
    new.unlink(missing_ok=True)
    write_new_file(new, [data], disk)
    new.replace(path)
    disk.sync_folder(path.parent)


def write_private_file(path: Path, data: bytes) -> None:
    """Write a file that only its owner can read, durably, whatever the umask says. Raises OSError."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        os.fchmod(file.fileno(), 0o600)  # one that was there keeps its mode otherwise
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def make_private_folder(path: Path) -> None:
    """Make a folder, and those that it lies in, for their owner alone. Raises OSError."""
    if not path.is_dir():
        make_private_folder(path.parent)
        path.mkdir(0o700, exist_ok=True)


_SMALL = 5_000_000
"""Bytes: of larger files that are no text, only the name is looked at."""
_TEXTS = (".jsonl", ".csv", ".json", ".toml", ".txt", ".md")

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


def lines_with(path: Path, is_found: Callable[[str], object]) -> list[int]:
    """The lines of a file, from 1, in which something is found. A film is not searched: it is as large as no text is.

    Raises OSError.
    """
    if path.suffix not in _TEXTS and path.stat().st_size > _SMALL:
        return []
    lines = path.read_bytes().decode("utf-8", "replace").splitlines()
    return [number for number, line in enumerate(lines, 1) if is_found(line)]
