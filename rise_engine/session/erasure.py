"""Folders and files that are to be gone.

What has no name any more may still lie on the disk until something else is written there: solid-state disks, btrfs and
zfs do not write over old blocks even when they are told to. docs/how-to/promises.md says so to people.
"""

from __future__ import annotations

import os
from pathlib import Path


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
