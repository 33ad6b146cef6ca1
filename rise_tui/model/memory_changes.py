"""Parts of values, such as `person.name` and `list.0`, changes that this console can undo, and changes of a condition's
values. Pure."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.base.json_codec import json_equal
from rise_engine.kernel.records import MemoryRecord
from rise_engine.kernel.view import MemoryView, SessionView, condition_key
from rise_tui.rendering.text import format_value, shorten

JsonPath: TypeAlias = tuple[str | int, ...]
"""A memory key, then names into objects and indexes into arrays."""


class NoSuchPath(RiseError, LookupError):
    """The value has no such part (any more)."""


def path_text(path: JsonPath) -> str:
    """A path as conditions and templates write it."""
    return ".".join(map(str, path))


def children(value: Any) -> Iterator[tuple[str | int, Any]]:
    """The parts of an object or an array; none for other values."""
    if isinstance(value, dict):
        yield from value.items()
    elif isinstance(value, (list, tuple)):
        yield from enumerate(value)


def value_at(value: Any, path: JsonPath) -> Any:
    """The part at `path` of a value. Raises NoSuchPath."""
    for step in path:
        parts = dict(children(value))
        if step not in parts:
            raise NoSuchPath(path_text(path))
        value = parts[step]
    return value


def with_replaced(value: Any, path: JsonPath, new: Any) -> Any:
    """The value with one part replaced. Raises NoSuchPath."""
    if not path:
        return new
    inner = with_replaced(value_at(value, path[:1]), path[1:], new)
    copied: Any = dict(value) if isinstance(value, dict) else list(value)
    copied[path[0]] = inner
    return copied


def with_removed(value: Any, path: JsonPath) -> Any:
    """The value without one part. In an array, later items move up. Raises NoSuchPath."""
    value_at(value, path)
    holder = value_at(value, path[:-1])
    copied: Any = dict(holder) if isinstance(holder, dict) else list(holder)
    del copied[path[-1]]
    return with_replaced(value, path[:-1], copied)


MAX_CHANGES = 200
"""Maximum number of remembered changes."""


class UndoStep(Struct, frozen=True):
    """The effect of one press of undo."""

    kind: Literal["do", "ask", "nothing"]
    notice: str
    function: str = ""
    behavior: str = ""


class UndoStack:
    """The changes, newest last, and the one that is being undone."""

    def __init__(self) -> None:
        self._changes: list[MemoryRecord] = []
        self._undoing: MemoryRecord | None = None
        self._warned: tuple[MemoryRecord, Any] | None = None
        """A change that another client has overwritten since, and the new value: the undo was already asked about."""

    def __len__(self) -> int:
        return len(self._changes)

    def record_change(self, record: MemoryRecord) -> None:
        """Note that a requested change was made: a new one, or one that undoes the last one."""
        undoing = self._undoing
        if undoing is not None and record.key == undoing.key and _restores(record, undoing):
            self._undoing = None
            self._changes = [change for change in self._changes if change is not undoing]
            return
        self._changes.append(record)
        del self._changes[:-MAX_CHANGES]

    def clear(self) -> None:
        """Forget all changes. Changes made meanwhile are unknown, so nothing can be undone."""
        self._changes.clear()
        self._undoing = self._warned = None

    def next_step(self, memory: Mapping[str, MemoryView]) -> UndoStep:
        """The next undo step. A value that another client has changed since is not overwritten without asking."""
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
        notice = f"undoing: {change.key} is {format_value(change.old)} again, was {former}"
        return UndoStep("do", notice, "assignValue", json.dumps({change.key: change.old}, ensure_ascii=False))


def _restores(record: MemoryRecord, change: MemoryRecord) -> bool:
    return record.deleted if change.created else not record.deleted and json_equal(record.value, change.old)


# --- values of the condition ------------------------------------------------------------------------------------------


def changed_key(function: str, behavior: str) -> str:
    """The key of a task that sets or deletes it, as the memory pane writes such tasks."""
    return behavior if function == "deleteValue" else next(iter(json.loads(behavior)))


CHANGE_QUESTION = "Change a value of the condition?"
MAX_VALUE = 24
"""Cells of a value in it."""
CHANGED = "≠ changed"
"""The values that the condition set are no longer its own."""


def condition_change_lines(view: SessionView, function: str, behavior: str) -> list[str]:
    """The lines of the question before one of the condition's keys gets another value; empty: none is needed."""
    written = changed_key(function, behavior)
    key = condition_key(written, view.condition_values)
    if key is None or key in view.overridden:
        return []
    old = view.condition_values[key]
    new = None if function == "deleteValue" else json.loads(behavior)[written]
    if function != "deleteValue" and key == written and json_equal(new, old):
        return []
    becomes = "be deleted" if function == "deleteValue" else f"become {shorten(format_value(new), MAX_VALUE)}"
    if key != written:
        becomes = f"be replaced in part: {written} would {becomes}"
    setter = "The study" if view.session is not None and view.session.study else "The condition"
    return [
        f"{setter} set {key} to {shorten(format_value(old), MAX_VALUE)} at the start.",
        f"It would {becomes}, and this session would no longer",
        f"follow its condition. The title would show “{CHANGED}”.",
    ]


def assignment(key: str, value: Any) -> tuple[str, str]:
    """The function and the behaviour of a task that sets a key."""
    return "assignValue", json.dumps({key: value}, ensure_ascii=False)
