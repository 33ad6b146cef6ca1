"""Whether a program of a study can be started (`run` of a `[[check]]`), as far as one can see without doing so."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import clean, escape_surrogates


def program_problem(arguments: Sequence[str], folder: str | Path) -> str:
    """Why a program of a study cannot be started, in a sentence; empty: it can, as far as one can see without doing so.

    :param arguments: the check's `run`.
    :param folder: the study's.
    """
    if not arguments or not arguments[0]:
        return "`run` names no program"
    name, folder = arguments[0], Path(folder)
    if any("\0" in argument for argument in arguments):
        return "a program and its arguments cannot have a NUL in them"
    if "/" not in name:
        if shutil.which(name) is not None:
            return ""
        if (folder / name).is_file():
            return f"{name} lies in the study's folder, and is no program of this computer: write ./{name}"
        return f"there is no program {name} on this computer"
    path = folder / name
    if not path.exists():
        near = did_you_mean(path.name, _names_in(path.parent), limit=0)
        return f"there is no program {name} in the study's folder{near}"
    if not path.is_file():
        return f"{name} is no program but a folder"
    if not os.access(path, os.X_OK):
        return f"{name} may not be executed: chmod +x {escape_surrogates(str(path))}"
    return _interpreter_problem(name, path)


def _names_in(folder: Path) -> list[str]:
    with suppress(OSError):
        return sorted(each.name for each in folder.iterdir())
    return []


def _interpreter_problem(name: str, path: Path) -> str:
    """What is wrong with the first line of a script; empty: nothing, or it is no script."""
    try:
        with path.open("rb") as file:
            head = file.read(256)
    except OSError as error:
        return f"{name} cannot be read: {error.strerror or error}"
    if not head:
        return f"{name} is empty"
    first, end, _ = head.partition(b"\n")
    if not first.startswith(b"#!"):
        return ""
    if end and first.endswith(b"\r"):
        return f"{name} has line ends of Windows, which hide its interpreter: save it with line ends of Unix"
    words = first[2:].split()
    interpreter = words[0].decode("utf-8", "replace") if words else ""
    if not interpreter or not Path(interpreter).exists():
        return f"the first line of {name} names an interpreter that is not there: {clean(interpreter) or 'none'}"
    return ""
