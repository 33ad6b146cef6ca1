"""Values within values: `person.name`, `list.0`. Pure; nothing that is given is changed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

from rise_engine.base.errors import RiseError

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
