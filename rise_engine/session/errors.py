"""What can be wrong with a session on the disk."""

from __future__ import annotations

from rise_engine.errors import RiseError


class SessionError(RiseError):
    """A session's folder cannot be used; the text says why, for a person."""
