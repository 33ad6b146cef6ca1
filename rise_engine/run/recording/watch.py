"""Whether a recording grows."""

from __future__ import annotations

from rise_engine.ports.recorder import RecorderStatus


class GrowthWatch:
    """Looks at one recording again and again.

    >>> watch = GrowthWatch(3.0, now=0.0)
    >>> watch.look(RecorderStatus(True, bytes=10), 1.0), watch.look(RecorderStatus(True, bytes=10), 3.9)
    (True, True)
    >>> watch.look(RecorderStatus(True, bytes=10), 4.0), watch.look(RecorderStatus(True, bytes=11), 4.5)
    (False, True)
    """

    def __init__(self, stalled_after: float, now: float) -> None:
        """
        :param stalled_after: seconds without growth after which it has stalled.
        :param now: a time in seconds, from which on it is expected to grow.
        """
        self.stalled_after = stalled_after
        self.has_grown = False
        """Whether it ever has."""
        self._most = -1.0
        self._grown_at = now

    def look(self, status: RecorderStatus, now: float) -> bool:
        """Whether it grows, or may still be believed to.

        :param status: how it stands; of one about which nobody can know anything it is believed.
        :param now: the time.
        """
        size = status.bytes if status.bytes is not None else status.seconds
        if size is None:
            self.has_grown = True
            return True
        if size > max(self._most, 0):
            self.has_grown = True
            self._grown_at = now
        elif size < self._most:  # another file
            self._grown_at = now
        self._most = size
        return now - self._grown_at < self.stalled_after

    def still_for(self, now: float) -> float:
        """Seconds since it last grew."""
        return now - self._grown_at
