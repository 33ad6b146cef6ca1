"""Translates scripts of a chart to our conditions and values, exactly or not at all.

The languages differ in truth (ECMAScript: every number except 0), in equality (`'1' == 1`), and in `+`. So the
translation first determines the kinds of value that a variable can have at a script's place. It refuses everything with
another meaning for one of them.
"""

from __future__ import annotations

import json
import operator as operators
from collections.abc import Callable, Mapping
from itertools import product
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_exchange.scxml.script import (
    UNDECLARED,
    ArrayNode,
    ChartRefusedError,
    Constant,
    EventField,
    Operation,
    ScriptNode,
    Variable,
)

Kind = Literal["number", "text", "boolean", "null", "undefined", "list", "undeclared", "refused"]
"""`undeclared`: the variable does not exist. `refused`: nothing is known of it, which was reported."""


class Possible(Struct, frozen=True):
    """The possible values at a place."""

    kinds: frozenset[Kind]
    constant: Any = None
    """The value if it is always the same: a tuple for a list; the text for a field of `_event`; a `Constant` for a
    variable whose values are followed. Otherwise None."""
    most: int = 0
    """For a `<send>`: the number of possibly pending events."""

    def joined(self, other: Possible) -> Possible:
        """Return the possible values of one or the other."""
        constant = self.constant if self.constant == other.constant else None
        return Possible(self.kinds | other.kinds, constant, max(self.most, other.most))


Knowledge: TypeAlias = Mapping[str, Possible]
"""The knowledge at one place of the chart, by the names of variables, including `_event.name`."""


class TranslatedValue(Struct, frozen=True):
    """A value in our language."""

    text: str
    strength: int
    """The binding strength of its outermost operator; `_ATOM` never needs brackets."""
    value: Possible
    truth: bool | None = None
    """Whether it holds, if known in advance."""


_OR, _AND, _NOT, _EQUAL, _ORDER, _SUM, _PRODUCT, _NEGATIVE, _ATOM = range(9)
_NUMBER, _TEXT, _BOOLEAN, _NULL, _UNDEFINED, _REFUSED = (
    Possible(frozenset({kind})) for kind in ("number", "text", "boolean", "null", "undefined", "refused")
)
UNDEFINED, REFUSED = _UNDEFINED, _REFUSED
_COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "==": operators.eq,
    "===": operators.eq,
    "!=": operators.ne,
    "!==": operators.ne,
    "<": operators.lt,
    "<=": operators.le,
    ">": operators.gt,
    ">=": operators.ge,
}
_ARITHMETIC: dict[str, Callable[[Any, Any], Any]] = {"+": operators.add, "-": operators.sub, "*": operators.mul}
_NOTHING: frozenset[Kind] = frozenset({"null", "undefined"})
_NUMERIC: frozenset[Kind] = frozenset({"number", "boolean"})


def known_constant(node: ScriptNode, knowledge: Knowledge) -> Possible | None:
    """Return the value of a written constant or list of constants; None: it must be computed."""
    if isinstance(node, Constant):
        return _possible_of(node)
    if isinstance(node, ArrayNode) and all(isinstance(entry, Constant) for entry in node.entries):
        return Possible(frozenset({"list"}), tuple(node.entries))
    if isinstance(node, Variable) and node.name in knowledge:
        found = knowledge[node.name]
        return found if found.kinds == {"list"} and found.constant is not None else None
    return None


def value_beforehand(node: ScriptNode, knowledge: Knowledge) -> Constant | None:
    """Return the constant value of a script, as ECMAScript computes it; None: unknown."""
    match node:
        case Constant():
            return node
        case Variable(name) if name in knowledge:
            constant = knowledge[name].constant
            return constant if isinstance(constant, Constant) else None
        case Operation(operator, operands):
            values = [value_beforehand(operand, knowledge) for operand in operands]
            known = [value for value in values if value is not None]
            if operator in ("&&", "||") and known and values[0] is not None:
                return values[1] if bool(known[0].value) == (operator == "&&") else known[0]
            return _work_out(operator, known) if len(known) == len(values) else None
    return None


def _work_out(operator: str, operands: list[Constant]) -> Constant | None:
    """Compute operators of one number, or of two values of one kind."""
    values = [operand.value for operand in operands]
    if operator == "not":
        return Constant(not values[0])
    kinds = {_possible_of(operand) for operand in operands}
    if len(values) == 2 and len(kinds) == 1 and operator in _COMPARISONS and kinds <= {_NUMBER, _TEXT}:
        return Constant(_COMPARISONS[operator](*values))
    if len(values) == 2 and operator in _ARITHMETIC and kinds == {_NUMBER}:
        return Constant(_ARITHMETIC[operator](*values))
    return None


def translate_constant(value: Constant) -> str:
    """Write a constant in our language; `undefined` is null."""
    return json.dumps(value.value, ensure_ascii=False)


def translate_value(node: ScriptNode, knowledge: Knowledge) -> TranslatedValue:
    """Write a value in our language. Raises ChartRefusedError."""
    return _Translator(knowledge).value(node)


def translate_condition(node: ScriptNode, knowledge: Knowledge) -> TranslatedValue:
    """Write whether a value is true in ECMAScript, in our language. Raises ChartRefusedError."""
    return _Translator(knowledge).truth(node)


def all_hold(conditions: list[TranslatedValue]) -> str:
    """Write a condition that holds if all of these do; `true` if there are none."""
    texts = [_bracketed(each, _NOT) if len(conditions) > 1 else each.text for each in conditions]
    return " and ".join(texts) or "true"


class _Translator:
    def __init__(self, knowledge: Knowledge) -> None:
        self.knowledge = knowledge

    # --- values ---

    def value(self, node: ScriptNode) -> TranslatedValue:
        match node:
            case Constant():
                return TranslatedValue(translate_constant(node), _ATOM, _possible_of(node), _truth_of(node))
            case Variable():
                return self.variable(node.name)
            case EventField():
                return self.event_field(node.name)
            case Operation(operator, operands):
                return self.operation(operator, operands)
            case ArrayNode():
                raise _refused("a list can only be what a variable holds from the start", "list-arithmetic")
        raise AssertionError(node)  # In() is already resolved

    def variable(self, name: str) -> TranslatedValue:
        found = self.knowledge.get(name)
        if found is None or found.kinds == {"undeclared"}:
            raise ChartRefusedError(UNDECLARED, name)
        if "undeclared" in found.kinds:
            raise _refused(f"`{name}` may not be declared by then; declare it with `<data>`")
        return TranslatedValue(name, _ATOM, found)

    def event_field(self, name: str) -> TranslatedValue:
        found = self.knowledge.get(f"_event.{name}")
        if found is None or (found.constant is None and "text" in found.kinds):
            message = f"`_event.{name}` is not the same on all paths to here, and rules do not know it while they run"
            raise _refused(message, "computed")
        if found.kinds == {"undeclared"}:
            raise _refused("no event has happened by then", "computed")
        text = "null" if found.constant is None else json.dumps(found.constant, ensure_ascii=False)
        return TranslatedValue(text, _ATOM, found, bool(found.constant))

    def operation(self, operator: str, operands: tuple[ScriptNode, ...]) -> TranslatedValue:
        match operator:
            case "refused":
                return TranslatedValue("null", _ATOM, _REFUSED)
            case "||" | "&&":
                if any(not self.value(operand).value.kinds <= {"boolean", "refused"} for operand in operands):
                    raise _refused(f"`{operator}` gives one of its values in ECMAScript; here it is true or false")
                return self.logic(operator, operands)
            case "not":
                return self.logic(operator, operands)
            case "==" | "!=" | "===" | "!==":
                return self.equality(operator, *operands)
            case "<" | "<=" | ">" | ">=":
                return self.ordering(operator, *operands)
            case "typeof":
                name = self.type_name(operands[0])
                return TranslatedValue(json.dumps(name), _ATOM, _TEXT, True)
            case "%":
                raise _refused("the remainder `%` has no exact counterpart; of n by 2, write n - 2 * Math.floor(n / 2)")
            case "/":
                divisor = operands[1]
                if not isinstance(divisor, Constant) or divisor.value in (0, None):
                    raise _refused("a divisor must be a literal number, and not 0")
        translated = [self.number(operand, operator) for operand in operands]
        if any("refused" in each.value.kinds for each in translated):
            return TranslatedValue("null", _ATOM, _REFUSED)
        if operator in ("floor", "ceil", "abs"):
            return TranslatedValue(f"{operator}({translated[0].text})", _ATOM, _NUMBER)
        if operator == "negative":
            return TranslatedValue(f"-{_bracketed(translated[0], _ATOM)}", _NEGATIVE, _NUMBER)
        if operator == "positive":
            return translated[0]
        strength = _SUM if operator in "+-" else _PRODUCT
        left, right = _bracketed(translated[0], strength), _bracketed(translated[1], strength + 1)
        return TranslatedValue(f"{left} {operator} {right}", strength, _NUMBER)

    def number(self, node: ScriptNode, operator: str) -> TranslatedValue:
        translated = self.value(node)
        kinds = translated.value.kinds
        if "refused" in kinds:
            return TranslatedValue("null", _ATOM, _REFUSED)
        if kinds == {"number"}:
            return translated
        if operator == "+" and "text" in kinds:
            raise _refused("texts cannot be joined in rules; write both into the text of an act, with {key}")
        if "list" in kinds:
            raise _refused("lists cannot be computed with", "list-arithmetic")
        raise _refused(f"`{translated.text}` {_may_be(kinds)} here, and `{operator}` is the same only for numbers")

    # --- truth ---

    def truth(self, node: ScriptNode) -> TranslatedValue:
        """Write a condition that holds if the value is true in ECMAScript."""
        if isinstance(node, Operation) and node.operator in ("||", "&&", "not"):
            return self.logic(node.operator, node.operands)
        translated = self.value(node)
        kinds = translated.value.kinds
        if translated.truth is not None:
            return _constant(translated.truth)
        if "refused" in kinds:
            return TranslatedValue("null", _ATOM, _REFUSED)
        if kinds <= {"boolean"}:
            return translated
        if kinds <= _NOTHING:
            return _constant(False)
        if kinds <= _NOTHING | {"text"} or kinds <= _NOTHING | {"boolean"}:
            return TranslatedValue(translated.text, translated.strength, _BOOLEAN)
        if kinds == {"list"}:
            return _constant(True)
        text = _bracketed(translated, _SUM)
        holds = TranslatedValue(f"{text} < 0 or {text} > 0", _OR, _BOOLEAN)  # false for NaN
        if kinds <= _NUMERIC:
            return holds
        if kinds <= _NUMERIC | _NOTHING:
            return TranslatedValue(f"{text} != null and {_bracketed(holds, _NOT)}", _AND, _BOOLEAN)
        raise _refused(f"`{translated.text}` {_may_be(kinds)} here; compare it with something")

    def logic(self, operator: str, operands: tuple[ScriptNode, ...]) -> TranslatedValue:
        translated = [self.truth(operand) for operand in operands]
        if any("refused" in each.value.kinds for each in translated):
            return TranslatedValue("null", _ATOM, _REFUSED)
        if operator == "not":
            inner = translated[0]
            if inner.truth is not None:
                return _constant(not inner.truth)
            return TranslatedValue(f"not {_bracketed(inner, _ATOM)}", _NOT, _BOOLEAN)
        decisive = operator == "||"
        if translated[0].truth is not None:
            return _constant(decisive) if translated[0].truth == decisive else translated[1]
        if translated[1].truth is not None and translated[1].truth != decisive:
            return translated[0]
        if translated[1].truth is not None:  # the first has no side effects
            return _constant(decisive)
        word, strength = ("or", _OR) if decisive else ("and", _AND)
        return TranslatedValue(f" {word} ".join(_bracketed(each, _EQUAL) for each in translated), strength, _BOOLEAN)

    # --- comparisons ---

    def equality(self, operator: str, left: ScriptNode, right: ScriptNode) -> TranslatedValue:
        is_equal, is_strict = operator[0] == "=", len(operator) == 3
        if (answer := self.type_question(left, right, is_equal)) is not None:
            return answer
        a, b = self.value(left), self.value(right)
        if "refused" in a.value.kinds | b.value.kinds:
            return TranslatedValue("null", _ATOM, _REFUSED)
        pairs = {_equality_of(x, y, is_strict) for x, y in product(a.value.kinds, b.value.kinds)}
        if "unlike" in pairs:
            raise _refused(
                f"`{a.text}` {_may_be(a.value.kinds)} and `{b.text}` {_may_be(b.value.kinds)} here; ECMAScript would "
                "turn one into the other before it compares"
            )
        written = isinstance(left, Constant | EventField) and isinstance(right, Constant | EventField)
        if written and a.value.kinds == b.value.kinds:
            return _constant((a.text == b.text) == is_equal)
        if pairs == {"never"}:
            return _constant(not is_equal)
        sign = "=" if is_equal else "!="
        return TranslatedValue(f"{_bracketed(a, _ORDER)} {sign} {_bracketed(b, _ORDER)}", _EQUAL, _BOOLEAN)

    def ordering(self, operator: str, left: ScriptNode, right: ScriptNode) -> TranslatedValue:
        a, b = self.value(left), self.value(right)
        kinds = a.value.kinds | b.value.kinds
        if "refused" in kinds:
            return TranslatedValue("null", _ATOM, _REFUSED)
        if not (kinds <= _NUMERIC or kinds == {"text"}):
            raise _refused(
                f"`{operator}` compares numbers, or texts: `{a.text}` {_may_be(a.value.kinds)} here, and `{b.text}` "
                f"{_may_be(b.value.kinds)}"
            )
        return TranslatedValue(f"{_bracketed(a, _SUM)} {operator} {_bracketed(b, _SUM)}", _ORDER, _BOOLEAN)

    def type_question(self, left: ScriptNode, right: ScriptNode, is_equal: bool) -> TranslatedValue | None:
        """`typeof x == 'undefined'` and similar; without `is_equal`, with `!=`."""
        if isinstance(right, Operation) and right.operator == "typeof":
            left, right = right, left
        if not (isinstance(left, Operation) and left.operator == "typeof" and isinstance(right, Constant)):
            return None
        inner = left.operands[0]
        kinds = self.kinds_of(inner)
        names = {_TYPE_NAMES.get(kind, "") for kind in kinds}
        if "" in names:
            return TranslatedValue("null", _ATOM, _REFUSED)
        if right.value not in names:
            return _constant(not is_equal)
        if len(names) == 1:
            return _constant(is_equal)
        if right.value == "undefined" and "undeclared" not in kinds and "null" not in kinds:
            return TranslatedValue(f"{self.value(inner).text} {'=' if is_equal else '!='} null", _EQUAL, _BOOLEAN)
        raise _refused(f"what {_may_be(kinds)} here cannot be asked for its type")

    def type_name(self, node: ScriptNode) -> str:
        names = {_TYPE_NAMES.get(kind, "") for kind in self.kinds_of(node)}
        if len(names) != 1:
            raise _refused("`typeof` can only be compared with a text here")
        return names.pop()

    def kinds_of(self, node: ScriptNode) -> frozenset[Kind]:
        if isinstance(node, Variable) and (found := self.knowledge.get(node.name)) is None:
            return frozenset({"undeclared"})
        if isinstance(node, Variable) and found is not None:
            return found.kinds
        return self.value(node).value.kinds


_TYPE_NAMES = {
    "number": "number",
    "text": "string",
    "boolean": "boolean",
    "null": "object",
    "undefined": "undefined",
    "list": "object",
    "undeclared": "undefined",
}
_KIND_WORDS = {
    "number": "a number",
    "text": "a text",
    "boolean": "true or false",
    "null": "null",
    "undefined": "undefined",
    "list": "a list",
    "undeclared": "not declared",
}


def _equality_of(left: Kind, right: Kind, is_strict: bool) -> str:
    """Compare two kinds: `same` as in our language, `never` equal, or `unlike` ours."""
    kinds = {left, right}
    if "list" in kinds:
        return "unlike" if left == right else "never" if kinds & _NOTHING or is_strict else "unlike"
    if kinds <= _NOTHING:
        return "same" if not is_strict or left == right else "unlike"
    if kinds & _NOTHING:
        return "never"
    if left == right:
        return "same"
    if is_strict:
        return "never" if "text" in kinds else "unlike"
    return "unlike" if "text" in kinds else "same"


def _may_be(kinds: frozenset[Kind]) -> str:
    """`is a number`, `may be a number or undefined`."""
    words = [word for kind, word in _KIND_WORDS.items() if kind in kinds]
    return f"is {words[0]}" if len(words) == 1 else f"may be {', '.join(words[:-1])} or {words[-1]}"


def _possible_of(node: Constant) -> Possible:
    value = node.value
    if value is None:
        return _UNDEFINED if node.is_undefined else _NULL
    if isinstance(value, bool):
        return _BOOLEAN
    return _TEXT if isinstance(value, str) else _NUMBER


def _truth_of(node: Constant) -> bool:
    return bool(node.value)


def _constant(holds: bool) -> TranslatedValue:
    return TranslatedValue("true" if holds else "false", _ATOM, _BOOLEAN, holds)


def _bracketed(translated: TranslatedValue, least: int) -> str:
    """Return its text, in brackets unless it binds at least this tightly."""
    return translated.text if translated.strength >= least else f"({translated.text})"


def _refused(message: str, code: str = "expression") -> ChartRefusedError:
    return ChartRefusedError(code, message)
