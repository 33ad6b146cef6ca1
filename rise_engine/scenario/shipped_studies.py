"""The studies that come with the program: complete scenarios to run by name from anywhere, and to copy.

An installation has them in this package, a checkout in the folder `scenarios`. They are never changed. A new study
begins with a copy or with its first files.
"""

from __future__ import annotations

import os
import shutil
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from shutil import copyfile
from tempfile import mkdtemp

from rise_engine.base.errors import StudyError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE, why_none_written
from rise_engine.syntax.toml import toml_value

_PACKAGE = Path(__file__).parents[1]


def shipped_studies() -> dict[str, Path]:
    """The shipped studies by name."""
    for home in (_PACKAGE / "studies", _PACKAGE.parent / "scenarios"):
        found = sorted(home.glob(f"*/{SCENARIO_FILE}")) if home.is_dir() else []
        if found:
            return {file.parent.name: file.parent for file in found}
    return {}


def resolve_study(written: str) -> str:
    """The intended folder (or file): an existing path, or else the shipped study of that name."""
    name = written.strip().rstrip("/")
    if not name or os.path.lexists(written) or "/" in name:
        return written
    folder = shipped_studies().get(name)
    return written if folder is None else str(folder)


def shipped_name(folder: str | os.PathLike[str]) -> str:
    """The name of the shipped study in a folder, or empty."""
    real = os.path.realpath(folder)
    return next((name for name, path in shipped_studies().items() if os.path.realpath(path) == real), "")


def study_title(folder: Path) -> str:
    """The title of a study or a scenario, or else the name of its folder."""
    for name in (STUDY_FILE, SCENARIO_FILE):
        with suppress(OSError, ValueError):
            title = tomllib.loads((folder / name).read_text(encoding="utf-8")).get("title")
            if isinstance(title, str) and title:
                return title
    return folder.name


def study_lines() -> list[str]:
    """The shipped studies for people, one per line: name and title."""
    studies = shipped_studies()
    width = max(map(len, studies), default=0)
    return [f"{name:<{width}}  {study_title(path)}" for name, path in studies.items()]


def shipped_hint() -> str:
    """The end of a sentence about a missing folder."""
    names = ", ".join(f"`{name}`" for name in shipped_studies())
    return f"; shipped with the program are {names}" if names else ""


def copy_study(name: str, to: Path) -> int:
    """Copy a shipped study into a new or empty folder. Returns the number of files. Raises StudyError."""
    studies = shipped_studies()
    if name not in studies:
        raise StudyError(f"no study `{name}` is shipped with the program{did_you_mean(name, studies)}")
    source, number = studies[name], 0
    try:
        _check_empty(to)
        to.mkdir(parents=True, exist_ok=True)
        for path in sorted(source.rglob("*")):
            new = to / path.relative_to(source)
            if path.is_dir():
                new.mkdir(exist_ok=True)
            elif path.is_file():
                copyfile(path, new)  # without permissions, because the copy must be writable
                number += 1
    except OSError as error:
        raise StudyError(f"{error.filename or to}: {error.strerror or error}") from error
    return number


def _check_empty(folder: Path) -> None:
    """:raises StudyError: there is a file of this name, or a folder with contents. :raises OSError: unreadable."""
    if os.path.lexists(folder) and not folder.is_dir():
        raise StudyError(f"{folder} is not a folder")
    if folder.is_dir() and any(folder.iterdir()):
        raise StudyError(f"{folder} is not empty; name a new folder")


# --- new studies ------------------------------------------------------------------------------------------------------


AGENTS_FILE = "AGENTS.md"
_BLANK = Path(__file__).with_name("blank")
"""A study with one act and one rule, with TITLE and ROBOT for its title and robot."""


def blank_study(title: str, robot: str) -> dict[str, str]:
    """The files of a study with one act and one rule, by name.

    :param title: the title of the study. :param robot: the name of a profile.
    """
    files = {path.relative_to(_BLANK).as_posix(): path.read_text("utf-8") for path in _BLANK.rglob("*.*")}
    settings = files[SCENARIO_FILE].replace('"ROBOT"', toml_value(robot))
    return {**files, SCENARIO_FILE: settings.replace('"TITLE"', toml_value(title))}


def write_blank_study(folder: Path, title: str, robot: str) -> tuple[str, ...]:
    """Make a study with one act and one rule in a new or empty folder, completely or not at all. Returns its files.

    :raises StudyError: the folder is not empty, or it cannot be written.
    """
    files = blank_study(title, robot)
    try:
        _check_empty(folder)
        write_new_folder(folder, files)
    except (OSError, UnicodeError) as error:
        raise StudyError(f"{folder}: {getattr(error, 'strerror', None) or error}") from error
    return tuple(files)


def write_new_folder(folder: Path, files: Mapping[str, str]) -> None:
    """Make a folder of a study, or fill an empty one, completely or not at all.

    :param files: texts by their names in the folder.
    :raises StudyError: a name is not allowed in a study.
    :raises OSError, UnicodeError: it cannot be written.
    """
    parent = folder.absolute().parent
    parent.mkdir(parents=True, exist_ok=True)
    made = Path(mkdtemp(prefix=f".{folder.name}.", dir=parent))
    try:
        if problem := why_none_written(made, files.items()):
            raise StudyError(problem)
        for name, text in files.items():
            path = made / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(text.encode())
        made.chmod(0o755)
        made.replace(folder)  # may replace an empty folder
    finally:  # also after an interruption
        shutil.rmtree(made, ignore_errors=True)


def write_agents_file(folder: Path) -> None:
    """Add the page for language models to a study that has none. Raises StudyError."""
    try:
        with (folder / AGENTS_FILE).open("x", encoding="utf-8") as file:
            file.write((_BLANK / AGENTS_FILE).read_text("utf-8"))
    except FileExistsError:
        return
    except OSError as error:
        raise StudyError(f"{error.filename or folder}: {error.strerror or error}") from error
