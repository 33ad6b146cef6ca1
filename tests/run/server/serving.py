"""A session served on a real Unix socket, in the loop of the test."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, closing, suppress
from pathlib import Path
from typing import Any

from rise_engine.base.files import Disk
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.view import SessionView
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.run.protocol import messages, registry
from rise_engine.run.protocol.client import (
    AttachReply,
    Client,
    ClientUpdate,
    EngineGone,
    Heartbeat,
    JournalStatus,
)
from rise_engine.run.protocol.registry import SessionLock
from rise_engine.run.server.hub import SessionHub
from rise_engine.run.server.server import SessionServer
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, create_session
from rise_engine.session.journal import Journal
from tests.patience import PATIENCE

ROOT = Path(__file__).parents[3]
GREETING = ROOT / "scenarios" / "greeting"
LABLINKING = ROOT / "scenarios" / "lablinking"
FAST = 50.0


class Served:
    """A running session and its parts."""

    def __init__(self, engine: Engine, hub: SessionHub, server: SessionServer, lock: SessionLock, folder: Path) -> None:
        self.engine, self.hub, self.server, self.lock, self.folder = engine, hub, server, lock, folder
        self.name, self.path = lock.name, lock.socket

    def client(self, who: str = "anna", role: Any = "wizard") -> SocketClient:
        return SocketClient(self.path, who, role)


@asynccontextmanager
async def served(
    root: Path, scenario: Path = LABLINKING, *, speed: float = FAST, disk: Disk | None = None, participant: str = ""
) -> AsyncIterator[Served]:
    """`participant` is in the name of the session's folder, and so makes it another one than that of a test beside."""
    loaded = load(scenario)
    assert loaded.scenario is not None
    begun = SessionStarted(participant=participant, speed=speed)
    versions = {"rise-tui": "test"}
    folder = create_session(
        root / "sessions", loaded.scenario, loaded.files, seed=1, faults=(), versions=versions, begun=begun
    )
    lock = registry.acquire_lock(registry.session_name(scenario))
    assert lock is not None
    with closing(lock):
        loop = asyncio.get_running_loop()
        clock = RealClock(loop, speed)
        robot = make_robot(loaded.scenario.robot, loaded.scenario.mode, clock, 1, ())

        def changed() -> None:
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(engine.flush_durable)

        journal = None if disk is None else Journal(folder / JOURNAL, changed=changed, disk=disk, retry=0.01)
        engine = Engine(loaded.scenario, robot, clock, 1, started=begun, journal=journal)
        hub = SessionHub(engine, str(folder))
        server = SessionServer(hub, lock.socket)
        await server.start()
        engine.start()
        try:
            yield Served(engine, hub, server, lock, folder)
        finally:
            engine.end("the test is over")
            engine.end_now("the test is over")
            await server.close()
            if journal is not None:
                await asyncio.to_thread(journal.close, 1.0)


class OwnSession(SocketClient):
    """A client whose session is served in the loop of the test, from its first `attach` until it ends the session."""

    def __init__(
        self, root: Path, scenario: Path, who: str = "anna", *, speed: float = FAST, disk: Disk | None = None
    ) -> None:
        super().__init__(root, who)
        self._serving = served(root, scenario, speed=speed, disk=disk)
        self._running: Served | None = None

    async def attach(self) -> AttachReply:
        if self._running is None:
            running = self._running = await self._serving.__aenter__()
            self._session = running.path
            loop = asyncio.get_running_loop()
            running.engine.on_ended(lambda: setattr(self, "_closing", loop.create_task(running.server.close())))
        return await super().attach()

    async def close(self, *, end_session: bool = False, reason: str = "") -> None:
        await super().close(end_session=end_session, reason=reason)
        if end_session and self._running is not None:
            self._running = None
            await self._serving.__aexit__(None, None, None)


class Follower:
    """Folds everything that a client gets, as a console does."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.view = SessionView()
        self.journaling: list[JournalStatus] = []
        self.pulses: list[Heartbeat] = []
        self.error: EngineGone | None = None
        self._changed = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self.hello: AttachReply

    async def attach(self) -> Follower:
        self.hello = await self.client.attach()
        self.view = self.hello.view
        self._task = asyncio.create_task(self._follow(self.client.records()))
        return self

    async def _follow(self, updates: AsyncIterator[Sequence[ClientUpdate]]) -> None:
        try:
            async for batch in updates:
                for update in batch:
                    if isinstance(update, JournalStatus):
                        self.journaling.append(update)
                    elif isinstance(update, Heartbeat):
                        self.pulses.append(update)
                    else:
                        assert update.seq == self.view.seq + 1, "a gap"
                        self.view.apply(update)
                self._changed.set()
        except EngineGone as error:
            self.error = error
        finally:
            self._changed.set()

    async def until(self, true: Callable[[SessionView], object]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not true(self.view):
                assert self._task is not None and not self._task.done(), f"the stream has ended: {self.error}"
                self._changed.clear()
                await self._changed.wait()

    async def over(self) -> EngineGone | None:
        """Wait until the stream has ended, and say how."""
        assert self._task is not None
        async with asyncio.timeout(PATIENCE):
            await asyncio.wait([self._task])
        if self._task.exception() is not None:
            await self._task
        return self.error

    async def close(self) -> None:
        await self.client.close()
        await self.over()


class RawConnection:
    """A connection that sends and reads lines as they are."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    @classmethod
    async def open(cls, path: Path) -> RawConnection:
        return cls(*await asyncio.open_unix_connection(path, limit=2**24))

    def send(self, **message: Any) -> None:
        self.writer.write(json.dumps(message).encode() + b"\n")

    def attach(self, name: str = "raw", role: str = "node") -> None:
        self.send(type="attach", version=messages.VERSION, name=name, role=role)

    async def read(self) -> dict[str, Any]:
        """The next line; an empty object at the end."""
        async with asyncio.timeout(PATIENCE):
            data = await self.reader.readline()
        value: dict[str, Any] = json.loads(data) if data else {}
        return value

    async def until(self, type: str) -> dict[str, Any]:
        async with asyncio.timeout(PATIENCE):  # over all of it: a session that never says it says other things for ever
            while True:
                message = await self.read()
                assert message, f"the connection ended before {type}"
                if message["type"] == type:
                    return message

    async def refused(self) -> str:
        """The sentence with which the connection ends."""
        message = await self.until("refused")
        with suppress(ConnectionError):
            assert await self.read() == {}
        self.writer.close()
        reason: str = message["reason"]
        return reason

    async def close(self) -> None:
        self.writer.close()
        with suppress(OSError):
            await self.writer.wait_closed()
