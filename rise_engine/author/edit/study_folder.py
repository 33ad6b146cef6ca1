"""The files of a study's folder, and the study.toml of a folder above it.

The study.toml above belongs to all scenarios of the study, and a plan may have been made from it. An edit of one
scenario does not change it, but a rename must know what it sets.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.author.edit.rename_data import Renaming, data_splices
from rise_engine.scenario.files.file_names import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.files.source_files import MAX_BYTES
from rise_engine.scenario.files.study_paths import RECORDED, SUFFIXES, why_not_read
from rise_engine.scenario.files.tree import contents_of_interrupted_save

_MOST_FILES = 5_000


def read_study_files(folder: Path) -> Files:
    """Read the text files of a study by their names relative to its folder, without hidden ones.

    :raises EditRefused: it cannot be read, or has far more files than a study.
    """
    files: dict[str, bytes] = {}
    try:
        for path in _paths(folder, folder):
            with suppress(FileNotFoundError):  # gone since it was listed, like the temporary files of other editors
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


# --- the study.toml above --------------------------------------------------------------------------------------------


_USUAL_SCENARIO = "scenario"
_LEVELS_UP = 3


def read_study_above(folder: Path) -> Files:
    """Read the study.toml that names this scenario, by its path; empty: there is none.

    :param folder: the scenario's. A study.toml beside scenario.toml does not count: it is one of the scenario's files.
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

    :param folder: with a study.toml. The list is empty if it has none, or is itself a scenario.
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
    """Say that a study.toml sets a memory key, or that it may because it cannot be read; empty: none does."""
    renaming = Renaming("key", "", key, f"{key}_", {})
    for path, data in above.items():
        try:
            if any(data_splices({STUDY_FILE: data}, renaming)):
                return f"{path} sets `{key}`"
        except EditRefused:
            return f"{path} cannot be read, and may set `{key}`"
    return ""


def _may_name(data: bytes, above: Path, folder: Path) -> bool:
    """Return whether a study names this scenario; one that cannot be read may."""
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
