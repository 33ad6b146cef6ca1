"""The working memory: JSON values by key, every change recorded (semantics.md 7)."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable
from typing import Any

from rise_engine.expression import Assignment, EvaluationError, lookup
from rise_engine.kernel.core import Core
from rise_engine.kernel.records import ENGINE, MemoryRecord
from rise_engine.scenario.model import SESSION


class WorkingMemory:
    """Writes to the memory. Reading is `core.env`, which conditions are evaluated against."""

    def __init__(self, core: Core, on_change: Callable[[str], None]) -> None:
        self._core = core
        self._on_change = on_change
        """Called with each key that was written: rules may be watching it."""
        self._known_keys = core.scenario.known_keys

    def load_start_values(self) -> None:
        """Take in the scenario's start values, recorded with the source `file`."""
        for key, value in self._core.scenario.memory.items():
            self.write(key, value, "file")

    def why_not_write(self, key: str) -> str:
        """Why nobody may set or delete a key, or empty."""
        head = key.partition(".")[0]
        if self._core.scenario.reads_session and head == SESSION:
            return f"`{SESSION}` says how the session stands; it is the engine's, and cannot be set"
        return f"`{head}` is a table of the scenario, which nothing changes" if head in self._core.tables else ""

    def is_key(self, word: str) -> bool:
        """Whether a bare word is a key: one that exists, or that something in the scenario sets."""
        return (
            lookup(self._core.memory, word)[0] or word.partition(".")[0] in self._known_keys or word in self._known_keys
        )

    def compute(self, assignments: tuple[Assignment, ...]) -> list[tuple[str, Any]]:
        """What assignments would write, key by key. Raises EvaluationError and writes nothing: it is all or nothing."""
        core = self._core
        for assignment in assignments:
            if problem := self.why_not_write(assignment.key):
                raise EvaluationError(problem, assignment.text)
        so_far = ChainMap[str, Any]({}, core.memory)
        """The memory with what the assignments before would write."""
        written = []
        try:
            for assignment in assignments:
                limited = bool(core.tables) and any(key.partition(".")[0] in core.tables for key in assignment.keys)
                key, value = assignment.entry(core.env, self._known_keys, so_far, limited=limited)
                so_far[key] = value
                written.append((key, value))
        finally:  # also of one that fails: else whatever is looked at next would be said to read those keys
            self._note_missing_keys(assignments)
        return written

    def _note_missing_keys(self, assignments: tuple[Assignment, ...]) -> None:
        for key in self._core.newly_missing():
            self._core.record_note(f"the memory has no value for {key!r}, which `{assignments[0].text}` reads")

    def assign(self, written: list[tuple[str, Any]], source: str) -> None:
        for key, value in written:
            self.write(key, value, source)

    def write(self, key: str, value: Any, source: str, *, part: str = "") -> None:
        """Set a key. `part`: which part of its value is another one than before, if no other is."""
        core = self._core
        memory = core.memory
        created = key not in memory
        old = memory.get(key)
        memory[key] = value
        core.emit(MemoryRecord, key, value, old, source, created=created)
        if source != ENGINE:  # what it keeps under `session` is not taken back
            core.memory_log.note(core.records[-1].seq, key, not created, old)
        self._on_change(part or key)

    def delete(self, key: str, source: str) -> None:
        core = self._core
        old = core.memory.pop(key)
        core.emit(MemoryRecord, key, None, old, source, deleted=True)
        core.memory_log.note(core.records[-1].seq, key, True, old)
        self._on_change(key)
