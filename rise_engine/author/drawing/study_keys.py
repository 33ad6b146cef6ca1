"""The keys of a study: their titles, and the keys that running rules wait for. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

from rise_engine.author.drawing.rule_text import events_raised_by, find_event_source, is_met
from rise_engine.base.typed_values import format_value
from rise_engine.expression import Assignment, Environment, EvaluationError, Expression, LanguageError
from rise_engine.scenario.model import KeyBinding, Scenario, Transition, normal_topic

ACT, RULE, EVENT, SET = "startCommunicationRobotAct", "startInteractionRule", "raiseEventTopic", "assignValue"


def key_title(binding: KeyBinding) -> str:
    """Return a key's title: the author's label, or words for its function."""
    if binding.title:
        return binding.title
    name = binding.behavior.strip()
    match binding.function:
        case "assignValue":
            return _assignment_title(name)
        case "raiseEventTopic":
            return normal_topic(name).replace("_", " ").replace("/", " ")
        case "stopCommunicationRobotAct" | "stopInteractionRule":
            return f"stop {short_title(name)}"
        case _:
            return short_title(name)


def short_title(name: str) -> str:
    """Make the name of an act or a rule readable: `R_Task1_Intro` becomes `Task1 Intro`."""
    return name.removeprefix("R_").replace("_", " ") or name


def _assignment_title(text: str) -> str:
    """Shorten an assignment: `understood = true` becomes `understood`, `mood = 'good'` becomes `mood good`."""
    assignment = _parse_assignment(text)
    if assignment is None:
        return text
    try:
        value = assignment.evaluate(Environment({}), frozenset())
    except EvaluationError:
        return text
    name = (assignment.target.text if assignment.target is not None else assignment.key).replace("_", " ")
    if assignment.keys and assignment.bare_word is None:
        return text
    if not isinstance(value, bool):
        return f"{name} {format_value(value)}"
    return name if value else f"not {name}"


class StudyKeys:
    """The possible effects of each key of a scenario."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.events_of_rule = {name: events_raised_by(rule) for name, rule in scenario.rules.items()}
        """By rule name: all topics that it raises, without slash."""
        self._by_task: dict[tuple[str, str], KeyBinding] = {}
        """If several keys have the same task, the first of the file."""
        self._by_topic: dict[str, list[KeyBinding]] = {}
        """Keys that raise a topic, themselves or through a rule that they start."""
        keys = list(scenario.keys.values())
        for key in keys:
            self._by_task.setdefault((key.function, normal_topic(key.task_behavior)), key)
            if key.function == EVENT:
                self._by_topic.setdefault(normal_topic(key.behavior), []).append(key)
            for topic in self.events_of_rule.get(key.behavior, ()) if key.function == RULE else ():
                self._by_topic.setdefault(topic, []).append(key)
        for key in keys:  # a rule started in another state has that key, unless another key starts it
            self._by_task.setdefault((key.function, normal_topic(key.behavior)), key)
        assignments = ((key, _parse_assignment(key.behavior)) for key in keys if key.function == SET)
        self._assignments = [(key, assignment) for key, assignment in assignments if assignment is not None]
        answers = self._find_answers()
        self.answer_keys = tuple(key for key in keys if key.key in answers)
        """Keys that some state of a rule may wait for, in the file's order."""
        self.other_keys = tuple(key for key in keys if key.key not in answers and key.function != ACT)
        """The other keys that do not start an act."""
        self.act_keys = tuple(key for key in keys if key.key not in answers and key.function == ACT)

    def key_of(self, function: str, behavior: str) -> KeyBinding | None:
        """Return the key that submits this; None: there is none."""
        return self._by_task.get((function, normal_topic(behavior)))

    def keys_for(
        self, transition: Transition, memory: Mapping[str, Any], running: Iterable[str] = ()
    ) -> Iterator[KeyBinding]:
        """Yield the keys that would make a rule take this transition now. `running` acts and rules cannot be
        started."""
        if transition.is_eventless and transition.condition is not None:
            yield from self.keys_setting(transition.condition, memory)
        if transition.event is None:
            return
        if not is_met(transition.condition, memory):
            return
        for key in self.keys_raising(transition.event):
            if key.function != RULE or key.behavior not in running:
                yield key
        name = find_event_source(self.scenario, transition.event)
        if name is not None and name not in running:
            for function in (ACT, RULE):
                if (starter := self.key_of(function, name)) is not None:
                    yield starter

    def keys_raising(self, topic: str | None) -> Sequence[KeyBinding]:
        """Return the keys that raise a topic (without its slash) themselves or by starting a rule, in file order."""
        return self._by_topic.get(topic, ()) if topic is not None else ()

    def keys_setting(self, condition: Expression, memory: Mapping[str, Any]) -> Iterator[KeyBinding]:
        """Yield the keys that set a value so that a false condition becomes true."""
        if is_met(condition, memory):
            return
        for key, assignment in self._assignments_for(condition):
            try:
                changed, value = assignment.entry(Environment(memory), self.scenario.known_keys)
                if condition.as_condition({**memory, changed: value}):
                    yield key
            except EvaluationError:
                continue

    def expected_keys(
        self, states: Mapping[str, str | None], memory: Mapping[str, Any], running: Iterable[str] = ()
    ) -> frozenset[str]:
        """Collect the keys (as Textual spells them) that the rules in these `states` wait for."""
        busy = {*running, *states}
        return frozenset(
            key.key
            for name, state in states.items()
            for transition in transitions_of(self.scenario, name, state)
            for key in self.keys_for(transition, memory, busy)
        )

    def _assignments_for(self, condition: Expression) -> list[tuple[KeyBinding, Assignment]]:
        """Find the keys that assign a value, or a part of one, that a condition reads."""
        heads = {key.partition(".")[0] for key in condition.keys}
        return [(key, each) for key, each in self._assignments if each.key.partition(".")[0] in heads]

    def _find_answers(self) -> set[str]:
        """Find the keys that some state could wait for, whatever the memory."""
        rules = self.scenario.rules.values()
        started = {function.argument for rule in rules for function in rule.functions if function.name == ACT}
        return {
            key.key
            for rule in rules
            for state in rule.states.values()
            for transition in state.transitions
            for key in self._possible_keys(rule.name, transition, started)
        }

    def _possible_keys(self, rule: str, transition: Transition, started: set[str]) -> Iterator[KeyBinding]:
        """Yield the keys that could make this rule take this transition; `started`: acts that rules start."""
        if transition.event is not None:
            raising = self.keys_raising(transition.event)
            yield from (key for key in raising if key.function != RULE or key.behavior != rule)
            name = find_event_source(self.scenario, transition.event)
            starter = self.key_of(ACT, name) if name is not None else None
            if starter is not None and starter.behavior not in started:
                yield starter
        elif transition.is_eventless and transition.condition is not None:
            yield from (key for key, _ in self._assignments_for(transition.condition))


def transitions_of(scenario: Scenario, rule: str, state: str | None) -> tuple[Transition, ...]:
    """Return the transitions of a state; none if it is unknown."""
    known = scenario.rules.get(rule)
    found = known.states.get(state) if known is not None and state is not None else None
    return found.transitions if found is not None else ()


@lru_cache(256)
def _parse_assignment(text: str) -> Assignment | None:
    try:
        return Assignment.parse(text)
    except LanguageError:
        return None
