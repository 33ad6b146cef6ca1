"""What stands in the inputs of a shared session for what is private: other values that are as equal to one another as
the real ones were, so that a condition which only compares them is not moved."""

from __future__ import annotations

import json
import re
from collections.abc import Collection
from typing import Any

from rise_engine.expression import Assignment, ExpressionError
from rise_engine.expression.environment import Environment
from rise_engine.expression.errors import EvaluationError
from rise_engine.privacy.private_values import PrivateValues

_FIRST_NUMBER = 90_001
"""Five digits: a number that is found wherever it stands (`private_values.WITHIN_NUMBERS`)."""
_LITERAL = re.compile(r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|(?<![\w.])(?:\d+\.\d+|\d{2,})(?!\w)""")
"""A text, or a number of two digits and more, in an expression."""
_NO_NAME = re.compile(r"[^A-Za-z0-9]+")


class StandIns:
    """Gives every value of a private key another, the same one each time."""

    def __init__(self, private: PrivateValues, known_keys: Collection[str]) -> None:
        """`private`: which has taken in everything that the keys held. `known_keys`: all keys of the scenario."""
        self._private = private
        self._known_keys = known_keys
        self._given: dict[tuple[bool, str], tuple[str, str | int]] = {}

    def values(self) -> list[tuple[str, str | int]]:
        """Those that were given, with the key of each as `{person_name}`."""
        return list(self._given.values())

    def replace(self, value: Any) -> Any:
        """A JSON value in whose texts and numbers nothing private stands."""
        return self._private.replace_values(value, self._stand_in)

    def replace_memory(self, memory: dict[str, Any]) -> dict[str, Any]:
        """Values of memory keys by their names, those of private keys among them."""
        return {key: self._replace_all(key, value) for key, value in memory.items()}

    def replace_assignment(self, behavior: str) -> str:
        """The behaviour of assignValue: `person_name = "Anna"`, also when it cannot be read."""
        try:
            assignments = Assignment.parse_all(behavior)
        except ExpressionError:
            named = [
                key for key in sorted(self._private.keys) if re.search(rf"(?<![\w.]){re.escape(key)}(?!\w)", behavior)
            ]
            if named:
                return "; ".join(f"{key} = {{{key}}}" for key in named)
            return str(self.replace(behavior))
        if not any(self._private.is_hidden(each.key) for each in assignments):
            return str(self.replace(behavior))
        if behavior.lstrip().startswith("{"):
            values = {each.key: self._replace_all(each.key, each.literal) for each in assignments}
            return json.dumps(values, ensure_ascii=False)
        (assignment,) = assignments
        left, equals, _ = behavior.partition("=")
        word = assignment.bare_word
        if word is not None:  # a text that somebody did not quote, unless it is a key; then nobody typed a value
            return behavior if word in self._known_keys else f"{left}{equals} {self._replace_all(assignment.key, word)}"
        value = _constant(assignment)
        if value is None:
            return self._replace_literals(f"{{{assignment.key}}}", str(self.replace(behavior)), len(left))
        return f"{left}{equals} {json.dumps(self._replace_all(assignment.key, value[0]), ensure_ascii=False)}"

    def _replace_literals(self, slot: str, text: str, start: int) -> str:
        """What is written in an expression that reads something else, too, or that cannot be computed."""

        def replace(found: re.Match[str]) -> str:
            written = found[0]
            if written[0] in "\"'":
                return f"{written[0]}{self._stand_in(slot, written[1:-1])}{written[0]}" if written[1:-1] else written
            return str(self._stand_in(slot, float(written)))

        return text[:start] + _LITERAL.sub(replace, text[start:])

    def _replace_all(self, key: str, value: Any) -> Any:
        """Of a private key nothing stays; of another, what no private key held."""
        if not self._private.is_hidden(key):
            return self.replace(value)
        slot = f"{{{key.partition('.')[0].partition('[')[0]}}}"
        return self._hide(slot, value)

    def _hide(self, slot: str, value: Any) -> Any:
        if isinstance(value, dict):
            return {name: self._hide(slot, each) for name, each in value.items()}
        if isinstance(value, list):
            return [self._hide(slot, each) for each in value]
        if value is None or value == "":
            return value  # nothing is nobody's
        if isinstance(value, bool):
            return self._stand_in(slot, json.dumps(value))
        return self._stand_in(slot, value)

    def _stand_in(self, slot: str, found: str | int | float) -> str | int:
        """For a number a number: a scenario that reckons with it goes on, and is noticed when it comes to something
        else. For a text a word for each of its words: who is called by the first name has the first one there, too."""
        if isinstance(found, str):
            return " ".join(str(self._give(slot, word.casefold(), number=False)) for word in found.split())
        return self._give(slot, f"{found:g}", number=True)

    def _give(self, slot: str, found: str, *, number: bool) -> str | int:
        known = (number, found)
        if known not in self._given:
            count = len(self._given)
            value = _FIRST_NUMBER + count if number else f"{_NO_NAME.sub('', slot).upper()}{count + 1}"
            self._given[known] = (slot, value)
        return self._given[known][1]


def _constant(assignment: Assignment) -> tuple[Any] | None:
    """The value of a right side that reads nothing; None: it reads something, so nobody typed a value."""
    expression = assignment.expression
    if expression is not None and (expression.keys or expression.draws):
        return None
    try:
        return (assignment.evaluate(Environment({})),)
    except EvaluationError:
        return None
