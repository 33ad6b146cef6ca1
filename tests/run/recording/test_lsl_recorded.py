"""Our live stream, recorded by LabRecorder's own code in another process and read by pyxdf."""

from __future__ import annotations

import asyncio
import os
import sys
import time
from pathlib import Path

import pytest

from rise_engine.base.files import Disk
from rise_engine.run.client import connect
from tests.patience import PATIENCE
from tests.run.server.conftest import scratch as scratch
from tests.run.server.serving import GREETING, served

pytest.importorskip("labrecorder", reason="LabRecorder's wheel (labrecorder) is not there for this system")
pytest.importorskip("pylsl")
ONLY_HERE = f"T{os.getpid()}"
"""A participant whom no test beside this one has: LSL finds streams by the session's name, whoever began it."""
COUNT, BEFORE = 400, 150
"""Markers in all, and those that happen before anybody records."""


async def start(*arguments: str) -> asyncio.subprocess.Process:
    return await asyncio.create_subprocess_exec(
        sys.executable,
        *("-m", *arguments),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )


async def line(stream: asyncio.StreamReader | None, word: str) -> str:
    """The next line of a process's output with that word in it."""
    assert stream is not None
    seen = ""
    async with asyncio.timeout(PATIENCE):
        while word not in (found := (await stream.readline()).decode()):
            seen += found
            assert found, f"the process has ended: {seen}"
    return found


async def finish(process: asyncio.subprocess.Process) -> str:
    """End its standard input; what it said then, once it has ended in order."""
    async with asyncio.timeout(PATIENCE):
        _, errors = await process.communicate(b"")
    assert process.returncode == 0, errors.decode()
    return errors.decode()


@pytest.mark.slow
async def test_labrecorder_has_every_marker_in_order_with_its_exact_time(scratch: Path) -> None:
    import pyxdf

    file = scratch / "session.xdf"
    bounds: list[tuple[float, float]] = []
    async with served(scratch, GREETING, speed=1.0, disk=Disk(), participant=ONLY_HERE) as session:
        outlet = await start("rise_engine", "lsl", str(session.path))
        opened = await line(outlet.stderr, "sending markers")
        source = f"rise/{session.folder.name}"
        assert source in opened
        async with connect(session.path, "marker") as program:

            async def raise_events(numbers: range) -> None:
                for number in numbers:
                    before = time.monotonic()
                    await program.raise_event(f"/m{number}")
                    bounds.append((before, time.monotonic()))

            await raise_events(range(BEFORE))
            recorder = await start("tests.run.recording.lab_recorder", str(file), source)
            await line(recorder.stdout, "Started data collection")
            await raise_events(range(BEFORE, COUNT))
            times = [record.t for record in session.hub.view.unhandled][-3:]
            origin = program.attach_reply.origin
        ended = asyncio.Event()
        session.engine.on_ended(ended.set)
        session.engine.end("all is recorded")
        await asyncio.wait_for(ended.wait(), PATIENCE)
    assert "went to nobody" not in await finish(outlet)  # it ends with the session, when its markers were fetched
    await finish(recorder)
    (stream,), _ = pyxdf.load_xdf(file, synchronize_clocks=False, dejitter_timestamps=False)
    assert stream["info"]["name"] == ["rise"] and stream["info"]["type"] == ["Markers"]
    assert stream["info"]["desc"][0]["session"] == [session.folder.name]
    found = [(marker, stamp) for (marker,), stamp in zip(stream["time_series"], stream["time_stamps"], strict=True)]
    assert found[-1][0] == "session/ended"
    events = [(marker, stamp) for marker, stamp in found if marker.startswith("event/")]
    assert [marker for marker, _ in events] == [f"event/m{number}" for number in range(COUNT)]
    # Each stamp lies between the moment at which the program sent the event and the one at which it was recorded.
    outside = [
        (marker, stamp, low, high)
        for (marker, stamp), (low, high) in zip(events, bounds, strict=True)
        if not low - 0.001 <= stamp <= high + 0.001
    ]
    assert not outside, outside[:3]
    assert origin is not None
    assert [stamp for _, stamp in events[-3:]] == pytest.approx([origin + t for t in times], abs=0.001)
