"""What a save that was killed has left in a study's folder, so that it is read as if the save had come to its end.

A save writes all new contents beside the files, then a note that names them, and only then renames
(`rise_engine.author.edit.saving`). From the note on, the study is the new one, and whoever reads it follows the note.
The note holds names and sums, and no places: a folder that is copied with it says nothing about the one it came from.
"""

from __future__ import annotations

import os
from hashlib import sha256
from pathlib import Path

import msgspec
from msgspec import Struct

from rise_engine.scenario.study_paths import why_not_written

NOTE = ".rise-save.json"
FRESH = ".rise-new"
"""The end of the name of a new content that is not in its place yet."""


class SavedFile(Struct, frozen=True):
    """One file of a save."""

    name: str
    """Relative to the study's folder."""
    before: str | None
    """SHA-256 of what the save found there; None: nothing."""
    after: str | None
    """SHA-256 of what it writes; None: the file goes."""


def sum_of(data: bytes | None) -> str | None:
    """The SHA-256 of a content, of no file None."""
    return None if data is None else sha256(data).hexdigest()


def sum_on_disk(path: Path) -> str | None:
    """The SHA-256 of a file, None when there is none. Raises OSError."""
    try:
        return sum_of(path.read_bytes())
    except FileNotFoundError:
        return None


def fresh_path(target: Path) -> Path:
    """Where the new content of a file waits for its place."""
    return target.with_name(f".{target.name}{FRESH}")


def read_note(folder: Path) -> tuple[SavedFile, ...] | None:
    """What an interrupted save wanted; None: there is none. Raises OSError and msgspec.DecodeError."""
    path = folder / NOTE
    if not os.path.lexists(path):
        return None
    note = msgspec.json.decode(path.read_bytes(), type=tuple[SavedFile, ...])
    for file in note:
        if problem := why_not_written(folder, file.name, goes=file.after is None):
            raise msgspec.ValidationError(problem)
    return note


def still_to_do(folder: Path, note: tuple[SavedFile, ...]) -> dict[str, bytes | None]:
    """What of a save has not come into its place: the contents by name, None for a file that goes.

    A file that somebody has changed after the save was killed is not among them: it stays. Raises OSError.
    """
    left: dict[str, bytes | None] = {}
    for file in note:
        if file.after == file.before or sum_on_disk(folder / file.name) != file.before:
            continue
        if file.after is None:
            left[file.name] = None
            continue
        fresh = fresh_path(Path(os.path.realpath(folder / file.name)))
        if os.path.lexists(fresh) and sum_of(data := fresh.read_bytes()) == file.after:
            left[file.name] = data
    return left


def contents_of_interrupted_save(folder: Path) -> dict[str, bytes | None]:
    """What is to be read instead of the disk: the contents that an interrupted save has not put in their place."""
    try:
        note = read_note(folder)
        return still_to_do(folder, note) if note else {}
    except (OSError, msgspec.DecodeError, ValueError):  # what cannot be read is no note; the files stand as they are
        return {}
