"""The memory (semantics.md 7) and what conditions see of it (semantics.md 8)."""

from __future__ import annotations

import copy
from typing import Any

from rise_engine.expression import Assignment, Environment, EvaluationError, Expression, lookup

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

    def set_by_condition(self, values: dict[str, Any], source: str) -> None:
        """What the condition of the session sets, where anybody may."""
        for key, value in values.items():
            if why := self.why_not_set(key):
                self.session.put("note", text=why, source="engine", stood=None, suspended=False)
            else:
                self.set(key, copy.deepcopy(value), source)

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

    @property
    def readable(self) -> dict[str, Any]:
        """All that can be read: also the tables of the scenario (semantics.md 7.3)."""
        return {**self.values, **{name: table.records for name, table in self.session.scenario.tables.items()}}

    def environment(self, missing: set[str], parts: dict[str, Any] | None = None) -> Environment:
        """What an expression is evaluated in."""
        return Environment(self.readable, self.session.chance.fraction, missing, self.session.chance.one_of, parts)

    def why_not_set(self, key: str) -> str:
        """Why nobody may set a key, or empty."""
        head = key.split(".")[0]
        if self.session.standing.owns(key):
            return "that is the engine's"
        return "that is a table" if head in self.session.scenario.tables else ""

    def taken_as_text(self, change: Assignment, value: Any) -> bool:
        """Whether the right side is a word that is no key."""
        return change.bare_word is not None and value == change.bare_word

    def computed(self, changes: tuple[Assignment, ...]) -> list[tuple[str, Any]]:
        """Which keys assignments give which values now; each sees what those before it set."""
        missing: set[str] = set()
        known, tables = self.session.scenario.known_keys, self.session.scenario.tables
        so_far, entries = self.readable, []
        try:
            for change in changes:
                limited = any(key.split(".")[0] in tables for key in change.keys)
                key, value = change.entry(self.environment(missing), known, so_far, limited=limited)
                so_far[key] = value
                entries.append((key, value))
        finally:
            self.note_missing(missing)
        return entries

    def note_missing(self, missing: set[str]) -> None:
        """Say of keys that do not exist that they were read."""
        for key in self.first_time(missing):
            self.session.put("note", text=f"there is no key {key}", source="engine", stood=None, suspended=False)

    def holds(self, condition: Expression, rule: str, state: str) -> bool:
        """Look at a condition; what was seen is recorded."""
        missing: set[str] = set()
        result, error = False, ""
        parts: dict[str, Any] = {}
        try:
            result = condition.compiled_condition(self.environment(missing, parts))
        except EvaluationError as why:
            error = str(why)
        values = {key: lookup(self.readable, key)[1] for key in condition.keys - condition.keys_of_parts_only}
        for name, table in self.session.scenario.tables.items():
            if name in values:
                values[name] = table.size_text
        values.update(parts)
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
