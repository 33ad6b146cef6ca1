"""Rules made ready to run: indexed by topic, conditions compiled, blocks as flat tuples. Done once, at load."""

from __future__ import annotations

from typing import Any

from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.model import Block, Function, If, OneOf, Rule, Statement, Transition, normal_topic

RAISE, ASSIGN, CALL, TEST, JUMP, PICK = range(6)
"""What an Op does. A block is flat: `if` and `oneOf` become jumps within it, so that running one needs no recursion, and
an error that skips the rest of a block is a jump to its end."""


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


class Op:
    """One step of a block. Which fields are set depends on `kind`."""

    __slots__ = ("argument", "assignments", "condition", "function", "kind", "shown", "target", "targets", "topic")

    kind: int
    function: str
    argument: str
    topic: str
    """RAISE: without slash, for routing."""
    shown: str
    """RAISE: with slash, for records."""
    assignments: tuple[Assignment, ...]
    condition: Condition
    target: int
    """TEST: where to go on when the condition is false. JUMP: where to go on."""
    targets: tuple[int, ...]
    """PICK: where each choice begins."""

    def __init__(self, kind: int) -> None:
        self.kind = kind


class TransitionCode:
    __slots__ = ("after", "condition", "direct", "index", "ops", "target", "topic", "trigger")

    def __init__(self, transition: Transition, index: int) -> None:
        self.index = index
        self.topic = transition.event
        self.condition = Condition(transition.condition) if transition.condition is not None else None
        self.after = transition.after
        self.ops = _block(transition.block)
        self.target: StateCode | None = None
        self.direct = False
        """Nothing runs between leaving the old state and entering the new one."""
        if transition.event is not None:
            self.trigger = "/" + transition.event
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
        "lists",
        "quiet",
        "timed",
        "topics",
        "transitions",
        "watched",
        "watching",
    )

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
        self.quiet = not (self.timed or self.final or self.watching)
        """Entering it needs no more than waiting for events."""
        self.lists: tuple[Waiting, ...] = ()
        """Where a rule in this state stands in line: one list per topic, one per key that it watches."""


Waiting = dict[Any, None]
"""Running rules in stack order, the top one last."""


class RuleCode:
    __slots__ = ("initial", "name", "priority", "source", "states")

    def __init__(self, rule: Rule, waiting: dict[str, Waiting], watching: dict[str, Waiting]) -> None:
        self.name = rule.name
        self.source = f"rule:{rule.name}"
        self.priority = float(rule.priority)
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
            for way, transition in zip(self.states[state.id].transitions, state.transitions, strict=True):
                way.target = self.states[transition.target] if transition.target is not None else None
                way.direct = way.target is not None and not way.ops and not state.on_exit
        for code in self.states.values():
            code.lists = tuple(
                lists.setdefault(name, {})
                for lists, names in ((waiting, code.topics), (watching, code.watched))
                for name in names
            )
        self.initial = self.states[rule.initial]


def _block(block: Block) -> tuple[Op, ...]:
    ops: list[Op] = []
    for statement in block:
        _append(ops, statement)
    return tuple(ops)


def _append(ops: list[Op], statement: Statement) -> None:
    match statement:
        case Function():
            ops.append(_function(statement))
        case If():
            jumps = []
            for branch in statement.branches:
                test = None
                if branch.condition is not None:
                    test = Op(TEST)
                    test.condition = Condition(branch.condition)
                    ops.append(test)
                for inner in branch.block:
                    _append(ops, inner)
                jumps.append(_jump(ops))
                if test is not None:
                    test.target = len(ops)
            for jump in jumps:
                jump.target = len(ops)
        case OneOf():
            pick = Op(PICK)
            ops.append(pick)
            targets, jumps = [], []
            for choice in statement.choices:
                targets.append(len(ops))
                _append(ops, choice)
                jumps.append(_jump(ops))
            pick.targets = tuple(targets)
            for jump in jumps:
                jump.target = len(ops)


def _jump(ops: list[Op]) -> Op:
    jump = Op(JUMP)
    ops.append(jump)
    return jump


def _function(function: Function) -> Op:
    if function.name == "raiseEventTopic":
        op = Op(RAISE)
        op.topic = normal_topic(function.argument)
        op.shown = "/" + op.topic
    elif function.name == "assignValue" and function.assignment is not None:
        op = Op(ASSIGN)
        op.assignments = (function.assignment,)
    else:
        op = Op(CALL)
        op.function = function.name
    op.argument = function.argument
    return op


def _prefixes(key: str) -> list[str]:
    """`a.b.c` is touched by changes of `a`, `a.b` and `a.b.c`: a dotted key reaches into objects."""
    parts = key.split(".")
    return [".".join(parts[: n + 1]) for n in range(len(parts))]
