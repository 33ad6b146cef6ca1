"""`rise-engine convert to-scxml`: the rules of a study as SCXML documents."""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress
from pathlib import Path

import click

from rise_engine import exit_status
from rise_engine.cli.arguments import exit_with_usage, resolve_scenario
from rise_engine.cli.check import print_findings
from rise_engine.cli.options import FOLDER
from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Rule, Scenario
from rise_engine.scxml.export import export_rule
from rise_engine.scxml.limits import find_losses, find_refusals
from rise_engine.text import clean, pluralize

_ENDING = ".scxml"


@click.command("to-scxml")
@FOLDER
@click.option("--rule", "names", metavar="NAME", multiple=True, help="Only this rule. Repeatable.")
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    type=click.Path(),
    help="One file, FILE.scxml, or a folder with a file for each rule. What is there under these names is replaced.",
)
@click.option("--seed", metavar="N", type=int, default=1, show_default=True, help="What chance begins with.")
@click.option("--strict", is_flag=True, help="Write nothing when anything is lost.")
def to_scxml(folder: str, names: tuple[str, ...], output: str | None, seed: int, strict: bool) -> None:
    """Write the rules of the scenario in DIR as SCXML, each as a document of its own.

    One document goes to standard output without -o. First it says, rule by rule, what a document does not have; a rule
    that SCXML cannot say is refused, and then nothing is written.

    Exit status: 0; 1 nothing was written: the scenario has errors, a rule is refused, or --strict and something is
    lost; 2 there is no such folder or rule, or -o is missing or cannot be used; 74 it cannot be written.
    """
    loaded = load(resolve_scenario(folder))
    if loaded.scenario is None:
        print_findings(loaded)
        sys.exit(exit_status.REFUSED)
    rules = _chosen(loaded.scenario, names)
    into_file = output is not None and output.endswith(_ENDING)
    if len(rules) > 1 and (output is None or into_file):
        exit_with_usage(f"these are {len(rules)} rules; name a folder with -o, or one of them with --rule")
    if output is not None and not into_file and Path(output).exists() and not Path(output).is_dir():
        exit_with_usage(f"{output} is no folder, and no name that ends with {_ENDING}")
    _report_limits(loaded.scenario, rules, strict=strict)
    texts = {rule.name: export_rule(loaded.scenario, rule, seed=seed) for rule in rules}
    if output is None:
        click.echo(texts[rules[0].name], nl=False)
        return
    paths = [Path(output)] if into_file else [Path(output) / name for name in _file_names(rules)]
    for path, text in zip(paths, texts.values(), strict=True):
        _write(path, text)
    click.echo(clean(f"{output}: {pluralize(len(paths), 'document')}"))


def _chosen(scenario: Scenario, names: tuple[str, ...]) -> list[Rule]:
    for name in names:
        if name not in scenario.rules:
            exit_with_usage(f"there is no rule `{name}`{did_you_mean(name, scenario.rules)}")
    if not scenario.rules:
        exit_with_usage("this scenario has no rules")
    return [scenario.rules[name] for name in dict.fromkeys(names)] or list(scenario.rules.values())


def _report_limits(scenario: Scenario, rules: list[Rule], *, strict: bool) -> None:
    """Say what is lost and what is refused; end the program when nothing is to be written."""
    refused, lost = 0, 0
    for rule in rules:
        refusals = find_refusals(scenario, rule)
        losses = find_losses(scenario, rule)
        refused, lost = refused + refusals.errors, lost + len(losses)
        for finding in (*refusals.sorted(), *losses):
            click.echo(str(finding), err=True)
    if refused:
        click.echo(f"nothing was written: {pluralize(refused, 'error')}", err=True)
        sys.exit(exit_status.REFUSED)
    if strict and lost:
        click.echo(f"nothing was written, because of --strict: {lost} {'loss' if lost == 1 else 'losses'}", err=True)
        sys.exit(exit_status.REFUSED)


def _file_names(rules: list[Rule]) -> list[str]:
    """A file for each rule, named so that every file system takes it, none like another."""
    names: list[str] = []
    for rule in rules:
        stem = re.sub(r"[^\w. -]", "_", rule.name)[:100].strip(". ") or "rule"
        taken = [name.casefold() for name in names]
        number = 1
        name = stem
        while f"{name}{_ENDING}".casefold() in taken:
            number += 1
            name = f"{stem} {number}"
        names.append(f"{name}{_ENDING}")
    return names


def _write(path: Path, text: str) -> None:
    """The whole file or nothing of it. Ends the program when it cannot be written."""
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, "utf-8", newline="\n")
        os.replace(part, path)  # noqa: PTH105  # an earlier one may be there
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        click.echo(f"error: {path} cannot be written: {error.strerror or error}", err=True)
        sys.exit(exit_status.NOT_WRITTEN)
