"""The entry points of installed packages: drivers, bridges, profiles, recorders, outlets, export formats."""

from __future__ import annotations

import sys
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points


def installed_plugins(group: str) -> EntryPoints:
    """The entry points of a group. Searches all packages only once for each `sys.path`, because that is slow."""
    return _installed_on(tuple(sys.path), group)


def find_plugin(group: str, name: str) -> EntryPoint | None:
    """The entry point of that name. Of two, the one that Python finds first."""
    return next(iter(installed_plugins(group).select(name=name)), None)


@cache
def _installed_on(path: tuple[str, ...], group: str) -> EntryPoints:
    return entry_points(group=group)
