"""Work in portions, so that whatever comes from outside, the loop's other work goes on."""

from __future__ import annotations

import logging
from asyncio import AbstractEventLoop
from collections.abc import Callable
from time import perf_counter

_LOG = logging.getLogger(__name__)

TURN_SECONDS = 0.0005
"""For which work is done in one turn of the loop. A console's key waits for some turns, and may wait for 10 ms."""
HASTY = 4
"""Pieces that may be done at once in one turn, without waiting for a turn."""


class Portions:
    """Does pieces of work, one of each kind in turn, and only so many before the loop goes on."""

    def __init__(self, loop: AbstractEventLoop, *kinds: Callable[[], bool]) -> None:
        """Each of `kinds` does one piece of its work, and gives false when there was none."""
        self._loop = loop
        self._kinds = kinds
        self._waking = False
        self._hasty = 0

    def wake(self) -> None:
        """There is work."""
        if not self._waking:
            self._waking = True
            self._loop.call_soon(self._turn)

    def at_leisure(self) -> bool:
        """Whether a piece can be done at once: nothing waits, and little was done in this turn of the loop."""
        if self._waking or self._hasty >= HASTY:
            return False
        if not self._hasty:
            self._loop.call_soon(self._rested)
        self._hasty += 1
        return True

    def finish(self, seconds: float) -> None:
        """Do all that is left, but not for longer than about `seconds`."""
        self._work(perf_counter() + seconds)

    def _rested(self) -> None:
        self._hasty = 0

    def _turn(self) -> None:
        # What comes up while this turn works is done in it or in the next, and never at once: order is kept.
        if self._work(perf_counter() + TURN_SECONDS):
            self._loop.call_soon(self._turn)
        else:
            self._waking = False

    def _work(self, until: float) -> bool:
        """Whether there may be more."""
        while True:
            done = False
            for kind in self._kinds:
                try:
                    done = kind() or done
                except Exception:  # of one piece; it must not keep the others from being done
                    _LOG.exception("a piece of work failed")
                    done = True
            if not done:
                return False
            if perf_counter() > until:
                return True
