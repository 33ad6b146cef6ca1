"""What `rise-engine expand` prints and writes: a scenario without templates."""

from __future__ import annotations

import sys
from pathlib import Path
from shutil import copyfile

from rise_engine.cli.check import print_findings
from rise_engine.cli.terminal import write_xml
from rise_engine.errors import RiseError
from rise_engine.scenario.element_templates import PATTERNS
from rise_engine.scenario.loader import expanded_files, load
from rise_engine.scenario.plain_xml import additions, plain_text
from rise_engine.scenario.study_paths import why_not_read
from rise_engine.scenario.xml import XmlFile
from rise_engine.text import pluralize


class ExpandError(RiseError):
    """The expanded scenario cannot be written; the message is a sentence for a person."""


def expand_report(folder: str, new: str | None) -> int:
    """Print the acts and rules of a scenario with their templates put in, or write them into a copy of it.

    :param folder: the scenario's.
    :param new: the folder of the copy, a new or empty one; None: print.
    :return: the exit status, 1 when the scenario has errors (they go to standard error).
    :raises ExpandError: the copy cannot be written.
    """
    loaded = load(folder)
    if loaded.scenario is None:
        print_findings(loaded)
        return 1
    files = expanded_files(loaded.scenario)
    texts = {file.source.name: plain_text(file) for file in files}
    if new is None:
        for name, text in texts.items():
            if text:
                write_xml(f"<!-- {name} -->\n{text.rstrip()}\n")
    else:
        number = _write_copy(Path(loaded.scenario.folder), Path(new), texts)
        print(f"{new}: {pluralize(number, 'file')}, without templates")
    print(_additions_text(files), file=sys.stderr)
    return 0


def _write_copy(folder: Path, new: Path, texts: dict[str, str]) -> int:
    """Copy a scenario with other texts; how many files it has. Hidden files and patterns stay behind."""
    try:
        if new.exists() and (not new.is_dir() or any(new.iterdir())):
            raise ExpandError(f"{new} is {'not empty' if new.is_dir() else 'no folder'}; name a new folder")
        number = 0
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            relative = path.relative_to(folder)
            text = texts.get(relative.as_posix())
            if (
                text == ""
                or why_not_read(folder, relative)
                or relative.parts[0] == PATTERNS
                or any(part.startswith(".") for part in relative.parts)
            ):
                continue
            target = new / relative
            target.parent.mkdir(parents=True, exist_ok=True)
            if text is None:
                copyfile(path, target)
            else:
                target.write_text(text, encoding="utf-8", newline="")
            number += 1
    except OSError as error:
        raise ExpandError(f"{error.filename or new}: {error.strerror or error}") from error
    return number


def _additions_text(files: list[XmlFile]) -> str:
    """What RISE itself would not read of it, in a sentence."""
    found = additions(files)
    if not found:
        return "nothing in these acts and rules is beyond RISE"
    return "beyond RISE itself, these acts and rules have: " + ", ".join(
        f"{name} ({number})" for name, number in sorted(found.items())
    )
