"""The memory (semantics.md 7) and what conditions see of it (semantics.md 8)."""

from __future__ import annotations

import copy
from typing import Any

from rise_engine.expression import Assignment, Environment, EvaluationError, Expression, assigned_entry, lookup

from .session import Session


class Memory:
    """Keys with values."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.values: dict[str, Any] = {}
        self.told: set[str] = set()
        """Keys that do not exist and of which this was said."""

    def begin(self) -> None:
        """The start values."""
        for key, value in self.session.scenario.memory.items():
            self.set(key, copy.deepcopy(value), "file")

    def set(self, key: str, value: Any, source: str, part: str = "") -> None:
        """Change one key, or one part of the object that is its value."""
        created, old = key not in self.values, self.values.get(key)
        self.values[key] = value
        self.session.put("memory", key=key, value=value, old=old, source=source, deleted=False, created=created)
        self.session.rules.key_changed(part or key)

    def delete(self, key: str, source: str) -> None:
        """Take one away."""
        old = self.values.pop(key)
        self.session.put("memory", key=key, value=None, old=old, source=source, deleted=True, created=False)
        self.session.rules.key_changed(key)

    def environment(self, missing: set[str]) -> Environment:
        """What an expression is evaluated in."""
        return Environment(self.values, self.session.chance.fraction, missing)

    def entry(self, key: str, value: Any) -> tuple[str, Any]:
        """The key that gets another value when `key` is set: the object that it reaches into."""
        return assigned_entry(self.values, key, value)

    def taken_as_text(self, change: Assignment, value: Any) -> bool:
        """Whether the right side is a word that is no key."""
        return change.bare_word is not None and value == change.bare_word

    def computed(self, change: Assignment) -> Any:
        """The value that an assignment gives now."""
        missing: set[str] = set()
        known = self.session.scenario.known_keys
        try:
            return change.evaluate(self.environment(missing), known)
        finally:
            self.note_missing(missing)

    def note_missing(self, missing: set[str]) -> None:
        """Say of keys that do not exist that they were read."""
        for key in self.first_time(missing):
            self.session.put("note", text=f"there is no key {key}", source="engine")

    def holds(self, condition: Expression, rule: str, state: str) -> bool:
        """Look at a condition; what was seen is recorded."""
        missing: set[str] = set()
        result, error = False, ""
        values = {key: lookup(self.values, key)[1] for key in condition.keys}
        try:
            result = condition.as_condition(self.values, self.session.chance.fraction, missing)
        except EvaluationError as why:
            error = str(why)
        self.session.put(
            "condition",
            rule=rule,
            state=state,
            expression=condition.text,
            values=values,
            result=result,
            error=error,
            missing=self.first_time(missing),
        )
        return result

    def first_time(self, missing: set[str]) -> list[str]:
        """Those of them that nobody has been told of yet."""
        new = sorted(missing - self.told)
        self.told |= missing
        return new
