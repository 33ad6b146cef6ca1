"""What a save that was killed has left in a study's folder, so that it is read as if the save had come to its end.

A save writes all new contents beside the files, then a note that says which file gets which of them, and only then
renames (`rise_engine.edit.saving`). From the note on, the study is the new one, and whoever reads it follows the note.
"""

from __future__ import annotations

import os
from pathlib import Path

import msgspec
from msgspec import Struct

NOTE = ".rise-save.json"


class SavedFile(Struct, frozen=True):
    """One file of a save."""

    name: str
    """Relative to the study's folder."""
    target: str
    """Where it lies really, links followed."""
    fresh: str | None
    """The new content, in a file beside the target until it is renamed; None: the file goes."""


def read_note(folder: Path) -> tuple[SavedFile, ...] | None:
    """What an interrupted save wanted; None: there is none. Raises OSError and msgspec.DecodeError."""
    path = folder / NOTE
    if not os.path.lexists(path):
        return None
    return msgspec.json.decode(path.read_bytes(), type=tuple[SavedFile, ...])


def contents_of_interrupted_save(folder: Path) -> dict[str, bytes | None]:
    """What is to be read instead of the disk: the contents that an interrupted save has not put in their place."""
    try:
        note = read_note(folder)
        held: dict[str, bytes | None] = {}
        for file in note or ():
            if file.fresh is None:
                held[file.name] = None
            elif os.path.lexists(file.fresh):
                held[file.name] = Path(file.fresh).read_bytes()
    except (OSError, msgspec.DecodeError):  # what cannot be read is no note; the files stand as they are
        return {}
    return held
