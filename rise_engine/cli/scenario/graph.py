"""`rise-engine graph`: drawings of a study's rules or acts."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import click

from rise_engine.author.drawing.pictures import (
    mermaid_of_acts,
    mermaid_of_rules,
    picture_of_act,
    picture_of_rule,
    svg_text,
    text_of,
)
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.cli.options import SCENARIO
from rise_engine.cli.scenario.loading import sound_scenario
from rise_engine.cli.terminal import Refused, exit_with_usage, reason_of
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Act, Rule, Scenario

Named = TypeVar("Named", Act, Rule)
FORMATS = ("text", "svg", "mermaid")
WIDTH = 100
"""Default number of cells of a drawing."""
MIN_WIDTH, MAX_WIDTH = 40, 400


def graph_text(scenario: Scenario, name: str, format: str, width: int, *, act: bool = False) -> str:
    """Draw a rule, an act, or all of them. Ends the command if there is none.

    :param name: the name of a rule or an act; empty: all rules, or all acts.
    :param format: one of FORMATS.
    :param width: cells, for text and SVG.
    :param act: whether to draw the act, even if a rule has the same name; without a name: all acts.
    """
    if act or (name and name not in scenario.rules and name in scenario.acts):
        acts = _chosen(scenario.acts, name, "act")
        if format in ("text", "svg"):
            return _drawn(scenario, acts, (), format, width)
        return mermaid_of_acts(acts)
    if name and name not in scenario.rules:
        near = did_you_mean(name, [*scenario.rules, *scenario.acts])
        exit_with_usage(f"there is no rule and no act `{name}`{near}")
    rules = _chosen(scenario.rules, name, "rule")
    if format in ("text", "svg"):
        return _drawn(scenario, (), rules, format, width)
    return mermaid_of_rules(rules)


def _chosen(among: dict[str, Named], name: str, what: str) -> list[Named]:
    if name and name not in among:
        exit_with_usage(f"there is no {what} `{name}`{did_you_mean(name, among)}")
    if not among:
        exit_with_usage(f"this scenario has no {what}s")
    return [among[name]] if name else list(among.values())


def _drawn(scenario: Scenario, acts: Sequence[Act], rules: Sequence[Rule], format: str, width: int) -> str:
    pictures = [*(picture_of_rule(rule, width) for rule in rules), *(picture_of_act(act, width) for act in acts)]
    if format == "svg":
        return svg_text(scenario.title, pictures)
    blocks = []
    for picture in pictures:
        head = f"{picture.kind} {picture.name}: {picture.summary}"
        blocks.append("\n".join([head, "", *text_of(picture)]))
    return "\n\n".join(blocks) + "\n"


@click.command()
@SCENARIO
@click.argument("name", required=False, default="")
@click.option(
    "--format", "format", type=click.Choice(FORMATS), default="text", help="Choose the format. Default: text."
)
@click.option(
    "--act", is_flag=True, help="Draw the act NAME, even if a rule has the same name. Without NAME: all acts."
)
@click.option(
    "--width",
    type=click.IntRange(MIN_WIDTH, MAX_WIDTH),
    default=None,
    help=f"Limit text and SVG to this many characters. Default: the terminal's width, or {WIDTH}.",
)
@click.option("-o", "--output", metavar="FILE", help="Write the drawing to this file, and replace an earlier one.")
def graph(folder: str, name: str, format: str, act: bool, width: int | None, output: str | None) -> None:
    """Draw the rule or act NAME of the scenario in DIR, or all its rules, with states and transitions.

    SVG is for papers and browsers, Mermaid for pages that draw it. The same scenario gives the same bytes. Exit status:
    0; 1 if the scenario has errors or the file cannot be written; 2 if there is no such rule or act.
    """
    scenario = sound_scenario(load(folder))
    if width is None:
        fits_terminal = output is None and format == "text" and sys.stdout.isatty()
        width = max(MIN_WIDTH, min(shutil.get_terminal_size().columns, MAX_WIDTH)) if fits_terminal else WIDTH
    text = graph_text(scenario, name, format, width, act=act)
    if output is None:
        print(text, end="")
        return
    try:
        Path(output).write_bytes(text.encode())
    except OSError as error:
        raise Refused(f"{output}: {reason_of(error)}") from None
