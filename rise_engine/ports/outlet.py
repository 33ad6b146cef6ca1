"""The port behind which an outlet stands: a program that passes on what happens in a session while it runs, as markers
for other recorders (Lab Streaming Layer).

An outlet is found by an entry point of the group `rise.outlets`. It runs in a process of its own and attaches to the
session as any client does (`rise_engine.run.client.connect`), so that nothing that it does can hold up a session.
"""

from __future__ import annotations

from asyncio import Event
from collections.abc import Awaitable, Callable
from typing import Literal, TypeAlias

from msgspec import Struct


class OutletPlan(Struct, frozen=True):
    """What is to be passed on."""

    socket: str
    """Of the session: a path, or its name, as `rise_engine.run.client.connect` takes it."""
    session: str = ""
    """Name of the session's folder."""
    task: str = ""
    """The study's id; empty: the session is of no study."""
    scope: Literal["machine", "link", "site"] = "machine"
    """How far it can be seen."""
    payload: Literal["short", "json"] = "short"
    """Short words, or whole records."""


OutletRunner: TypeAlias = Callable[[OutletPlan, Event], Awaitable[None]]
"""What an entry point names: (plan, finish) -> None. It returns when the session is over, or soon after `finish` was
set. It raises AdapterError when it cannot go on."""
