"""Files and folders of recordings: new names, and how large they are."""

from __future__ import annotations

import re
from pathlib import Path

from rise_engine.ports.recorder import RecordingPlan


def new_path(folder: Path, stem: str, suffix: str = "") -> Path:
    """A path in a folder at which nothing lies yet: the second is called `..._2`.

    :param folder: where it is to be.
    :param stem: how its name begins.
    :param suffix: how it ends, with its dot.
    """
    number = 1
    while True:
        path = folder / (f"{stem}{suffix}" if number == 1 else f"{stem}_{number}{suffix}")
        if not path.exists() and not path.is_symlink():
            return path
        number += 1


def recording_stem(plan: RecordingPlan, name: str) -> str:
    """How the file of a recorder is called: the session's name and its own.

    :param plan: what is recorded.
    :param name: of the recorder.
    """
    return re.sub(r"[^A-Za-z0-9._-]", "-", f"{plan.session}_{name}")


def size_of(path: Path) -> int | None:
    """Bytes of a file, or of all that lie in a folder; None: there is nothing."""
    try:
        if path.is_dir():
            return sum(each.stat().st_size for each in path.rglob("*") if each.is_file())
        return path.stat().st_size
    except OSError:
        return None
