"""A steady load for an engine: this many records a second, some from the memory and some from events."""

from __future__ import annotations

import asyncio
import time

from rise_engine.kernel.inputs import Submit
from rise_engine.run.engine.engine import Engine
from rise_engine.run.server.hub import SessionHub


async def make_records(engine: Engine, hub: SessionHub, rate: float, end: asyncio.Future[str]) -> float:
    """Make `rate` records a second until `end` is done; returns the actual rate."""
    began, first, number = time.monotonic(), hub.view.seq, 0
    while not end.done():
        while hub.view.seq - first < (time.monotonic() - began) * rate:
            number += 1
            if number % 3:
                engine.post(Submit(function="assignValue", behavior=f"s{number % 7} = {number}", source="node:n"))
            else:
                engine.post(Submit(function="raiseEventTopic", behavior="/other", source="node:n"))
            await asyncio.sleep(0)
        await asyncio.sleep(0.002)
    return (hub.view.seq - first) / (time.monotonic() - began)
