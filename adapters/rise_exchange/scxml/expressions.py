"""Translates our condition language to ECMAScript: one expression for each condition, formula and assignment.

As in the language's own compiler, each node is written for its parent: as a truth value, as a number, or as a value of
its own type. It calls the functions of `rise_exchange.scxml.export`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from typing import Any

from rise_engine.expression import Assignment, Expression
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
    may_join,
    walk,
)
from rise_engine.expression.operators import LIST_FUNCTIONS
from rise_engine.scenario.model import Scenario

EXACT_WHOLE_NUMBERS = 2**53
"""ECMAScript has every whole number up to this; ours are exact beyond it."""
APPROXIMATE_FUNCTIONS = frozenset({"sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "ln", "log10", "pow"})
"""Functions whose last digit depends on the interpreter in ECMAScript."""
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff]")
_CONSTANTS = {"pi": "Math.PI", "e": "Math.E", "r2d": "(180 / Math.PI)", "d2r": "(Math.PI / 180)"}
_NUMERIC = {
    **{name: f"Math.{name}" for name in ("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "abs", "exp", "sqrt")},
    **{name: name for name in ("floor", "ceil", "round", "lerp", "clamp")},
    "ln": "Math.log",
    "log10": "Math.log10",
    "min": "least",
    "max": "most",
    "pow": "power",
}
_ORDERS = {"<": "<", "<=": "<=", ">": ">", ">=": ">="}


def condition_code(expression: Expression) -> str:
    """Return an expression that is true if the condition holds, and false if it does not or ends with an error."""
    code = _truth(expression.root)
    return f"holds(() => {code})" if _can_fail(expression.root) else code


def delay_code(expression: Expression, unit: float | None) -> str:
    """Return an expression for a computed time in SCXML's form; an empty text if the value is no time."""
    unit_code = "" if unit is None else f", {number_code(unit)}"
    return f"computedDelay(() => {_stored(expression.root, finite=False)}{unit_code})"


def assignment_code(assignment: Assignment, scenario: Scenario) -> str:
    """Return an expression for the memory after an assignment; it throws if the assignment fails."""
    expression, target = assignment.expression, assignment.target
    word, known_keys = assignment.bare_word, scenario.known_keys  # an unknown bare word can be a text
    if expression is None:
        value = json_code(assignment.literal)
    elif word is not None and word not in known_keys and word.partition(".")[0] not in known_keys:
        value = f"wordOrKey({text_code(word)})"
    else:
        value = _stored(expression.root)
    if target is not None:
        assert isinstance(target.root, Part)
        code = f"changedPart({text_code(assignment.key)}, {value}, {_steps(target.root)})"
    else:
        code = f"changed({text_code(assignment.key)}, {value})"
    return f"limited({code})" if is_limited(assignment, scenario) else code


def is_limited(assignment: Assignment, scenario: Scenario) -> bool:
    """Whether the size of the new value is limited (semantics.md 8.7)."""
    gives_parts = assignment.expression is not None and assignment.expression.gives_parts
    reads_table = any(key.partition(".")[0] in scenario.tables for key in assignment.keys)
    return gives_parts or reads_table or assignment.target is not None


def text_code(text: str) -> str:
    """A text as a literal of ECMAScript that is valid in XML."""
    inner = json.dumps(text, ensure_ascii=False)[1:-1].replace('\\"', '"').replace("'", "\\'")
    return f"'{escape_for_xml(inner)}'"


def json_code(value: Any) -> str:
    """A JSON value on one line that is valid in XML."""
    return escape_for_xml(json.dumps(value, ensure_ascii=False))


def escape_for_xml(code: str) -> str:
    """Escape the characters that XML cannot contain, or would change; they only occur in texts."""
    return _NOT_XML.sub(lambda found: f"\\u{ord(found[0]):04x}", code)


def number_code(value: float) -> str:
    """A number as a literal."""
    return {"inf": "Infinity", "-inf": "-Infinity", "nan": "NaN"}.get(repr(value), repr(value))


def nodes_of(expression: Expression) -> Iterator[Node]:
    """Every node of an expression, in no particular order."""
    return (node for node, _ in walk(expression.root))


def _truth(node: Node) -> str:
    match node:
        case Logic("xor", operands):
            return f"odd({', '.join(map(_truth, operands))})"
        case Logic(operator, operands):
            return f" {'&&' if operator == 'and' else '||'} ".join(map(_bracketed(_truth), operands))
        case Key(name):
            return f"truth(key({text_code(name)}))"
        case Compare():
            return _comparison(node)
        case Not(operand):
            return f"!{_bracketed(_truth)(operand)}"
        case Literal(value):
            is_above_0 = isinstance(value, int | float) and value > 0
            return "true" if is_above_0 or (isinstance(value, str) and value) else "false"
        case Defined(_, Part() as part):
            return f"isThere(() => {_part(part)})"
        case Defined(name):
            return f"key({text_code(name)}) !== undefined"
        case Chain() | Power() | Negative() if not may_join(node):
            return f"{_bracketed(_number)(node)} > 0"
        case _:
            return f"truth({_value(node)})"


def _comparison(node: Compare) -> str:
    left, right = _value(node.left), _value(node.right)
    match node.operator:
        case "==":
            return f"same({left}, {right})"
        case "!=":
            return f"!same({left}, {right})"
        case "starts with":
            return f"text({left}).startsWith(text({right}))"
        case "ends with":
            return f"text({left}).endsWith(text({right}))"
        case "contains":
            return f"contains({left}, {right})"
    return f"order({left}, {right}) {_ORDERS[node.operator]} 0"


def _number(node: Node) -> str:
    match node:
        case Literal(value) if isinstance(value, int | float):
            return number_code(float(value)) if isinstance(value, bool | float) else str(value)
        case Chain(first, rest):
            terms = (f" {sign} {_bracketed(_number)(operand)}" for sign, operand in rest)
            return _bracketed(_number)(first) + "".join(terms)
        case Negative(operand):
            return f"-{_bracketed(_number)(operand)}"
        case Power(base, exponent):
            return f"power({_number(base)}, {_number(exponent)})"
        case FunctionCall("clamp01", (argument,)):
            return f"clamp({_number(argument)}, 0, 1)"
        case FunctionCall("rand", arguments):
            return f"rand({', '.join(map(_number, arguments))})"
        case FunctionCall("length", (argument,)):
            return f"lengthOf({_value(argument)})"
        case FunctionCall(function, arguments) if function in _NUMERIC:
            return f"{_NUMERIC[function]}({', '.join(map(_number, arguments))})"
        case Logic() | Not() | Compare() | Defined():
            return f"Number({_truth(node)})"
        case _:
            return f"number({_value(node)})"


def _value(node: Node) -> str:
    match node:
        case Key(name):
            return f"key({text_code(name)})"
        case Literal(str() as text):
            return text_code(text)
        case Literal(bool() | None as word):
            return json.dumps(word)
        case NamedConstant(name):
            return f"named({text_code(name)}, {_CONSTANTS[name]})"
        case Logic() | Not() | Compare() | Defined():
            return _truth(node)
        case FunctionCall("lower", (argument,)):
            return f"text({_value(argument)}).toLowerCase()"
        case Part():
            return _part(node)
        case FunctionCall(function, arguments) if function in LIST_FUNCTIONS:
            entries = [] if function == "range" else [_value(arguments[0])]
            return f"{function}({', '.join([*entries, *map(_number, arguments[len(entries) :])])})"
        case Chain(first, rest) if may_join(node):
            return f"sum({', '.join(map(_value, (first, *(operand for _, operand in rest))))})"
        case _:
            return _number(node)


def _stored(node: Node, *, finite: bool = True) -> str:
    """A value as the memory stores it; not `finite`: any number is allowed."""
    return f"kept({_value(node)})" if finite and not isinstance(node, Literal) else _value(node)


def _part(part: Part) -> str:
    return f"part({_value(part.base)}, {_steps(part)})"


def _steps(part: Part) -> str:
    return ", ".join(text_code(step) if isinstance(step, str) else f"() => {_value(step)}" for step in part.steps)


def _bracketed(write: Callable[[Node], str]) -> Callable[[Node], str]:
    """Return a function that writes an operand, in brackets if necessary."""

    def written(node: Node) -> str:
        code = write(node)
        is_atom = isinstance(node, Key | Part | FunctionCall | NamedConstant) or (
            isinstance(node, Literal) and not code.startswith("-")
        )
        return code if is_atom else f"({code})"

    return written


_SAFE = (Key, Logic, Not, Literal, NamedConstant)


def _can_fail(node: Node) -> bool:
    """Whether a condition can end with an error."""
    return any(
        not isinstance(each, _SAFE)
        and not (isinstance(each, Defined) and each.part is None)
        and not (isinstance(each, Compare) and each.operator in ("==", "!="))
        for each, _ in walk(node)
    )
