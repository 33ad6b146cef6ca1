"""How long the computer has been suspended: its lid was closed, or it slept. A monotonic clock stands still then."""

from __future__ import annotations

import time

_COUNTING = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""A clock that goes on in suspend: CLOCK_BOOTTIME on Linux, CLOCK_MONOTONIC on macOS (clock_gettime(2), (3))."""
_STANDING = getattr(time, "CLOCK_UPTIME_RAW", time.CLOCK_MONOTONIC)
"""A clock that stands still: CLOCK_MONOTONIC on Linux, CLOCK_UPTIME_RAW on macOS. Never a test's virtual one."""


def suspended_seconds() -> float:
    """Return how long the computer has been suspended, since any fixed moment. Only the difference of two results means
    something. Where no clock tells, it is always the same."""
    return time.clock_gettime(_COUNTING) - time.clock_gettime(_STANDING)
