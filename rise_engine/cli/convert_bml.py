"""What both directions between acts and BML have in common on the command line."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from rise_engine.bml.findings import ConversionFindings
from rise_engine.bml.names import BmlNames, read_names
from rise_engine.exit_status import REFUSED
from rise_engine.scenario.model import RobotProfile
from rise_engine.scenario.source_files import FileReader, SourceFile
from rise_engine.text import clean, pluralize

NAMES = click.option(
    "--names",
    "names_file",
    metavar="FILE",
    type=click.Path(),
    help="A TOML file: where targets are, and what lexemes of [head], [gesture], [posture] and [face] mean.",
)
STRICT = click.option("--strict", is_flag=True, help="Refuse, and write nothing, when anything would be lost.")


def read_source(file: str, findings: ConversionFindings) -> SourceFile | None:
    """A file that was named on the command line; None after a finding."""
    return FileReader(Path(), findings.diagnostics).read(Path(file))


def read_names_option(file: str | None, robot: RobotProfile, findings: ConversionFindings) -> BmlNames:
    """The names of `--names`; without it, BML's usual ones and the robot's own."""
    source = read_source(file, findings) if file is not None else None
    return BmlNames(robot) if source is None else read_names(source, robot, findings.diagnostics)


def tell_findings(findings: ConversionFindings, *, strict: bool) -> None:
    """Say on standard error what refuses the conversion and what it loses; end the program when it is refused."""
    for diagnostic in findings.diagnostics.sorted():
        click.echo(str(diagnostic), err=True)
    for loss in findings.losses:
        click.echo(str(loss), err=True)
    errors, losses = findings.diagnostics.errors, len(findings.losses)
    if errors:
        refuse(f"{pluralize(errors, 'error')}; nothing was written")
    if losses and strict:
        refuse(f"{pluralize(losses, 'thing')} lost, and --strict allows none; nothing was written")
    if losses:
        click.echo(f"{pluralize(losses, 'thing')} lost", err=True)


def refuse(message: str) -> None:
    """End the program: nothing was written, and why."""
    click.echo(clean(message), err=True)
    sys.exit(REFUSED)
