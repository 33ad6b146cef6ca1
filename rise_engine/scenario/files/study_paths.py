"""Names of a study's files: the usual ones, and checks of names from outside.

Edits, imports, bundles and the note of a save contain names of files, scenarios and studies those of folders. Each is
checked here before anything is written or read. A valid name stays in the study's folder, also after following links,
and is no file that another program executes (`.git/config`, `.vscode/tasks.json`, `.envrc`).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path, PurePosixPath

from rise_engine.base.text import UNSEEN, clean

SCENARIO_FILE = "scenario.toml"
STUDY_FILE = "study.toml"
"""For a study with a design: participants, factors, sessions."""
PARTICIPANTS_FILE = "participants.csv"
LEXICON_FILE = "lexicon.toml"
TEXTS_FOLDER = "texts"
"""Contains the translations, one file per language: `texts/de.toml`."""

DEFAULT_PATHS = {"acts": "acts", "rules": "rules", "memory": "memory.json"}
"""The places of acts, rules and memory, unless `scenario.toml` has others."""


SUFFIXES = (".xml", ".toml", ".json", ".jsonl", ".csv", ".md", ".txt")
"""The endings of a study's files, which are all text."""
RECORDED = ("sessions", "bundles", "exports")
"""Folders of recorded data, which are not a study's own files."""
CONFIG_FILES = ("package.json", "pyproject.toml")
"""Lower-case names of files that other programs execute or obey."""
_LONGEST_SHOWN = 120
_EXAMPLE = "name it relative to the study's folder, as in `acts/greeting.xml`"


def why_no_name(name: str, suffixes: Sequence[str] | None = SUFFIXES) -> str:
    """Why a file of a study or a bundle cannot have this name, as a sentence without its end; empty: it can.

    :param name: relative to the folder, with slashes.
    :param suffixes: the allowed endings in lower case; None: any, also of a folder.

    >>> why_no_name("acts/greeting.xml"), why_no_name(".x")[:14]
    ('', '`.x` is hidden')
    """
    path, cleaned = PurePosixPath(name), clean(name)
    shown = f"`{cleaned if len(cleaned) <= _LONGEST_SHOWN else cleaned[:_LONGEST_SHOWN] + '…'}`"
    if not path.parts:
        return f"{shown} names no file; {_EXAMPLE}"
    if path.is_absolute() or ".." in path.parts:
        return f"{shown} leads out of the study's folder; {_EXAMPLE}"
    if "\\" in name or UNSEEN.search(name):
        return f"{shown} has a character that is not allowed in names (`\\`, or an invisible one); {_EXAMPLE}"
    if hidden := next((part for part in path.parts if part.startswith(".")), ""):
        return (
            f"{shown} is hidden, because `{hidden}` begins with a dot: other programs take instructions from such "
            "files; choose a name without the dot"
        )
    if suffixes is None:
        return ""
    if recorded := next((part for part in path.parts if part.lower() in RECORDED), ""):
        return f"{shown} is in `{recorded}`, with recorded data, which edits cannot change; choose another folder"
    if path.name.lower() in CONFIG_FILES:
        return f"{shown} is a file from which other programs take instructions; choose another name"
    if not path.name.lower().endswith(tuple(suffixes)):
        ends = " or ".join((", ".join(suffixes[:-1]), suffixes[-1]) if len(suffixes) > 1 else suffixes)
        return f"{shown} is not a name for this file: it has to end in {ends}"
    return ""


def why_not_written(folder: Path, name: str, suffixes: Sequence[str] = SUFFIXES, *, goes: bool = False) -> str:
    """Why a file of a study cannot be written, as a sentence without its end; empty: it can.

    Like `why_no_name`, but also checks the targets of links on the disk.

    :param folder: the study's folder.
    :param goes: whether the file will be deleted, which deletes a link itself.
    """
    if problem := why_no_name(name, suffixes):
        return problem
    path = folder / name
    real = Path(os.path.realpath(path.parent)) / path.name if goes else Path(os.path.realpath(path))
    home = os.path.realpath(folder)
    if not real.is_relative_to(home):
        return f"`{name}` leads out of the study's folder through a link, to {clean(str(real))}; {_COPY}"
    problem = why_no_name(real.relative_to(home).as_posix(), suffixes)
    return f"`{name}` is a link, and {problem}" if problem else ""


def why_none_written(folder: Path, contents: Iterable[tuple[str, object]]) -> str:
    """Why several files cannot be written, with all reasons; empty: they can.

    :param contents: names and contents; None: the file will be deleted.
    """
    problems = (why_not_written(folder, name, goes=content is None) for name, content in contents)
    return "; ".join(filter(None, problems))


def why_not_read(folder: Path, path: str | os.PathLike[str]) -> str:
    """Why a file or folder is not part of a study, as a sentence without its end; empty: it is.

    A folder of links can be a study, too (`colcon build --symlink-install`): if its main file is a link to a file of
    the same name, other links may lead to that file's folder.

    :param folder: the study's folder.
    :param path: relative to that folder, as written in a file.
    """
    real = Path(os.path.realpath(folder / path))
    if any(real.is_relative_to(home) for home in _real_folders(folder)):
        return ""
    here = os.path.normpath(folder)
    is_link = os.path.normpath(folder / path).startswith(os.path.join(here, ""))  # noqa: PTH118  # texts
    leads = f"`{clean(os.fspath(path))}` leads out of the study's folder{' through a link' * is_link}, to "
    return f"{leads}{clean(str(real))}; {_COPY if is_link else _INSIDE}"


_COPY = "replace the link with a copy"
_INSIDE = "a study reads only files in its own folder: copy it there, and name the copy"


def _real_folders(folder: Path) -> Iterator[Path]:
    yield Path(os.path.realpath(folder))
    for name in (SCENARIO_FILE, STUDY_FILE):
        real = Path(os.path.realpath(folder / name))
        if real.name == name and real.is_file():
            yield real.parent
