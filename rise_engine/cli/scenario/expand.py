"""`rise-engine expand`: a scenario without templates, printed or written."""

from __future__ import annotations

from pathlib import Path
from shutil import copyfile

import click

from rise_engine.base.text import pluralize
from rise_engine.cli.options import SCENARIO
from rise_engine.cli.scenario.loading import sound_scenario
from rise_engine.cli.terminal import Refused, print_lines, print_notes, reason_of, write_xml
from rise_engine.scenario.files.study_paths import why_not_read
from rise_engine.scenario.files.xml import XmlFile
from rise_engine.scenario.loader import expanded_files, load
from rise_engine.scenario.reading.element_templates import PATTERNS
from rise_engine.scenario.reading.expansion import additions, plain_text


@click.command()
@SCENARIO
@click.option(
    "-o", "--output", "new", metavar="NEWDIR", help="Write a copy of the scenario into this new or empty folder."
)
def expand(folder: str, new: str | None) -> None:
    """Print the acts and rules of the scenario in DIR without templates, as if they were written by hand.

    Standard error lists what RISE itself does not know in them. Exit status: 0; 1 if the scenario has errors or the
    copy cannot be written; 2 if there is no such folder.
    """
    scenario = sound_scenario(load(folder))
    files = expanded_files(scenario)
    texts = {file.source.name: plain_text(file) for file in files}
    if new is None:
        for name, text in texts.items():
            if text:
                write_xml(f"<!-- {name} -->\n{text.rstrip()}\n")
    else:
        number = _write_copy(Path(scenario.folder), Path(new), texts)
        print_lines(f"{new}: {pluralize(number, 'file')}, without templates")
    print_notes(_additions_text(files))


def _write_copy(folder: Path, new: Path, texts: dict[str, str]) -> int:
    """Copy a scenario with changed texts, without hidden files and patterns; return the number of files."""
    try:
        if new.exists() and (not new.is_dir() or any(new.iterdir())):
            raise Refused(f"{new} is {'not empty' if new.is_dir() else 'no folder'}; name a new folder")
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
        raise Refused(f"{error.filename or new}: {reason_of(error)}") from error
    return number


def _additions_text(files: list[XmlFile]) -> str:
    """Return in a sentence what RISE itself would not read."""
    found = additions(files)
    if not found:
        return "nothing in these acts and rules is beyond RISE"
    return "beyond RISE itself, these acts and rules have: " + ", ".join(
        f"{name} ({number})" for name, number in sorted(found.items())
    )
