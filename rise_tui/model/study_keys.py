"""The keys of a study: what each is called, and which of them a running rule waits for. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

from rise_engine.expression import Assignment, Environment, EvaluationError, Expression, LanguageError, assigned_entry
from rise_engine.scenario.model import KeyBinding, Rule, Scenario, Transition, normal_topic
from rise_tui.model.conditions import holds
from rise_tui.model.rule_text import events_raised_by, functions_of_rule, parse_engine_event
from rise_tui.rendering.text import format_value

ACT, RULE, EVENT, SET = "startCommunicationRobotAct", "startInteractionRule", "raiseEventTopic", "assignValue"
_STARTS = {"_end", "_succeeded"}
"""Endings that somebody brings about by starting the act; nobody starts one so that it fails."""


def key_title(binding: KeyBinding) -> str:
    """What a key is called: the author's label, or a word that is made of what it does."""
    if binding.title:
        return binding.title
    name = binding.behavior.strip()
    match binding.function:
        case "assignValue":
            return _set_title(name)
        case "raiseEventTopic":
            return normal_topic(name).replace("_", " ").replace("/", " ")
        case "stopCommunicationRobotAct" | "stopInteractionRule":
            return f"stop {short_title(name)}"
        case _:
            return short_title(name)


def short_title(name: str) -> str:
    """The name of an act or a rule as one reads it: `R_Task1_Intro` is `Task1 Intro`."""
    return name.removeprefix("R_").replace("_", " ") or name


def _set_title(text: str) -> str:
    """`understood = true` is `understood`, `mood = 'good'` is `mood good`."""
    assignment = _assignment(text)
    if assignment is None:
        return text
    try:
        value = assignment.evaluate(Environment({}), frozenset())
    except EvaluationError:
        return text
    name = assignment.key.replace("_", " ")
    if assignment.keys and assignment.bare_word is None:
        return text
    if not isinstance(value, bool):
        return f"{name} {format_value(value)}"
    return name if value else f"not {name}"


class StudyKeys:
    """Knows of each key of a scenario what it could bring about."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._raised = {name: events_raised_by(rule) for name, rule in scenario.rules.items()}
        self._by_topic: dict[str, list[KeyBinding]] = {}
        """Keys that raise a topic: themselves, or by a rule that they start."""
        self._starts: dict[tuple[str, str], KeyBinding] = {}
        self._sets: list[KeyBinding] = []
        for key in scenario.keys.values():
            if key.function == EVENT:
                self._by_topic.setdefault(normal_topic(key.behavior), []).append(key)
            elif key.function in (ACT, RULE):
                self._starts.setdefault((key.function, key.behavior), key)
                for topic in self._raised.get(key.behavior, ()) if key.function == RULE else ():
                    self._by_topic.setdefault(topic, []).append(key)
            elif key.function == SET:
                self._sets.append(key)
        answers = self._answers()
        keys = list(scenario.keys.values())
        self.answer_keys = tuple(key for key in keys if key.key in answers)
        """Those that some state of a rule may wait for, in the order of the file."""
        self.other_keys = tuple(key for key in keys if key.key not in answers and key.function != ACT)
        """The other keys that start no act."""
        self.act_keys = tuple(key for key in keys if key.key not in answers and key.function == ACT)

    def keys_for(
        self, transition: Transition, memory: Mapping[str, Any], running: Iterable[str] = ()
    ) -> Iterator[KeyBinding]:
        """The keys that would make a rule take this way now. `running`: acts and rules that run or wait already."""
        if transition.event is None:
            if transition.after is None and transition.condition is not None:
                yield from self.keys_setting(transition.condition, memory)
            return
        if not holds(transition.condition, memory):
            return
        for key in self.keys_raising(transition.event):
            if key.function != RULE or key.behavior not in running:
                yield key
        found = parse_engine_event(self._scenario, transition.event)
        if found is not None and found[1] in _STARTS and found[0] not in running:
            for function in (ACT, RULE):
                if (starter := self._starts.get((function, found[0]))) is not None:
                    yield starter

    def keys_raising(self, topic: str | None) -> Sequence[KeyBinding]:
        """The keys that raise a topic (without its slash): themselves, or by a rule that they start. In file order."""
        return self._by_topic.get(topic, ()) if topic is not None else ()

    def keys_setting(self, condition: Expression, memory: Mapping[str, Any]) -> Iterator[KeyBinding]:
        """The keys that set a value with which a condition holds that does not hold now."""
        if holds(condition, memory):
            return
        heads = {key.partition(".")[0] for key in condition.keys}
        for key in self._sets:
            assignment = _assignment(key.behavior)
            if assignment is None or assignment.key.partition(".")[0] not in heads:
                continue
            try:
                value = assignment.evaluate(Environment(memory), self._scenario.known_keys)
                changed, value = assigned_entry(memory, assignment.key, value)
                if condition.as_condition({**memory, changed: value}):
                    yield key
            except EvaluationError:
                continue

    def expected_keys(
        self, states: Mapping[str, str | None], memory: Mapping[str, Any], running: Iterable[str] = ()
    ) -> frozenset[str]:
        """The keys (as Textual spells them) that a running rule waits for. `states`: each rule's state."""
        busy = {*running, *states}
        return frozenset(
            key.key
            for name, state in states.items()
            for transition in transitions_of(self._scenario, name, state)
            for key in self.keys_for(transition, memory, busy)
        )

    def _answers(self) -> set[str]:
        """Keys that could be awaited in some state, whatever the memory holds."""
        started = {name for rule in self._scenario.rules.values() for name in _acts_started(rule)}
        found: set[str] = set()
        for rule in self._scenario.rules.values():
            for state in rule.states.values():
                for transition in state.transitions:
                    found |= {key.key for key in self._possible(rule.name, transition, started)}
        return found

    def _possible(self, rule: str, transition: Transition, started: set[str]) -> Iterator[KeyBinding]:
        if transition.event is not None:
            raising = self.keys_raising(transition.event)
            yield from (key for key in raising if key.function != RULE or key.behavior != rule)
            found = parse_engine_event(self._scenario, transition.event)
            starter = self._starts.get((ACT, found[0])) if found is not None and found[1] in _STARTS else None
            if starter is not None and starter.behavior not in started:
                yield starter
        elif transition.after is None and transition.condition is not None:
            heads = {key.partition(".")[0] for key in transition.condition.keys}
            for key in self._sets:
                assignment = _assignment(key.behavior)
                if assignment is not None and assignment.key.partition(".")[0] in heads:
                    yield key


def transitions_of(scenario: Scenario, rule: str, state: str | None) -> tuple[Transition, ...]:
    """The ways out of a state; none when it is not known."""
    known = scenario.rules.get(rule)
    found = known.states.get(state) if known is not None and state is not None else None
    return found.transitions if found is not None else ()


def _acts_started(rule: Rule) -> Iterator[str]:
    return (function.argument for function in functions_of_rule(rule) if function.name == ACT)


@lru_cache(256)
def _assignment(text: str) -> Assignment | None:
    try:
        return Assignment.parse(text)
    except LanguageError:
        return None
