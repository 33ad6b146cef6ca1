"""`rise-engine convert from-scxml`: a statechart as rules."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from shlex import quote
from tempfile import NamedTemporaryFile
from typing import NoReturn

import click

from rise_engine.cli.arguments import exit_with_usage
from rise_engine.exit_status import NOT_WRITTEN, REFUSED
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.file_names import DEFAULT_PATHS
from rise_engine.scenario.loader import load
from rise_engine.scenario.new_study import write_new_folder
from rise_engine.scenario.shipped_studies import StudyCopyError
from rise_engine.scenario.source_files import FileReader
from rise_engine.scenario.study_paths import why_not_written
from rise_engine.scxml.chart_in_study import called_acts, check_neighbours, file_name, is_made_file, new_study_files
from rise_engine.scxml.rules_file import flattening_notes, rules_text
from rise_engine.scxml.rules_of_chart import MadeRules, rules_of_chart
from rise_engine.text import clean


@click.command("from-scxml")
@click.argument("file", metavar="FILE.scxml", type=click.Path())
@click.option("--into", metavar="DIR", required=True, type=click.Path(), help="A study, or a new or empty folder.")
@click.option("--name", metavar="RULE", default="", help="Of the rule. Default: the chart's name, or that of its file.")
@click.option(
    "--event",
    "events",
    metavar="EVENT",
    multiple=True,
    help="An event from outside that the chart means by `*` or by a part of its name. Can be given several times.",
)
def from_scxml(file: str, into: str, name: str, events: tuple[str, ...]) -> None:
    """Make rules of the statechart in FILE.scxml, in the study DIR: exactly what it means, or nothing.

    States within states, parallel states and histories are flattened. What rules cannot say exactly is refused with
    its place and the reason, all of it at once, and then nothing is written.

    Exit status: 0; 1 refused; 2 wrong usage, or no such file; 74 DIR cannot be written.
    """
    path, folder = Path(file), Path(into)
    if not path.is_file():
        exit_with_usage(f"there is no file {file}")
    if folder.exists() and not folder.is_dir():
        exit_with_usage(f"{into} is no folder")
    diagnostics = Diagnostics()
    source = FileReader(path.parent, diagnostics).read(path)
    outside = tuple(event.strip().removeprefix("/") for event in events)
    made = rules_of_chart(source, diagnostics, name.strip(), outside) if source is not None else None
    if made is None:
        _refuse(diagnostics.sorted())
    text = rules_text(made, path.name)
    is_new = not folder.exists() or not any(folder.iterdir())
    written = _write_new(folder, made, path.stem, text) if is_new else _write_into(folder, made, text)
    click.echo(clean(f"{written}: made from {path.name}"))
    for note in flattening_notes(made):
        click.echo(clean(f"  - {note}"))
    if is_new and (acts := called_acts(made)):
        click.echo(clean(f"  - to be written: {', '.join(acts)} in acts/acts.xml; until then each says its name"))
    click.echo(f"check it with rise-engine check {quote(into)}")


def _refuse(found: list[Diagnostic]) -> NoReturn:
    """End the program with what was found."""
    for diagnostic in found:
        click.echo(str(diagnostic), err=True)
    click.echo("nothing was written", err=True)
    sys.exit(REFUSED)


def _write_new(folder: Path, made: MadeRules, title: str, text: str) -> Path:
    """A whole study, or nothing."""
    files = new_study_files(made, made.chart.name or title, text)
    held = {name: content.encode() for name, content in files.items()}
    _refuse_errors(load(folder, held=held).errors)
    try:
        write_new_folder(folder, files)
    except StudyCopyError as error:
        _refuse_name(str(error))
    except OSError as error:
        _not_written(folder, error)
    return folder / "rules" / file_name(made)


def _write_into(folder: Path, made: MadeRules, text: str) -> Path:
    """The rules file in a study that is there, or nothing."""
    before = load(folder)  # with errors it may still be whole with the new rules: a key may name them already
    rules = before.scenario.paths["rules"] if before.scenario is not None else DEFAULT_PATHS["rules"]
    target = folder / rules / file_name(made)
    if (folder / rules).is_file():
        exit_with_usage(f"{folder} has its rules in one file, {rules}; move it into a folder `rules`")
    try:
        if target.exists() and not is_made_file(target.read_text("utf-8")):
            exit_with_usage(f"{target} is there, and was not made from a chart; choose another --name")
    except (OSError, UnicodeDecodeError):
        exit_with_usage(f"{target} is there, and cannot be read; choose another --name")
    name = target.relative_to(folder).as_posix()
    if problem := why_not_written(folder, name):
        _refuse_name(problem)
    after = load(folder, held={name: text.encode()})
    _refuse_errors(after.errors)
    diagnostics = Diagnostics()
    assert after.scenario is not None
    check_neighbours(made, after.scenario, name, diagnostics)
    _refuse_errors(diagnostics.sorted())
    temporary = ""
    try:
        target.parent.mkdir(exist_ok=True)
        with NamedTemporaryFile("w", encoding="utf-8", dir=target.parent, prefix=".made.", delete=False) as file:
            temporary = file.name
            file.write(text)
        Path(temporary).chmod(0o644)
        os.replace(temporary, target)  # noqa: PTH105
    except OSError as error:
        if temporary:
            Path(temporary).unlink(missing_ok=True)
        _not_written(target, error)
    return target


def _refuse_name(problem: str) -> NoReturn:
    click.echo(f"error: {problem}; nothing was written", err=True)
    sys.exit(REFUSED)


def _refuse_errors(errors: list[Diagnostic]) -> None:
    if errors:
        _refuse(errors)


def _not_written(path: Path, error: OSError) -> NoReturn:
    click.echo(f"error: {path} cannot be written: {error.strerror or error}", err=True)
    sys.exit(NOT_WRITTEN)
