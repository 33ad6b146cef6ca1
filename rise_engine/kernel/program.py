"""Rules made ready to run: indexed by topic, conditions compiled, blocks as chains of steps. Done once, at load.

The classes have slots, and rules that ask the same share a condition, because there may be thousands of them: without,
events for a thousand rules in turn take one and a half times as long (benchmarks/many_rules).
"""

from __future__ import annotations

from copy import copy
from functools import lru_cache
from typing import Any

from rise_engine.expression import Assignment, Expression
from rise_engine.kernel.core import Topic, Topics
from rise_engine.scenario.model import Block, Function, If, OneOf, Rule, Statement, Transition, normal_topic

RAISE, ASSIGN, CALL, TEST, PICK = range(5)
"""What an Op does."""


class Condition:
    """A condition and the keys whose values belong into its record."""

    __slots__ = ("keys", "only_key", "test", "text", "watched")

    def __init__(self, expression: Expression) -> None:
        self.text = expression.text
        self.test = expression.condition
        self.keys = tuple(sorted(expression.keys))
        self.only_key = self.keys[0] if len(self.keys) == 1 else ""
        self.watched = expression.keys | expression.constants
        """A key called `e` would hide the constant, so a change of it matters too."""


_condition = lru_cache(maxsize=1024)(Condition)
"""Rules that ask the same share the answer's code: with a thousand rules, memory that is not touched is time."""


class Op:
    """One step of a block, and the step after it: null at the end of the block.

    A block is a chain. The arms of an `if` and of a `oneOf` go on with what follows it, so that running a block needs
    neither recursion nor jumps, and an error that skips the rest of a block just ends the chain.
    Which fields are set depends on `kind`.
    """

    __slots__ = (
        "argument",
        "assignments",
        "choices",
        "condition",
        "function",
        "kind",
        "next",
        "otherwise",
        "source",
        "topic",
    )

    kind: int
    next: Op | None
    """TEST: where to go on when the condition is true."""
    source: str
    """Whose step it is, for records."""
    function: str
    argument: str
    topic: Topic
    """RAISE: the event that it puts in the queue."""
    assignments: tuple[Assignment, ...]
    condition: Condition
    otherwise: Op | None
    """TEST: where to go on when the condition is false."""
    choices: tuple[Op | None, ...]
    """PICK: where each choice begins."""

    def __init__(self, kind: int, source: str, next: Op | None) -> None:
        self.kind = kind
        self.source = source
        self.next = next


class TransitionCode:
    __slots__ = ("after", "block", "condition", "enters", "index", "landing", "topic", "trigger")

    def __init__(self, transition: Transition, index: int, blocks: Blocks, topics: Topics) -> None:
        self.index = index
        self.topic = topics.named(transition.event) if transition.event is not None else None
        self.condition = _condition(transition.condition) if transition.condition is not None else None
        self.after = transition.after
        self.block = blocks.compile(transition.block)
        self.enters: StateCode | None = None
        """The state that is entered at once; null when functions come first, or when the state is not left."""
        self.landing: TransitionCode | None = None
        """When functions come first: the same transition without them, which enters its target after they have run."""
        if self.topic is not None:
            self.trigger = self.topic.shown
        elif transition.after is not None:
            self.trigger = f"after {transition.after:g}s"
        else:
            self.trigger = transition.condition.text if transition.condition is not None else ""


class StateCode:
    """A state: what it does and what it waits for."""

    __slots__ = (
        "by_topic",
        "entry",
        "exit",
        "final",
        "id",
        "lines",
        "quiet",
        "sure",
        "timed",
        "transitions",
        "watched",
        "watching",
    )

    def __init__(self, id: str, entry: Op | None, exit: Op | None, transitions: list[TransitionCode]) -> None:
        self.id = id
        self.entry = entry
        self.exit = exit
        self.transitions = transitions
        by_topic: dict[Topic, list[TransitionCode]] = {}
        for transition in transitions:
            if transition.topic is not None:
                by_topic.setdefault(transition.topic, []).append(transition)
        self.by_topic = {topic: tuple(taken) for topic, taken in by_topic.items()}
        self.sure = {topic: taken[0] for topic, taken in by_topic.items() if taken[0].condition is None}
        """What is taken without looking at any condition."""
        self.timed = tuple(t for t in transitions if t.after is not None)
        self.watching = tuple(t for t in transitions if t.topic is None and t.after is None)
        self.watched = tuple(
            sorted({top for t in self.watching if t.condition for key in t.condition.watched for top in _prefixes(key)})
        )
        self.final = not transitions
        self.quiet = not (self.timed or self.final or self.watching)
        """Entering it needs no more than waiting for events."""
        self.lines: tuple[tuple[Line, TransitionCode | None], ...] = ()
        """Where a rule in this state stands in line, and with what: one line per topic, one per key that it watches."""


Line = dict[Any, TransitionCode | None]
"""A line of running rules in stack order, the highest last, each with what it takes for sure: null when that depends on
conditions. Everything that finding the taker of an event needs lies here, near together in memory."""


class RuleCode:
    __slots__ = ("initial", "name", "priority", "source", "states")

    def __init__(self, rule: Rule, topics: Topics, watching: dict[str, Line]) -> None:
        self.name = rule.name
        self.source = f"rule:{rule.name}"
        self.priority = float(rule.priority)
        blocks = Blocks(self.source, topics)
        self.states = {
            state.id: StateCode(
                state.id,
                blocks.compile(state.on_entry),
                blocks.compile(state.on_exit),
                [TransitionCode(way, index, blocks, topics) for index, way in enumerate(state.transitions)],
            )
            for state in rule.states.values()
        }
        for state in rule.states.values():
            for way, transition in zip(self.states[state.id].transitions, state.transitions, strict=True):
                if transition.target is not None:
                    landing = way
                    if transition.block or state.on_exit:
                        landing = way.landing = copy(way)
                    landing.enters = self.states[transition.target]
        for code in self.states.values():
            code.lines = (
                *((topic.line, code.sure.get(topic)) for topic in code.by_topic),
                *((watching.setdefault(key, {}), None) for key in code.watched),
            )
        self.initial = self.states[rule.initial]


class Blocks:
    """Compiles the blocks of one rule."""

    def __init__(self, source: str, topics: Topics) -> None:
        self._source = source
        self._topics = topics

    def compile(self, block: Block, then: Op | None = None) -> Op | None:
        """The first step of a block that goes on with `then`. From its end, so that each step knows the next."""
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
                        test.condition = _condition(branch.condition)
                        test.otherwise = otherwise
                        otherwise = test
                return otherwise
            case OneOf():
                pick = Op(PICK, self._source, then)
                pick.choices = tuple(self._statement(choice, then) for choice in statement.choices)
                return pick

    def _function(self, function: Function, then: Op | None) -> Op:
        if function.name == "raiseEventTopic":
            op = Op(RAISE, self._source, then)
            op.topic = self._topics.named(normal_topic(function.argument))
        elif function.name == "assignValue" and function.assignment is not None:
            op = Op(ASSIGN, self._source, then)
            op.assignments = (function.assignment,)
        else:
            op = Op(CALL, self._source, then)
            op.function = function.name
        op.argument = function.argument
        return op


def _prefixes(key: str) -> list[str]:
    """`a.b.c` is touched by changes of `a`, `a.b` and `a.b.c`: a dotted key reaches into objects."""
    parts = key.split(".")
    return [".".join(parts[: n + 1]) for n in range(len(parts))]
