"""Rules made ready to run: indexed by topic, conditions compiled, blocks as flat tuples. Done once, at load."""

from __future__ import annotations

from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.model import Block, Function, If, OneOf, Rule, Statement, Transition, normal_topic

RAISE, ASSIGN, CALL, IF, ONE_OF = range(5)


class Condition:
    """A condition and the keys whose values belong into its record."""

    __slots__ = ("keys", "test", "text", "watched")

    def __init__(self, expression: Expression) -> None:
        self.text = expression.text
        self.test = expression.condition
        self.keys = tuple(sorted(expression.keys))
        self.watched = expression.keys | expression.constants
        """A key called `e` would hide the constant, so a change of it matters too."""


class Op:
    """One statement. Which fields are set depends on `kind`."""

    __slots__ = ("argument", "assignments", "branches", "choices", "function", "kind", "shown", "topic")

    kind: int
    function: str
    argument: str
    topic: str
    """Without slash, for routing."""
    shown: str
    """With slash, for records."""
    assignments: tuple[Assignment, ...]
    branches: tuple[tuple[Condition | None, tuple[Op, ...]], ...]
    choices: tuple[tuple[Op, ...], ...]


class TransitionCode:
    __slots__ = ("after", "condition", "index", "ops", "target", "topic", "trigger")

    def __init__(self, transition: Transition, index: int) -> None:
        self.index = index
        self.topic = transition.event
        self.condition = Condition(transition.condition) if transition.condition is not None else None
        self.after = transition.after
        self.ops = _block(transition.block)
        self.target: StateCode | None = None
        if transition.event is not None:
            self.trigger = "/" + transition.event
        elif transition.after is not None:
            self.trigger = f"after {transition.after:g}s"
        else:
            self.trigger = transition.condition.text if transition.condition is not None else ""


class StateCode:
    """A state: what it does and what it waits for."""

    __slots__ = ("by_topic", "entry", "exit", "final", "id", "timed", "topics", "transitions", "watched", "watching")

    def __init__(self, id: str, entry: tuple[Op, ...], exit: tuple[Op, ...], transitions: list[TransitionCode]) -> None:
        self.id = id
        self.entry = entry
        self.exit = exit
        self.transitions = transitions
        by_topic: dict[str, list[TransitionCode]] = {}
        for transition in transitions:
            if transition.topic is not None:
                by_topic.setdefault(transition.topic, []).append(transition)
        self.by_topic = {topic: tuple(taken) for topic, taken in by_topic.items()}
        self.topics = tuple(by_topic)
        self.timed = tuple(t for t in transitions if t.after is not None)
        self.watching = tuple(t for t in transitions if t.topic is None and t.after is None)
        self.watched = tuple(
            sorted({top for t in self.watching if t.condition for key in t.condition.watched for top in _prefixes(key)})
        )
        self.final = not transitions


class RuleCode:
    __slots__ = ("initial", "name", "priority", "source", "states")

    def __init__(self, rule: Rule) -> None:
        self.name = rule.name
        self.source = f"rule:{rule.name}"
        self.priority = rule.priority
        self.states = {
            state.id: StateCode(
                state.id,
                _block(state.on_entry),
                _block(state.on_exit),
                [TransitionCode(transition, index) for index, transition in enumerate(state.transitions)],
            )
            for state in rule.states.values()
        }
        for state in rule.states.values():
            for code, transition in zip(self.states[state.id].transitions, state.transitions, strict=True):
                code.target = self.states[transition.target] if transition.target is not None else None
        self.initial = self.states[rule.initial]


def _block(block: Block) -> tuple[Op, ...]:
    return tuple(_op(statement) for statement in block)


def _op(statement: Statement) -> Op:
    op = Op()
    match statement:
        case Function(name="raiseEventTopic"):
            op.kind = RAISE
            op.topic = normal_topic(statement.argument)
            op.shown = "/" + op.topic
            op.argument = statement.argument
        case Function(name="assignValue") if statement.assignment is not None:
            op.kind = ASSIGN
            op.assignments = (statement.assignment,)
            op.argument = statement.argument
        case Function():
            op.kind = CALL
            op.function = statement.name
            op.argument = statement.argument
        case If():
            op.kind = IF
            op.branches = tuple(
                (Condition(branch.condition) if branch.condition is not None else None, _block(branch.block))
                for branch in statement.branches
            )
        case OneOf():
            op.kind = ONE_OF
            op.choices = tuple(_block((choice,)) for choice in statement.choices)
    return op


def _prefixes(key: str) -> list[str]:
    """`a.b.c` is touched by changes of `a`, `a.b` and `a.b.c`: a dotted key reaches into objects."""
    parts = key.split(".")
    return [".".join(parts[: n + 1]) for n in range(len(parts))]
