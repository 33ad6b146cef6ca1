"""Reads InteractionRules (paper, section 4.2.2; semantics.md 5; docs/reference/rules.md)."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from functools import partial
from typing import get_args

from msgspec.structs import replace

from rise_engine.base.nearest_name import suggest
from rise_engine.base.text import BLANKS
from rise_engine.expression import Expression
from rise_engine.scenario.diagnostics import Diagnostics, unknown_code
from rise_engine.scenario.draft import ForeignEnd, Mention, ScenarioDraft
from rise_engine.scenario.files.xml import XmlFile
from rise_engine.scenario.grammar import form_of
from rise_engine.scenario.model import (
    ActOutcome,
    Block,
    Rule,
    SourceLocation,
    State,
    Transition,
    functions_in,
    normal_topic,
)
from rise_engine.scenario.reading.blocks import BlockReader
from rise_engine.scenario.reading.element_reader import read_delay
from rise_engine.scenario.reading.graph import component_numbers
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_writing import RULE_WRAPPERS

_NUMBER = re.compile(r"\s*[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\s*\Z", re.ASCII)
TOO_SHORT = 0.05
"""Seconds. A rule that loops faster than this floods the record and every console."""
_TRIGGERS = ("eventTopic", "ended", "after")
_OUTCOMES: tuple[ActOutcome, ...] = get_args(ActOutcome)


def read_rules(file: XmlFile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Read every rule of a file into `draft`."""
    _RuleReader(file, draft, diagnostics).read_rules()


class _RuleReader(BlockReader):
    def __init__(self, file: XmlFile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
        super().__init__(file, draft, diagnostics)
        self.targets: list[tuple[str, Element]] = []
        """The targets in the current rule."""
        self.short: list[tuple[str, str, Element]] = []
        """Its transitions after less than TOO_SHORT: state, target, element."""
        self.shared: list[tuple[str, Element, list[tuple[Transition, Element]]]] = []
        """Its transitions that several states share: the states' names as written, the element, the transitions."""
        self.doubtful: set[SourceLocation] = set()
        """Its transitions whose trigger has an error, so that its meaning is unknown."""
        self.unknown_states: list[tuple[Element, str, str]] = []
        """Names of missing states: element, attribute, name."""

    def read_rules(self) -> None:
        self.read_parts("InteractionRule", RULE_WRAPPERS, self.draft.rule_definitions, self.read_rule)

    def read_rule(self, element: Element) -> Rule | None:
        self.targets.clear()
        self.short.clear()
        self.shared.clear()
        self.doubtful.clear()
        self.unknown_states.clear()
        self.check_attributes(element)
        self.check_no_text(element)
        name = (self.read_meant(element, "name") or "").strip()
        if not name:
            self.report_missing(["name"], element, 'a rule needs a name: <InteractionRule name="..." initial="...">')
            self.draft.unreadable_parts.add("rules")
        states: dict[str, State] = {}
        unread: set[str] = set()  # including misspelt names of states
        for child in element:
            if child.tag == "transitions":
                self.read_shared(child)
                continue
            if child.tag != "State":
                self.report_misplaced(child, element, form_of("InteractionRule").children)
                unread.update(child.attributes.values())
                continue
            state = self.read_state(child)
            if state is None:
                unread.update(child.attributes.values())
                continue
            if state.id in states:
                message = f"there is another state `{state.id}` in line {states[state.id].location.line}"
                self.report_value("duplicate-state", child, "id", message)
            else:
                states[state.id] = state
        self.add_shared(states)
        initial = self.read_initial(element, states)
        for target, transition in self.targets:
            if target not in states:
                self.unknown_states.append((transition, "target", target))
        for transition, attribute, target in self.unknown_states if self.file.is_complete(element) else ():
            if target not in unread:
                self.report_unknown_state(transition, attribute, target, states)
        priority = self.read_priority(element)
        self.check_short_loops(states)
        self.check_own_ends(states)
        for state in states.values():
            self.check_order(state)
        # A rule without a valid initial state still exists, so that others may name it.
        return Rule(name, initial or "", states, priority, self.file.element_location(element)) if name else None

    def read_initial(self, element: Element, states: dict[str, State]) -> str | None:
        initial = element.get("initial")
        has_states = (
            bool(states) or any(child.tag != "transitions" for child in element) or not self.file.is_complete(element)
        )
        if not has_states:
            self.report_error("no-states", element, "this rule has no states")
        if initial is None:
            example = next(iter(states), "...")
            self.report_missing(["initial"], element, f'a rule says where it begins: initial="{example}"')
            return None
        initial = initial.strip()
        if initial in states:
            return initial
        if has_states:
            self.unknown_states.append((element, "initial", initial))
        return None

    def report_unknown_state(self, element: Element, attribute: str, name: str, states: dict[str, State]) -> None:
        code, near = unknown_code("unknown-state", name, states), suggest(name, states)
        self.report_value(code, element, attribute, f"there is no state `{name}` in this rule", near)

    def read_priority(self, element: Element) -> float:
        text = element.get("priority")
        if text is None:
            return 0
        value = float(text) if _NUMBER.match(text) else math.nan
        if not math.isfinite(value):
            self.report_value("wrong-type", element, "priority", f"priority is a number; `{text}` is not")
            return 0
        return int(value) if value.is_integer() else value

    def check_short_loops(self, states: dict[str, State]) -> None:
        """Warn of a short `after` in a loop that waits for nothing else."""
        if not self.short:
            return
        targets: dict[str, list[str]] = {}
        for name, state in states.items():
            own = set(_raised_topics(state.on_entry))
            targets[name] = [
                t.target
                for t in state.transitions
                if t.target in states and (t.event in own if t.event is not None else t.after is None or _is_short(t))
            ]
        knot = component_numbers(targets)
        for name, target, element in self.short:
            if name in states and target in states and knot[name] == knot[target]:
                after = element.attributes["after"].strip()
                message = (
                    f"after {after} this transition leads back to `{name}` and waits for nothing else: each round is "
                    f"recorded and sent to every console; wait for at least {1000 * TOO_SHORT:.0f}ms, or for an event"
                )
                self.diagnostics.warning("short-loop", self.file.value_location(element, "after"), message)

    def read_state(self, element: Element) -> State | None:
        attributes = self.check_attributes(element)
        self.check_no_text(element)
        name = attributes.get("id", "").strip()
        if not name:
            self.report_missing(["id"], element, 'a state needs a name: <State id="...">')
        blocks: dict[str, Block] = {}
        transitions: list[Transition] = []
        for child in element:
            tag = child.tag
            if tag == "transition":
                transition = self.read_transition(child)
                if transition is not None:
                    transitions.append(transition)
                    self.note_short(name, transition, child)
            elif tag in ("onEntry", "onExit"):
                if tag in blocks:
                    self.report_error("duplicate-element", child, f"this state has `<{tag}>` twice; join them")
                self.check_attributes(child)
                blocks[tag] = blocks.get(tag, ()) + self.read_block(child)
            else:
                self.report_misplaced(child, element, form_of("State").children)
        if not name:
            return None
        return State(
            name,
            blocks.get("onEntry", ()),
            blocks.get("onExit", ()),
            tuple(transitions),
            self.file.element_location(element),
        )

    def note_short(self, state: str, transition: Transition, element: Element) -> None:
        if transition.target and _is_short(transition):
            self.short.append((state, transition.target, element))

    def read_shared(self, element: Element) -> None:
        """Read `<transitions in="A | B">`: transitions that several states have after their own."""
        names = self.check_attributes(element).get("in")
        self.check_no_text(element)
        if names is None:
            message = '`<transitions>` says which states have them: <transitions in="A | B">'
            self.report_missing(["in"], element, message)
        transitions = []
        for child in element:
            if child.tag != "transition":
                self.report_misplaced(child, element, form_of("transitions").children)
            elif (transition := self.read_transition(child)) is not None:
                transitions.append((transition, child))
        if not len(element):
            self.report_warning("no-effect", element, "this element holds no transitions")
        self.shared.append((names or "", element, transitions))

    def add_shared(self, states: dict[str, State]) -> None:
        """Add the shared transitions to their states."""
        for names, element, transitions in self.shared:
            seen: set[str] = set()
            for name in (part.strip() for part in names.split("|")) if names.strip() else ():
                if name not in states:
                    self.unknown_states.append((element, "in", name))
                elif name in seen:
                    self.report_value("duplicate-state", element, "in", f"the state `{name}` is given twice here")
                else:
                    states[name] = replace(
                        states[name],
                        transitions=(*states[name].transitions, *(transition for transition, _ in transitions)),
                    )
                    for transition, child in transitions:
                        self.note_short(name, transition, child)
                seen.add(name)

    def read_transition(self, element: Element) -> Transition | None:
        attributes = self.check_attributes(element)
        get = attributes.get
        event = get("eventTopic")
        given = [name for name in _TRIGGERS if name in attributes]
        for other in given[1:]:
            message = f"a transition waits for one thing, and this one already has `{given[0]}`; write two transitions"
            self.report_attribute("trigger", element, other, message)
        if not given and "cond" not in attributes:
            message = "a transition waits for something: give it eventTopic, ended, after or cond"
            self.report_missing((*_TRIGGERS, "cond"), element, message, "trigger")
        topic: str | None = None
        if event is not None:
            topic = normal_topic(event)
            if topic:
                locate = partial(self.file.value_location, element, "eventTopic")
                self.draft.awaited_topics.append(Mention(topic, locate))
            else:
                self.report_value("trigger", element, "eventTopic", "eventTopic is empty")
        target = self.read_meant(element, "target")
        if target is not None:
            target = target.strip()
            self.targets.append((target, element))
        block = self.read_block(element)
        if target is None and not block and not len(element):
            self.report_warning("no-effect", element, "this transition has neither a target nor functions")
        return Transition(
            event=topic,
            condition=self.read_condition(element, "cond"),
            after=read_delay(self, element, "after") if "after" in attributes else None,
            target=target,
            block=block,
            location=self.file.element_location(element),
            ended=self.read_ended(element) if "ended" in attributes else None,
            outcomes=self.read_outcomes(element) if "outcome" in attributes else (),
            held=self.read_held(element),
        )

    def read_held(self, element: Element) -> Expression | None:
        """Read `while="..." after="8s"`: the condition that must hold for that time."""
        if "while" in element.attributes and "after" not in element.attributes:
            message = '`while` must hold for some time: add after="8s", or use `cond` for a condition without a time'
            self.report_attribute("trigger", element, "while", message)
        return self.read_condition(element, "while")

    def read_ended(self, element: Element) -> str:
        """Read the act whose end the transition waits for."""
        name = element.attributes["ended"].strip()
        self.draft.act_mentions.append(Mention(name, partial(self.file.value_location, element, "ended")))
        return name

    def read_outcomes(self, element: Element) -> tuple[ActOutcome, ...]:
        """Read `outcome="failed"`, or several: `outcome="failed | stopped"`."""
        if "ended" not in element.attributes:
            message = (
                '`outcome` says how an act has ended; write it together with `ended`: ended="R_X" outcome="failed"'
            )
            self.report_attribute("trigger", element, "outcome", message)
        words = [word.strip(BLANKS) for word in element.attributes["outcome"].split("|")]
        for word in words:
            if word not in _OUTCOMES:
                message = f"an act is `succeeded`, `failed` or `stopped`, not `{word}`"
                self.report_value("wrong-value", element, "outcome", message, suggest(word, _OUTCOMES))
                self.doubtful.add(self.file.element_location(element))
        return tuple(known for known in _OUTCOMES if known in words)

    def check_own_ends(self, states: dict[str, State]) -> None:
        """Note waits of a rule for the end of an act that it never starts itself."""
        started = {
            function.argument
            for state in states.values()
            for block in state.blocks
            for function in functions_in(block)
            if function.name == "startCommunicationRobotAct"
        }
        reported: set[SourceLocation] = set()
        for state in states.values():
            for transition in state.transitions:
                if (
                    transition.ended is not None
                    and transition.ended not in started
                    and transition.location not in reported
                ):
                    reported.add(transition.location)
                    self.draft.foreign_ends.append(ForeignEnd(transition.ended, transition.location))

    def check_order(self, state: State) -> None:
        """Warn of a transition that is never taken, because an earlier one has the same trigger and no condition."""
        always: dict[object, Transition] = {}
        for transition in state.transitions:
            if transition.location in self.doubtful:
                continue
            triggers = tuple(_triggers(transition))
            earlier = [always[trigger] for trigger in triggers if trigger in always]
            if triggers and len(earlier) == len(triggers):
                first = earlier[0].location
                message = (
                    f"never taken in the state `{state.id}`: the transition in line {first.line} has the same trigger "
                    "and no condition"
                )
                self.diagnostics.warning("unreachable-transition", transition.location, message, related=first)
            elif transition.condition is None:
                for trigger in triggers:
                    always.setdefault(trigger, transition)


def _triggers(transition: Transition) -> Iterator[object]:
    """The triggers of a transition; empty: its condition alone triggers it."""
    if transition.ended is not None:
        yield from ((transition.ended, outcome) for outcome in transition.outcomes or _OUTCOMES)
    elif not transition.is_eventless:
        yield transition.event if transition.event is not None else (transition.after, transition.held)


def _is_short(transition: Transition) -> bool:
    """Whether a transition waits for hardly any time."""
    after = transition.after
    return after is not None and after.seconds is not None and after.seconds < TOO_SHORT and transition.held is None


def _raised_topics(block: Block) -> Iterator[str]:
    """The topics that a block may raise."""
    return (normal_topic(each.argument) for each in functions_in(block) if each.name == "raiseEventTopic")
