"""The working memory: JSON values by key, with a record of every change (semantics.md 7)."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable
from typing import Any

from rise_engine.expression import Assignment, EvaluationError, lookup
from rise_engine.kernel.core import Core
from rise_engine.kernel.records import ENGINE, MemoryRecord
from rise_engine.scenario.model import SESSION


class WorkingMemory:
    """Writes to the memory. Conditions read it through `core.env`."""

    def __init__(self, core: Core, on_change: Callable[[str], None]) -> None:
        self._core = core
        self._on_change = on_change
        """Called with each written key, because rules may watch it."""
        self._known_keys = core.scenario.known_keys

    def load_start_values(self) -> None:
        """Write the scenario's start values. Their source in the record is `file`."""
        for key, value in self._core.scenario.memory.items():
            self.write(key, value, "file")

    def why_not_write(self, key: str) -> str:
        """Why a key may not be set or deleted; empty: it may."""
        head = key.partition(".")[0]
        if self._core.scenario.reads_session and head == SESSION:
            return f"`{SESSION}` has the engine's values about the session, and cannot be set"
        return f"`{head}` is a table of the scenario, which nothing changes" if head in self._core.tables else ""

    def is_key(self, word: str) -> bool:
        """Whether a bare word is a key: one that exists, or that something in the scenario sets."""
        return (
            lookup(self._core.memory, word)[0] or word.partition(".")[0] in self._known_keys or word in self._known_keys
        )

    def compute(self, assignments: tuple[Assignment, ...]) -> list[tuple[str, Any]]:
        """Return the values that assignments would write, by key. Raises EvaluationError. Nothing is written."""
        core = self._core
        for assignment in assignments:
            if problem := self.why_not_write(assignment.key):
                raise EvaluationError(problem, assignment.text)
        so_far = ChainMap[str, Any]({}, core.memory)
        """The memory with the values of the previous assignments."""
        written = []
        try:
            for assignment in assignments:
                limited = bool(core.tables) and any(key.partition(".")[0] in core.tables for key in assignment.keys)
                key, value = assignment.entry(core.env, self._known_keys, so_far, limited=limited)
                so_far[key] = value
                written.append((key, value))
        finally:  # also after a failure, because later evaluations would report those keys
            self._note_missing_keys(assignments)
        return written

    def _note_missing_keys(self, assignments: tuple[Assignment, ...]) -> None:
        for key in self._core.newly_missing():
            self._core.record_note(f"the memory has no value for {key!r}, which `{assignments[0].text}` reads")

    def assign(self, written: list[tuple[str, Any]], source: str) -> None:
        for key, value in written:
            self.write(key, value, source)

    def write(self, key: str, value: Any, source: str, *, part: str = "") -> None:
        """Set a key. `part`: the only part of its value that differs; empty: several."""
        core = self._core
        memory = core.memory
        created = key not in memory
        old = memory.get(key)
        memory[key] = value
        core.emit(MemoryRecord, key, value, old, source, created=created)
        if source != ENGINE:  # a step back does not restore the engine's values under `session`
            core.memory_log.note(core.records[-1].seq, key, not created, old)
        self._on_change(part or key)

    def delete(self, key: str, source: str) -> None:
        core = self._core
        old = core.memory.pop(key)
        core.emit(MemoryRecord, key, None, old, source, deleted=True)
        core.memory_log.note(core.records[-1].seq, key, True, old)
        self._on_change(key)
