"""Compiles a tree once at load into closures of one argument, the environment, so that evaluation is plain calls.

An expression can be used as a condition, a number or a value. Each node is compiled for the form that its parent reads,
so that no type is checked twice.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import neg
from typing import Any, TypeAlias

from rise_engine.expression.environment import (
    MISSING,
    Environment,
    Json,
    describe,
    is_true,
    lookup,
    native_number,
    to_double,
)
from rise_engine.expression.errors import EvaluationError
from rise_engine.expression.functions import CONSTANTS, NUMERIC, power
from rise_engine.expression.nodes import (
    Chain,
    Compare,
    Defined,
    FunctionCall,
    Key,
    Literal,
    Logic,
    NamedConstant,
    Negative,
    Node,
    Not,
    Part,
    Power,
    SituationTest,
    may_join,
    with_all_brackets,
)
from rise_engine.expression.operators import (
    LIST_FUNCTIONS,
    Condition,
    ListCall,
    Number,
    Operand,
    Refuse,
    compile_call,
    compile_chain,
    compile_comparison,
    compile_logic,
)
from rise_engine.expression.parts import PartReader

Compute: TypeAlias = Callable[[Any], Json]
REMEDY = "put the value into a text with braces where it is said, as in `Number {n}`, or keep it as a text"
NO_NUMBER = "is not a number"
NO_SUMMAND = f"is not a number, and `+` joins it only with other texts; {REMEDY}"
_QUESTIONS: dict[str, Callable[..., bool]] = {
    "in": lambda situation, rule, state: situation.in_state(rule, state),
    "rule": lambda situation, rule: situation.rule_runs(rule),
    "runs": lambda situation, act: situation.act_runs(act),
    "waits": lambda situation, act: situation.act_waits(act),
}
"""The query of an `AskedSituation` for each function of a property."""


class ExpressionCompiler:
    """Compiles the nodes of one expression. Errors quote its text."""

    __slots__ = ("text",)

    def __init__(self, text: str) -> None:
        self.text = text

    def compile_condition(self, node: Node) -> Condition:
        """Compile a node for its truth value."""
        match node:
            case Logic(operator, operands):
                return compile_logic(operator, [self.compile_condition(operand) for operand in operands])
            case Key(name):

                def is_key_true(env: Environment) -> bool:  # a separate closure saves 4 % in benchmarks/kernel_events
                    try:
                        value = env.memory[name]
                    except KeyError:
                        value = env.value_of_absent_key(name, False)
                    return is_true(value)

                return is_key_true
            case Compare():
                return compile_comparison(
                    node.operator,
                    self.compile_operand(node.left),
                    self.compile_operand(node.right),
                    self.comparison_error(node),
                )
            case Not(operand):
                negated = self.compile_condition(operand)
                return lambda env: not negated(env)
            case Literal(value):
                fixed = is_true(value)
                return lambda env: fixed
            case Defined(_, Part() as part):
                return self.compile_part(part, asked=True).is_there
            case Defined(name):
                return lambda env: lookup(env.memory, name)[0]
            case Chain() | Power() | Negative() if not may_join(node):
                number = self.compile_number(node)
                return lambda env: number(env) > 0
            case SituationTest():
                return self.compile_situation_test(node)
            case _:
                read = self.compile_operand(node)
                return lambda env: is_true(read(env))

    def compile_number(self, node: Node, problem: str = NO_NUMBER) -> Number:
        """Compile a node as a double: booleans are 1 and 0, a missing key is 0. `problem` describes other values."""
        match node:
            case Literal(value) if isinstance(value, (int, float)):
                fixed = float(value)
                return lambda env: fixed
            case Chain(first, rest):
                problem = NO_SUMMAND if all(sign == "+" for sign, _ in rest) else NO_NUMBER
                return compile_chain(
                    self.compile_number(first, problem),
                    [(sign, self.compile_number(operand, problem)) for sign, operand in rest],
                )
            case Negative(operand):
                return compile_call(neg, [self.compile_number(operand)])
            case Power(base, exponent):
                return compile_call(power, [self.compile_number(base), self.compile_number(exponent)])
            case FunctionCall(function, arguments) if function in NUMERIC:
                return compile_call(NUMERIC[function], [self.compile_number(argument) for argument in arguments])
            case FunctionCall("rand", arguments):
                return self.compile_rand([self.compile_number(argument) for argument in arguments])
            case FunctionCall("length", (argument,)):
                return self.compile_function(_length, argument, (str, list, dict), 0.0, "has no length")
            case Logic() | Not() | Compare() | Defined() | SituationTest():
                condition = self.compile_condition(node)
                return lambda env: 1.0 if condition(env) else 0.0
            case _:
                return self.compile_function(to_double, node, (int, float), 0.0, problem)

    def compile_operand(self, node: Node) -> Operand:
        """Compile a node for its value in its own type: MISSING for a missing key, doubles for computed numbers."""
        match node:
            case Key(name):

                def read(env: Environment) -> Json:
                    try:
                        return env.memory[name]
                    except KeyError:
                        return env.value_of_absent_key(name, MISSING)

                return read
            case Literal(value):
                return lambda env: value
            case NamedConstant(name):
                constant = CONSTANTS[name]
                return lambda env: env.memory.get(name, constant)
            case Negative(Literal(value)) if value.__class__ is int:
                opposite = -value  # exact, unlike a double
                return lambda env: opposite
            case Logic() | Not() | Compare() | Defined() | SituationTest():
                return self.compile_condition(node)
            case FunctionCall("lower", (argument,)):
                return self.compile_function(str.lower, argument, str, "", "is not a text")
            case Part():
                return self.compile_part(node)
            case FunctionCall(function, arguments) if function in LIST_FUNCTIONS:
                return self.compile_list_call(function, arguments)
            case Chain(first, rest) if may_join(node):
                return self.compile_sum([first, *(operand for _, operand in rest)])
            case _:
                return self.compile_number(node)

    def compile_value(self, node: Node) -> Operand:
        """Compile a whole expression for its value in the memory's form."""
        operand = self.compile_operand(node)
        if isinstance(node, Key):

            def stored(env: Environment) -> Json:
                value = operand(env)
                return None if value is MISSING else value

            return stored
        if isinstance(node, (Chain, Negative, Power, FunctionCall)):

            def computed(env: Environment) -> Json:
                value = operand(env)
                return native_number(value) if value.__class__ is float else value

            return computed
        return operand

    def compile_sum(self, nodes: list[Node]) -> Operand:
        """Compile a sum that joins texts or adds numbers, depending on the values."""
        operands = [self.compile_operand(node) for node in nodes]

        def run(env: Environment) -> Json:
            values = [operand(env) for operand in operands]
            known = [value for value in values if value is not MISSING]
            if not any(isinstance(value, str) for value in known):
                return sum((self._number(node, value) for node, value in zip(nodes, values, strict=True)), 0.0)
            if all(isinstance(value, str) for value in known):
                return "".join(known)
            text = next(value for value in known if isinstance(value, str))
            other = next(value for value in known if not isinstance(value, str))
            raise EvaluationError(
                f"`+` joins texts or adds numbers, and this one has {describe(text)} and {describe(other)}; {REMEDY}",
                self.text,
            )

        return run

    def _number(self, node: Node, value: Json) -> float:
        if value is MISSING:
            return 0.0
        if not isinstance(value, int | float):
            raise self._mismatch(node, value, NO_NUMBER)
        return to_double(value)

    def _mismatch(self, node: Node, value: Json, problem: str) -> EvaluationError:
        return EvaluationError(f"`{with_all_brackets(node)}` is {describe(value)}, which {problem}", self.text)

    def compile_part(self, part: Part, *, asked: bool = False) -> PartReader:
        """Compile the reader of a part. `asked`: only its existence matters, so a missing key is not reported."""
        base = self.compile_operand(part.base)
        if asked and isinstance(part.base, Key):
            name = part.base.name

            def look_up(env: Environment) -> Json:
                found, value = lookup(env.memory, name)
                return value if found else MISSING

            base = look_up
        steps = [step if isinstance(step, str) else self.compile_operand(step) for step in part.steps]
        return PartReader(part, base, steps, self.text)

    def compile_list_call(self, function: str, arguments: tuple[Node, ...]) -> ListCall:
        """Compile a function that returns a list."""
        takes_list = function != "range"
        entries = self.compile_operand(arguments[0]) if takes_list else None
        return ListCall(function, entries, [self.compile_number(each) for each in arguments[takes_list:]], self.text)

    def compile_function(
        self, compute: Compute, node: Node, types: type | tuple[type, ...], absent: Json, problem: str
    ) -> Operand:
        """Compile `compute` of a node's value, which must have one of these types; `absent` for a missing key."""
        operand = self.compile_operand(node)

        def run(env: Environment) -> Json:
            value = operand(env)
            if isinstance(value, types):
                return compute(value)
            if value is MISSING:
                return absent
            raise self._mismatch(node, value, problem)

        return run

    def compile_rand(self, bounds: list[Number]) -> Number:
        """Compile `rand(max)` or `rand(min, max)`, which draws exactly one number from the session's source."""

        def run(env: Environment) -> float:
            values = [bound(env) for bound in bounds]
            if env.rand is None:
                raise EvaluationError("there is no source of chance here, so `rand` has no value", self.text)
            low, high = (0.0, *values)[-2:]
            return low + env.rand() * (high - low)

        return run

    def compile_situation_test(self, node: SituationTest) -> Condition:
        """Compile a test of the situation in a property of a study."""
        ask = _QUESTIONS[node.function]
        names = node.names

        def run(env: Environment) -> bool:
            if env.situation is None:
                shown = with_all_brackets(node)
                raise EvaluationError(f"there is no situation here that could be asked for `{shown}`", self.text)
            return ask(env.situation, *names)

        return run

    def comparison_error(self, node: Compare) -> Refuse:
        """Return a function that makes the error for two sides that cannot be compared."""

        def error(left: Json, right: Json) -> EvaluationError:
            action = "order" if node.operator in ("<", "<=", ">", ">=") else f"use `{node.operator}` on"
            return EvaluationError(
                f"cannot {action} {describe(left)} and {describe(right)} in `{with_all_brackets(node)}`",
                self.text,
            )

        return error


def _length(value: str | list[Json] | dict[str, Json]) -> float:
    return float(len(value))
