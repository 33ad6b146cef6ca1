"""The rules file of a flattened chart, whose head names source and changes, and its place in a study."""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

from rise_engine.base.text import pluralize
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import Function, Scenario, normal_topic
from rise_engine.syntax.toml import toml_key, toml_value
from rise_exchange.scxml.chart import ChartState
from rise_exchange.scxml.content_translation import FunctionLine, IfLines, Lines, SendHelper
from rise_exchange.scxml.rules_of_chart import MadeRules, MadeState

_WIDTH = 110


def rules_text(made: MadeRules, file: str) -> str:
    """Return the text of the rules file.

    :param made: the rules.
    :param file: the name of the chart's file, for the head.
    """
    head = f"made from {file}: change the chart and convert it again, not this file"
    lines = ["<!--", f"  {_plain(head)}", "", *(f"  {line}" for line in _wrapped(flattening_notes(made))), "-->"]
    lines += ["<InteractionRules>", ""]
    lines += [f"<InteractionRule name={quoteattr(made.name)} initial={quoteattr(made.initial)}>"]
    for state in made.states:
        lines += ["", *_state_lines(state)]
    lines += ["", "</InteractionRule>"]
    for helper in made.helpers:
        lines += ["", *_helper_lines(helper)]
    return "\n".join([*lines, "", "</InteractionRules>", ""])


def flattening_notes(made: MadeRules) -> list[str]:
    """Describe the flattening, in one sentence each."""
    states = list(_inner_states(made.chart.root))
    count = f"{pluralize(len(states), 'state')} of the chart, {pluralize(len(made.states), 'state')} here, "
    notes = [count + pluralize(sum(len(state.transitions) for state in made.states), "transition")]
    notes += _kind_notes(states)
    for descriptor, events in made.flat.widened.items():
        known = [event for event in events if event in made.awaited]
        meant = ", ".join(f"/{event}" for event in known) or "no event that can come"
        notes.append(f"the event `{descriptor}` of the chart means {meant}; other events from outside are not seen")
    for helper in made.helpers:
        place = helper.place
        when = (
            f"after {_time(place.seconds)}" if place.seconds else "after all events that the chart raises, 1 ms later"
        )
        only = "; nothing else may send this event" if place.event in made.exclusive else ""
        notes.append(f"line {place.location.line}: /{place.event} is sent {when}, by the rule {helper.rule}{only}")
    if made.chart.variables or made.keys:
        keys = ", ".join(made.keys)
        notes.append(f"keys of the memory that belong to these rules, and that nothing else may set: {keys}")
    return [*notes, *made.chart.notes]


def _kind_notes(states: list[ChartState]) -> Iterator[str]:
    compound = [state.id for state in states if state.is_compound]
    if compound:
        yield f"states with states inside are gone: {', '.join(compound)}; what they do is in the states inside"
    parallel = [state.id for state in states if state.kind == "parallel"]
    if parallel:
        yield f"parallel states became their product: {', '.join(parallel)}; each state here names one of every region"
    histories = [state.id for state in states if state.kind == "history"]
    if histories:
        yield f"what a history remembers is part of the state here: {', '.join(histories)}"


def _inner_states(state: ChartState) -> Iterator[ChartState]:
    for inner in (*state.histories, *state.children):
        yield inner
        yield from _inner_states(inner)


def _state_lines(state: MadeState) -> Iterator[str]:
    if state.comment:
        yield f"  <!-- {_plain(state.comment)} -->"
    if not (state.on_entry or state.transitions):
        yield f"  <State id={quoteattr(state.id)}/>"
        return
    yield f"  <State id={quoteattr(state.id)}>"
    if state.on_entry:
        yield "    <onEntry>"
        yield from _function_lines(state.on_entry, 6)
        yield "    </onEntry>"
    for transition in state.transitions:
        attributes = f" eventTopic={quoteattr('/' + transition.event)}" if transition.event is not None else ""
        attributes += f" cond={quoteattr(transition.condition)}" if transition.condition else ""
        if transition.event is None or transition.target != state.id:
            attributes += f" target={quoteattr(transition.target)}"
        if transition.lines:
            yield f"    <transition{attributes}>"
            yield from _function_lines(transition.lines, 6)
            yield "    </transition>"
        elif "target" in attributes or transition.target != state.id:
            yield f"    <transition{attributes}/>"
        else:  # has no effect, but skips the transitions after it
            yield f"    <transition{attributes} target={quoteattr(state.id)}/>"
    yield "  </State>"


def _function_lines(lines: Lines, indent: int) -> Iterator[str]:
    blanks = " " * indent
    for line in lines:
        if isinstance(line, FunctionLine):
            yield f"{blanks}<function {line.name}={quoteattr(line.argument)}/>"
        elif isinstance(line, IfLines):
            yield from _if_lines(line, blanks)


def _if_lines(line: IfLines, blanks: str) -> Iterator[str]:
    """Write an `<if>` with its further branches inside: a later `<else>` could be read as that of an outer one."""
    (condition, inner), *others = line.branches
    yield f"{blanks}<if cond={quoteattr(condition or 'true')}>"
    yield from _function_lines(inner, len(blanks) + 2)
    is_ambiguous = bool(inner) and isinstance(inner[-1], IfLines)
    for condition, inner in others:
        if is_ambiguous:
            yield f"{blanks}  <!-- check: allow ambiguous-else: the outer one is meant -->"
        is_ambiguous = False
        tag = "else" if condition is None else "elseif"
        cond = f" cond={quoteattr(condition)}" if condition is not None else ""
        yield f"{blanks}  <{tag}{cond}>"
        yield from _function_lines(inner, len(blanks) + 4)
        yield f"{blanks}  </{tag}>"
    yield f"{blanks}</if>"


def _helper_lines(helper: SendHelper) -> Iterator[str]:
    after = _time(helper.place.seconds or 0.001)
    yield f"<!-- line {helper.place.location.line} -->"
    yield f'<InteractionRule name={quoteattr(helper.rule)} initial="Waiting">'
    yield '  <State id="Waiting">'
    yield f'    <transition after="{after}" target="Sent"/>'
    yield "  </State>"
    yield '  <State id="Sent">'
    yield "    <onEntry>"
    yield f"      <function assignValue={quoteattr(f'{helper.key} = false')}/>"
    yield f"      <function raiseEventTopic={quoteattr('/' + helper.place.event)}/>"
    yield "    </onEntry>"
    yield "  </State>"
    yield "</InteractionRule>"


def _time(seconds: float) -> str:
    return f"{seconds:.6f}".rstrip("0").rstrip(".") + "s" if seconds >= 1 else f"{round(seconds * 1000, 3):g}ms"


def _wrapped(sentences: list[str]) -> Iterator[str]:
    for sentence in sentences:
        line = "-"
        for word in _plain(sentence).split():
            if len(line) + len(word) >= _WIDTH:
                yield line
                line = " "
            line += f" {word}"
        yield line


def _plain(text: str) -> str:
    """A text that is valid in a comment of XML."""
    return re.sub(r"-(?=-)|-\Z", "- ", " ".join(text.split())).rstrip()


MADE_FROM = "made from "
"""The start of the head of a rules file made from a chart."""
_KEYS = "1234567890"


def file_name(made: MadeRules) -> str:
    """The name of the rules file: the rule's name, with `_` for everything except letters and digits."""
    return f"{re.sub(r'[^a-z0-9]+', '_', made.name.lower()).strip('_') or 'chart'}.xml"


def is_made_file(text: str) -> bool:
    """Whether a rules file was made from a chart, and may be made again."""
    return re.match(rf"<!--\s*{MADE_FROM}", text) is not None


def external_events(made: MadeRules) -> list[str]:
    """Return the events that the rules wait for and that neither they nor their acts raise or send."""
    own = {*made.raised, *(helper.place.event for helper in made.helpers)}
    ends = tuple(f"{act}_" for act in called_acts(made))
    return [event for event in made.awaited if event not in own and not event.startswith(ends)]


def called_acts(made: MadeRules) -> list[str]:
    """The acts that the rules start or stop, by name."""
    blocks = [state.on_entry for state in made.states]
    blocks += [transition.lines for state in made.states for transition in state.transitions]
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
    """Return a study for the rules: a key that starts them, keys for events from outside as far as there are digits,
    and their acts. Each act says its name until it is written.

    :param rules: the text of the rules file.
    """
    lines = [f"title = {toml_value(title)}", 'robot = "generic"', "", "[keys]"]
    lines.append(f"b = {{ rule = {toml_value(made.name)}, label = {toml_value('begin')} }}")
    for key, event in zip(_KEYS, external_events(made), strict=False):
        lines.append(f"{toml_key(key)} = {{ event = {toml_value('/' + event)}, label = {toml_value(event)} }}")
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
            for transition in state.transitions:
                if transition.event in made.raised:
                    message = (
                        f"`/{transition.event}` is for the chart itself, which raises it; this rule would take it away"
                    )
                    diagnostics.error("shared-event", transition.location, message)
        for function in rule.functions:
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
