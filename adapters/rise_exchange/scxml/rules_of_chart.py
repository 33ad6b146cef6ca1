"""Converts a flat chart to rules: the knowledge in each state, the effect of each transition, and the rules."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from msgspec import Struct

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.model import SourceLocation
from rise_exchange.scxml.chart import ERROR, AssignNode, Chart, SendPlace
from rise_exchange.scxml.content_translation import (
    ContentTranslator,
    FunctionLine,
    IfLines,
    Lines,
    SendHelper,
    joined,
    pending_name,
    waiting_name,
)
from rise_exchange.scxml.flattening import (
    FlatChart,
    FlatState,
    FlatTransition,
    all_transitions,
    external_events,
    flatten,
)
from rise_exchange.scxml.interpretation import matches
from rise_exchange.scxml.reading import read_chart
from rise_exchange.scxml.script import UNDECLARED, ChartRefusedError
from rise_exchange.scxml.translation import (
    UNDEFINED,
    Knowledge,
    Possible,
    TranslatedValue,
    all_hold,
    translate_condition,
    value_beforehand,
)

_STRUCTURE = ("chart", "namespace")
"""Errors of a chart that prevent further checks. All other diagnostics are reported together."""
START = "Start"
"""The state of the rule in which the chart's variables get their values."""
_IDLE = Possible(frozenset({"boolean"}))


class MadeTransition(Struct, frozen=True):
    """A transition of a made state."""

    event: str | None
    condition: str
    """Empty: none."""
    target: str
    lines: Lines
    entering: Lines
    """The lines after those, for entering the target."""


class MadeState(Struct):
    """A state of the rule."""

    id: str
    comment: str
    on_entry: Lines
    transitions: list[MadeTransition]


class MadeRules(Struct):
    """A chart as rules: the rule itself, and one for each delayed send."""

    name: str
    chart: Chart
    flat: FlatChart
    initial: str
    states: list[MadeState]
    helpers: list[SendHelper]
    exclusive: list[str]
    """Events that only the helpers may send; otherwise a helper might be needed again too early."""
    keys: list[str]
    """The memory keys that the rules set."""
    raised: list[str]
    """The events that they raise, without slash."""
    awaited: list[str]
    """The events that they wait for."""


def rules_of_chart(
    source: SourceFile, diagnostics: Diagnostics, name: str = "", outside: tuple[str, ...] = ()
) -> MadeRules | None:
    """Make rules from an SCXML document; None after diagnostics.

    :param source: the document.
    :param diagnostics: receives everything that cannot be expressed exactly.
    :param name: the rule's name; empty: the chart's own name, else the file's.
    :param outside: events from outside that the chart does not name, but may receive through `*` or a part of a name.
    """
    chart = read_chart(source, diagnostics)
    if chart is None or any(each.code in _STRUCTURE for each in diagnostics.sorted()):
        return None
    chart.outside = outside
    try:
        flat = flatten(chart)
    except ChartRefusedError as error:
        assert error.location is not None
        diagnostics.error(error.code, error.location, str(error))
        return None
    own_name = name or chart.name or re.sub(r"\.[^.]*\Z", "", source.name.rpartition("/")[2])
    made = _RuleMaker(chart, flat, own_name, diagnostics).make()
    return None if diagnostics.errors else made


class _RuleMaker:
    def __init__(self, chart: Chart, flat: FlatChart, name: str, diagnostics: Diagnostics) -> None:
        self.chart = chart
        self.flat = flat
        self.name = name
        self.diagnostics = diagnostics
        self.helpers = _helpers(dict.fromkeys(chart.places, 1), name)
        self.transitions = list(all_transitions(chart.root))
        self.awaits_errors = any(matches(transition, ERROR) for transition in self.transitions)
        self.is_final = False
        """Whether the knowledge is final, so that diagnostics count."""
        self.translator = ContentTranslator(self.helpers, self.report, follows_values=True)
        self.seen: set[str] = set()
        """The possible events."""
        self.known: dict[FlatState, Knowledge] = {}
        alone = {place.event: place for place in chart.places}
        several = [place for place in chart.places if alone[place.event] is not place]
        self.alone = {event: place for event, place in alone.items() if event not in {each.event for each in several}}
        """The `<send>` of each event that only one `<send>` sends."""
        self.is_exclusive = False
        """Whether to assume that nothing else sends those events, so that each comes from its `<send>`."""
        self.is_refused = False
        """Whether too many events may be pending."""

    def report(self, code: str, location: SourceLocation, message: str) -> None:
        self.is_refused = self.is_refused or code == "pending"
        if self.is_final:
            self.diagnostics.error(code, location, message)

    # --- what is known ---

    def make(self) -> MadeRules:
        if self.chart.places:
            self.helpers = self.needed_helpers()
        self.translator = ContentTranslator(self.helpers, self.report)
        self.follow_all()
        self.is_final = True
        self.check_conditions()
        return self.write()

    def needed_helpers(self) -> list[SendHelper]:
        """Return as many rules for each `<send>` as it may need together. This follows the values of variables; the
        rules do not, so that they contain each condition of the chart."""
        need = self.most_pending()
        if self.is_refused:
            self.is_exclusive = True
            need = self.most_pending()
        if self.is_refused:  # again, for the diagnostics
            self.is_final = True
            self.most_pending()
            self.is_final = False
        return _helpers(need, self.name)

    def most_pending(self) -> dict[SendPlace, int]:
        """Return the number of possibly pending events of each `<send>`; `is_refused`: too many."""
        self.is_refused = False
        self.follow_all()
        need = dict.fromkeys(self.chart.places, 1)
        for state, known in self.known.items():
            for place in need:
                need[place] = max(need[place], known[pending_name(place)].most)
            for transition, before, _ in self.live(state):
                behind = self.translator.blocks((*transition.leaving, *transition.entering), before)[1]
                for place in need:
                    need[place] = max(need[place], behind[pending_name(place)].most)
        return need

    def follow_all(self) -> None:
        """Determine the knowledge everywhere, with all possible events."""
        self.seen = external_events(self.chart)
        before = (-1, -1)
        while before != (now := (len(self.translator.raised), len(self.translator.raised_inside))):
            before = now
            self.seen |= self.translator.raised
            self.follow()

    def follow(self) -> None:
        """Determine the knowledge in each flat state, from the start until nothing changes."""
        first = self.flat.states[0]
        self.known = {first: self.start()[2]}
        waiting = [first]
        while waiting:
            state = waiting.pop()
            for transition, before, _ in self.live(state):
                _, behind = self.translator.blocks((*transition.leaving, *transition.entering), before)
                target = transition.target
                new = joined(self.known[target], behind) if target in self.known else behind
                if new != self.known.get(target):
                    self.known[target] = new
                    if target not in waiting:
                        waiting.append(target)

    def start(self) -> tuple[Lines, Lines, Knowledge]:
        """Write the start of the rule: no helper runs, the variables get their values, the chart is entered."""
        lines: Lines = ()
        known: dict[str, Possible] = {}
        for helper in self.helpers:
            lines += (IfLines(((f"defined({helper.key})", (IfLines(((helper.key, helper.stop[:1]),)),)),)),)
            lines += helper.stop[1:]
            known[pending_name(helper.place)] = known[waiting_name(helper.place)] = _IDLE
        now: Knowledge = known
        for variable in self.chart.variables:
            if variable.value is None:
                if not self.translator.is_refused_name(variable.name, variable.location):
                    lines += (FunctionLine("assignValue", f"{variable.name} = null"),)
                now = {**now, variable.name: UNDEFINED}
                continue
            node = AssignNode(variable.name, variable.value, variable.location, declares=True)
            more, now = self.translator.assign(node, now)
            if more is None:
                self.report("data", variable.location, f"`{variable.name}` has no value that could be worked out")
            lines += more or ()
        more, now = self.translator.blocks((self.chart.scripts,), now)
        entering, now = self.translator.blocks(self.flat.first_blocks, now)
        return lines + more, entering, now

    def live(self, state: FlatState) -> Iterator[tuple[FlatTransition, Knowledge, list[TranslatedValue]]]:
        """Return the possible transitions, with the knowledge before them and their conditions."""
        decided: set[str | None] = set()
        for transition in state.transitions:
            event = transition.event
            if event in decided or None in decided or (event is not None and event not in self.seen):
                continue
            known = self.with_event(self.known[state], event)
            conditions = self.conditions(transition, known)
            if conditions is None:
                continue
            if not conditions:
                decided.add(event)
            yield transition, known, conditions

    def with_event(self, known: Knowledge, event: str | None) -> Knowledge:
        """Return the knowledge while an event is handled."""
        if event is None:
            return known
        more = {"_event.name": Possible(frozenset({"text"}), event), "_event.invokeid": UNDEFINED}
        sent = [place for place in self.chart.places if place.event == event]
        more["_event.origin"] = UNDEFINED if not sent else Possible(frozenset({"text"}))
        if self.is_exclusive and event in self.alone and event not in self.translator.raised_inside:
            name = pending_name(self.alone[event])
            more[name] = Possible(_IDLE.kinds, None, max(known[name].most - 1, 0))
        return {**known, **more}

    def conditions(self, transition: FlatTransition, known: Knowledge) -> list[TranslatedValue] | None:
        """Return the conditions that must hold; None: they never do."""
        found: list[TranslatedValue] = []
        for script in transition.conditions:
            assert script.root is not None
            try:
                translated = translate_condition(script.root, known)
            except ChartRefusedError as error:
                if error.code == UNDECLARED and self.awaits_errors:
                    message = f"there is no variable {error} here, so this raises `{ERROR}` each time it is looked at"
                    self.report("condition-error", script.location, f"{message}; conditions of rules raise nothing")
                if error.code == UNDECLARED:
                    return None
                self.report(error.code, script.location, str(error))
                continue
            truth = translated.truth
            if truth is None and self.translator.follows_values:
                value = value_beforehand(script.root, known)
                truth = None if value is None else bool(value.value)
            if truth is False:
                return None
            if truth is None:
                found.append(translated)
        return found

    def check_conditions(self) -> None:
        """Report conditions that are no expressions. They are false, and raise an event that rules cannot see."""
        for transition in self.transitions:
            if transition.condition is not None and transition.condition.root is None and self.awaits_errors:
                message = (
                    f"`{transition.condition.text.strip()}` is not an expression: it is false, and raises `{ERROR}`"
                )
                location = transition.condition.location
                self.report("condition-error", location, f"{message}, which conditions of rules never do")

    # --- the rule ---

    def write(self) -> MadeRules:
        first = self.flat.states[0]
        lines, entering, _ = self.start()
        made = {
            state: MadeState(state.name, _comment(state), (), []) for state in self.flat.states if state in self.known
        }
        awaited: dict[str, None] = {}
        for state, result in made.items():
            for transition, known, conditions in self.live(state):
                before, behind = self.translator.blocks(transition.leaving, known)
                after, behind = self.translator.blocks(transition.entering, behind)
                if transition.target.is_over:
                    after += self.stop_helpers(behind)
                condition = all_hold(conditions) if conditions or transition.event is None else ""
                written = MadeTransition(transition.event, condition, transition.target.name, before, after)
                if transition.event is not None:
                    awaited[transition.event] = None
                result.transitions.append(written)
            if not result.transitions and not state.is_over:  # it waits forever; a rule without a transition would end
                result.transitions.append(MadeTransition(None, "false", state.name, (), ()))
            self.check_endless(state)
        if first.is_over:
            entering += self.stop_helpers(self.known[first])
        states = [self.without_idle_raises(state, awaited) for state in made.values()]
        start = MadeTransition(None, "true", first.name, self.kept(lines, awaited), self.kept(entering, awaited))
        initial = _share_entries(start, states)
        names = {name for known in self.known.values() for name in known if name.isidentifier()}
        keys = [*sorted(names), *(helper.key for helper in self.helpers)]
        raised = sorted(self.translator.raised & set(awaited) | self.translator.raised_inside)
        exclusive = sorted(self.alone) if self.is_exclusive else []
        return MadeRules(
            self.name, self.chart, self.flat, initial, states, self.helpers, exclusive, keys, raised, list(awaited)
        )

    def check_endless(self, state: FlatState) -> None:
        """Refuse an endless circle of unconditional transitions without an event."""
        passed: list[FlatState] = []
        while state not in passed:
            passed.append(state)
            transition = next(iter(self.live(state)), None) if state in self.known else None
            if transition is None or transition[0].event is not None or transition[2]:
                return
            state = transition[0].target
        location = passed[0].transitions[0].location
        self.report("endless", location, "from here, transitions without event or condition lead in an endless circle")

    def stop_helpers(self, known: Knowledge) -> Lines:
        """Cancel pending sends when the chart ends (6.2.4)."""
        return tuple(line for place in self.chart.places for line in self.translator.stop(place, known))

    def without_idle_raises(self, state: MadeState, awaited: dict[str, None]) -> MadeState:
        transitions = [
            MadeTransition(
                transition.event,
                transition.condition,
                transition.target,
                self.kept(transition.lines, awaited),
                self.kept(transition.entering, awaited),
            )
            for transition in state.transitions
        ]
        return MadeState(state.id, state.comment, (), transitions)

    def kept(self, lines: Lines, awaited: dict[str, None]) -> Lines:
        """Return the lines without events that the standard raises automatically and that have no listener."""
        kept: list[FunctionLine | IfLines] = []
        for line in lines:
            if isinstance(line, IfLines):
                kept.append(IfLines(tuple((text, self.kept(inner, awaited)) for text, inner in line.branches)))
            elif line.argument[1:] in awaited or not line.argument.startswith(("/done.state.", "/error.")):
                kept.append(line)
        return tuple(kept)


def _helpers(places: dict[SendPlace, int], rule: str) -> list[SendHelper]:
    """Return the given number of rules for each `<send>`, with unique names."""
    beginning = _slug(rule) if re.match(r"[^\W\d]", rule) else f"_{_slug(rule)}"
    found: list[SendHelper] = []
    for place, count in places.items():
        for _ in range(count):
            name, key = place.event, _slug(place.event)
            number = 1
            while any(
                each.rule == f"{rule} sends {name}" or each.key == f"{beginning}.pending_{key}" for each in found
            ):
                number += 1
                name, key = f"{place.event} {number}", f"{_slug(place.event)}_{number}"
            found.append(SendHelper(place, f"{rule} sends {name}", f"{beginning}.pending_{key}"))
    return found


def _slug(text: str) -> str:
    """Convert a text for use in a key."""
    return re.sub(r"\W", "_", text)


def _comment(state: FlatState) -> str:
    """Describe the chart's active states and its histories' memory, if the name does not show them."""
    active = sorted(state.configuration, key=lambda each: each.order)
    names = " ".join(each.id for each in active) if len(active) > 1 else ""
    for history, saved in sorted(state.history.items(), key=lambda item: item[0].order):
        names += f"; {history.id} remembers {' '.join(each.id for each in saved)}"
    return names.removeprefix("; ")


def _share_entries(start: MadeTransition, states: list[MadeState]) -> str:
    """Move the common end of all transitions into a state to its onEntry.

    :param start: the transition into the first state.
    :return: the rule's first state: that state, if nothing must be done before it.
    """
    by_id = {state.id: state for state in states}
    entering: dict[str, list[Lines]] = {state.id: [] for state in states}
    for transition in (
        start,
        *(transition for state in states for transition in state.transitions if not _stays(state, transition)),
    ):
        entering[transition.target].append(transition.entering)
    for state in states:
        state.on_entry = _common_end(entering[state.id])
    for state in states:
        state.transitions = [
            _joined(transition, () if _stays(state, transition) else by_id[transition.target].on_entry)
            for transition in state.transitions
        ]
    before = _joined(start, by_id[start.target].on_entry).lines
    if not before:
        return start.target
    id = START
    while id in by_id:
        id += "'"
    states.insert(0, MadeState(id, "", before, [MadeTransition(None, "true", start.target, (), ())]))
    return id


def _joined(transition: MadeTransition, end: Lines) -> MadeTransition:
    """Return a transition with all its actions in `lines`, except those that its target now does."""
    entering = transition.entering[: len(transition.entering) - len(end)]
    return MadeTransition(transition.event, transition.condition, transition.target, transition.lines + entering, ())


def _stays(state: MadeState, transition: MadeTransition) -> bool:
    """Whether the rule stays in its state, as a transition without a target does."""
    return transition.event is not None and transition.target == state.id


def _common_end(several: list[Lines]) -> Lines:
    shortest: Any = min(several, key=len, default=())
    count = 0
    while count < len(shortest) and len({lines[-count - 1] for lines in several}) == 1:
        count += 1
    return tuple(shortest[len(shortest) - count :])
