"""The port behind which markers leave for other programs while a session runs: the Lab Streaming Layer, say.

An outlet is found by an entry point of the group `rise.outlets`. It lives in a process of its own (`rise-engine lsl`),
so that nothing that it does can touch the session.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, Protocol, TypeAlias

from msgspec import Struct

from rise_engine.errors import RiseError

Scope: TypeAlias = Literal["machine", "link", "site"]
"""How far a stream can be seen: this computer, its network segment, the whole site."""


class OutletError(RiseError):
    """Markers cannot be sent; a sentence for a person, with what to do."""


class MarkerStream(Struct, frozen=True, kw_only=True):
    """What a stream says about itself."""

    name: str
    type: str
    source_id: str
    """By which receivers find it again after its process was started anew."""
    description: dict[str, str]
    """Of its session, by element name."""


class Outlet(Protocol):
    """One stream. No method blocks."""

    def send(self, text: str, at: float) -> None:
        """Send one marker. `at`: when it happened, on this computer's monotonic clock (`time.monotonic()`), in seconds;
        that may be long ago."""

    def has_consumers(self) -> bool:
        """Whether anybody receives it now."""

    def close(self) -> None:
        """Take the stream away. What consumers have not fetched by now may be lost."""


OutletOpener: TypeAlias = Callable[[MarkerStream, Scope], Outlet]
"""What an entry point names. Raises OutletError."""
