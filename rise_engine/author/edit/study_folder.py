"""Reading and saving the files of a study's folder, and reading the study.toml of a folder above it.

A save writes all files of a change or none. First, new contents are written beside the files and made durable. Then a
note lists the files. Then the new files are renamed, and the note is deleted. A save that is killed before the note has
no effect. After the note, `finish_interrupted` completes it, and readers follow the note until then
(`rise_engine.scenario.files.tree`).

The study.toml above belongs to all scenarios of the study, and a plan may depend on it. An edit of one scenario does
not change it, but a rename must know its memory keys.
"""

from __future__ import annotations

import os
import stat
import tomllib
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec

from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.author.edit.rename_data import Renaming, data_splices
from rise_engine.base.files import durable_file, sync, write_whole
from rise_engine.scenario.files.source_files import MAX_BYTES
from rise_engine.scenario.files.study_paths import (
    RECORDED,
    SCENARIO_FILE,
    STUDY_FILE,
    SUFFIXES,
    why_none_written,
    why_not_read,
    why_not_written,
)
from rise_engine.scenario.files.tree import (
    NEW_SUFFIX,
    NOTE,
    SavedFile,
    contents_of_interrupted_save,
    fresh_path,
    pending_contents,
    read_note,
    sum_of,
    sum_on_disk,
)
from rise_engine.scenario.shipped_studies import shipped_name

_MAX_FILES = 5_000


def read_study_files(folder: Path) -> Files:
    """Read the text files of a study by their names relative to its folder, without hidden ones.

    :raises EditRefused: it cannot be read, or has too many files for a study.
    """
    files: dict[str, bytes] = {}
    try:
        for path in _paths(folder, folder):
            with suppress(FileNotFoundError):  # deleted since it was listed, like the temporary files of other editors
                if path.stat().st_size <= MAX_BYTES:
                    files[path.relative_to(folder).as_posix()] = path.read_bytes()
            if len(files) > _MAX_FILES:
                raise EditRefused(f"{folder} has more than {_MAX_FILES:,} files; is it the folder of one study?")
        for name, data in contents_of_interrupted_save(folder).items():
            if data is None:
                files.pop(name, None)
            else:
                files[name] = data
    except OSError as error:
        raise EditRefused(f"{error.filename or folder}: {error.strerror or error}") from None
    return files


def _paths(folder: Path, study: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.name in RECORDED:
            continue
        if path.is_symlink():
            if path.is_file() and path.suffix.lower() in SUFFIXES and not why_not_read(study, path):
                yield path
        elif path.is_dir():
            yield from _paths(path, study)
        elif path.suffix.lower() in SUFFIXES and path.is_file():
            yield path


# --- the study.toml above --------------------------------------------------------------------------------------------


_USUAL_SCENARIO = "scenario"
_LEVELS_UP = 3


def read_study_above(folder: Path) -> Files:
    """Read the study.toml that names this scenario, by its path; empty: there is none.

    :param folder: the scenario's folder. A study.toml in it does not count: it is one of the scenario's files.
    """
    folder = folder.resolve()
    for above in list(folder.parents)[:_LEVELS_UP]:
        try:
            data = (above / STUDY_FILE).read_bytes()
        except OSError:
            continue
        return {str(above / STUDY_FILE): data} if _may_name(data, above, folder) else {}
    return {}


def scenarios_below(folder: Path) -> list[Path]:
    """List the scenarios of a study's folder, its own first; only those that exist.

    :param folder: the study's folder. Without a study.toml, or with a scenario.toml, the list is empty.
    """
    if (folder / SCENARIO_FILE).exists():
        return []
    try:
        values = tomllib.loads((folder / STUDY_FILE).read_text("utf-8-sig"))
    except (OSError, ValueError, RecursionError):
        return []
    own = str(values.get("scenario", _USUAL_SCENARIO))
    names = [own, *sorted({str(name) for name in _scenarios(values)} - {own})]
    return [folder / name for name in names if (folder / name / SCENARIO_FILE).is_file()]


def sets_key(above: Files, key: str) -> str:
    """Return a sentence that a study.toml sets a memory key, or may because it is unreadable; empty: none does."""
    renaming = Renaming("key", "", key, f"{key}_", {})
    for path, data in above.items():
        try:
            if any(data_splices({STUDY_FILE: data}, renaming)):
                return f"{path} sets `{key}`"
        except EditRefused:
            return f"{path} cannot be read, and may set `{key}`"
    return ""


def _may_name(data: bytes, above: Path, folder: Path) -> bool:
    """Return whether a study names this scenario; an unreadable study may."""
    try:
        values = tomllib.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        return True
    return any((above / name).resolve() == folder for name in _scenarios(values))


def _scenarios(values: dict[str, Any]) -> set[str]:
    """Return the folders that a study names: its own scenario, and those of levels of factors."""
    found = {values.get("scenario", _USUAL_SCENARIO)}
    factors = values.get("factors")
    for factor in factors.values() if isinstance(factors, dict) else ():
        levels = factor.get("levels") if isinstance(factor, dict) else None
        for level in levels.values() if isinstance(levels, dict) else ():
            found.add(level.get("scenario") if isinstance(level, dict) else None)
    return {name for name in found if isinstance(name, str)}


# --- saving -----------------------------------------------------------------------------------------------------------


Reached = Callable[[str], None]


def write_files(folder: Path, before: Files, after: Files, *, reached: Reached = lambda step: None) -> tuple[str, ...]:
    """Write the differences between two states of a study's files: all or nothing.

    A link within the study stays a link; its target gets the content. Owner and permissions stay.

    :param folder: the study's folder.
    :param before: the expected files on the disk. If they differ, nothing is written.
    :param reached: gets each step, for tests.
    :return: the names of the files that were written, made or deleted.
    :raises EditRefused: the study comes with the program, a file name is invalid (`study_paths`), a file has changed
        meanwhile, or the disk fails.
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
        _check_unchanged(folder, before, names)  # writing took some time
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
    """Refuse a study that comes with the program. :raises EditRefused: it does."""
    if name := shipped_name(folder):
        raise EditRefused(
            f"this study comes with the program and stays as it is; copy it: rise-engine new DIR --from {name}"
        )


def finish_interrupted(folder: Path) -> tuple[str, ...]:
    """Complete a save that was killed after its note, or delete the new contents of one killed before it.

    Files that have changed since stay.

    :return: the names of the files that were written now; empty: nothing was interrupted.
    :raises EditRefused: the disk fails.
    """
    finished: tuple[str, ...] = ()
    try:
        with suppress(msgspec.DecodeError, ValueError):  # our notes are complete, so this file is not ours
            note = read_note(folder)
            if note is not None:
                finished = _carry_out(folder, note, lambda step: None)
        for litter in _unfinished_files(folder):
            litter.unlink(missing_ok=True)
    except OSError as error:
        raise EditRefused(f"{error.filename or folder}: {error.strerror or error}") from None
    return finished


def _unfinished_files(folder: Path) -> Iterator[Path]:
    """Yield new contents that were not renamed: in the folder, and at the targets of its links."""
    for path in [*folder.rglob("*")]:
        if path.name.startswith(".") and path.name.endswith(NEW_SUFFIX):
            yield path
        elif path.is_symlink() and not why_not_written(folder, path.relative_to(folder).as_posix()):
            yield fresh_path(Path(os.path.realpath(path)))


def _check_unchanged(folder: Path, before: Files, names: list[str]) -> None:
    """Check that no file has changed. :raises EditRefused: one has, or cannot be read."""
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
    """Write all new contents durably beside their files. `made` gets the created folders."""
    for name in names:
        target = Path(os.path.realpath(folder / name))
        content = after.get(name)
        if content is None:
            if not os.access((folder / name).parent, os.W_OK):
                raise PermissionError(13, "you may not write into this folder", str((folder / name).parent))
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
    """Write new content with the owner and permissions of the file that it will replace."""
    fresh = fresh_path(target)
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(13, "you may not write this file", str(target))
    fresh.unlink(missing_ok=True)
    with durable_file(fresh, new=True) as file:
        if target.exists():
            found = target.stat()
            with suppress(OSError):  # only root may give a file away
                os.fchown(file.fileno(), found.st_uid, found.st_gid)
            os.fchmod(file.fileno(), stat.S_IMODE(found.st_mode))
        file.write(data)


def _clear(folder: Path, names: list[str], made: list[Path]) -> None:
    """Delete the new contents of a save that does not happen. With a note, it happens."""
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
    """Rename all new contents, and return the names that were still missing."""
    left = pending_contents(folder, note)
    for name, content in left.items():
        path = folder / name
        if content is None:
            path.unlink(missing_ok=True)  # removes the link, not its target
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
