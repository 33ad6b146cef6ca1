"""The one interface between a console and an engine: messages, never calls into the engine (console.md, law 4 and 5).

`Client` is what a console holds. `rise_engine.link.local` implements it over an engine on a thread of its own; the
socket client of a later release implements the same, so that consoles do not change when the engine moves out.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from typing import Protocol, TypeAlias

from msgspec import Struct

from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import AnyRecord
from rise_engine.scenario.model import Scenario
from rise_engine.view import View

ClientInput: TypeAlias = Submit | Note
"""What a console may send. Time and nothing else is added by the engine."""


class Hello(Struct, frozen=True):
    """What a client is told when it attaches: snapshot plus later records is the live state."""

    scenario: Scenario
    mode: str
    """`debug` or `real`, as the session runs (the command line may override the scenario)."""
    robot: str
    seed: int
    view: View
    """The state at `view.seq`; the next record has the next number."""


class Reply(Struct, frozen=True):
    """The engine's answer to one input."""

    accepted: bool
    reason: str = ""
    task: int | None = None
    """The task's id, for `Submit`."""


class EngineGone(ConnectionError):
    """The engine has ended or cannot be reached; the message says why, for a person."""


class Client(Protocol):
    """One console's connection to one engine. All methods belong to the console's loop."""

    async def attach(self) -> Hello:
        """Begin. Raises EngineGone."""
        ...

    def records(self) -> AsyncIterator[Sequence[AnyRecord]]:
        """Batches of records since `attach`, in order and without gaps; ends when the engine does."""
        ...

    async def send(self, message: ClientInput) -> Reply:
        """Submit an input and wait for the engine to accept or reject it. Raises EngineGone."""
        ...

    def now(self) -> float:
        """The session's time in seconds, as well as this client knows it; for running clocks on the screen."""
        ...

    async def close(self, *, end_session: bool = True) -> None:
        """Leave. With `end_session`, the engine stops the robot and ends the session."""
        ...
