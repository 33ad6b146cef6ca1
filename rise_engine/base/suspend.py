"""The duration of suspends of the computer, in which a monotonic clock stands still."""

from __future__ import annotations

import time

_COUNTING = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""A clock that continues in suspend: CLOCK_BOOTTIME on Linux, CLOCK_MONOTONIC on macOS (clock_gettime(2), (3))."""
_STANDING = getattr(time, "CLOCK_UPTIME_RAW", time.CLOCK_MONOTONIC)
"""A clock that stands still in suspend: CLOCK_MONOTONIC on Linux, CLOCK_UPTIME_RAW on macOS, never a virtual one."""


def suspended_seconds() -> float:
    """Return the seconds of suspend since any fixed moment. Only differences of results have a meaning. Without such
    clocks, the result is constant."""
    return time.clock_gettime(_COUNTING) - time.clock_gettime(_STANDING)
