"""A session of the study that is being edited: whether one runs, and how it is stopped."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple, Protocol


class RunningHere(NamedTuple):
    """A session that runs on the scenario that is being edited."""

    socket: str
    participant: str

    @property
    def sentence(self) -> str:
        """For the line above the key hints."""
        who = f"a session with {self.participant}" if self.participant else "a session"
        return f"{who} runs on its own copy; what you save counts for the next one"


class SessionWatch(Protocol):
    """Finds such a session, and stops it. Both block."""

    def find(self, folder: Path) -> RunningHere | None:
        """The latest one of this scenario on this computer."""

    def stop(self, session: RunningHere) -> str:
        """Stop everything there; says what came of it."""


class NoSessions:
    """Where somebody else takes care of the session: over a console, which has the stop key itself."""

    def find(self, folder: Path) -> RunningHere | None:
        return None

    def stop(self, session: RunningHere) -> str:
        return ""
