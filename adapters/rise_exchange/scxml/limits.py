"""The limits of SCXML for a rule: refusals and losses, reported before anything is written.

docs/reference/scxml.md has a line for each code. They follow from what a rule waits for, raises, reads and sets.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import chain

from msgspec import Struct

from rise_engine.base.nearest_name import in_backquotes
from rise_engine.base.text import clean
from rise_engine.expression import Assignment, Expression
from rise_engine.expression.nodes import FunctionCall, Literal, Power
from rise_engine.scenario.diagnostics import Diagnostics
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
    Statement,
    Transition,
    functions_in,
    normal_topic,
    statements_in,
)
from rise_exchange.scxml.expressions import APPROXIMATE_FUNCTIONS, EXACT_WHOLE_NUMBERS, is_limited, nodes_of


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
        """All of its functions, those of a block from its end. Losses name the first that they concern."""
        return [each for block in self.blocks for each in reversed([*functions_in(block)])]

    @cached_property
    def blocks(self) -> list[Block]:
        """All of its blocks."""
        return [block for state in self.rule.states.values() for block in state.blocks]

    @cached_property
    def statements(self) -> list[Statement]:
        """All of its statements."""
        return [statement for block in self.blocks for statement in statements_in(block)]

    @cached_property
    def expressions(self) -> list[tuple[Expression, SourceLocation]]:
        """Every condition, formula and index, with its element."""
        found: list[tuple[Expression | None, SourceLocation]] = []
        for transition in self.transitions:
            found += ((each, transition.location) for each in transition.expressions)
        for statement in self.statements:
            if isinstance(statement, If):
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
        """Whether it uses random choices."""
        return any(each.draws for each, _ in self.expressions) or any(
            isinstance(each, OneOf) for each in self.statements
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
    def has_loop(self) -> bool:
        """Whether its states have a circle of transitions that wait only for conditions and its own events."""
        targets_of = {
            state.id: {
                transition.target or state.id
                for transition in state.transitions
                if (transition.is_eventless and (transition.target is not None or transition.block))
                or transition.event in self.raised_topics
            }
            for state in self.rule.states.values()
        }
        while leaves := [state for state, targets in targets_of.items() if not targets & targets_of.keys()]:
            for state in leaves:
                del targets_of[state]
        return bool(targets_of)


REFUSALS = {
    "scxml-chance": "how often a condition without event is looked at differs in SCXML, and so would what is drawn",
    "scxml-number": "a whole number beyond 2^53 cannot be told from its neighbours in ECMAScript",
    "scxml-stop": "a document cannot end in the middle of its functions",
    "scxml-read-only": "the engine refuses to set this while a session runs",
    "scxml-name": "`__proto__` is not a plain name in ECMAScript",
}
"""Reasons why a rule has no document, by the code of the error."""
LOSSES = {
    "routing": "who takes an event that several rules wait for",
    "kept": "events that are kept for a rule that waits later",
    "memory-meanwhile": "changes of the memory that a function brings about at once",
    "chance": "one source of chance for the whole session",
    "digits": "the last digit of some functions",
    "letters": "small letters by one version of Unicode",
    "size": "the size of a value, byte by byte",
    "fractions": "times shorter than a millisecond",
    "circle": "the end of a rule that goes round without waiting",
    "beginning": "a beginning in another state",
    "stopped": "the end of a rule in the middle of its functions",
}
"""Parts of a rule that a document omits, by code."""


class Loss(Struct, frozen=True):
    """A part of a rule that a document omits.

    >>> str(Loss("chance", "other rules draw, too", SourceLocation("rules/a.xml", 3, 5)))
    'rules/a.xml:3:5: loss chance: other rules draw, too'
    """

    code: str
    """One of LOSSES."""
    message: str
    location: SourceLocation

    def __str__(self) -> str:
        """One line, without control characters for a terminal."""
        return clean(f"{self.location}: loss {self.code}: {self.message}")


def find_refusals(scenario: Scenario, rule: Rule) -> Diagnostics:
    """Return why SCXML cannot express a rule; empty: it can."""
    found = Diagnostics()
    analysis = RuleAnalysis(scenario, rule)

    def refuse(code: str, location: SourceLocation, what: str) -> None:
        found.error(code, location, f"{what}: {REFUSALS[code]}")

    for transition in analysis.transitions:
        watched = transition.held or (transition.condition if transition.is_eventless else None)
        if watched is not None and watched.draws:
            refuse(
                "scxml-chance", transition.location, f"`{watched.text}` draws by chance; give it an event, or an `if`"
            )
    for expression, location in analysis.expressions:
        for node in nodes_of(expression):
            if isinstance(node, Literal) and _is_too_large(node.value):
                refuse("scxml-number", location, f"{node.value} in `{expression.text}`")
    for function in analysis.functions:
        if function.name == "stopInteractionRule" and function.argument == rule.name:
            refuse("scxml-stop", function.location, "the rule stops itself; let it enter a state without transitions")
    for function, assignment in analysis.assignments:
        head = assignment.key.partition(".")[0]
        if head in scenario.tables or (head == SESSION and scenario.reads_session):
            refuse("scxml-read-only", function.location, f"`{assignment.text}` sets `{head}`")
        _check_json(assignment.literal, f"`{assignment.text}`", function.location, found)
    file = scenario.paths.get("memory", "memory.json")
    for key, value in analysis.start_memory.items():
        location = scenario.tables[key].location if key in scenario.tables else SourceLocation(file)
        _check_json({key: value}, f"the value of `{key}`", location, found)
    return found


def find_losses(scenario: Scenario, rule: Rule) -> list[Loss]:
    """Return the losses of a rule in reading order, each once."""
    analysis = RuleAnalysis(scenario, rule)
    losses = [
        *_losses_among_rules(analysis),
        *_losses_of_functions(analysis),
        *_losses_of_expressions(analysis),
        *_losses_of_times(analysis),
    ]
    return sorted(set(losses), key=lambda loss: (loss.location.line, loss.location.column, loss.code, loss.message))


def _losses_among_rules(analysis: RuleAnalysis) -> Iterator[Loss]:
    scenario, rule = analysis.scenario, analysis.rule
    for topic, others in analysis.shared_topics.items():
        waiting = next(each for each in analysis.transitions if each.event == topic)
        message = (
            f"`/{topic}` is also waited for by {in_backquotes(others)}; the sender has to decide which one gets it"
        )
        yield Loss("routing", message, waiting.location)
    kept = sorted(topic for topic in _kept_topics(scenario) if topic in analysis.topics)
    for topic in kept:
        waiting = next(each for each in analysis.transitions if each.event == topic)
        message = f"`/{topic}` may be kept; the sender has to wait until the document waits for it"
        yield Loss("kept", message, waiting.location)
    for other in scenario.rules.values():
        for function in RuleAnalysis(scenario, other).functions:
            if _begins_elsewhere(function, rule):
                message = f"`{other.name}` starts it in another way than from the beginning of its initial state"
                yield Loss("beginning", message, rule.location)
    for key in scenario.keys.values():
        if key.function == "startInteractionRule" and key.behavior == rule.name and (key.state or not key.enter):
            message = f"the key `{key.label}` starts it in another way than from the beginning of its initial state"
            yield Loss("beginning", message, rule.location)
    for name in sorted(analysis.started_rules - {rule.name}):
        for function in RuleAnalysis(scenario, scenario.rules[name]).functions:
            if function.name == "stopInteractionRule" and function.argument == rule.name:
                message = f"`{name}`, which it starts, stops it; the functions after that start are then left out"
                yield Loss("stopped", message, rule.location)
    if analysis.has_loop:
        message = (
            "its states can go round without waiting; a session stops that after 1,000 steps, a document never ends"
        )
        yield Loss("circle", message, rule.location)


def _losses_of_functions(analysis: RuleAnalysis) -> Iterator[Loss]:
    scenario, rule = analysis.scenario, analysis.rule
    reads_session = any(key.partition(".")[0] == SESSION for key in analysis.keys_read) and scenario.reads_session
    if reads_session and any(function.name.endswith("CommunicationRobotAct") for function in analysis.functions):
        message = f"`{SESSION}` changes as soon as an act starts; the document hears of it after its functions"
        yield Loss("memory-meanwhile", message, rule.location)
    for name in sorted(analysis.started_rules):
        other = RuleAnalysis(scenario, scenario.rules[name])
        shared = sorted({each.key for _, each in other.assignments} & analysis.memory_names)
        if shared and name != rule.name:
            message = (
                f"`{name}`, which it starts, sets {in_backquotes(shared)}; the document hears of it after its functions"
            )
            yield Loss("memory-meanwhile", message, rule.location)
    if analysis.draws and (others := _other_sources_of_chance(analysis)):
        message = f"{others} draw from the session's one source of chance; the document has one of its own"
        yield Loss("chance", message, rule.location)


def _losses_of_expressions(analysis: RuleAnalysis) -> Iterator[Loss]:
    for expression, location in analysis.expressions:
        for node in nodes_of(expression):
            call = node.function if isinstance(node, FunctionCall) else "^" if isinstance(node, Power) else ""
            if call in APPROXIMATE_FUNCTIONS or call == "^":
                message = f"`{call}` in `{expression.text}` may differ in its last digit"
                yield Loss("digits", message, location)
            elif call == "lower":
                message = f"`{expression.text}` knows the letters that the interpreter's version of Unicode has"
                yield Loss("letters", message, location)
    for function, assignment in analysis.assignments:
        if is_limited(assignment, analysis.scenario):
            message = "the limit of 100,000 bytes for what is set counts numbers as ECMAScript writes them"
            yield Loss("size", f"`{assignment.text}`: {message}", function.location)
            break


def _losses_of_times(analysis: RuleAnalysis) -> Iterator[Loss]:
    for transition in analysis.transitions:
        after = transition.after
        if after is not None and (after.seconds is None or round(after.seconds * 1000, 6) % 1):
            message = f"`{after.text}` may be no whole number of milliseconds, which many interpreters round to"
            yield Loss("fractions", message, transition.location)


def _kept_topics(scenario: Scenario) -> set[str]:
    """The events that anything in the scenario raises with `keep`."""
    rules = (RuleAnalysis(scenario, rule) for rule in scenario.rules.values())
    kept = {each.argument for rule in rules for each in rule.functions if each.keep is not None}
    kept |= {key.behavior for key in scenario.keys.values() if key.keep is not None}
    return {topic.strip().removeprefix("/") for topic in kept}


def _begins_elsewhere(function: Function, rule: Rule) -> bool:
    starts_it = function.name == "startInteractionRule" and function.argument == rule.name
    return starts_it and (function.state not in (None, rule.initial) or not function.enter)


def _other_sources_of_chance(analysis: RuleAnalysis) -> str:
    scenario = analysis.scenario
    rules = [
        f"the rule `{rule.name}`"
        for rule in scenario.rules.values()
        if rule.name != analysis.rule.name and RuleAnalysis(scenario, rule).draws
    ]
    acts = [
        f"the variants of `{act.name}`"
        for act in scenario.acts.values()
        if any(len(action.calls) > 1 for action in act.actions)
    ]
    found = [*rules, *acts]
    return ", ".join(found[:3]) + (f" and {len(found) - 3} more" if len(found) > 3 else "")


def _check_json(value: Json, where: str, location: SourceLocation, found: Diagnostics) -> None:
    """Refuse values that ECMAScript would read differently. It does not recurse, so any depth is possible."""
    pending = [value]
    while pending:
        each = pending.pop()
        if isinstance(each, dict):
            if "__proto__" in each:
                found.error("scxml-name", location, f"{where}: {REFUSALS['scxml-name']}")
            pending += each.values()
        elif isinstance(each, list):
            pending += each
        elif _is_too_large(each):
            found.error("scxml-number", location, f"{each} in {where}: {REFUSALS['scxml-number']}")


def _is_too_large(value: Json) -> bool:
    return isinstance(value, int) and abs(value) > EXACT_WHOLE_NUMBERS
