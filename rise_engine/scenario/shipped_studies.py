"""The studies that come with the program: complete scenarios, to be run by their name from anywhere, and to be copied.

Where it is installed they lie in this package; in a checkout they are the folder `scenarios`. Nothing is written there.
"""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from shutil import copyfile

from rise_engine.base.errors import RiseError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.file_names import SCENARIO_FILE

_PACKAGE = Path(__file__).parents[1]


class StudyCopyError(RiseError):
    """A study could not be copied; the message is a sentence for a person."""


def shipped_studies() -> dict[str, Path]:
    """The shipped studies by name."""
    for home in (_PACKAGE / "studies", _PACKAGE.parent / "scenarios"):
        found = sorted(home.glob(f"*/{SCENARIO_FILE}")) if home.is_dir() else []
        if found:
            return {file.parent.name: file.parent for file in found}
    return {}


def resolve_study(written: str) -> str:
    """The folder (or file) that is meant: what is there, or else the shipped study of that name."""
    name = written.strip().rstrip("/")
    if not name or os.path.lexists(written) or "/" in name:
        return written
    folder = shipped_studies().get(name)
    return written if folder is None else str(folder)


def shipped_name(folder: str | os.PathLike[str]) -> str:
    """The name of the shipped study that lies there, or empty."""
    real = os.path.realpath(folder)
    return next((name for name, path in shipped_studies().items() if os.path.realpath(path) == real), "")


def study_title(folder: Path) -> str:
    """What a study calls itself."""
    try:
        title = tomllib.loads((folder / SCENARIO_FILE).read_text(encoding="utf-8")).get("title")
    except (OSError, ValueError):
        return folder.name
    return title if isinstance(title, str) and title else folder.name


def study_lines() -> list[str]:
    """The shipped studies for a person, each in a line: its name and its title."""
    studies = shipped_studies()
    width = max(map(len, studies), default=0)
    return [f"{name:<{width}}  {study_title(path)}" for name, path in studies.items()]


def shipped_hint() -> str:
    """The end of a sentence about a folder that is not there."""
    names = ", ".join(f"`{name}`" for name in shipped_studies())
    return f"; shipped with the program are {names}" if names else ""


def copy_study(name: str, to: Path) -> int:
    """Copy a shipped study into a new or empty folder; how many files it has. Raises StudyCopyError."""
    studies = shipped_studies()
    if name not in studies:
        raise StudyCopyError(f"no study `{name}` is shipped with the program{did_you_mean(name, studies)}")
    source, number = studies[name], 0
    try:
        if to.exists() and not to.is_dir():
            raise StudyCopyError(f"{to} is not a folder")
        if to.is_dir() and any(to.iterdir()):
            raise StudyCopyError(f"{to} is not empty; name a new folder")
        to.mkdir(parents=True, exist_ok=True)
        for path in sorted(source.rglob("*")):
            new = to / path.relative_to(source)
            if path.is_dir():
                new.mkdir(exist_ok=True)
            elif path.is_file():
                copyfile(path, new)  # not its permissions: the copy is to be changed
                number += 1
    except OSError as error:
        raise StudyCopyError(f"{error.filename or to}: {error.strerror or error}") from error
    return number
