"""`rise-engine convert to-bml`: acts as blocks of BML 1.0."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import click

from rise_engine.bml.findings import ConversionFindings
from rise_engine.bml.writing import write_act
from rise_engine.cli.arguments import exit_with_usage, resolve_scenario
from rise_engine.cli.check import load_or_refuse
from rise_engine.cli.convert_bml import NAMES, STRICT, read_names_option, tell_findings
from rise_engine.cli.options import FOLDER
from rise_engine.cli.terminal import write_xml
from rise_engine.exit_status import NOT_WRITTEN, REFUSED
from rise_engine.protocol.task_file import unknown_name_sentence
from rise_engine.scenario.model import ActSettings, Scenario
from rise_engine.text import pluralize

_NOT_IN_NAME = re.compile(r"[^\w.-]")
_SUFFIX = ".bml.xml"


@click.command("to-bml")
@FOLDER
@click.option("--act", "acts", metavar="NAME", multiple=True, help="An act. Repeatable. Default: all.")
@click.option(
    "-o", "--output", metavar="FILE|FOLDER", type=click.Path(), help="New. A file for one act; else a folder."
)
@NAMES
@STRICT
def to_bml(folder: str, acts: tuple[str, ...], output: str | None, names_file: str | None, strict: bool) -> None:
    """Write acts of the scenario in DIR as blocks of BML 1.0, one in each file.

    \b
      rise-engine convert to-bml DIR --act R_Greeting
      rise-engine convert to-bml DIR -o FOLDER --names lab.toml

    What other programs that read BML will not do of an act is listed first, with file, line and column. `from-bml` has
    all of it again. Nothing is ever written over.

    Exit status: 0; 1 the scenario has errors, or something is lost and --strict; 2 wrong usage; 74 it cannot be
    written.
    """
    scenario = load_or_refuse(resolve_scenario(folder), robot=None, mode=None)
    if scenario is None:
        sys.exit(REFUSED)
    unknown = [name for name in acts if name not in scenario.acts]
    if unknown:
        exit_with_usage(f"--act: {unknown_name_sentence('act', unknown[0], list(scenario.acts))}")
    wanted = list(dict.fromkeys(acts)) or list(scenario.acts)
    if output is None and len(wanted) != 1:
        exit_with_usage(f"a file of BML has one block, and these are {pluralize(len(wanted), 'act')}; add -o FOLDER")
    findings = ConversionFindings()
    blocks = _write_blocks(scenario, wanted, names_file, findings)
    tell_findings(findings, strict=strict)
    if output is None:
        write_xml(blocks[wanted[0]].rstrip("\n"))
        return
    is_file = len(wanted) == 1 and Path(output).suffix in (".xml", ".bml")
    _save({Path(output) if is_file else Path(output, _file_name(name)): text for name, text in blocks.items()})
    click.echo(f"{output}: {pluralize(len(blocks), 'block')} of BML 1.0")


def _write_blocks(
    scenario: Scenario, wanted: list[str], names_file: str | None, findings: ConversionFindings
) -> dict[str, str]:
    """The texts of blocks, by the names of acts."""
    names = read_names_option(names_file, scenario.robot, findings)
    return {
        name: write_act(
            scenario.acts[name],
            scenario.act_settings.get(name, ActSettings()).calling_type,
            scenario.memory,
            names,
            findings,
        )
        for name in wanted
    }


def _file_name(act: str) -> str:
    return _NOT_IN_NAME.sub("_", act).lstrip(".") + _SUFFIX


def _save(files: dict[Path, str]) -> None:
    """Write new files, all of them or none. Ends the program when they are there already, or cannot be written."""
    there = [path for path in files if path.exists()]
    if there:
        exit_with_usage(f"there is a file {there[0]} already; nothing is written over")
    made: list[Path] = []
    try:
        for path, text in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8", newline="") as file:
                made.append(path)
                file.write(text)
    except OSError as error:
        for path in made:
            path.unlink(missing_ok=True)
        click.echo(f"error: {error.filename or path} cannot be written: {error.strerror or error}", err=True)
        sys.exit(NOT_WRITTEN)
