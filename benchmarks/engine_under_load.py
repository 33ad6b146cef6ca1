"""The engine of `console_keys` in a separate process: makes records all the time, and notes the times of commands.

Arguments: the folder of its scenario and its sockets, the folder of its journal, records per second. It prints `ready`.
After a line on its input, it prints its notes as JSON, in seconds on the monotonic clock: the behaviour of each of a
wizard's commands with the times of its arrival and durability, and the times of input on the floor's socket.
"""

from __future__ import annotations

import asyncio
import json
import sys
import time
from contextlib import closing, suppress
from pathlib import Path

from steady_load import make_records

from rise_engine.kernel.inputs import Submit
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine, ReplyCallback, versions
from rise_engine.run.protocol.client import ClientInput, Reply
from rise_engine.run.protocol.registry import acquire_lock
from rise_engine.run.server.hub import AttachedClient, SessionHub
from rise_engine.run.server.server import SessionServer
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, create_session
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import encode_header


class WatchedHub(SessionHub):
    """Notes each command of a wizard."""

    def __init__(self, engine: Engine, folder: str) -> None:
        super().__init__(engine, folder)
        self.commands: list[tuple[str, float, float]] = []

    def submit(self, client: AttachedClient, message: ClientInput, answer: ReplyCallback) -> None:
        came = time.monotonic()

        def durable(reply: Reply) -> None:
            if client.role == "wizard" and isinstance(message, Submit):
                self.commands.append((message.behavior, came, time.monotonic()))
            answer(reply)

        super().submit(client, message, durable)


async def serve(root: Path, disk: Path, rate: float) -> None:
    loop = asyncio.get_running_loop()
    loaded = load(str(root / "scenario"))
    scenario = loaded.scenario
    assert scenario is not None
    folder = create_session(disk, scenario, loaded.files, seed=1, faults=(), versions=versions())
    clock = RealClock(loop, 1)

    def changed() -> None:
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(engine.flush_durable)

    journal = Journal(folder / JOURNAL, size=0, lock=None, changed=changed, now=clock.now)
    engine = Engine(scenario, make_robot(scenario.robot, scenario.mode, clock, 1, ()), clock, 1, journal=journal)
    journal.append(encode_header("benchmark"))
    floor: list[float] = []

    class Floor(asyncio.Protocol):
        def data_received(self, data: bytes) -> None:
            floor.append(time.monotonic())

    with closing(acquire_lock("keys")) as name:
        hub = WatchedHub(engine, str(folder))
        server = SessionServer(hub, name.socket)
        await server.start()
        await loop.create_unix_server(Floor, str(root / "floor.sock"))
        engine.start()
        reading = asyncio.ensure_future(asyncio.to_thread(sys.stdin.readline))
        print("ready", flush=True)
        made = await make_records(engine, hub, rate, reading)
        print(json.dumps({"commands": hub.commands, "floor": floor, "rate": made}), flush=True)
        engine.end_now("done")
        await server.close()
        await asyncio.to_thread(journal.close, 5.0)


if __name__ == "__main__":
    asyncio.run(serve(Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3])))
