"""An engine on a real socket that does what a test says: for consoles that are processes of their own.

`FakeClient` makes the records and remembers what it was sent; this serves it, on a thread, as a session that runs.
"""

from __future__ import annotations

import asyncio
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from threading import Event, Thread
from time import monotonic
from typing import Any

from rise_engine.run.protocol import messages, registry
from rise_engine.scenario.loader import load
from rise_engine.session.folder import create_session
from tests.patience import PATIENCE
from tests.tui.fake import DEMO, FakeClient
from tests.tui.terminals import Terminal, environment_of, terminal


class ScriptedEngine:
    """One session, named `demo`, reached by `rise-tui` with the same RISE_RUNTIME. All consoles share its records."""

    def __init__(self, home: str, *, folder: str = DEMO, speed: float = 0.0) -> None:
        """`speed`: session seconds in a second; with 0 no clock moves, and nothing is painted unless something is."""
        loaded = load(folder)
        assert loaded.scenario is not None
        kept = create_session(
            Path(home, "sessions"), loaded.scenario, loaded.files, seed=1, faults=(), versions={"rise-tui": ""}
        )
        self.fake = FakeClient(loaded.scenario, folder=str(kept))
        self.speed = speed
        self._ready = Event()
        self._consoles: set[asyncio.StreamWriter] = set()
        before, os.environ["RISE_RUNTIME"] = os.environ.get("RISE_RUNTIME"), str(Path(home, "run"))
        try:
            claimed = registry.acquire_lock("demo")
        finally:
            os.environ.pop("RISE_RUNTIME") if before is None else os.environ.update(RISE_RUNTIME=before)
        assert claimed is not None
        self._claim = claimed
        self._thread = Thread(target=lambda: asyncio.run(self._serve()), daemon=True)
        self._thread.start()
        assert self._ready.wait(PATIENCE)

    def do(self, what: Callable[[FakeClient], object]) -> None:
        """Let the engine do something, and wait until it is on its way to the consoles."""
        done = Event()

        def run() -> None:
            try:
                what(self.fake)
            finally:
                done.set()

        self._loop.call_soon_threadsafe(run)
        assert done.wait(PATIENCE)

    def until_sent(self, function: str, behavior: str = "", *, times: int = 1) -> None:
        """Wait until a console has asked for this so many times in all."""
        end = monotonic() + PATIENCE
        while self.asked(function, behavior) < times:
            assert monotonic() < end, f"{function} {behavior} was not sent; these were: {self.fake.asked()}"
            Event().wait(0.01)

    def asked(self, function: str, behavior: str = "") -> int:
        """How often."""
        return self.fake.asked().count((function, behavior))

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join(PATIENCE)
        self._claim.close()

    async def _serve(self) -> None:
        self._loop, self._over = asyncio.get_running_loop(), asyncio.Event()
        server = await asyncio.start_unix_server(self._console, self._claim.socket, limit=1 << 20)
        self._ready.set()
        await self._over.wait()
        server.close()
        for writer in tuple(self._consoles):
            writer.close()
        for task in asyncio.all_tasks() - {asyncio.current_task()}:
            task.cancel()

    async def _console(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._consoles.add(writer)
        answering: set[asyncio.Task[None]] = set()
        with suppress(ConnectionError, asyncio.CancelledError):
            while data := await reader.readline():
                match messages.decode_client_message(data):
                    case messages.AskSummaryMessage():
                        writer.write(messages.encode_line(self._about()))
                    case messages.AttachMessage():
                        await self._welcome(writer)
                        answering.add(asyncio.create_task(self._records(writer)))
                    case messages.SendMessage(id=id, message=message):
                        answering.add(asyncio.create_task(self._answer(writer, id, message)))
                    case messages.ControlMessage(id=id, verb=verb):
                        reply = await self.fake.change_control(verb)
                        writer.write(messages.encode_line(messages.ReplyMessage(id, reply.accepted, reply.reason)))
                    case _:
                        pass
        for task in answering:
            task.cancel()
        self._consoles.discard(writer)
        writer.close()

    async def _welcome(self, writer: asyncio.StreamWriter) -> None:
        attach_reply = await self.fake.attach()
        welcome = messages.HelloMessage(
            version=messages.VERSION,
            you=attach_reply.you,
            role=attach_reply.role,
            mode=attach_reply.mode,
            robot=attach_reply.robot,
            seed=attach_reply.seed,
            scenario_hash=attach_reply.scenario.hash,
            folder=attach_reply.folder,
            replay=attach_reply.replay,
            journaling=attach_reply.journaling,
            t=self.fake.time,
            speed=self.speed,
            state=messages.without_tasks(attach_reply.view),
        )
        for message in (
            welcome,
            messages.TasksMessage(list(attach_reply.view.tasks.values())),
            messages.ReadyMessage(),
        ):
            writer.write(messages.encode_line(message))

    async def _records(self, writer: asyncio.StreamWriter) -> None:
        async for batch in self.fake.records():
            records: list[Any] = list(batch)
            writer.write(messages.encode_line(messages.RecordsMessage(records)))
            await writer.drain()

    async def _answer(self, writer: asyncio.StreamWriter, id: int, message: Any) -> None:
        reply = await self.fake.send(message)
        writer.write(messages.encode_line(messages.ReplyMessage(id, reply.accepted, reply.reason, reply.task)))

    def _about(self) -> messages.SessionSummary:
        fake = self.fake
        return messages.SessionSummary(
            version=messages.VERSION,
            title=fake.scenario.title,
            mode=fake.mode,
            robot=fake.scenario.robot.name,
            seed=1,
            scenario_folder=fake.scenario.folder,
            scenario_hash=fake.scenario.hash,
            folder=fake.folder,
            t=fake.time,
            seq=0,
            busy=False,
            stopped=False,
            control=None,
            clients=[],
        )


@contextmanager
def scripted(home: str, **options: Any) -> Iterator[ScriptedEngine]:
    engine = ScriptedEngine(home, **options)
    try:
        yield engine
    finally:
        engine.close()


@contextmanager
def scripted_console(
    size: tuple[int, int] = (120, 40), speed: float = 0.0
) -> Iterator[tuple[Terminal, ScriptedEngine]]:
    """A console at a terminal, attached to a scripted engine, with its first screen painted."""
    home = tempfile.mkdtemp(prefix="rise-", dir="/tmp")  # the path of a socket has to be short
    environment_of(home)
    try:
        with scripted(home, speed=speed) as engine, terminal("--wizard", "anna", home=home, size=size) as it:
            it.until_screen("LIVE")
            it.still()
            yield it, engine
    finally:
        rmtree(home, ignore_errors=True)
