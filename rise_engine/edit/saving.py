"""Saving a study: all files of a change or none, whatever happens on the way.

New contents are written beside the files and made durable; then a note says which of them go where; then they are
renamed; then the note goes. Killed before the note, a save has not happened, and after it, it has: `finish_interrupted`
brings it to its end, and who reads the study before that follows the note (`rise_engine.scenario.interrupted_save`).
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import msgspec

from rise_engine.edit.plan import EditRefused, Files
from rise_engine.scenario.interrupted_save import NOTE, SavedFile, read_note
from rise_engine.scenario.shipped_studies import shipped_name
from rise_engine.text import pluralize

_FRESH = ".rise-new"
"""The end of the name of a new content that is not in its place yet."""


def write_files(
    folder: Path, before: Files, after: Files, *, reached: Callable[[str], None] = lambda step: None
) -> tuple[str, ...]:
    """Write what differs between two states of a study's files: all of it or nothing.

    A link stays a link, and the file that it leads to is written; owner and permissions stay.

    :param folder: the study's folder.
    :param before: what is on the disk, as far as the caller knows. When it is not, nothing is written.
    :param reached: told each step, for tests.
    :return: the names of the files that were written, made or deleted.
    :raises EditRefused: the study comes with the program, a file has changed meanwhile, or the disk does not take it.
    """
    refuse_shipped(folder)
    names = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
    if not names:
        return ()
    _check_unchanged(folder, before, names)
    saved: list[SavedFile] = []
    made: list[Path] = []
    try:
        for name in names:
            target = Path(os.path.realpath(folder / name))
            content = after.get(name)
            if content is None:
                saved.append(SavedFile(name, str(target), None))
                continue
            _make_folders(target.parent, made)
            fresh = target.with_name(f".{target.name}{_FRESH}")
            saved.append(SavedFile(name, str(target), str(fresh)))
            _write_beside(target, fresh, content)
            reached(f"wrote {name}")
        _write_note(folder, tuple(saved))
        reached("wrote the note")
    except OSError as error:
        for file in saved:
            if file.fresh is not None:
                with suppress(OSError):
                    Path(file.fresh).unlink(missing_ok=True)
        for each in reversed(made):
            with suppress(OSError):
                each.rmdir()
        named = os.path.relpath(error.filename, folder) if isinstance(error.filename, str) else str(folder)
        raise EditRefused(f"{named}: {error.strerror or error}; nothing was written") from None
    try:
        _carry_out(folder, tuple(saved), reached)
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

    :return: the names of the files that were written now; empty: nothing was interrupted.
    :raises EditRefused: the disk does not take it.
    """
    try:
        note = read_note(folder)
        if note is not None:
            _carry_out(folder, note, lambda step: None)
        for litter in folder.rglob(f".*{_FRESH}"):
            litter.unlink(missing_ok=True)
    except OSError as error:
        raise EditRefused(f"{error.filename or folder}: {error.strerror or error}") from None
    except msgspec.DecodeError:  # a note is renamed into its place when it is whole; this is somebody else's file
        return ()
    return tuple(file.name for file in note or ())


def _check_unchanged(folder: Path, before: Files, names: list[str]) -> None:
    changed = []
    for name in names:
        try:
            now: bytes | None = (folder / name).read_bytes()
        except FileNotFoundError:
            now = None
        except OSError as error:
            raise EditRefused(f"{name}: {error.strerror or error}; nothing was written") from None
        if now != before.get(name):
            changed.append(name)
    if changed:
        have = "has" if len(changed) == 1 else "have"
        raise EditRefused(f"{', '.join(changed)} {have} changed on the disk meanwhile; nothing was written")


def _make_folders(folder: Path, made: list[Path]) -> None:
    if not folder.is_dir():
        _make_folders(folder.parent, made)
        folder.mkdir()
        made.append(folder)


def _write_beside(target: Path, fresh: Path, data: bytes) -> None:
    """A new content, durable, with the owner and permissions of the file that it will replace."""
    fresh.unlink(missing_ok=True)
    descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
    with os.fdopen(descriptor, "wb") as file:
        if target.exists():
            found = target.stat()
            if not os.access(target, os.W_OK):
                raise PermissionError(13, "this file may not be written by you", str(target))
            with suppress(OSError):  # only root may give a file away
                os.fchown(descriptor, found.st_uid, found.st_gid)
            os.fchmod(descriptor, stat.S_IMODE(found.st_mode))
        file.write(data)
        file.flush()
        os.fsync(descriptor)


def _write_note(folder: Path, saved: tuple[SavedFile, ...]) -> None:
    fresh = folder / f"{NOTE}{_FRESH}"
    descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(msgspec.json.encode(saved))
        file.flush()
        os.fsync(descriptor)
    for each in {Path(file.target).parent for file in saved if file.fresh is not None}:
        _sync_folder(each)
    fresh.replace(folder / NOTE)
    _sync_folder(folder)


def _carry_out(folder: Path, saved: tuple[SavedFile, ...], reached: Callable[[str], None]) -> None:
    for file in saved:
        target = Path(file.target)
        if file.fresh is None:
            target.unlink(missing_ok=True)
        elif os.path.lexists(file.fresh):  # else it has its place already
            Path(file.fresh).replace(target)
        reached(f"put {file.name} in its place")
    for each in {Path(file.target).parent for file in saved}:
        if each.is_dir():
            _sync_folder(each)
    (folder / NOTE).unlink(missing_ok=True)
    reached("took the note away")


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def save_report(names: tuple[str, ...]) -> str:
    """`2 files written: acts/a.xml, memory.json`."""
    return f"{pluralize(len(names), 'file')} written: {', '.join(names)}" if names else "nothing was to be written"
