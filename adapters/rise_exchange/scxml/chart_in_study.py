"""Places the rules of a chart in the folder of a study, and checks that they fit what is already there."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import Function, Rule, Scenario, functions_in, normal_topic
from rise_engine.syntax.toml import toml_key
from rise_exchange.scxml.content_translation import FunctionLine, Lines
from rise_exchange.scxml.rules_of_chart import MadeRules

MADE_FROM = "made from "
"""The beginning of the head of a rules file that was made from a chart."""
_KEYS = "1234567890"


def file_name(made: MadeRules) -> str:
    """The name of the rules file: the rule's name, with `_` for everything except letters and digits."""
    return f"{re.sub(r'[^a-z0-9]+', '_', made.name.lower()).strip('_') or 'chart'}.xml"


def is_made_file(text: str) -> bool:
    """Whether a rules file was made from a chart, and may be made again."""
    return re.match(rf"<!--\s*{MADE_FROM}", text) is not None


def outside_events(made: MadeRules) -> list[str]:
    """The events that the rules wait for and that neither they nor their acts raise or send."""
    own = {*made.raised, *(helper.place.event for helper in made.helpers)}
    ends = tuple(f"{act}_" for act in called_acts(made))
    return [event for event in made.awaited if event not in own and not event.startswith(ends)]


def called_acts(made: MadeRules) -> list[str]:
    """The acts that the rules start or stop, by name."""
    blocks = [state.on_entry for state in made.states]
    blocks += [way.lines for state in made.states for way in state.transitions]
    names = {line.argument for block in blocks for line in _lines(block) if line.name.endswith("CommunicationRobotAct")}
    return sorted(names)


def _lines(block: Lines) -> Iterator[FunctionLine]:
    for line in block:
        if isinstance(line, FunctionLine):
            yield line
        else:
            for _, inner in line.branches:
                yield from _lines(inner)


def new_study_files(made: MadeRules, title: str, rules: str) -> dict[str, str]:
    """A study for the rules: a key that starts them, one key for each event from outside while there are digits, and
    their acts. Each act says its name until somebody writes it.

    :param rules: the text of the rules file.
    """
    lines = [f"title = {_toml(title)}", 'robot = "generic"', "", "[keys]"]
    lines.append(f"b = {{ rule = {_toml(made.name)}, label = {_toml('begin')} }}")
    for key, event in zip(_KEYS, outside_events(made), strict=False):
        lines.append(f"{toml_key(key)} = {{ event = {_toml('/' + event)}, label = {_toml(event)} }}")
    return {
        "scenario.toml": "\n".join([*lines, ""]),
        "acts/acts.xml": _acts_text(called_acts(made)),
        f"rules/{file_name(made)}": rules,
        "memory.json": "{}\n",
    }


def _acts_text(names: list[str]) -> str:
    acts = "".join(
        f"\n<Dialog name={quoteattr(name)}>\n  <Speech>\n    <actionID>1</actionID>\n"
        f"    <message>{escape(name.replace('{', '{{').replace('}', '}}'))}</message>\n  </Speech>\n</Dialog>\n"
        for name in names
    )
    head = "<!-- What the robot says and does: until it is written, an act says its name. -->"
    return f"{head}\n<Dialogs>\n{acts}\n</Dialogs>\n"


def check_neighbours(made: MadeRules, scenario: Scenario, replaced: str, diagnostics: Diagnostics) -> None:
    """Report where the study would interfere with a chart's own variables and events.

    :param replaced: the rules file that is replaced; its content does not count.
    """
    own = {made.name, *(helper.rule for helper in made.helpers)}
    own |= {name for name, rule in scenario.rules.items() if rule.location.file == replaced}
    sent = set(made.exclusive)
    keys = set(made.keys)
    for rule in scenario.rules.values():
        if rule.name in own:
            continue
        for state in rule.states.values():
            for way in state.transitions:
                if way.event in made.raised:
                    message = f"`/{way.event}` is for the chart itself, which raises it; this rule would take it away"
                    diagnostics.error("shared-event", way.location, message)
        for function in _functions(rule):
            _check_function(function, keys, sent, diagnostics)
    for binding in scenario.keys.values():
        if binding.function == "raiseEventTopic" and normal_topic(binding.behavior) in sent:
            message = f"`/{normal_topic(binding.behavior)}` is sent by the chart itself; a key cannot send it, too"
            diagnostics.error("shared-event", binding.location, message)


def _check_function(function: Function, keys: set[str], sent: set[str], diagnostics: Diagnostics) -> None:
    topic = normal_topic(function.argument) if function.name == "raiseEventTopic" else None
    if topic in sent:
        diagnostics.error("shared-event", function.location, f"`/{topic}` is sent by the chart itself, and only by it")
    if function.assignment is not None and function.assignment.key in keys:
        message = f"`{function.assignment.key}` is a variable of the chart; nothing else may set it"
        diagnostics.error("shared-key", function.location, message)


def _functions(rule: Rule) -> Iterator[Function]:
    for state in rule.states.values():
        for block in (state.on_entry, state.on_exit, *(way.block for way in state.transitions)):
            yield from functions_in(block)


def _toml(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
