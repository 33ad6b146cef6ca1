"""When a waiting task will probably start: the typical durations of what must end before it. Pure."""

from __future__ import annotations

from collections.abc import Iterable
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


def estimate_starts(running: Iterable[QueuedTask], waiting: Iterable[QueuedTask]) -> list[float | None]:
    """Seconds until each waiting task probably starts, in order; None where something before it has no typical time.

    A task that is overdue may end at any moment. A None act that waits starts when what runs has ended, or before.
    """
    start: float | None = 0.0
    for task in running:
        start = _next_start(start, task)
    starts = []
    for task in waiting:
        starts.append(start)
        start = _next_start(start, task)
    return starts


def _next_start(start: float | None, task: QueuedTask) -> float | None:
    """When the next task starts, if this one starts then or runs already."""
    if not task.in_turn:
        return start
    return None if start is None or task.seconds_left is None else start + max(0.0, task.seconds_left)
