"""The one interface between a console and an engine: messages, never calls into the engine (console.md 4.1, 5.1).

`Client` is what a console, a feature node or a test holds. `rise_engine.run.client.socket` implements it over the
session's socket, `rise_engine.run.client.replay` over the record of a session.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from typing import Literal, Protocol, TypeAlias

from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.kernel.inputs import CheckReport, Note, OutcomeReport, RecordingReport, Submit, SyncMark
from rise_engine.kernel.records import AnyRecord
from rise_engine.kernel.view import SessionView
from rise_engine.scenario.model import Scenario

Role: TypeAlias = Literal["wizard", "observer", "node"]
"""wizard: a console that may hold control. observer: only watches, but may stop everything and add notes. node: a
program, which submits tasks at any time, as ROS nodes do."""

ControlVerb: TypeAlias = Literal["take", "ask", "give", "release"]
"""What a wizard can do about control: take it (whoever has it), ask the holder for it, give it to the one who asked,
release it. Who attaches as a wizard while nobody holds control gets it."""

ClientInput: TypeAlias = Submit | Note | CheckReport | OutcomeReport | RecordingReport | SyncMark
"""What a client may send. The engine puts on the time and the source."""


class JournalStatus(Struct, frozen=True, tag_field="kind", tag="journaling"):
    """How the record of the session stands. Comes among the records whenever it changes; no record itself."""

    durable: int = 0
    """All records up to this `seq` are on the disk. Records reach clients only then."""
    behind: float = 0.0
    """Seconds for which the oldest input has been waiting for the disk; 0 when nothing waits."""
    trouble: str = ""
    """Why nothing can be recorded, for a person. While this is set, the session is paused."""


class Heartbeat(Struct, frozen=True, tag_field="kind", tag="pulse"):
    """Signs of life, about once a second. Comes among the records; no record itself."""

    robot_seen: float | None = None
    """Session time of the robot's last sign of life; None: its driver does not know."""
    lag: float = 0.0
    """Seconds by which the engine's loop was late at most, lately."""


class ShadowStatus(Struct, frozen=True):
    """How a shadow stands (`run.client.shadow`). Comes among the records whenever it changes; no record itself,
    and never on a socket."""

    paused: bool
    shown: int
    """Cues that were shown."""
    cues: int
    """Of how many."""
    kept: bool = True
    """Whether there is a file already."""


Update: TypeAlias = AnyRecord | JournalStatus | Heartbeat
ClientUpdate: TypeAlias = Update | ShadowStatus


class AttachReply(Struct, frozen=True):
    """What a client is told when it attaches: snapshot plus later records is the live state."""

    scenario: Scenario
    mode: str
    """`debug` or `real`, as the session runs (the command line may override the scenario)."""
    robot: str
    seed: int
    view: SessionView
    """The state at `view.seq`; the next record has the next number."""
    you: str = ""
    """How the session calls this client: `wizard:anna`; a second Anna is `wizard:anna#2`. `view.control` names the one
    who holds control."""
    role: Role = "wizard"
    folder: str = ""
    """The session's folder; empty when nothing is kept."""
    replay: bool = False
    """This is no session but the replay of one: nothing can be submitted."""
    shadow: bool = False
    """This is no session but the cues of one, for a second wizard: what they press is kept, and sent nowhere."""
    journaling: JournalStatus = JournalStatus()
    speed: float = 1.0
    """Session seconds in a second."""
    origin: float | None = None
    """This computer's monotonic clock (`time.monotonic()`) at session time 0: at `t` it shows `origin + t / speed`, in
    every process. Of a session that was recovered it holds from there on. None: nobody knows."""

    @property
    def is_recorded(self) -> bool:
        """Whether what is shown has happened already, and no robot is there."""
        return self.replay or self.shadow

    @property
    def recorded_as(self) -> str:
        """What it is then, in a word."""
        return "shadow" if self.shadow else "replay"


class Reply(Struct, frozen=True):
    """The engine's answer to one message. An accepted one is on the disk."""

    accepted: bool
    reason: str = ""
    task: int | None = None
    """The task's id, for `Submit`."""


class EngineGone(RiseError, ConnectionError):
    """The engine has ended or cannot be reached; the message says why, for a person."""


class LinkLost(EngineGone):
    """This connection was cut (the client was too slow, say), but the engine goes on: attach again."""


class Rejected(RiseError):
    """The session did not accept what was asked for; the text says why."""


class Client(Protocol):
    """One connection to one engine. All methods belong to the client's loop.

    Programs have it easier with `rise_engine.run.client.connect`; who wants the batches and replies themselves:

        import asyncio
        from rise_engine.run.client.socket import SocketClient
        from rise_engine.kernel.inputs import Submit
        from rise_engine.kernel.records import EventRecord
        from rise_engine.run.protocol.client import Client

        async def main() -> None:
            client: Client = SocketClient("greeting", "gaze-tracker", "node")
            print((await client.attach()).scenario.title)
            reply = await client.send(Submit(function="raiseEventTopic", behavior="/H_greets"))
            if not reply.accepted:
                print(reply.reason)
            async for batch in client.records():
                if any(isinstance(update, EventRecord) for update in batch):
                    break
            await client.close()

        asyncio.run(main())
    """

    async def attach(self) -> AttachReply:
        """Begin, or begin again after `LinkLost`.

        :return: what the session runs, and its state at this moment, from which `records` goes on.
        :raises EngineGone: no such session runs, or it does not admit this client; the text says why.
        """
        ...

    def records(self) -> AsyncIterator[Sequence[ClientUpdate]]:
        """What happens from `attach` on. Ends when the session does.

        :return: for `async for`: batches, in order and without gaps, of records and of what comes
            among them (`JournalStatus`, `Heartbeat`).
        :raises LinkLost: while iterating, when only this connection was cut.
        :raises EngineGone: while iterating, when the engine has gone without an end.
        """
        ...

    async def send(self, message: ClientInput) -> Reply:
        """Submit an input and wait until the engine has accepted (and recorded) or rejected it.

        :param message: a task, a note or a report; the engine puts on the time and the source.
        :return: what became of it; an accepted task's id is in it, and its records have come before.
        :raises EngineGone: when the session or this connection (`LinkLost`) is over.
        """
        ...

    async def change_control(self, verb: ControlVerb) -> Reply:
        """Do something about who holds control. What comes of it arrives as a record too.

        :param verb: `take`, `ask`, `give` or `release`, see `ControlVerb`.
        :return: whether it was done, or why not.
        :raises EngineGone: when the session or this connection (`LinkLost`) is over.
        """
        ...

    async def take_over(self) -> Reply:
        """Let the session go on with the files of its scenario as they are now (semantics.md 12.5).

        :return: whether it does, or why not. If it does, the connection ends (`LinkLost`); attach again.
        :raises EngineGone: when the session or this connection (`LinkLost`) is over.
        """
        ...

    def now(self) -> float:
        """The session's time in seconds, as well as this client knows it; for running clocks on the screen."""
        ...

    async def close(self, *, end_session: bool = False) -> None:
        """Leave; the session goes on.

        :param end_session: also let the engine stop the robot and end the session.
        :raises Rejected: when this client may not end it; it stays attached.
        """
        ...
