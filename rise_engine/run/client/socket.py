"""A client of a session in another process, over the session's socket."""

from __future__ import annotations

import asyncio
import os
import time
from collections import deque
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any, get_args

from rise_engine.base.files import is_locked
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol import registry
from rise_engine.run.protocol.client import (
    AttachReply,
    ClientInput,
    ControlVerb,
    EngineGone,
    LinkLost,
    Rejected,
    Reply,
    Role,
    Update,
)
from rise_engine.run.protocol.messages import (
    VERSION,
    AttachMessage,
    ClientMessage,
    ControlMessage,
    EndedMessage,
    EndMessage,
    HeartbeatMessage,
    HelloMessage,
    JournalStatusMessage,
    ReadyMessage,
    RecordsMessage,
    RefusedMessage,
    ReplyMessage,
    ScenarioMessage,
    SendMessage,
    ServerMessage,
    TakeOverMessage,
    TasksMessage,
    decode_server_message,
    encode_line,
    with_tasks,
)
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.serialization import decode_scenario

READ_BYTES = 262_144
ATTACH_SECONDS = 15.0
"""Time limit in seconds for the engine to send its state. An engine that stands still sends none."""
SLICE_SECONDS = 0.001
"""Seconds of reading before other tasks of the loop get their turn."""
MAX_WAITING_RECORDS = 20_000
"""Maximum number of records that wait in `records`. With more, the connection is cut."""
LOCK_RELEASE_SECONDS = 0.3
"""Seconds that an ending process may take to release its lock."""

_INPUT_NAMES = ", ".join(kind.__name__ for kind in get_args(ClientInput))


class SocketClient:
    """An implementation of `rise_engine.run.protocol.client.Client`. All methods belong to one loop."""

    def __init__(
        self,
        session: str | os.PathLike[str],
        who: str,
        role: Role = "wizard",
        *,
        scenario: Scenario | None = None,
    ) -> None:
        """:param session: the name of a running session, or the path of its socket.
        :param who: the client's name in the record, without the role.
        :param role: what it may do.
        :param scenario: the session's probable scenario; with the right hash it is not loaded again.
        """
        self._session = session
        self._name = who
        self._role: Role = role
        self._scenario = scenario
        self._connection: _ServerConnection | None = None
        self._clock_at_attach: tuple[float, float, float] | None = None
        """Session time, speed, and this process' clock at that moment."""

    async def attach(self) -> AttachReply:
        """Attach as `Client` does. Raises EngineGone with the engine's sentence, also if the engine refuses.

        A client that was attached before gets LinkLost if the engine does not answer, because the engine may continue.
        """
        await self._disconnect()
        connection = await _ServerConnection.open(self._socket_path())
        try:
            connection.write(AttachMessage(VERSION, self._name, self._role, scenario=self._scenario is None))
            hello, view = await asyncio.wait_for(connection.state, ATTACH_SECONDS)
            scenario = await self._find_scenario(hello, connection.scenario)
        except TimeoutError:
            await connection.close()
            gone = EngineGone if self._clock_at_attach is None else LinkLost  # a client that was attached tries again
            raise gone(
                f"the engine of the session at {self._socket_path()} gives no sign of life: look at the robot, and "
                "at the computer that runs the engine"
            ) from None
        except BaseException:
            await connection.close()
            raise
        self._connection = connection
        self._clock_at_attach = hello.t, hello.speed, connection.hello_at
        return AttachReply(
            scenario,
            hello.mode,
            hello.robot,
            hello.seed,
            view,
            you=hello.you,
            role=hello.role,
            folder=hello.folder,
            replay=hello.replay,
            journaling=hello.journaling,
            speed=hello.speed,
            origin=hello.origin,
        )

    def records(self) -> AsyncIterator[Sequence[Update]]:
        """Yield records as `Client` does."""
        if self._connection is None:
            raise RuntimeError("attach first")
        return self._connection.read_batches()

    async def send(self, message: ClientInput) -> Reply:
        if not isinstance(message, ClientInput):
            raise TypeError(f"a client may send {_INPUT_NAMES}, not {type(message).__name__}")
        connection = self._require_connection()
        return await connection.request(SendMessage(connection.next_id(), message))

    async def change_control(self, verb: ControlVerb) -> Reply:
        connection = self._require_connection()
        return await connection.request(ControlMessage(connection.next_id(), verb))

    def now(self) -> float:
        if self._clock_at_attach is None:
            return 0.0
        t, speed, at = self._clock_at_attach
        ended_at = self._connection.ended_at if self._connection is not None else None
        return t + ((time.monotonic() if ended_at is None else ended_at) - at) * speed

    async def take_over(self) -> Reply:
        connection = self._require_connection()
        return await connection.request(TakeOverMessage(connection.next_id()))

    async def close(self, *, end_session: bool = False, reason: str = "") -> None:
        """Leave as `Client` does; with `end_session`, return when the session has ended."""
        connection = self._connection
        if end_session and connection is not None:
            with suppress(EngineGone):
                reply = await connection.request(EndMessage(connection.next_id(), reason))
                if not reply.accepted:
                    raise Rejected(reply.reason)
                await connection.ended.wait()
        await self._disconnect()

    # --- attaching -------------------------------------------------------------------------------------------------

    def _socket_path(self) -> Path:
        if isinstance(self._session, os.PathLike) or "/" in self._session:
            return Path(self._session)
        try:
            return registry.socket_path(registry.find_running(self._session))
        except registry.RegistryError as error:
            raise EngineGone(str(error)) from None

    def _require_connection(self) -> _ServerConnection:
        if self._connection is None:
            raise LinkLost("this client is not attached to a session")
        return self._connection

    async def _disconnect(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            await connection.close()

    async def _find_scenario(self, hello: HelloMessage, encoded: bytes) -> Scenario:
        """Return the scenario that the engine sent, or read the copy in the session's folder."""
        if encoded:
            with suppress(ValueError):  # another release may encode it differently
                self._scenario = decode_scenario(encoded)
        if self._scenario is None or self._scenario.hash != hello.scenario_hash:
            folder = Path(hello.folder)
            self._scenario = await asyncio.to_thread(_load_copy, folder, hello.scenario_hash)
        return self._scenario


def _load_copy(folder: Path, hash: str) -> Scenario:
    """Load the scenario with this hash. Raises EngineGone."""
    from rise_engine.base.errors import SessionError
    from rise_engine.session.folder import read_info
    from rise_engine.session.scenario_copies import load_copy_with_hash

    try:
        return load_copy_with_hash(folder, read_info(folder), hash)
    except SessionError as error:
        raise EngineGone(f"the session runs, but what it runs cannot be read: {error}") from None


class _ServerConnection:
    """One connection, from its opening to its end."""

    def __init__(self, path: Path, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._path = path
        self._reader = reader
        self._writer = writer
        self._partial = b""
        self._lines: deque[bytes] = deque()
        self._numbers = count(1)
        self._unanswered: dict[int, asyncio.Future[Reply]] = {}
        loop = asyncio.get_running_loop()
        self.state: asyncio.Future[tuple[HelloMessage, SessionView]] = loop.create_future()
        """Done when the state is complete."""
        self.hello_at = 0.0
        """The arrival of `hello`, by this process' clock."""
        self.scenario = b""
        """The session's scenario, if the engine sent it."""
        self._hello: HelloMessage | None = None
        """The `hello` of a state in transfer, and its tasks that have arrived."""
        self._tasks: list[TaskView] = []
        self._updates: deque[Update] = deque()
        self._arrived = asyncio.Event()
        self._error: EngineGone | None = None
        self._reason: EngineGone = LinkLost("this client has left the session")
        self.ended = asyncio.Event()
        """Set when nothing more arrives."""
        self.ended_at: float | None = None
        self._reading = asyncio.create_task(self._read())

    @classmethod
    async def open(cls, path: Path) -> _ServerConnection:
        """Open a connection. Raises EngineGone."""
        try:
            reader, writer = await asyncio.open_unix_connection(path, limit=READ_BYTES * 4)
        except (FileNotFoundError, ConnectionRefusedError):
            if is_locked(registry.lock_path(path)):
                raise EngineGone(f"the session at {path} is just starting or being recovered: try again soon") from None
            raise EngineGone(f"no session runs at {path}: its engine has gone") from None
        except OSError as error:
            raise EngineGone(f"the session at {path} cannot be reached: {error.strerror or error}") from None
        return cls(path, reader, writer)

    def next_id(self) -> int:
        return next(self._numbers)

    def write(self, message: ClientMessage) -> None:
        self._writer.write(encode_line(message))

    async def request(self, message: SendMessage | ControlMessage | EndMessage | TakeOverMessage) -> Reply:
        """Send a request and wait for the reply. Raises EngineGone."""
        if self.ended.is_set():
            raise self._reason
        future: asyncio.Future[Reply] = asyncio.get_running_loop().create_future()
        self._unanswered[message.id] = future
        try:
            self.write(message)
            with suppress(ConnectionError):  # the reading side finds the reason
                await self._writer.drain()
            return await future
        finally:
            self._unanswered.pop(message.id, None)

    async def _read_message(self) -> ServerMessage:
        """Return the next message. Raises EngineGone if there is none."""
        while not self._lines:
            try:
                data = await self._reader.read(READ_BYTES)
            except OSError:
                data = b""
            if not data:
                raise await self._reason_for_cut()
            *lines, self._partial = (self._partial + data).split(b"\n") if b"\n" in data else [self._partial + data]
            self._lines.extend(lines)
        try:
            return decode_server_message(self._lines.popleft())
        except ValueError as error:
            raise EngineGone(str(error)) from None

    async def _read(self) -> None:
        began = time.monotonic()
        try:
            while True:
                if time.monotonic() - began > SLICE_SECONDS:  # after much data, let other tasks run
                    await asyncio.sleep(0)
                    began = time.monotonic()
                message = await self._read_message()
                if isinstance(message, EndedMessage) and not message.failed:
                    self._reason = EngineGone("the session has ended")
                    return
                self._take_message(message)
        except EngineGone as error:
            self._error = self._reason = error
        finally:
            self._finish()

    def _take_message(self, message: ServerMessage) -> None:
        """Handle a message. Raises EngineGone if it is the last one."""
        match message:
            case RecordsMessage(records=records):
                self._add_updates(*records)
                if len(self._updates) > MAX_WAITING_RECORDS:
                    self._updates.clear()  # the state after the next attaching includes all of them
                    raise LinkLost("this client fell too far behind the engine; attach again")
            case JournalStatusMessage(journaling=journaling):
                self._add_updates(journaling)
            case HeartbeatMessage(pulse=pulse):
                self._add_updates(pulse)
            case ReplyMessage(id=id, accepted=accepted, reason=reason, task=task):
                future = self._unanswered.get(id)
                if future is not None and not future.done():
                    future.set_result(Reply(accepted, reason, task))
            case HelloMessage() as hello:
                self._hello = hello
                self.hello_at = time.monotonic()
            case ScenarioMessage(scenario=scenario):
                self.scenario = bytes(scenario)
            case TasksMessage(tasks=tasks):
                self._tasks += tasks
            case ReadyMessage() if self._hello is not None:
                self.state.set_result((self._hello, with_tasks(self._hello.state, self._tasks)))
                self._hello, self._tasks = None, []
            case EndedMessage(reason=reason):
                raise EngineGone(reason)
            case RefusedMessage(reason=reason):
                raise LinkLost(reason) if self.state.done() else EngineGone(reason)
            case _:
                pass

    def _add_updates(self, *updates: Update) -> None:
        self._updates.extend(updates)
        self._arrived.set()

    def _finish(self) -> None:
        if self.ended.is_set():
            return
        self.ended_at = time.monotonic()
        self.ended.set()
        self._arrived.set()
        self._writer.close()
        waiting: list[asyncio.Future[Any]] = [*self._unanswered.values(), self.state]
        for future in waiting:
            if not future.done():
                future.set_exception(self._reason)
                future.exception()  # nothing may be waiting for it

    async def _reason_for_cut(self) -> EngineGone:
        """Return why the connection ended without a message. An engine's lock ends with its process."""
        lock = registry.lock_path(self._path)
        deadline = time.monotonic() + LOCK_RELEASE_SECONDS
        while is_locked(lock):
            if time.monotonic() > deadline:
                return LinkLost("the engine has cut this connection, but it goes on; attach again")
            await asyncio.sleep(0.02)
        if not lock.exists() and await _accepts_connections(self._path):  # an engine without a lock
            return LinkLost("the engine has cut this connection, but it goes on; attach again")
        return EngineGone("its process no longer exists")

    async def read_batches(self) -> AsyncIterator[Sequence[Update]]:
        while True:
            await self._arrived.wait()
            self._arrived.clear()
            if self._updates:
                batch = list(self._updates)
                self._updates.clear()
                yield batch
            if self.ended.is_set() and not self._updates:
                self._arrived.set()  # for the next call
                if self._error is not None:
                    raise self._error
                return

    async def close(self) -> None:
        if not self._reading.done():
            self._reading.cancel()
            with suppress(asyncio.CancelledError):
                await self._reading
        self._finish()
        with suppress(OSError):
            await self._writer.wait_closed()


async def _accepts_connections(path: Path) -> bool:
    try:
        _, writer = await asyncio.open_unix_connection(path)
    except OSError:
        return False
    writer.close()
    return True
