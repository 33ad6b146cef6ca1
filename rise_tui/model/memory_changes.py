"""Values within values, as `person.name` and `list.0`, and the memory changes that this console can take back. Pure."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.base.json_codec import json_equal
from rise_engine.kernel.records import MemoryRecord
from rise_engine.kernel.view import MemoryView
from rise_tui.rendering.text import format_value

JsonPath: TypeAlias = tuple[str | int, ...]
"""A memory key, then names into objects and indexes into arrays."""


class NoSuchPath(RiseError, LookupError):
    """The value has no such part (any more)."""


def path_text(path: JsonPath) -> str:
    """As conditions and templates write it."""
    return ".".join(map(str, path))


def children(value: Any) -> Iterator[tuple[str | int, Any]]:
    """What an object or an array consists of; nothing for any other value."""
    if isinstance(value, dict):
        yield from value.items()
    elif isinstance(value, (list, tuple)):
        yield from enumerate(value)


def value_at(value: Any, path: JsonPath) -> Any:
    """What lies at `path` within the value. Raises NoSuchPath."""
    for step in path:
        parts = dict(children(value))
        if step not in parts:
            raise NoSuchPath(path_text(path))
        value = parts[step]
    return value


def with_replaced(value: Any, path: JsonPath, new: Any) -> Any:
    """The value with one part of it changed. Raises NoSuchPath."""
    if not path:
        return new
    inner = with_replaced(value_at(value, path[:1]), path[1:], new)
    copied: Any = dict(value) if isinstance(value, dict) else list(value)
    copied[path[0]] = inner
    return copied


def with_removed(value: Any, path: JsonPath) -> Any:
    """The value without one part of it; what comes after it in an array moves up. Raises NoSuchPath."""
    value_at(value, path)
    holder = value_at(value, path[:-1])
    copied: Any = dict(holder) if isinstance(holder, dict) else list(holder)
    del copied[path[-1]]
    return with_replaced(value, path[:-1], copied)


MOST = 200
"""Changes that are remembered."""


class UndoStep(Struct, frozen=True):
    """What one press of undo comes to."""

    kind: Literal["do", "ask", "nothing"]
    said: str
    function: str = ""
    behavior: str = ""


class UndoStack:
    """The changes, newest last, and the one that is just being taken back."""

    def __init__(self) -> None:
        self._changes: list[MemoryRecord] = []
        self._undoing: MemoryRecord | None = None
        self._warned: tuple[MemoryRecord, Any] | None = None
        """A change that somebody else has changed since, and to what: undoing it was asked about."""

    def __len__(self) -> int:
        return len(self._changes)

    def record_change(self, record: MemoryRecord) -> None:
        """A change that this console asked for has become true: a new one, or one that takes the last one back."""
        undoing = self._undoing
        if undoing is not None and record.key == undoing.key and _restores(record, undoing):
            self._undoing = None
            self._changes = [change for change in self._changes if change is not undoing]
            return
        self._changes.append(record)
        del self._changes[:-MOST]

    def clear(self) -> None:
        """What happened meanwhile is not known: nothing can be taken back any more."""
        self._changes.clear()
        self._undoing = self._warned = None

    def next_step(self, memory: Mapping[str, MemoryView]) -> UndoStep:
        """What to do for undo now. A value that somebody else has changed since is not overwritten without asking."""
        if not self._changes:
            return UndoStep("nothing", "nothing to undo")
        change = self._changes[-1]
        entry = memory.get(change.key)
        present = (entry.value,) if entry is not None else ()
        expected = () if change.deleted else (change.value,)
        asked = self._warned is not None and self._warned[0] is change and json_equal(self._warned[1], present)
        if not asked and not json_equal(present, expected):
            self._warned = change, present
            present_text = f"{format_value(entry.value)}, by {entry.source}" if entry is not None else "deleted"
            back = "deletes it" if change.created else f"makes it {format_value(change.old)} again"
            return UndoStep("ask", f"{change.key} has changed since, to {present_text}: undo again {back}")
        self._warned, self._undoing = None, change
        if change.created:
            if entry is None:
                self._changes.pop()
                return UndoStep("nothing", f"{change.key} is already gone")
            return UndoStep("do", f"undoing: {change.key} is deleted again", "deleteValue", change.key)
        former = "deleted" if change.deleted else format_value(change.value)
        said = f"undoing: {change.key} is {format_value(change.old)} again, was {former}"
        return UndoStep("do", said, "assignValue", json.dumps({change.key: change.old}, ensure_ascii=False))


def _restores(record: MemoryRecord, change: MemoryRecord) -> bool:
    return record.deleted if change.created else not record.deleted and json_equal(record.value, change.old)
