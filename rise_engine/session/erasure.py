"""Files that are to be gone: overwritten as far as that is possible, then removed.

Overwriting is a best effort. File systems that write anew elsewhere (btrfs, zfs), solid-state disks, snapshots and
backups may keep what was there; docs/how-to/promises.md says so to people.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from rise_engine.session.disk import Disk

BLOCK = 1_000_000


def overwrite(descriptor: int, disk: Disk) -> None:
    """Write zeros over all of an open file, durably. Raises OSError."""
    zeros = bytes(BLOCK)
    size = os.fstat(descriptor).st_size
    for at in range(0, size, BLOCK):
        disk.write(descriptor, zeros[: min(BLOCK, size - at)], at)
    disk.sync(descriptor)


def has_other_names(path: Path) -> bool:
    """Whether the file has further names (hard links): then it stays under those, and is not overwritten, because they
    may be a backup's."""
    return path.lstat().st_nlink > 1


def erase_file(path: Path, disk: Disk | None = None) -> None:
    """Overwrite a file and remove it; a link is only removed. Does nothing when it is not there. Raises OSError."""
    disk = disk or Disk()
    try:
        found = path.lstat()
    except FileNotFoundError:
        return
    if stat.S_ISREG(found.st_mode) and found.st_nlink == 1:
        path.chmod(0o600)
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
        try:
            overwrite(descriptor, disk)
        finally:
            os.close(descriptor)
    path.unlink(missing_ok=True)


def erase_folder(folder: Path, disk: Disk | None = None) -> int:
    """Erase every file in a folder and below, then the folder; how many files there were. Links are not followed.

    What is gone already is passed over, so that one that was interrupted can be called again. Raises OSError.
    """
    if folder.is_symlink():
        folder.unlink()
        return 0
    count = 0
    for where, folders, files in os.walk(folder, topdown=False):
        for name in files:
            erase_file(Path(where, name), disk)
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
