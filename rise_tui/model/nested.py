"""Values within values: `person.name`, `list.0`. Pure; nothing that is given is changed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

from rise_engine.errors import RiseError

Path: TypeAlias = tuple[str | int, ...]
"""A memory key, then names into objects and indexes into arrays."""


class NoSuchPart(RiseError, LookupError):
    """The value has no such part (any more)."""


def written(path: Path) -> str:
    """As conditions and templates write it."""
    return ".".join(map(str, path))


def parts(value: Any) -> Iterator[tuple[str | int, Any]]:
    """What an object or an array consists of; nothing for any other value."""
    if isinstance(value, dict):
        yield from value.items()
    elif isinstance(value, (list, tuple)):
        yield from enumerate(value)


def part(value: Any, path: Path) -> Any:
    """What lies at `path` within the value. Raises NoSuchPart."""
    for step in path:
        fits = isinstance(value, dict if isinstance(step, str) else (list, tuple))
        try:
            value = value[step] if fits else _no_such(path)
        except (KeyError, IndexError):
            _no_such(path)
    return value


def replaced(value: Any, path: Path, new: Any) -> Any:
    """The value with one part of it changed. Raises NoSuchPart."""
    if not path:
        return new
    inner = replaced(part(value, path[:1]), path[1:], new)
    copied: Any = dict(value) if isinstance(value, dict) else list(value)
    copied[path[0]] = inner
    return copied


def removed(value: Any, path: Path) -> Any:
    """The value without one part of it; what comes after it in an array moves up. Raises NoSuchPart."""
    part(value, path)
    holder = part(value, path[:-1])
    copied: Any = dict(holder) if isinstance(holder, dict) else list(holder)
    del copied[path[-1]]
    return replaced(value, path[:-1], copied)


def _no_such(path: Path) -> Any:
    raise NoSuchPart(written(path))
