"""Long work on an asyncio loop in short slices, between which the loop's other work continues."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from time import perf_counter

_LOG = logging.getLogger(__name__)


class TimeSlicer:
    """Repeats a small step for a few milliseconds in each turn of the loop, until no work is left."""

    def __init__(self, step: Callable[[], int], seconds: float, *, most: float = float("inf")) -> None:
        """`step` does one small piece of work and returns its amount, in the unit of `most`, or 0 (False) without work.
        A slice ends after `seconds`, or once it has done more than `most`.

        A step that raises is logged and counts as done, so that the remaining work continues.
        """
        self._step = step
        self._seconds = seconds
        self._most = most
        self._scheduled: asyncio.Handle | None = None

    @property
    def busy(self) -> bool:
        """Whether a slice is scheduled, so that work may be left."""
        return self._scheduled is not None

    def wake(self) -> None:
        """Start working in the loop's next turn. Call it on the loop's thread."""
        if self._scheduled is None:
            self._scheduled = asyncio.get_running_loop().call_soon(self._run_scheduled)

    def cancel(self) -> None:
        """Stop until the next `wake`."""
        if self._scheduled is not None:
            self._scheduled.cancel()
            self._scheduled = None

    def run_slice(self, seconds: float | None = None) -> bool:
        """Run one slice now, with another length if `seconds` is given. Returns whether work may be left."""
        end = perf_counter() + (self._seconds if seconds is None else seconds)
        done = 0.0
        while True:
            try:
                amount = self._step()
            except Exception:  # the caller's step failed; the remaining work continues
                _LOG.exception("a piece of work failed")
                amount = 1
            if not amount:
                return False
            done += amount
            if done > self._most or perf_counter() > end:
                return True

    def _run_scheduled(self) -> None:
        # Still scheduled while it runs: work that arrives meanwhile is done in this slice or the next.
        if self.run_slice():
            self._scheduled = asyncio.get_running_loop().call_soon(self._run_scheduled)
        else:
            self._scheduled = None
