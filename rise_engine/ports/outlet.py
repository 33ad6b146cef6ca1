"""The port for an outlet, which passes on a running session's events as markers for recorders (Lab Streaming Layer).

The engine finds an outlet by an entry point of the group `rise.outlets`. It runs in its own process and attaches to the
session like any client (`rise_engine.run.client.connect`), so that it can never block a session.
"""

from __future__ import annotations

from asyncio import Event
from collections.abc import Awaitable, Callable
from typing import Literal, TypeAlias

from msgspec import Struct


class OutletPlan(Struct, frozen=True):
    """What an outlet passes on."""

    socket: str
    """The session's socket: a path, or its name, as `rise_engine.run.client.connect` takes it."""
    session: str = ""
    """The name of the session's folder."""
    task: str = ""
    """The study's id; empty: the session belongs to no study."""
    scope: Literal["machine", "link", "site"] = "machine"
    """How far it is visible."""
    payload: Literal["short", "json"] = "short"
    """Short words, or whole records."""


OutletRunner: TypeAlias = Callable[[OutletPlan, Event], Awaitable[None]]
"""The callable of an entry point: (plan, finish) -> None. It returns when the session is over, or soon after `finish`
is set. Raises AdapterError."""
