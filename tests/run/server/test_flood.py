"""A hundred bad clients: the engine's memory stays flat, and stop-all works for an honest one.

Engine and bad clients are processes of their own. How late the engine's loop is meanwhile: `benchmarks/bad_clients.py`.
"""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from rise_engine.kernel.inputs import Submit
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import EngineGone
from tests.patience import PATIENCE

from .serving import ROOT, Follower

STOPS = 10
MEMORY = 100_000_000


@asynccontextmanager
async def process(*arguments: str, log: Path) -> AsyncIterator[asyncio.subprocess.Process]:
    pipe = asyncio.subprocess.PIPE
    with log.open("wb") as errors:
        it = await asyncio.create_subprocess_exec(
            sys.executable, *arguments, stdin=pipe, stdout=pipe, stderr=errors, cwd=ROOT
        )
    try:
        yield it
    finally:
        if it.returncode is None:
            it.kill()
            await it.communicate()


async def said(it: asyncio.subprocess.Process) -> str:
    assert it.stdout is not None
    return (await it.stdout.readline()).decode().strip()


@pytest.mark.slow
async def test_bad_clients_hold_up_nobody(scratch: Path) -> None:
    log = scratch / "engine.log"
    async with (
        asyncio.timeout(PATIENCE),
        process("-m", "tests.run.server.engine_process", str(scratch), log=log) as engine,
    ):
        path = await said(engine)
        wizard = await Follower(SocketClient(Path(path), "anna")).attach()
        script = str(Path(__file__).with_name("flooding.py"))
        async with process(script, path, log=scratch / "flood.log") as flood:
            assert await said(flood) == "flooding", (scratch / "flood.log").read_text()
            stops = 0
            while stops < STOPS:
                stops += await _stop(wizard)
            sent = json.loads((await flood.communicate(b""))[0])
        late = await Follower(SocketClient(Path(path), "late", "observer")).attach()
        assert (await late.client.send(Submit(function="stopAll"))).accepted
        assert late.view.stop.latched
        await wizard.close()
        await late.close()
        found = json.loads((await engine.communicate(b""))[0])
    assert sent["clients"] == 100
    assert found["grown"] < MEMORY, (found, sent)
    assert "Traceback" not in log.read_text(), log.read_text()


async def _stop(wizard: Follower) -> bool:
    """True when it was taken. When so much comes that even an honest client is cut off, it attaches again."""
    try:
        reply = await wizard.client.send(Submit(function="stopAll"))
    except EngineGone:
        await wizard.over()
        await wizard.attach()
        return False
    assert reply.accepted
    return True
