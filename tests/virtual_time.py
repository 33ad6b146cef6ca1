"""Time for tests of the console that passes when nothing is left to do, and only then.

Without it a test waits in vain (a debounce of half a second takes half a second) and in fear (a machine that is busy
may need longer than the moment after which "nothing has happened"). In a `VirtualLoop` a pause of a second means: what
is due within a second has happened. It costs what that work costs, on every machine.
"""

from __future__ import annotations

import asyncio
import selectors
import sys
import time
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

real_monotonic = time.monotonic
_now: float | None = None
"""What time it is for the loop that runs; None: no VirtualLoop runs."""


def monotonic() -> float:
    """Instead of `time.monotonic`: the time of the virtual loop that runs, or else the machine's."""
    return real_monotonic() if _now is None else _now


def install() -> None:
    """To be called before a module of ours is imported, because many hold the function itself.

    Textual is loaded by then, by its plugin for snapshots. `time.perf_counter` stays the machine's: with it programs
    measure how long they compute.
    """
    time.monotonic = monotonic
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] == "textual":
            for held in [held for held, value in vars(module).items() if value is real_monotonic]:
                setattr(module, held, monotonic)


class VirtualLoop(asyncio.SelectorEventLoop):
    """Goes to the next timer at once when it would wait for it; but not while a thread of its own works for it."""

    def __init__(self) -> None:
        super().__init__(_Selector(self))
        self.at = real_monotonic()
        self.working = 0
        """Jobs that threads of this loop have not ended."""

    def run_forever(self) -> None:
        global _now
        _now = self.at
        try:
            super().run_forever()
        finally:
            _now = None

    def advance(self, seconds: float) -> None:
        global _now
        _now = self.at = self.at + seconds

    def run_in_executor(  # type: ignore[override]
        self, executor: Executor | None, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        future = super().run_in_executor(executor, func, *args)
        self.working += 1
        future.add_done_callback(self._worked)
        return future

    def _worked(self, _future: object) -> None:
        self.working -= 1


class _Selector(selectors.DefaultSelector):
    def __init__(self, loop: VirtualLoop) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> Any:
        if timeout is None or timeout <= 0:
            return super().select(timeout)
        if self._loop.working:
            began = real_monotonic()
            events = super().select(timeout)
            self._loop.advance(min(timeout, real_monotonic() - began))
            return events
        if not (events := super().select(0)):
            self._loop.advance(timeout)
        return events
