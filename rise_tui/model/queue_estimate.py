"""When a waiting task will probably start: the typical durations of what must end before it. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple


class QueuedTask(NamedTuple):
    """A task, as far as waiting is concerned."""

    typical_seconds: float | None
    """How long it usually takes; None when nobody knows."""
    elapsed_seconds: float = 0.0
    """For a running one, in seconds."""
    in_turn: bool = True
    """It runs alone among its kind (Blocking and Interrupt); a None act runs beside it."""

    @property
    def seconds_left(self) -> float | None:
        """Seconds; negative when it is overdue."""
        return None if self.typical_seconds is None else self.typical_seconds - self.elapsed_seconds


def estimate_starts(running: Iterable[QueuedTask], waiting: Sequence[QueuedTask]) -> list[float | None]:
    """Seconds until each waiting task probably starts, in order; None where something before it has no typical time.

    A task that is overdue may end at any moment. A None act that waits starts when what runs has ended, or before.
    """
    at: float | None = 0.0
    for turn in running:
        if turn.in_turn:
            at = _sum(at, turn.seconds_left)
    found: list[float | None] = []
    for turn in waiting:
        found.append(at)
        if turn.in_turn:
            at = _sum(at, turn.seconds_left)
    return found


def _sum(at: float | None, left: float | None) -> float | None:
    return None if at is None or left is None else at + max(0.0, left)
