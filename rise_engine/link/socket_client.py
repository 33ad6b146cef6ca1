"""A client of a session that runs in another process, over the session's socket."""

from __future__ import annotations

import asyncio
import os
import time
from collections import deque
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any

from rise_engine.kernel.inputs import Note, Submit
from rise_engine.link import places
from rise_engine.link.client import (
    Arrival,
    ClientInput,
    EndRefused,
    EngineGone,
    Hello,
    LinkLost,
    Reply,
    Resync,
    Role,
    Verb,
)
from rise_engine.link.messages import (
    VERSION,
    Answer,
    Attach,
    Control,
    End,
    Ended,
    FromClient,
    JournalingChanged,
    PulseTold,
    Ready,
    Records,
    Refused,
    ScenarioTold,
    Send,
    Tasks,
    ToClient,
    Welcome,
    line,
    to_client,
    view_of,
)
from rise_engine.scenario.exchange import from_json
from rise_engine.scenario.model import Scenario
from rise_engine.view import TaskView

READ = 262_144
"""Bytes that are read at once."""
SLICE = 0.001
"""Seconds of reading after which the loop does what else there is to do."""
LIMIT = 200_000
"""Records that may wait to be taken from `records`; with more, the connection is given up."""
MANY = 5_000
"""The same for one who takes the state anew: with more, no more is read before some are taken."""
GRACE = 0.3
"""Seconds in which a process that is just ending lets go of its lock."""


class SocketClient:
    """Implements `rise_engine.link.client.Client`. All methods belong to one loop."""

    def __init__(
        self,
        session: str | os.PathLike[str],
        who: str,
        role: Role = "wizard",
        *,
        scenario: Scenario | None = None,
        resync: bool = False,
    ) -> None:
        """`session`: the name of a running session, or the path of its socket. `who`: the name in the record, without
        the role. `scenario`: what the session is known to run; with the right hash it is not loaded again.
        `resync`: a client that shows the state and needs not every record; see `Resync`."""
        self._session = session
        self._who = who
        self._role: Role = role
        self._scenario = scenario
        self._resync = resync
        self._connection: _Connection | None = None
        self._hello: tuple[float, float, float] | None = None
        """Session time, speed, and when that was on our own clock."""

    async def attach(self) -> Hello:
        """As the protocol says. Also raises EngineGone, with the engine's sentence, when it refuses this client."""
        await self._cut()
        connection = await _Connection.open(self._path(), resync=self._resync)
        try:
            attach = Attach(VERSION, self._who, self._role, scenario=self._scenario is None, resync=self._resync)
            connection.write(attach)
            hello = await self._arrive(connection)
        except BaseException:
            await connection.close()
            raise
        self._connection = connection
        return hello

    def records(self) -> AsyncIterator[Sequence[Arrival]]:
        """As the protocol says."""
        if self._connection is None:
            raise RuntimeError("attach first")
        return self._connection.batches()

    async def send(self, message: ClientInput) -> Reply:
        if not isinstance(message, Submit | Note):
            raise TypeError(f"a client may send Submit and Note, not {type(message).__name__}")
        connection = self._attached()
        return await connection.ask(Send(connection.number(), message))

    async def control(self, verb: Verb) -> Reply:
        connection = self._attached()
        return await connection.ask(Control(connection.number(), verb))

    def now(self) -> float:
        if self._hello is None:
            return 0.0
        t, speed, at = self._hello
        connection = self._connection
        until = time.monotonic() if connection is None or connection.over_at is None else connection.over_at
        return t + (until - at) * speed

    async def close(self, *, end_session: bool = False, reason: str = "") -> None:
        """As the protocol says; with `end_session`, returns when the session has ended."""
        connection = self._connection
        if end_session and connection is not None:
            with suppress(EngineGone):
                reply = await connection.ask(End(connection.number(), reason))
                if not reply.accepted:
                    raise EndRefused(reply.reason)
                await connection.over.wait()
        await self._cut()

    # --- within -------------------------------------------------------------------------------------------------

    def _path(self) -> Path:
        if isinstance(self._session, os.PathLike) or "/" in self._session:
            return Path(self._session)
        try:
            return places.socket_path(places.find(self._session))
        except places.PlaceError as error:
            raise EngineGone(str(error)) from None

    def _attached(self) -> _Connection:
        if self._connection is None:
            raise LinkLost("this client is not attached to a session")
        return self._connection

    async def _cut(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            await connection.close()

    async def _arrive(self, connection: _Connection) -> Hello:
        """The connection goes on being read meanwhile: what comes after the state waits in it."""
        welcome = await connection.welcome
        self._hello = welcome.t, welcome.speed, time.monotonic()
        tasks = await connection.tasks
        return Hello(
            await self._runs(welcome, connection.scenario),
            welcome.mode,
            welcome.robot,
            welcome.seed,
            view_of(welcome.state, tasks),
            you=welcome.you,
            role=welcome.role,
            folder=welcome.folder,
            replay=welcome.replay,
            journaling=welcome.journaling,
        )

    async def _runs(self, welcome: Welcome, told: bytes) -> Scenario:
        """What the session runs: as the engine told it, or else read from the copy in the session's folder."""
        if told:
            with suppress(ValueError):  # an engine of another release may describe it otherwise
                self._scenario = from_json(told)
        if self._scenario is None or self._scenario.hash != welcome.scenario_hash:
            folder = Path(welcome.folder)
            self._scenario = await asyncio.to_thread(_load_copy, folder)
            if self._scenario.hash != welcome.scenario_hash:
                raise EngineGone(f"{folder} does not hold the scenario that the session runs: it has another hash")
        return self._scenario


def _load_copy(folder: Path) -> Scenario:
    """Raises EngineGone."""
    from rise_engine.session.folder import SessionError, load_copy, read_info  # which reads XML: rarely needed

    try:
        return load_copy(folder, read_info(folder))
    except SessionError as error:
        raise EngineGone(f"the session runs, but what it runs cannot be read: {error}") from None


class _Connection:
    """One connection, from its opening to its end."""

    def __init__(self, path: Path, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, *, resync: bool) -> None:
        self._path = path
        self._resync = resync
        self._anew: Welcome | None = None
        """A state that is on its way, after records that were left out."""
        self._taken = asyncio.Event()
        self._reader = reader
        self._writer = writer
        self._partial = b""
        self._lines: deque[bytes] = deque()
        self._numbers = count(1)
        self._asked: dict[int, asyncio.Future[Reply]] = {}
        loop = asyncio.get_running_loop()
        self.welcome: asyncio.Future[Welcome] = loop.create_future()
        self.tasks: asyncio.Future[list[TaskView]] = loop.create_future()
        """Those of the state, once it is complete."""
        self.scenario = b""
        """What the session runs, if the engine told it."""
        self._some: list[TaskView] = []
        self._updates: deque[Arrival] = deque()
        self._arrived = asyncio.Event()
        self._error: EngineGone | None = None
        self._gone: EngineGone = LinkLost("this client has left the session")
        self.over = asyncio.Event()
        """Set when nothing more comes."""
        self.over_at: float | None = None
        self._reading = asyncio.create_task(self._read())

    @classmethod
    async def open(cls, path: Path, *, resync: bool) -> _Connection:
        """Raises EngineGone."""
        try:
            reader, writer = await asyncio.open_unix_connection(path, limit=READ * 4)
        except (FileNotFoundError, ConnectionRefusedError):
            if places.held(places.lock_path(path)):
                raise EngineGone(f"the session at {path} is just starting or being recovered: try again soon") from None
            raise EngineGone(f"no session runs at {path}: its engine has gone") from None
        except OSError as error:
            raise EngineGone(f"the session at {path} cannot be reached: {error.strerror or error}") from None
        return cls(path, reader, writer, resync=resync)

    def number(self) -> int:
        return next(self._numbers)

    def write(self, message: FromClient) -> None:
        self._writer.write(line(message))

    async def ask(self, message: Send | Control | End) -> Reply:
        """Raises EngineGone."""
        if self.over.is_set():
            raise self._gone
        future: asyncio.Future[Reply] = asyncio.get_running_loop().create_future()
        self._asked[message.id] = future
        try:
            self.write(message)
            with suppress(ConnectionError):  # the reading side finds out what it means
                await self._writer.drain()
            return await future
        finally:
            self._asked.pop(message.id, None)

    async def next(self) -> ToClient:
        """The next message. Raises EngineGone when there is none."""
        while not self._lines:
            try:
                data = await self._reader.read(READ)
            except OSError:
                data = b""
            if not data:
                raise await self._why_cut()
            *lines, self._partial = (self._partial + data).split(b"\n") if b"\n" in data else [self._partial + data]
            self._lines.extend(lines)
        try:
            return to_client(self._lines.popleft())
        except ValueError as error:
            raise EngineGone(str(error)) from None

    async def _read(self) -> None:
        began = time.monotonic()
        try:
            while True:
                if time.monotonic() - began > SLICE:  # much came at once: others on the loop have their turn
                    await asyncio.sleep(0)
                    began = time.monotonic()
                match await self.next():
                    case Records(records=records):
                        self._updates.extend(records)
                        if len(self._updates) > LIMIT:
                            raise LinkLost("this client fell too far behind the engine; attach again")
                        self._arrived.set()
                        while self._resync and len(self._updates) > MANY:
                            self._taken.clear()
                            await self._taken.wait()
                    case Answer(id=id) as answer:
                        future = self._asked.get(id)
                        if future is not None and not future.done():
                            future.set_result(answer.reply)
                    case JournalingChanged(journaling=journaling):
                        self._updates.append(journaling)
                        self._arrived.set()
                    case PulseTold(pulse=pulse):
                        self._updates.append(pulse)
                        self._arrived.set()
                    case Welcome() as welcome if self.welcome.done():
                        self._anew = welcome
                    case Welcome() as welcome:
                        self.welcome.set_result(welcome)
                    case ScenarioTold(scenario=scenario):
                        self.scenario = bytes(scenario)
                    case Tasks(tasks=tasks):
                        self._some += tasks
                    case Ready() if self._anew is not None:
                        self._updates.append(Resync(view_of(self._anew.state, self._some), self._anew.tasks))
                        self._updates.append(self._anew.journaling)
                        self._anew, self._some = None, []
                        self._arrived.set()
                    case Ready():
                        self.tasks.set_result(self._some)
                        self._some = []
                    case Ended(reason=reason, failed=failed):
                        if failed:
                            raise EngineGone(reason)
                        self._gone = EngineGone("the session has ended")
                        return
                    case Refused(reason=reason):
                        raise LinkLost(reason) if self.tasks.done() else EngineGone(reason)
                    case _:
                        pass
        except EngineGone as error:
            self._error = self._gone = error
        finally:
            self._finish()

    def _finish(self) -> None:
        if self.over.is_set():
            return
        self.over_at = time.monotonic()
        self.over.set()
        self._arrived.set()
        self._writer.close()
        waiting: list[asyncio.Future[Any]] = [*self._asked.values(), self.welcome, self.tasks]
        for future in waiting:
            if not future.done():
                future.set_exception(self._gone)
                future.exception()  # nobody may be waiting

    async def _why_cut(self) -> EngineGone:
        """The connection has ended without a word. An engine's lock goes with its process."""
        lock = places.lock_path(self._path)
        until = time.monotonic() + GRACE
        while places.held(lock):
            if time.monotonic() > until:
                return LinkLost("the engine has cut this connection, but it goes on; attach again")
            await asyncio.sleep(0.02)
        if not lock.exists() and await _answers(self._path):  # one that runs without a lock
            return LinkLost("the engine has cut this connection, but it goes on; attach again")
        return EngineGone("its process is not there any more")

    async def batches(self) -> AsyncIterator[Sequence[Arrival]]:
        while True:
            await self._arrived.wait()
            self._arrived.clear()
            if self._updates:
                batch = list(self._updates)
                self._updates.clear()
                self._taken.set()
                yield batch
            if self.over.is_set() and not self._updates:
                self._arrived.set()  # for whoever asks again
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


async def _answers(path: Path) -> bool:
    try:
        _, writer = await asyncio.open_unix_connection(path)
    except OSError:
        return False
    writer.close()
    return True
