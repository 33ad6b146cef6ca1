"""`rise-engine convert to-scxml` and `from-scxml`: rules as statecharts, and back."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from shlex import quote

import click

from rise_engine.base.errors import StudyError
from rise_engine.base.files import write_whole
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import pluralize
from rise_engine.cli.options import SCENARIO, STRICT
from rise_engine.cli.scenario.loading import sound_scenario
from rise_engine.cli.terminal import Refused, exit_with_usage, not_written, print_lines, print_notes
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS, why_not_written
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Rule, Scenario
from rise_engine.scenario.shipped_studies import write_new_folder
from rise_exchange.scxml.export import export_rule
from rise_exchange.scxml.limits import find_losses, find_refusals
from rise_exchange.scxml.rules_file import (
    called_acts,
    check_neighbours,
    file_name,
    flattening_notes,
    is_made_file,
    new_study_files,
    rules_text,
)
from rise_exchange.scxml.rules_of_chart import MadeRules, rules_of_chart

_ENDING = ".scxml"

# --- to SCXML -------------------------------------------------------------------------------------------------------


@click.command("to-scxml")
@SCENARIO
@click.option("--rule", "names", metavar="NAME", multiple=True, help="Convert only this rule. Repeatable.")
@click.option(
    "-o",
    "--output",
    metavar="PATH",
    type=click.Path(),
    help="Write to FILE.scxml, or to a folder with a file for each rule. Existing files of these names are replaced.",
)
@click.option("--seed", metavar="N", type=int, default=1, show_default=True, help="Set the seed of all random choices.")
@STRICT
def to_scxml(folder: str, names: tuple[str, ...], output: str | None, seed: int, strict: bool) -> None:
    """Write the rules of the scenario in DIR as SCXML, one document per rule.

    Without -o, one document goes to standard output. It first lists, rule by rule, what a document leaves out. If SCXML
    cannot express a rule, nothing is written.

    Exit status: 0; 1 nothing was written: the scenario has errors, a rule is refused, or --strict and something is
    lost; 2 there is no such folder or rule, or -o is missing or cannot be used; 74 it cannot be written.
    """
    scenario = sound_scenario(load(folder))
    rules = _chosen(scenario, names)
    into_file = output is not None and output.endswith(_ENDING)
    if len(rules) > 1 and (output is None or into_file):
        exit_with_usage(f"these are {len(rules)} rules; name a folder with -o, or one of them with --rule")
    if output is not None and not into_file and Path(output).exists() and not Path(output).is_dir():
        exit_with_usage(f"{output} is not a folder, and not a name that ends with {_ENDING}")
    _report_limits(scenario, rules, strict=strict)
    texts = {rule.name: export_rule(scenario, rule, seed=seed) for rule in rules}
    if output is None:
        print(texts[rules[0].name], end="")
        return
    paths = [Path(output)] if into_file else [Path(output) / name for name in _file_names(rules)]
    for path, text in zip(paths, texts.values(), strict=True):
        _write_whole(path, text)
    print_lines(f"{output}: {pluralize(len(paths), 'document')}")


def _chosen(scenario: Scenario, names: tuple[str, ...]) -> list[Rule]:
    for name in names:
        if name not in scenario.rules:
            exit_with_usage(f"there is no rule `{name}`{did_you_mean(name, scenario.rules)}")
    if not scenario.rules:
        exit_with_usage("this scenario has no rules")
    return [scenario.rules[name] for name in dict.fromkeys(names)] or list(scenario.rules.values())


def _report_limits(scenario: Scenario, rules: list[Rule], *, strict: bool) -> None:
    """Report losses and refusals. Ends the command if nothing should be written."""
    refused, lost, found = 0, 0, []
    for rule in rules:
        refusals = find_refusals(scenario, rule)
        losses = find_losses(scenario, rule)
        refused, lost = refused + refusals.errors, lost + len(losses)
        found += [*map(str, refusals.sorted()), *map(str, losses)]
    if refused:
        raise Refused(findings=found, hints=[f"nothing was written: {pluralize(refused, 'error')}"])
    if strict and lost:
        because = f"nothing was written, because of --strict: {lost} {'loss' if lost == 1 else 'losses'}"
        raise Refused(findings=found, hints=[because])
    print_notes(*found)


def _file_names(rules: list[Rule]) -> list[str]:
    """A file name for each rule, valid on every file system and unique."""
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


# --- from SCXML -----------------------------------------------------------------------------------------------------


@click.command("from-scxml")
@click.argument("file", metavar="FILE.scxml", type=click.Path())
@click.option(
    "--into", metavar="DIR", required=True, type=click.Path(), help="Write into this study, or a new or empty folder."
)
@click.option(
    "--name", metavar="RULE", default="", help="Name the rule. Default: the chart's name, or that of its file."
)
@click.option(
    "--event",
    "events",
    metavar="EVENT",
    multiple=True,
    help="Name an event from outside that the chart means by `*` or by a part of its name. Repeatable.",
)
def from_scxml(file: str, into: str, name: str, events: tuple[str, ...]) -> None:
    """Make rules from the statechart in FILE.scxml, in the study DIR: exactly what it means, or nothing.

    States within states, parallel states and histories are flattened. Everything that rules cannot express exactly is
    refused, with its place and the reason, and then nothing is written.

    Exit status: 0; 1 refused; 2 wrong usage, or no such file; 74 DIR cannot be written.
    """
    path, folder = Path(file), Path(into)
    if not path.is_file():
        exit_with_usage(f"there is no file {file}")
    if folder.exists() and not folder.is_dir():
        exit_with_usage(f"{into} is not a folder")
    diagnostics = Diagnostics()
    source = FileReader(path.parent, diagnostics).read(path)
    outside = tuple(event.strip().removeprefix("/") for event in events)
    made = rules_of_chart(source, diagnostics, name.strip(), outside) if source is not None else None
    if made is None:
        raise _refusal(diagnostics.sorted())
    text = rules_text(made, path.name)
    is_new = not folder.exists() or not any(folder.iterdir())
    written = _write_new(folder, made, path.stem, text) if is_new else _write_into(folder, made, text)
    print_lines(f"{written}: made from {path.name}", *(f"  - {note}" for note in flattening_notes(made)))
    if is_new and (acts := called_acts(made)):
        print_lines(f"  - to be written: {', '.join(acts)} in acts/acts.xml; until then each says its name")
    print_lines(f"check it with rise-engine check {quote(into)}")


def _refusal(found: Iterable[Diagnostic]) -> Refused:
    return Refused(findings=found, hints=["nothing was written"])


def _refuse_errors(errors: list[Diagnostic]) -> None:
    if errors:
        raise _refusal(errors)


def _write_new(folder: Path, made: MadeRules, title: str, text: str) -> Path:
    """Write a whole study, or nothing."""
    files = new_study_files(made, made.chart.name or title, text)
    held = {name: content.encode() for name, content in files.items()}
    _refuse_errors(load(folder, held=held).errors)
    try:
        write_new_folder(folder, files)
    except StudyError as error:
        raise Refused(f"{error}; nothing was written") from None
    except OSError as error:
        raise not_written(folder, error) from None
    return folder / "rules" / file_name(made)


def _write_into(folder: Path, made: MadeRules, text: str) -> Path:
    """Write the rules file into an existing study, or nothing."""
    before = load(folder)  # errors may vanish with the new rules: a key may already name them
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
        raise Refused(f"{problem}; nothing was written")
    after = load(folder, held={name: text.encode()})
    _refuse_errors(after.errors)
    diagnostics = Diagnostics()
    assert after.scenario is not None
    check_neighbours(made, after.scenario, name, diagnostics)
    _refuse_errors(diagnostics.sorted())
    _write_whole(target, text)
    return target


# --- both -----------------------------------------------------------------------------------------------------------


def _write_whole(path: Path, text: str) -> None:
    """Write the whole file or nothing. Ends the command if it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text.encode(), beside=path.with_name(f".{path.name}.part"), private=False)
    except OSError as error:
        raise not_written(path, error) from None
