"""A study's folder read and written whole: all files of a change, or none."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from rise_engine.edit.plan import EditRefused, Files
from rise_engine.scenario.shipped_studies import shipped_name
from rise_engine.scenario.source_files import MAX_BYTES

_SUFFIXES = (".xml", ".toml", ".json", ".jsonl", ".csv", ".md", ".txt")
_MOST_FILES = 5_000
_NO_PARTS = ("sessions", "bundles", "exports")
"""Folders of what was recorded; a study's own files are elsewhere."""


def read_study_files(folder: Path) -> Files:
    """The files of a study by their names relative to its folder: those in it that are text, hidden ones left out.

    :raises EditRefused: it cannot be read, or has far more files than a study.
    """
    files: dict[str, bytes] = {}
    try:
        for path in _paths(folder):
            if path.stat().st_size <= MAX_BYTES:
                files[path.relative_to(folder).as_posix()] = path.read_bytes()
            if len(files) > _MOST_FILES:
                raise EditRefused(f"{folder} has more than {_MOST_FILES:,} files; is it the folder of one study?")
    except OSError as error:
        raise EditRefused(f"{error.filename or folder}: {error.strerror or error}") from None
    return files


def _paths(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.name in _NO_PARTS:
            continue
        if path.is_dir() and not path.is_symlink():
            yield from _paths(path)
        elif path.suffix.lower() in _SUFFIXES and path.is_file():
            yield path


def write_study_files(folder: Path, before: Files, after: Files) -> tuple[str, ...]:
    """Write what differs between two states of a study; a link stays a link, and a file keeps its permissions.

    All new contents are on the disk before the first file is replaced, so that an error leaves everything as it was.

    :return: the names of the files that were written.
    :raises EditRefused: the study comes with the program, a file is not what it was in `before`, or cannot be written.
    """
    if name := shipped_name(folder):
        raise EditRefused(
            f"this study comes with the program and stays as it is; copy it: rise-engine new DIR --from {name}"
        )
    changed = [name for name in sorted(after) if after[name] != before.get(name)]
    fresh: dict[Path, Path] = {}
    try:
        for name in changed:
            target = Path(os.path.realpath(folder / name))
            now = target.read_bytes() if target.exists() else None
            if now != before.get(name):
                raise EditRefused(f"{name} has changed on the disk meanwhile; nothing was written, do it again")
            fresh[target] = _write_beside(target, after[name])
        for target, path in fresh.items():
            path.replace(target)
    except OSError as error:
        raise EditRefused(f"{error.filename or folder}: {error.strerror or error}; nothing was written") from None
    finally:
        for path in fresh.values():
            with suppress(OSError):
                path.unlink(missing_ok=True)
    return tuple(changed)


def _write_beside(target: Path, data: bytes) -> Path:
    """A file of this content in the same folder, durable, with the owner and permissions of the one that is there."""
    path = target.with_name(f".{target.name}.{os.getpid()}.new")
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
    with os.fdopen(descriptor, "wb") as file:
        if target.exists():
            found = target.stat()
            with suppress(OSError):  # only root may give a file away
                os.fchown(descriptor, found.st_uid, found.st_gid)
            os.fchmod(descriptor, stat.S_IMODE(found.st_mode))
        file.write(data)
        file.flush()
        os.fsync(descriptor)
    return path
