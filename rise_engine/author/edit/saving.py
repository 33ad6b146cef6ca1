"""Saving a study: all files of a change or none, whatever happens on the way.

New contents are written beside the files and made durable; then a note says which files get them; then they are
renamed; then the note goes. Killed before the note, a save has not happened, and after it, it has: `finish_interrupted`
brings it to its end, and who reads the study before that follows the note (`rise_engine.scenario.tree`).
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import msgspec

from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.base.files import durable_file, sync, write_whole
from rise_engine.scenario.shipped_studies import shipped_name
from rise_engine.scenario.study_paths import why_none_written, why_not_written
from rise_engine.scenario.tree import (
    FRESH,
    NOTE,
    SavedFile,
    fresh_path,
    read_note,
    still_to_do,
    sum_of,
    sum_on_disk,
)

Reached = Callable[[str], None]


def write_files(folder: Path, before: Files, after: Files, *, reached: Reached = lambda step: None) -> tuple[str, ...]:
    """Write what differs between two states of a study's files: all of it or nothing.

    A link within the study stays a link, and the file that it leads to is written; owner and permissions stay.

    :param folder: the study's folder.
    :param before: what is on the disk, as far as the caller knows. When it is not, nothing is written.
    :param reached: told each step, for tests.
    :return: the names of the files that were written, made or deleted.
    :raises EditRefused: the study comes with the program, it has no files of such names (`study_paths`), a file has
        changed meanwhile, or the disk does not take it.
    """
    refuse_shipped(folder)
    names = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
    if not names:
        return ()
    if problem := why_none_written(folder, ((name, after.get(name)) for name in names)):
        raise EditRefused(f"{problem}; nothing was written")
    _check_unchanged(folder, before, names)
    note = tuple(SavedFile(name, sum_of(before.get(name)), sum_of(after.get(name))) for name in names)
    made: list[Path] = []
    try:
        _write_fresh(folder, after, names, made, reached)
        _check_unchanged(folder, before, names)  # writing took its time
        _write_note(folder, note)
        reached("wrote the note")
    except BaseException as error:
        _clear(folder, names, made)
        if not isinstance(error, OSError):
            raise
        named = os.path.relpath(error.filename, folder) if isinstance(error.filename, str) else str(folder)
        raise EditRefused(f"{named}: {error.strerror or error}; nothing was written") from None
    try:
        _carry_out(folder, note, reached)
    except OSError as error:
        raise EditRefused(
            f"{error.filename or folder}: {error.strerror or error}; the rest is written when the study is opened next"
        ) from None
    return tuple(names)


def refuse_shipped(folder: Path) -> None:
    """:raises EditRefused: the study comes with the program."""
    if name := shipped_name(folder):
        raise EditRefused(
            f"this study comes with the program and stays as it is; copy it: rise-engine new DIR --from {name}"
        )


def finish_interrupted(folder: Path) -> tuple[str, ...]:
    """Bring a save to its end that was killed, and clear away what one has left that had not begun to count.

    What somebody has changed since stays as it is.

    :return: the names of the files that were written now; empty: nothing was interrupted.
    :raises EditRefused: the disk does not take it.
    """
    finished: tuple[str, ...] = ()
    try:
        with suppress(msgspec.DecodeError, ValueError):  # a note is there when it is whole; this is somebody else's
            note = read_note(folder)
            if note is not None:
                finished = _carry_out(folder, note, lambda step: None)
        for litter in _litter(folder):
            litter.unlink(missing_ok=True)
    except OSError as error:
        raise EditRefused(f"{error.filename or folder}: {error.strerror or error}") from None
    return finished


def _litter(folder: Path) -> Iterator[Path]:
    """New contents that have no place: in the folder, and where its links lead to."""
    for path in [*folder.rglob("*")]:
        if path.name.startswith(".") and path.name.endswith(FRESH):
            yield path
        elif path.is_symlink() and not why_not_written(folder, path.relative_to(folder).as_posix()):
            yield fresh_path(Path(os.path.realpath(path)))


def _check_unchanged(folder: Path, before: Files, names: list[str]) -> None:
    """:raises EditRefused: a file is not what it was, or cannot be read."""
    changed = []
    for name in names:
        try:
            now = sum_on_disk(folder / name)
        except OSError as error:
            raise EditRefused(f"{name}: {error.strerror or error}; nothing was written") from None
        if now != sum_of(before.get(name)):
            changed.append(name)
    if changed:
        have = "has" if len(changed) == 1 else "have"
        raise EditRefused(f"{', '.join(changed)} {have} changed on the disk meanwhile; nothing was written")


def _write_fresh(folder: Path, after: Files, names: list[str], made: list[Path], reached: Reached) -> None:
    """All new contents beside their files, durable. `made` gets the folders that were made for them."""
    for name in names:
        target = Path(os.path.realpath(folder / name))
        content = after.get(name)
        if content is None:
            if not os.access((folder / name).parent, os.W_OK):
                raise PermissionError(13, "this folder may not be written by you", str((folder / name).parent))
            continue
        _make_folders(target.parent, made)
        _write_beside(target, content)
        reached(f"wrote {name}")
    parents = {Path(os.path.realpath(folder / name)).parent for name in names}
    for each in {*parents, *(each.parent for each in made)}:
        if each.is_dir():
            sync(each)


def _make_folders(folder: Path, made: list[Path]) -> None:
    if not folder.is_dir():
        _make_folders(folder.parent, made)
        folder.mkdir()
        made.append(folder)


def _write_beside(target: Path, data: bytes) -> None:
    """A new content with the owner and permissions of the file that it will replace."""
    fresh = fresh_path(target)
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(13, "this file may not be written by you", str(target))
    fresh.unlink(missing_ok=True)
    with durable_file(fresh, new=True) as file:
        if target.exists():
            found = target.stat()
            with suppress(OSError):  # only root may give a file away
                os.fchown(file.fileno(), found.st_uid, found.st_gid)
            os.fchmod(file.fileno(), stat.S_IMODE(found.st_mode))
        file.write(data)


def _clear(folder: Path, names: list[str], made: list[Path]) -> None:
    """Take away what a save has left that does not happen. Once its note is there, it does."""
    if os.path.lexists(folder / NOTE):
        return
    for name in (*names, NOTE):
        with suppress(OSError):
            fresh_path(Path(os.path.realpath(folder / name))).unlink(missing_ok=True)
    for each in reversed(made):
        with suppress(OSError):
            each.rmdir()


def _write_note(folder: Path, note: tuple[SavedFile, ...]) -> None:
    write_whole(folder / NOTE, msgspec.json.encode(note), beside=fresh_path(folder / NOTE), private=False)
    sync(folder)


def _carry_out(folder: Path, note: tuple[SavedFile, ...], reached: Reached) -> tuple[str, ...]:
    """Put every new content in its place; which ones were still to be put there."""
    left = still_to_do(folder, note)
    for name, content in left.items():
        path = folder / name
        if content is None:
            path.unlink(missing_ok=True)  # of a link, the link
        else:
            target = Path(os.path.realpath(path))
            fresh_path(target).replace(target)
        reached(f"put {name} in its place")
    for each in {Path(os.path.realpath(folder / file.name)).parent for file in note}:
        if each.is_dir():
            sync(each)
    (folder / NOTE).unlink(missing_ok=True)
    sync(folder)
    reached("took the note away")
    return tuple(left)
