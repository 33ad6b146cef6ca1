"""Stand-ins for private values in the inputs of a shared session. Equal values get equal stand-ins, so that
conditions which only compare them have the same result."""

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
"""Five digits, so that it is found within longer words too (`private_values.WITHIN_NUMBERS`)."""
_LITERAL = re.compile(r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|(?<![\w.])(?:\d+\.\d+|\d{2,})(?!\w)""")
"""A text, or a number of at least two digits, in an expression."""
_NO_NAME = re.compile(r"[^A-Za-z0-9]+")


class StandIns:
    """A table that gives each value of a private key its stand-in, always the same one."""

    def __init__(self, private: PrivateValues, known_keys: Collection[str]) -> None:
        """`private`: has collected all values of the keys. `known_keys`: all keys of the scenario."""
        self._private = private
        self._known_keys = known_keys
        self._given: dict[tuple[bool, str], tuple[str, str | int]] = {}

    def values(self) -> list[tuple[str, str | int]]:
        """Return all stand-ins, each with its key as `{person_name}`."""
        return list(self._given.values())

    def replace(self, value: Any) -> Any:
        """Replace private values in the texts and numbers of a JSON value."""
        return self._private.replace_values(value, self._stand_in)

    def replace_memory(self, memory: dict[str, Any]) -> dict[str, Any]:
        """Replace the values of memory keys, given by name, some of them private."""
        return {key: self._replace_all(key, value) for key, value in memory.items()}

    def replace_assignment(self, behavior: str) -> str:
        """Replace values in the behaviour of assignValue: `person_name = "Anna"`, also when it cannot be read."""
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
        if word is not None:  # an unquoted text, unless it is a key: then no value was typed
            return behavior if word in self._known_keys else f"{left}{equals} {self._replace_all(assignment.key, word)}"
        value = _constant(assignment)
        if value is None:
            return self._replace_literals(f"{{{assignment.key}}}", str(self.replace(behavior)), len(left))
        return f"{left}{equals} {json.dumps(self._replace_all(assignment.key, value[0]), ensure_ascii=False)}"

    def _replace_literals(self, slot: str, text: str, start: int) -> str:
        """Replace the literals in an expression that also reads something, or cannot be computed."""

        def replace(found: re.Match[str]) -> str:
            written = found[0]
            if written[0] in "\"'":
                return f"{written[0]}{self._stand_in(slot, written[1:-1])}{written[0]}" if written[1:-1] else written
            return str(self._stand_in(slot, float(written)))

        return text[:start] + _LITERAL.sub(replace, text[start:])

    def _replace_all(self, key: str, value: Any) -> Any:
        """Replace the whole value of a private key. In other keys, replace what private keys held."""
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
            return value  # an empty value does not identify anybody
        if isinstance(value, bool):
            return self._stand_in(slot, json.dumps(value))
        return self._stand_in(slot, value)

    def _stand_in(self, slot: str, found: str | int | float) -> str | int:
        """Return the stand-in. A number gets a number: a scenario can compute with it, and a new outcome is noticed.
        Each word of a text gets a word, so that a first name has the same stand-in alone and in the full name."""
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
    """Return the value of a right side that reads nothing. None: it reads something, so no value was typed."""
    expression = assignment.expression
    if expression is not None and (expression.keys or expression.draws):
        return None
    try:
        return (assignment.evaluate(Environment({})),)
    except EvaluationError:
        return None
