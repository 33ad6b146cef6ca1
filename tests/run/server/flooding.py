"""A process of its own that is a hundred bad clients: `python flooding.py SOCKET`.

Prints `flooding` once all of them have done harm, goes on until its standard input ends, and prints what it has sent.
"""

from __future__ import annotations

import asyncio
import json
import logging
import sys
from contextlib import suppress

from rise_engine.run.protocol.messages import VERSION

logging.getLogger("asyncio").setLevel(logging.ERROR)  # it writes to connections that are cut
PATH = sys.argv[1]
MESSAGES, CONNECTIONS = 1000, 200
"""So much has to have come before it counts as a flood."""
NOTE = json.dumps({"type": "send", "id": 1, "message": {"input": "note", "text": "x" * 200}}).encode() + b"\n"
EVENT = (
    json.dumps(
        {"type": "send", "id": 1, "message": {"input": "submit", "function": "raiseEventTopic", "behavior": "x"}}
    )
    + "\n"
).encode()
LONG = json.dumps({"type": "send", "id": 1, "message": {"input": "note", "text": "x" * 50_000}}).encode() + b"\n"
sent = {"connections": 0, "messages": 0}


async def attach(role: str = "node") -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    reader, writer = await asyncio.open_unix_connection(PATH)
    sent["connections"] += 1
    writer.write(json.dumps({"type": "attach", "version": VERSION, "name": "flood", "role": role}).encode() + b"\n")
    return reader, writer


async def swallow(reader: asyncio.StreamReader) -> None:
    while await reader.read(262_144):
        pass


async def floods(line: bytes, reads: bool) -> None:
    """Writes as fast as it goes."""
    reader, writer = await attach()
    reading = asyncio.create_task(swallow(reader)) if reads else None
    if not reads:
        writer.transport.pause_reading()  # type: ignore[attr-defined]
    try:
        while True:
            writer.write(line * 20)
            sent["messages"] += 20
            await writer.drain()
            await asyncio.sleep(0)
    finally:
        writer.transport.abort()
        if reading is not None:
            reading.cancel()


async def stalls() -> None:
    """Never reads."""
    _, writer = await attach("observer")
    writer.transport.pause_reading()  # type: ignore[attr-defined]
    await asyncio.Event().wait()


async def vanishes(role: str) -> None:
    """Comes and goes, in the middle of everything."""
    while True:
        _, writer = await attach(role)
        writer.write(EVENT[:-9])
        await asyncio.sleep(0.005)
        writer.transport.abort()


async def babbles() -> None:
    """Sends what is no message."""
    while True:
        reader, writer = await asyncio.open_unix_connection(PATH)
        sent["connections"] += 1
        writer.write(b"\xff\x00" * 50_000 + b"\n")
        await reader.read(65_536)
        writer.transport.abort()
        await asyncio.sleep(0.005)


async def again(what: object) -> None:
    """Who was cut off comes back."""
    while True:
        with suppress(OSError):
            await what()  # type: ignore[operator]
        await asyncio.sleep(0.02)


async def main() -> None:
    kinds = [
        *[lambda: floods(NOTE, True)] * 20,
        *[lambda: floods(NOTE, False)] * 10,
        *[lambda: floods(EVENT, True)] * 10,
        *[lambda: floods(LONG, True)] * 10,
        *[stalls] * 25,
        *[lambda: vanishes("wizard")] * 10,
        *[lambda: vanishes("observer")] * 10,
        *[babbles] * 5,
    ]
    tasks = [asyncio.create_task(again(kind)) for kind in kinds]
    while sent["messages"] <= MESSAGES or sent["connections"] <= CONNECTIONS:  # noqa: ASYNC110
        await asyncio.sleep(0.01)
    print("flooding", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    print(json.dumps({**sent, "clients": len(tasks)}))


asyncio.run(main())
