"""Long work on the loop, in short pieces: so that a key never waits for a frame.

Between two pieces the loop takes whatever has come; while a key is on its way no piece is begun, and while the terminal
has not taken the last frames nothing is painted: frames are skipped, and what has changed meanwhile is in the next one.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable
from time import perf_counter
from typing import Any

from textual.app import App

from rise_tui.quiet.outlet import Outlet

SLICE = 0.0006
"""Seconds after which a piece of work gives way to what else there is to do.

None is begun that would take longer than what is left, if it takes as long as the one before it.
"""


class Slices:
    """Does one list of jobs after the other; each job should be short."""

    def __init__(self, app: App[Any]) -> None:
        self._app = app
        self._jobs: deque[Callable[[], object]] = deque()
        self._due: asyncio.Handle | None = None
        self.spent = 0.0
        """Seconds that the latest jobs took, without what happened between them."""

    @property
    def busy(self) -> bool:
        """Whether some are still to be done."""
        return bool(self._jobs)

    def do(self, jobs: Iterable[Callable[[], object]]) -> None:
        """Do these, soon; all at once where there is no terminal, as in tests."""
        self._jobs.extend(jobs)
        self.spent = 0.0
        if outlet_of(self._app) is None:
            while self._jobs:
                self._jobs.popleft()()
        elif self._due is None and self._jobs:
            self._due = asyncio.get_running_loop().call_soon(self._go_on)

    def _go_on(self) -> None:
        self._due = None
        outlet = outlet_of(self._app)
        wait = outlet.key_wait() if outlet is not None else 0.0
        loop = asyncio.get_running_loop()
        if wait:
            self._due = loop.call_later(wait, self._go_on)
            return
        began = perf_counter()
        took = 0.0
        while self._jobs and (at := perf_counter()) + took < began + SLICE:
            self._jobs.popleft()()
            took = perf_counter() - at
        self.spent += perf_counter() - began
        if self._jobs:
            self._due = loop.call_soon(self._go_on)


def outlet_of(app: App[Any]) -> Outlet | None:
    """Where an app writes to; None without a terminal (tests, Windows)."""
    outlet = getattr(app._driver, "outlet", None)
    return outlet if isinstance(outlet, Outlet) else None
