"""The files of a study's folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.scenario.interrupted_save import contents_of_interrupted_save
from rise_engine.scenario.source_files import MAX_BYTES
from rise_engine.scenario.study_paths import RECORDED, SUFFIXES, why_not_read

_MOST_FILES = 5_000


def read_study_files(folder: Path) -> Files:
    """The files of a study by their names relative to its folder: those in it that are text, hidden ones left out.

    :raises EditRefused: it cannot be read, or has far more files than a study.
    """
    files: dict[str, bytes] = {}
    try:
        for path in _paths(folder, folder):
            with suppress(FileNotFoundError):  # gone since it was listed, as what other editors write beside
                if path.stat().st_size <= MAX_BYTES:
                    files[path.relative_to(folder).as_posix()] = path.read_bytes()
            if len(files) > _MOST_FILES:
                raise EditRefused(f"{folder} has more than {_MOST_FILES:,} files; is it the folder of one study?")
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
