"""Textual's pilot without the work that no test looks at; all of it was half of what the tests of the console cost.

In virtual time nothing is left to do when time goes on: nobody has to ask every widget, or how busy the processor is.
What has changed is painted when the test looks, once; a terminal would also have seen each step on the way. A screen
of a kind is painted whole once at each size, and then only where it changes; snapshots paint it whole themselves. Apps
that load the same stylesheets with the same colours share what was parsed.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from typing import Any

from textual import app, pilot
from textual._compositor import Compositor
from textual.css.stylesheet import Stylesheet
from textual.pilot import Pilot

from tests.virtual_time import VirtualLoop

MOMENT = 0.001
"""Seconds: the shortest time that goes on when nothing is left to do."""

_wait_for_idle, _wait_for_screen, _pause = pilot.wait_for_idle, Pilot._wait_for_screen, Pilot.pause
_render_update = Compositor.render_update
_make_stylesheet, _set_variables = Stylesheet.__init__, Stylesheet.set_variables
_rules: defaultdict[object, Any] = defaultdict(dict)
"""What was parsed, by the colours."""
_painted: set[object] = set()
"""Kinds of screens that were painted whole, each with its size."""
_looking = False


def install() -> None:
    app.wait_for_idle = pilot.wait_for_idle = wait_for_idle  # type: ignore[attr-defined]
    Pilot._wait_for_screen, Pilot.pause = wait_for_screen, pause  # type: ignore[method-assign]
    Compositor.render_update = render_update  # type: ignore[method-assign]
    Stylesheet.__init__, Stylesheet.set_variables = make_stylesheet, set_variables  # type: ignore[method-assign]


def in_virtual_time() -> bool:
    return isinstance(asyncio.get_running_loop(), VirtualLoop)


async def wait_for_idle(min_sleep: float = 0.02, max_sleep: float = 1) -> None:
    await (asyncio.sleep(MOMENT) if in_virtual_time() else _wait_for_idle(min_sleep, max_sleep))


async def wait_for_screen(self: Pilot[Any], timeout: float = 30.0) -> bool:  # noqa: ASYNC109 (as Textual has it)
    return await (asyncio.sleep(MOMENT, True) if in_virtual_time() else _wait_for_screen(self, timeout))


async def pause(self: Pilot[Any], delay: float | None = None) -> None:
    global _looking
    await _pause(self, delay)
    if in_virtual_time():
        screen = self.app.screen
        dirty, whole = screen._compositor._dirty_regions, screen._compositor.size.region
        if whole in dirty:
            if (kind := (type(screen), whole)) in _painted:
                dirty.clear()
            _painted.add(kind)
        _looking = True
        try:
            screen._compositor_refresh()
        finally:
            _looking = False


def render_update(self: Compositor, full: bool = False, *more: Any, **options: Any) -> Any:
    """What is not painted stays among what has to be."""
    return _render_update(self, full, *more, **options) if full or _looking or not in_virtual_time() else None


def make_stylesheet(self: Stylesheet, *, variables: dict[str, str] | None = None) -> None:
    _make_stylesheet(self, variables=variables)
    self._parse_cache = _rules[tuple(self._variables.items())]


def set_variables(self: Stylesheet, variables: dict[str, str]) -> None:
    self._parse_cache = {}  # it is emptied
    _set_variables(self, variables)
    self._parse_cache = _rules[tuple(variables.items())]
