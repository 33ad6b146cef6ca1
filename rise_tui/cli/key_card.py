"""The key card, `rise-tui keys DIR`: all keys and their functions, printed on paper.

It is made from the scenario and the registry of actions, with this user's own keys.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import NamedTuple

import click

from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.scenario.keys import PUNCTUATION
from rise_engine.scenario.model import KeyBinding, Scenario
from rise_tui.actions import KEY_SCOPES, actions_in
from rise_tui.cli.command_line import KEYS
from rise_tui.config.key_file import KeyFile, read_keys
from rise_tui.config.launch import ScenarioProblems, load_scenario
from rise_tui.config.preferences import key_file_path
from rise_tui.key_labels import key_label, keys_of, use_own_keys
from rise_tui.rendering.text import clean, fit, fixed_span, wrap

WIDTH = 80
"""Columns of a plain terminal."""
KINDS = {
    "startCommunicationRobotAct": "Start an act",
    "stopCommunicationRobotAct": "Stop an act",
    "startInteractionRule": "Start a rule",
    "stopInteractionRule": "Stop a rule",
    "raiseEventTopic": "Raise an event",
    "assignValue": "Set a value",
}
_MARKS = frozenset(PUNCTUATION.values())
HOLD, FILLER = "press twice", "filler"
NO_KEY = "no key"


@click.command()
@click.argument("folder", metavar="DIR", required=False)
@click.option(
    "--html",
    metavar="FILE",
    is_flag=False,
    flag_value="-",
    help="Write a page for printing. Without FILE, print it to standard output.",
)
@KEYS
def keys(folder: str | None, html: str | None, keys: str | None) -> None:
    """Print a card with all keys, to lay beside the keyboard: first the scenario's in DIR, then the console's."""
    sys.exit(print_card(folder, html, keys))


class KeyCardEntry(NamedTuple):
    """One function of a key."""

    keys: tuple[str, ...]
    """The keys in people's words; the first is the usual one."""
    title: str
    help: str = ""
    marks: tuple[str, ...] = ()


class KeyCardSection(NamedTuple):
    title: str
    entries: tuple[KeyCardEntry, ...]


def print_card(folder: str | None, html: str | None, keys: str | None) -> int:
    """Print the card, or write it to a file; returns the exit status."""
    path = key_file_path(keys)
    key_file = read_keys(path) if path is not None else KeyFile()
    scenario: Scenario | None = None
    problems = [str(finding) for finding in key_file.problems]
    if folder is not None:
        prepared = load_scenario(SessionOptions(folder))
        if isinstance(prepared, ScenarioProblems):
            problems += prepared.lines
        else:
            scenario = prepared
            problems += map(str, key_file.clashes(scenario.keys))
    if problems:
        for line in (*problems, "no card was made"):
            click.echo(line, err=True)
        return 1
    use_own_keys(key_file.keys)
    title = clean(scenario.title) if scenario is not None else "rise-tui"
    card = tuple(sections(scenario))
    if html is None or html == "-":
        for line in [html_page(title, card)] if html else text_lines(title, card):
            click.echo(line)
        return 0
    try:
        Path(html).write_text(html_page(title, card) + "\n", encoding="utf-8")
    except OSError as error:
        click.echo(f"{html} cannot be written: {error.strerror or error}", err=True)
        return 1
    return 0


def sections(scenario: Scenario | None) -> Iterator[KeyCardSection]:
    """Return the functions of the scenario's keys, by kind, then the console's keys."""
    for function, title in KINDS.items() if scenario is not None else ():
        assert scenario is not None
        bindings = [binding for binding in scenario.keys.values() if binding.function == function]
        entries = [_scenario_entry(scenario, binding) for binding in bindings]
        if function.startswith("start"):
            known = scenario.acts if "RobotAct" in function else scenario.rules
            bound = {binding.behavior for binding in bindings}
            entries += [KeyCardEntry((), name, marks=_act_marks(scenario, name)) for name in known if name not in bound]
        if entries:
            yield KeyCardSection(title, tuple(entries))
    for scope, title in KEY_SCOPES:
        actions = tuple(
            KeyCardEntry(tuple(map(printed_key, keys_of(action))), action.title, action.help)
            for action in actions_in(scope)
            if scope != "console" or keys_of(action)
        )
        if actions:
            yield KeyCardSection(
                title if scope in ("everywhere", "console", "edit") else f"While {title} has the keys", actions
            )
    rest = tuple(KeyCardEntry((), action.title, action.help) for action in actions_in("console") if not keys_of(action))
    if rest:
        yield KeyCardSection("In the command palette", rest)


def _scenario_entry(scenario: Scenario, binding: KeyBinding) -> KeyCardEntry:
    marks = _act_marks(scenario, binding.behavior) if binding.function == "startCommunicationRobotAct" else ()
    behavior = clean(describe_behavior(binding.function, binding.task_behavior))
    return KeyCardEntry(
        (printed_key(binding.key),), f"{binding.title}  ({behavior})" if binding.title else behavior, marks=marks
    )


def _act_marks(scenario: Scenario, act: str) -> tuple[str, ...]:
    settings = scenario.settings_of(act)
    return (HOLD,) * settings.hold + (FILLER,) * settings.filler


def printed_key(key: str) -> str:
    """A key as printed on the keyboard: `F9`, `ctrl+g`, `?`, `shift+up`."""
    if key.startswith("ctrl+"):
        return f"ctrl+{key_label(key[5:])}"
    return key if key.startswith("shift+") or (key.isalpha() and key not in _MARKS) else key_label(key)


def text_lines(title: str, card: tuple[KeyCardSection, ...]) -> Iterator[str]:
    """Plain text that fits a terminal of 80 columns."""
    yield fit(f"{title}: keys", WIDTH).rstrip()
    for section in card:
        yield ""
        yield section.title.upper()
        for entry in section.entries:
            yield from _entry_lines(entry)


def _entry_lines(entry: KeyCardEntry) -> Iterator[str]:
    keys = fixed_span("  ".join(entry.keys) or NO_KEY, 18)[0]
    marks = f"  ({', '.join(entry.marks)})" if entry.marks else ""
    if not entry.help:
        yield f"  {keys}{fit(entry.title, WIDTH - 20 - len(marks)).rstrip()}{marks}"
        return
    rows = wrap(entry.help, WIDTH - 46)
    yield f"  {keys}{fixed_span(entry.title, 25)[0]} {rows[0]}".rstrip()
    for row in rows[1:]:
        yield f"{' ' * 46}{row}"


_STYLE = """
@page { size: A4; margin: 12mm; }
* { box-sizing: border-box; }
body { font: 10pt/1.35 "DejaVu Sans", Verdana, sans-serif; color: #000; background: #fff; margin: 0 auto;
  max-width: 186mm; }
h1 { font-size: 15pt; margin: 0 0 4mm; }
h2 { font-size: 10.5pt; margin: 0 0 1mm; border-bottom: 1px solid #000; break-after: avoid; }
.card { columns: 2; column-gap: 8mm; }
section { margin: 0 0 4mm; }
dl { margin: 0; }
div { display: grid; grid-template-columns: 26mm 1fr; gap: 2mm; padding: .5mm 0; break-inside: avoid; }
dt { margin: 0; }
dd { margin: 0; overflow-wrap: anywhere; }
kbd { font: bold 9pt "DejaVu Sans Mono", Consolas, monospace; border: 1px solid #000; border-radius: 2px;
  padding: 0 1mm; margin: 0 .5mm .5mm 0; display: inline-block; }
small { display: block; font-size: 8pt; }
em { font-size: 8pt; font-style: normal; border: 1px dashed #000; padding: 0 1mm; margin-left: 1mm; }
"""


def html_page(title: str, card: tuple[KeyCardSection, ...]) -> str:
    """A self-contained HTML page for A4 paper, in black and white."""
    parts = [
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}: keys</title>',
        f'<style>{_STYLE}</style>\n</head>\n<body>\n<h1>{escape(title)}: keys</h1>\n<main class="card">',
    ]
    for section in card:
        parts.append(f"<section><h2>{escape(section.title)}</h2>\n<dl>")
        parts += map(_entry_html, section.entries)
        parts.append("</dl></section>")
    return "\n".join((*parts, "</main>\n</body>\n</html>"))


def _entry_html(entry: KeyCardEntry) -> str:
    keys = "".join(f"<kbd>{escape(key)}</kbd>" for key in entry.keys) or NO_KEY
    marks = "".join(f"<em>{escape(mark)}</em>" for mark in entry.marks)
    more = f"<small>{escape(entry.help)}</small>" if entry.help else ""
    return f"<div><dt>{keys}</dt><dd>{escape(entry.title)}{marks}{more}</dd></div>"
