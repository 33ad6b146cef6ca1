"""Rules compiled at load: indexed by topic, with compiled conditions, and with blocks as chains of steps.

There may be thousands of rules, so the classes have slots, and equal conditions are shared. Without this, events for a
thousand rules in turn take half as long again (benchmarks/many_rules).
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import accumulate
from typing import get_args

from rise_engine.expression import Assignment, Environment, Expression
from rise_engine.kernel.core import EventTopic, EventTopics, RuleList
from rise_engine.scenario.model import (
    SESSION,
    SESSION_STATES,
    ActOutcome,
    Block,
    Function,
    If,
    OneOf,
    Rule,
    State,
    Statement,
    Transition,
    functions_in,
    normal_topic,
    result_topics,
)

OUTCOMES: tuple[ActOutcome, ...] = get_args(ActOutcome)
RAISE, ASSIGN, CALL, TEST, PICK = range(5)
"""The kinds of an Op."""


class CompiledCondition:
    """A condition, with the keys whose values its record contains."""

    __slots__ = ("evaluate", "keys", "only_key", "text", "watched_keys")

    def __init__(self, expression: Expression) -> None:
        self.text = expression.text
        self.evaluate = _collecting_parts(expression) if expression.parts else expression.compiled_condition
        self.keys = tuple(sorted(expression.keys - expression.keys_of_parts_only))
        self.only_key = self.keys[0] if len(self.keys) == 1 and not expression.parts else ""
        """The key, if the record needs only its value."""
        self.watched_keys = expression.keys | expression.constants
        """Includes constants, because a memory key named `e` would hide the constant."""


def _collecting_parts(expression: Expression) -> Callable[[Environment], bool]:
    """Return a condition that stores the parts that it reads in `env.parts`, for its record."""
    holds = expression.compiled_condition

    def evaluate(env: Environment) -> bool:
        env.parts = {}
        return holds(env)

    return evaluate


_compile_condition = lru_cache(maxsize=1024)(CompiledCondition)
"""Shared by equal conditions, which saves memory, and so time with a thousand rules."""


@dataclass(slots=True, eq=False)
class Op:
    """One step of a block, and the next step: null at the end of the block.

    A block is a chain. Each arm of an `if` or `oneOf` continues with the next step after it. So a block runs without
    recursion or jumps, and an error ends the chain. `kind` decides which fields are set.
    """

    kind: int
    source: str
    """The `source` in its records."""
    next: Op | None
    """TEST: the next step if the condition is true."""
    function: str = field(init=False)
    argument: str = field(init=False)
    topic: EventTopic = field(init=False)
    """RAISE: the event that it appends to the queue."""
    assignments: tuple[Assignment, ...] = field(init=False)
    condition: CompiledCondition = field(init=False)
    otherwise: Op | None = field(init=False)
    """TEST: the next step if the condition is false."""
    choices: tuple[Op | None, ...] = field(init=False)
    """PICK: the first step of each choice."""


class CompiledTransition:
    __slots__ = (
        "after",
        "block",
        "condition",
        "entered_at_once",
        "entry_after_actions",
        "held",
        "index",
        "next",
        "topics",
        "trigger",
    )

    def __init__(
        self,
        transition: Transition,
        index: int,
        blocks: BlockCompiler,
        topics: EventTopics,
        own_ends: dict[tuple[str, ActOutcome], EventTopic],
    ) -> None:
        self.index = index
        self.topics: tuple[EventTopic, ...] = ()
        """Any of these events triggers it."""
        if transition.event is not None:
            self.topics = (topics.get_or_add(transition.event),)
        elif transition.ended is not None:
            ends = [(transition.ended, outcome) for outcome in transition.outcomes or OUTCOMES]
            self.topics = tuple(own_ends.setdefault(end, _own_end_topic(*end)) for end in ends)
        self.condition = _compile_condition(transition.condition) if transition.condition is not None else None
        self.held = _compile_condition(transition.held) if transition.held is not None else None
        self.after = transition.after
        self.block = blocks.compile(transition.block)
        self.next: CompiledTransition | None = None
        """The next transition of the state for the same event."""
        self.entered_at_once: CompiledState | None = None
        """The state that is entered immediately; null: functions come first, or the state is not left."""
        self.entry_after_actions: CompiledTransition | None = None
        """If functions come first: the same transition without them, which then enters the target."""
        if transition.ended is not None:
            self.trigger = " ".join(("ended", transition.ended, *transition.outcomes))
        elif transition.event is not None:
            self.trigger = self.topics[0].with_slash
        elif transition.after is not None:
            seconds = transition.after.seconds
            self.trigger = f"after {transition.after.text if seconds is None else f'{seconds:g}s'}"
            if transition.held is not None:
                self.trigger = f"while {transition.held.text} {self.trigger}"
        else:
            self.trigger = transition.condition.text if transition.condition is not None else ""


def _own_end_topic(act: str, outcome: ActOutcome) -> EventTopic:
    topic = EventTopic(f"ended {act} {outcome}")
    topic.with_slash = topic.name  # private to one rule, so records show it without slash
    return topic


class CompiledState:
    """A state: its functions and its transitions."""

    __slots__ = (
        "by_topic",
        "delayed",
        "entry",
        "eventless",
        "exit",
        "final",
        "id",
        "transitions",
        "trivial",
        "wait_lists",
        "watch_lists",
    )

    def __init__(
        self,
        id: str,
        entry: Op | None,
        exit: Op | None,
        transitions: list[CompiledTransition],
        watchers: dict[str, RuleList],
    ) -> None:
        self.id = id
        self.entry = entry
        self.exit = exit
        self.transitions = transitions
        self.by_topic: dict[EventTopic, CompiledTransition] = {}
        """The first transition for each event. The others follow as its `next`."""
        self.delayed = tuple(t for t in transitions if t.after is not None and t.held is None)
        self.eventless = tuple(t for t in transitions if not t.topics and (t.after is None or t.held is not None))
        """Transitions that only a condition triggers, immediately or after it has held for a time."""
        watched = (t.held or t.condition for t in self.eventless)
        keys = {key for condition in watched if condition for key in condition.watched_keys}
        # `a.b.c` depends on changes of `a`, `a.b` and `a.b.c`: a dotted key leads into objects.
        written = {name for key in keys for name in accumulate(key.split("."), "{}.{}".format)}
        if SESSION in keys:  # each of its parts reports its own changes
            written.update(f"{SESSION}.{name}" for name in SESSION_STATES)
        self.watch_lists = tuple(watchers.setdefault(name, {}) for name in sorted(written))
        """The lists of rules that watch its keys."""
        self.final = not transitions
        self.trivial = not (self.delayed or self.final or self.eventless)
        """Whether entering it requires only waiting for events."""
        self.wait_lists: tuple[RuleList, ...] = ()
        """The lists for a rule in this state that is not on top of the stack."""

    def index_topics(self) -> None:
        """Index the transitions by their events, once they are complete."""
        for transition in reversed(self.transitions):
            for topic in transition.topics:
                entry = copy(transition) if len(transition.topics) > 1 else transition  # each chain has its own `next`
                entry.next = self.by_topic.get(topic)
                self.by_topic[topic] = entry
        self.wait_lists = tuple(topic.wait_list for topic in self.by_topic)


class CompiledRule:
    __slots__ = ("acts_of_own_ends", "initial", "name", "own_ends", "priority", "results", "source", "states")

    def __init__(self, rule: Rule, topics: EventTopics, watchers: dict[str, RuleList]) -> None:
        self.name = rule.name
        self.own_ends: dict[tuple[str, ActOutcome], EventTopic] = {}
        """The event for each act and outcome that the rule waits for with `ended`. Only this rule gets it."""
        self.source = f"rule:{rule.name}"
        self.priority = float(rule.priority)
        blocks = BlockCompiler(self.source, topics)
        self.states = {
            state.id: CompiledState(
                state.id,
                blocks.compile(state.on_entry),
                blocks.compile(state.on_exit),
                [
                    CompiledTransition(transition, index, blocks, topics, self.own_ends)
                    for index, transition in enumerate(state.transitions)
                ],
                watchers,
            )
            for state in rule.states.values()
        }
        for state in rule.states.values():
            for transition, compiled in zip(state.transitions, self.states[state.id].transitions, strict=True):
                if transition.target is not None:
                    entering = compiled
                    if transition.block or state.on_exit:
                        entering = compiled.entry_after_actions = copy(compiled)
                    entering.entered_at_once = self.states[transition.target]
        for compiled_state in self.states.values():
            compiled_state.index_topics()
        self.results = {state: topic for state, topic in result_topics(rule) if not _raises(rule.states[state], topic)}
        """The event that reports each state that ends the rule, unless the state raises that event itself."""
        self.acts_of_own_ends = frozenset(act for act, _ in self.own_ends)
        self.initial = self.states[rule.initial]


def _raises(state: State, topic: str) -> bool:
    return any(
        function.name == "raiseEventTopic" and normal_topic(function.argument) == topic
        for function in functions_in(state.on_entry)
    )


class BlockCompiler:
    """Compiles the blocks of one rule."""

    def __init__(self, source: str, topics: EventTopics) -> None:
        self._source = source
        self._topics = topics

    def compile(self, block: Block, then: Op | None = None) -> Op | None:
        """Compile a block, from its end, so that it continues with `then`. Returns its first step."""
        for statement in reversed(block):
            then = self._statement(statement, then)
        return then

    def _statement(self, statement: Statement, then: Op | None) -> Op | None:
        match statement:
            case Function():
                return self._function(statement, then)
            case If():
                otherwise = then
                for branch in reversed(statement.branches):
                    arm = self.compile(branch.block, then)
                    if branch.condition is None:
                        otherwise = arm
                    else:
                        test = Op(TEST, self._source, arm)
                        test.condition = _compile_condition(branch.condition)
                        test.otherwise = otherwise
                        otherwise = test
                return otherwise
            case OneOf():
                pick = Op(PICK, self._source, then)
                pick.choices = tuple(self._statement(choice, then) for choice in statement.choices)
                return pick

    def _function(self, function: Function, then: Op | None) -> Op:
        if function.name == "raiseEventTopic" and function.keep is None:
            op = Op(RAISE, self._source, then)
            op.topic = self._topics.get_or_add(normal_topic(function.argument))
        elif function.name == "assignValue" and function.assignment is not None:
            op = Op(ASSIGN, self._source, then)
            op.assignments = (function.assignment,)
        else:
            op = Op(CALL, self._source, then)
            op.function = function.name
        op.argument = function.behavior
        return op
