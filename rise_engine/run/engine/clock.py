"""The two clocks of a session: real time (optionally faster) and virtual time (as fast as the machine can).

Both measure seconds since the session began and never go back. `wall_label` returns the wall-clock time for records.
"""

from __future__ import annotations

from asyncio import AbstractEventLoop
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from heapq import heappop, heappush
from itertools import count
from time import time_ns
from typing import Protocol

from rise_engine.ports.robot import Clock, Timer

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_LAST_SECOND = 253_402_300_799.0
"""The last second of the calendar (the end of the year 9999), counted from 1970."""


def seconds_between_labels(before: str, now: str) -> float | None:
    """Compute the seconds between two wall-clock labels, negative if the clock was set back; None: a label is invalid.

    >>> seconds_between_labels("2026-11-21T14:00:00.000+01:00", "2026-11-21T13:00:02.500+00:00")
    2.5
    >>> seconds_between_labels("2026-11-21T14:00:00.000+01:00", "2026-11-21T12:00:00.000+00:00")
    -3600.0
    >>> seconds_between_labels("", "2026-11-21T13:00:02.500+00:00") is None
    True
    """
    try:
        between = datetime.fromisoformat(now) - datetime.fromisoformat(before)
    except (ValueError, TypeError):
        return None
    return round(between.total_seconds(), 3)


class SessionClock(Clock, Protocol):
    """The clock of the engine: the robot's clock, with labels for records."""

    speed: float
    """Session seconds in a second of the wall clock; 1 for a virtual clock."""

    def wall_label(self, t: float) -> str:
        """Return the wall-clock label of session time `t`: ISO 8601 with offset, to the millisecond. Never raises."""
        ...


class _VirtualTimer:
    __slots__ = ("callback",)

    def __init__(self, callback: Callable[[], None]) -> None:
        self.callback: Callable[[], None] | None = callback

    def cancel(self) -> None:
        self.callback = None


class VirtualClock:
    """Time that passes only by calls of `advance`, without thread, loop or waiting.

    Its wall labels begin at 1970-01-01T00:00:00.000+00:00, so that the same scenario, seed and inputs give the same
    output, byte for byte.
    """

    speed = 1.0

    def __init__(self) -> None:
        self._now = 0.0
        self._heap: list[tuple[float, int, _VirtualTimer]] = []
        """The time, a number, and the timer. A cancelled timer stays here until it is due."""
        self._numbers = count()

    def now(self) -> float:
        return self._now

    def wall_label(self, t: float) -> str:
        return (_EPOCH + timedelta(seconds=min(max(0.0, t), _LAST_SECOND))).isoformat(timespec="milliseconds")

    def call_at(self, when: float, callback: Callable[[], None]) -> Timer:
        # Rounded like the engine's times: timers that are due together run in the order of their setting.
        timer = _VirtualTimer(callback)
        heappush(self._heap, (max(round(when, 6), self._now), next(self._numbers), timer))
        return timer

    @property
    def next_at(self) -> float | None:
        """The session time of the next timer; None if there is none."""
        while self._heap and self._heap[0][2].callback is None:
            heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def advance(self) -> bool:
        """Let time pass until the next timer and run it. False if there is none."""
        if self.next_at is None:
            return False
        when, _, timer = heappop(self._heap)
        callback, timer.callback = timer.callback, None
        self._now = when
        assert callback is not None  # next_at dropped the cancelled ones
        callback()
        return True

    def pass_until(self, when: float) -> None:
        """Let time pass until `when`: earlier timers run, those at `when` wait for `advance`."""
        while (due := self.next_at) is not None and due < when:
            self.advance()
        self._now = max(self._now, when)


_OWN_TIME_SECONDS = 0.05
"""Delay in seconds from which an input gets a time of its own. Others are handled immediately."""


class RealClock:
    """Real time on an asyncio loop. With `speed` 10, ten session seconds pass in one second."""

    def __init__(self, loop: AbstractEventLoop, speed: float = 1.0, start: float = 0.0) -> None:
        """:param loop: the engine's.
        :param speed: session seconds in a second.
        :param start: the session's present time, for one that continues.
        :raises ValueError: `speed` is not above 0.
        """
        if not 0 < speed < float("inf"):
            raise ValueError("the speed must be a number above 0")
        self._loop = loop
        self.speed = speed
        self._origin = loop.time() - start / speed

    @property
    def origin(self) -> float:
        """The loop's clock at session time 0: it shows `origin + t / speed` at `t`.

        For a continued session, it is the time at which it would have begun without the break.
        """
        return self._origin

    def now(self) -> float:
        return (self._loop.time() - self._origin) * self.speed

    def wall_label(self, t: float) -> str:
        waited = (self.now() - t) / self.speed  # what happened while nothing could be recorded keeps its own time
        milliseconds = time_ns() // 1_000_000 - (int(waited * 1000) if waited > _OWN_TIME_SECONDS else 0)
        moment = datetime.fromtimestamp(milliseconds / 1000, UTC)
        return moment.astimezone().isoformat(timespec="milliseconds")

    def call_at(self, when: float, callback: Callable[[], None]) -> Timer:
        return self._loop.call_at(self._origin + when / self.speed, callback)
