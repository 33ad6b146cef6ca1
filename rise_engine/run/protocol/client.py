"""The only interface between a console and an engine: messages, never calls into the engine (console.md 4.1, 5.1).

A console, a feature node or a test uses a `Client`. `rise_engine.run.client.socket` implements it over the session's
socket, `rise_engine.run.client.replay` over the record of a session.
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
"""wizard: a console that may have control. observer: watches, adds notes, and may stop everything. node: a program,
which may submit tasks at any time, like a ROS node."""

ControlVerb: TypeAlias = Literal["take", "ask", "give", "release"]
"""take: whoever has it. ask: the holder for it. give: to the asker. release: to nobody. A wizard who attaches while
nobody has control gets it, unless a recovered session waits for a wizard. There, taking control continues it."""

ClientInput: TypeAlias = Submit | Note | CheckReport | OutcomeReport | RecordingReport | SyncMark
"""The inputs of a client. The engine sets the time and the source."""


class UnrecordedStop(Struct, frozen=True):
    """The last stop of a session that cannot record now. Its records follow."""

    source: str
    answered: bool = False
    """Whether the robot has answered. The other fields are its last answer, as in `StopReport`."""
    confirmed: tuple[str, ...] = ()
    unconfirmed: tuple[str, ...] = ()
    unstoppable: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """The stop and its answer, for a person."""
        parts = [f"stop was sent to the robot by {self.source}"]
        parts += [f"CANNOT BE STOPPED: {', '.join(self.unstoppable)}"] if self.unstoppable else []
        parts += [f"NOT confirmed by {', '.join(self.unconfirmed)}"] if self.unconfirmed else []
        parts += [f"confirmed by {', '.join(self.confirmed) or 'nobody'}"] if self.answered else []
        return "; ".join(parts)


class JournalStatus(Struct, frozen=True, tag_field="kind", tag="journaling"):
    """The state of the session's record, sent among the records whenever it changes. It is not a record itself."""

    durable: int = 0
    """All records up to this `seq` are on the disk. Clients get only these."""
    behind: float = 0.0
    """Seconds that the oldest input has been waiting for the disk; 0: nothing waits."""
    trouble: str = ""
    """Why nothing can be recorded, for a person. While this is set, the session is paused."""
    stop: UnrecordedStop | None = None
    """The last stop, if its record is not on the disk; None: no such stop."""

    @property
    def sentence(self) -> str:
        """The trouble and the stop, for a person; empty: everything is recorded."""
        return "; ".join(filter(None, (self.trouble, self.stop.sentence if self.stop is not None else "")))


class Heartbeat(Struct, frozen=True, tag_field="kind", tag="pulse"):
    """A sign of life, sent about once a second among the records. It is not a record itself."""

    robot_seen: float | None = None
    """Session time of the robot's last sign of life; None: its driver does not know."""
    lag: float = 0.0
    """Maximum recent delay of the engine's loop in seconds."""


class ShadowStatus(Struct, frozen=True):
    """The state of a shadow (`run.client.shadow`), among the records whenever it changes.

    It is not a record itself, and is never sent over a socket.
    """

    paused: bool
    shown: int
    """How many cues were shown."""
    cues: int
    """How many cues there are."""
    kept: bool = True
    """Whether its file exists."""


Update: TypeAlias = AnyRecord | JournalStatus | Heartbeat
ClientUpdate: TypeAlias = Update | ShadowStatus


class AttachReply(Struct, frozen=True):
    """The reply to an attaching client: this snapshot and the later records give the live state."""

    scenario: Scenario
    mode: str
    """`debug` or `real`, as the session runs (the command line may override the scenario)."""
    robot: str
    seed: int
    view: SessionView
    """The state at `view.seq`. The next record has the next number."""
    you: str = ""
    """The session's name for this client: `wizard:anna`, or `wizard:anna#2` for a second Anna, as in `view.control`."""
    role: Role = "wizard"
    folder: str = ""
    """The session's folder; empty: nothing is stored."""
    replay: bool = False
    """Whether this is the replay of a session: nothing can be submitted."""
    shadow: bool = False
    """Whether this shows only the cues of a session to a second wizard, whose keys are stored but have no effect."""
    journaling: JournalStatus = JournalStatus()
    speed: float = 1.0
    """Session seconds in a second."""
    origin: float | None = None
    """This computer's monotonic clock (`time.monotonic()`) at session time 0: at `t` it shows `origin + t / speed`, in
    every process. For a recovered session it is valid from the recovery on. None: unknown."""

    @property
    def is_recorded(self) -> bool:
        """Whether it is a recording, without a robot."""
        return self.replay or self.shadow

    @property
    def recorded_as(self) -> str:
        """The kind of recording, in a word."""
        return "shadow" if self.shadow else "replay"


class Reply(Struct, frozen=True):
    """The engine's reply to one message. An accepted message is on the disk."""

    accepted: bool
    reason: str = ""
    task: int | None = None
    """The task's id, for `Submit`."""


class EngineGone(RiseError, ConnectionError):
    """The engine has ended or cannot be reached; the message says why, for a person."""


class LinkLost(EngineGone):
    """This connection was cut (the client was too slow, say), but the engine goes on: attach again."""


class Rejected(RiseError):
    """The session did not accept a request. The text says why."""


class Client(Protocol):
    """One connection to one engine. All methods belong to the client's loop.

    `rise_engine.run.client.connect` is easier for programs. This example handles the batches and replies itself:

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
        """Attach, or attach again after `LinkLost`.

        :return: the scenario and the present state, from which `records` continues.
        :raises EngineGone: no such session runs, or it does not admit this client; the text says why.
        """
        ...

    def records(self) -> AsyncIterator[Sequence[ClientUpdate]]:
        """Yield all updates from `attach` on, until the session ends.

        :return: for `async for`: batches of records and other updates (`JournalStatus`, `Heartbeat`), in order and
            without gaps.
        :raises LinkLost: while iterating, if only this connection was cut.
        :raises EngineGone: while iterating, if the engine has gone without an end.
        """
        ...

    async def send(self, message: ClientInput) -> Reply:
        """Submit an input and wait until the engine has accepted (and recorded) or rejected it.

        :param message: a task, a note or a report; the engine sets the time and the source.
        :return: the reply; it has the id of an accepted task, whose records have come before.
        :raises EngineGone: the session or this connection (`LinkLost`) is over.
        """
        ...

    async def change_control(self, verb: ControlVerb) -> Reply:
        """Change who has control. The result also arrives as a record.

        :param verb: `take`, `ask`, `give` or `release`, see `ControlVerb`.
        :return: whether it was done, or why not.
        :raises EngineGone: the session or this connection (`LinkLost`) is over.
        """
        ...

    async def take_over(self) -> Reply:
        """Make the session continue with the present files of its scenario (semantics.md 12.5).

        :return: whether it does, or why not. If it does, the connection ends (`LinkLost`); attach again.
        :raises EngineGone: the session or this connection (`LinkLost`) is over.
        """
        ...

    def now(self) -> float:
        """Return the session's time in seconds, as exactly as known here, for running clocks on the screen."""
        ...

    async def close(self, *, end_session: bool = False) -> None:
        """Leave; the session continues.

        :param end_session: also make the engine stop the robot and end the session.
        :raises Rejected: this client may not end it; it stays attached.
        """
        ...
