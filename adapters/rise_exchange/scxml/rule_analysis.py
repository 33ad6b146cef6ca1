"""What a rule waits for, raises, reads and sets, for the export and its limits."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import chain

from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.model import (
    SESSION,
    SESSION_STATES,
    Block,
    Function,
    If,
    Json,
    OneOf,
    Rule,
    Scenario,
    SourceLocation,
    Transition,
    functions_in,
    normal_topic,
)


class RuleAnalysis:
    """One rule among the others of its scenario."""

    def __init__(self, scenario: Scenario, rule: Rule) -> None:
        self.scenario = scenario
        self.rule = rule

    @cached_property
    def transitions(self) -> list[Transition]:
        """All of its transitions."""
        return [transition for state in self.rule.states.values() for transition in state.transitions]

    @cached_property
    def functions(self) -> list[Function]:
        """All of its functions, in no particular order."""
        return [function for block in _blocks(self.rule) for function in functions_in(block)]

    @cached_property
    def expressions(self) -> list[tuple[Expression, SourceLocation]]:
        """Every condition, formula and index, with its element."""
        found: list[tuple[Expression | None, SourceLocation]] = []
        for transition in self.transitions:
            delay = transition.after.expression if transition.after is not None else None
            found += ((each, transition.location) for each in (transition.condition, transition.held, delay))
        for block in _blocks(self.rule):
            for statement in _ifs(block):
                found += ((branch.condition, statement.location) for branch in statement.branches)
        for function, assignment in self.assignments:
            found += ((each, function.location) for each in (assignment.expression, assignment.target))
        return [(expression, location) for expression, location in found if expression is not None]

    @cached_property
    def assignments(self) -> list[tuple[Function, Assignment]]:
        """Its assignments."""
        return [(function, function.assignment) for function in self.functions if function.assignment is not None]

    @cached_property
    def keys_read(self) -> frozenset[str]:
        """The keys in its expressions, dotted keys in full, and the constants that a key could hide."""
        return frozenset(chain.from_iterable(each.keys | each.constants for each, _ in self.expressions))

    @cached_property
    def memory_names(self) -> frozenset[str]:
        """The memory's names that its keys can depend on: each key, and its part before the first dot."""
        keys = self.keys_read | {assignment.key for _, assignment in self.assignments}
        return keys | {key.partition(".")[0] for key in keys}

    @cached_property
    def start_memory(self) -> dict[str, Json]:
        """The memory under these names at a session's start: start values, tables, and `session`."""
        session = dict.fromkeys(SESSION_STATES, False) | {"participant": "", "condition": "", "factors": {}}
        own = {SESSION: {**session, "language": self.scenario.language}} if self.scenario.reads_session else {}
        whole = {**self.scenario.memory, **self.scenario.table_memory, **own}
        return {key: value for key, value in whole.items() if key in self.memory_names}

    @cached_property
    def draws(self) -> bool:
        """Whether it uses chance."""
        return any(each.draws for each, _ in self.expressions) or any(
            True for block in _blocks(self.rule) for _ in _one_ofs(block)
        )

    @cached_property
    def topics(self) -> frozenset[str]:
        """The events that it waits for."""
        return frozenset(transition.event for transition in self.transitions if transition.event is not None)

    @cached_property
    def shared_topics(self) -> dict[str, list[str]]:
        """Those of them that other rules also wait for, with the names of these rules."""
        others = [
            RuleAnalysis(self.scenario, rule) for rule in self.scenario.rules.values() if rule.name != self.rule.name
        ]
        found = {topic: [other.rule.name for other in others if topic in other.topics] for topic in self.topics}
        return {topic: names for topic, names in sorted(found.items()) if names}

    @cached_property
    def raised_topics(self) -> frozenset[str]:
        """The events that it raises without keeping them."""
        return frozenset(
            normal_topic(each.argument)
            for each in self.functions
            if each.name == "raiseEventTopic" and each.keep is None
        )

    @cached_property
    def own_topics(self) -> frozenset[str]:
        """The events that it raises only for itself."""
        return self.raised_topics & self.topics - self.shared_topics.keys()

    @cached_property
    def started_rules(self) -> frozenset[str]:
        """The rules that it starts, directly or through others."""
        found: set[str] = set()
        pending = [self.rule]
        while pending:
            for function in RuleAnalysis(self.scenario, pending.pop()).functions:
                name = function.argument
                if function.name == "startInteractionRule" and name in self.scenario.rules and name not in found:
                    found.add(name)
                    pending.append(self.scenario.rules[name])
        return frozenset(found)

    @cached_property
    def goes_round(self) -> bool:
        """Whether its states have a circle of transitions that wait only for conditions and its own events."""
        ways = {
            state.id: {
                transition.target or state.id
                for transition in state.transitions
                if (transition.is_eventless and (transition.target is not None or transition.block))
                or transition.event in self.raised_topics
            }
            for state in self.rule.states.values()
        }
        while leaves := [state for state, targets in ways.items() if not targets & ways.keys()]:
            for state in leaves:
                del ways[state]
        return bool(ways)


def _blocks(rule: Rule) -> Iterator[Block]:
    for state in rule.states.values():
        yield state.on_entry
        yield state.on_exit
        yield from (transition.block for transition in state.transitions)


def _ifs(block: Block) -> Iterator[If]:
    for statement in block:
        if isinstance(statement, If):
            yield statement
            for branch in statement.branches:
                yield from _ifs(branch.block)
        elif isinstance(statement, OneOf):
            yield from _ifs(statement.choices)


def _one_ofs(block: Block) -> Iterator[OneOf]:
    for statement in block:
        if isinstance(statement, OneOf):
            yield statement
            yield from _one_ofs(statement.choices)
        elif isinstance(statement, If):
            for branch in statement.branches:
                yield from _one_ofs(branch.block)
