"""docs/how-to/add-an-eye-tracker.md: its code brings gaze and acts together, from a stream and from a file."""

from __future__ import annotations

import asyncio
import csv
import json
import os
import time
import wave
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from sybil import Sybil
from sybil.parsers.myst import CodeBlockParser

from rise_engine.run.client import connect
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineStarted, start_engine
from tests.patience import PATIENCE
from tests.run.recording.test_lsl_recorded import ONLY_HERE, finish, line, start
from tests.run.server.conftest import scratch as scratch
from tests.run.server.serving import GREETING
from tests.scenarios.played import process

pytest.importorskip("pandas")
pytestmark = pytest.mark.slow
PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "add-an-eye-tracker.md"
NAMED = "2026-11-23_093000_P01_tea_real"
"""What the page calls the session."""
ROBOT, TABLE = 400, 1200
"""Where the stand-in looks: pixels from the left."""
CLOCKS = 0.1
"""Seconds that two clocks may seem to be apart."""


def blocks() -> list[str]:
    """The page's code: two for a stream, one for a file, two for both."""
    document = Sybil(parsers=[CodeBlockParser("python", lambda example: None)]).parse(PAGE)
    return [str(example.parsed) for example in document.examples()]


def run(folder: Path, session: Path, *numbers: int) -> dict[str, Any]:
    """Run blocks of the page in a folder with its files, and return what they have made."""
    names: dict[str, Any] = {}
    before = Path.cwd()
    os.chdir(folder)
    try:
        for number in numbers:
            exec(compile(blocks()[number].replace(NAMED, str(session)), f"{PAGE}, block {number}", "exec"), names)
    finally:
        os.chdir(before)
    return names


def export_tables(session: Path, folder: Path) -> None:
    exported = process(["export", str(session), "--format", "tables", "-o", str(folder / "tables")])
    assert exported.returncode == 0, exported.stderr.decode()


async def until_both_are_recorded(recorder: asyncio.subprocess.Process) -> None:
    """LabRecorder's threads, one a stream, may write into the same line."""
    assert recorder.stdout is not None
    seen = ""
    async with asyncio.timeout(PATIENCE):
        while seen.count("Started data collection") < 2:
            more = (await recorder.stdout.read(1000)).decode()
            assert more, f"the recorder has ended: {seen}"
            seen += more


@pytest.fixture
def session(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[EngineStarted]:
    """A session of the greeting, in a process of its own."""
    monkeypatch.setenv("RISE_SESSIONS", str(scratch / "sessions"))
    started = start_engine(SessionOptions(str(GREETING), mode="debug", seed=1, unfinished="new", participant=ONLY_HERE))
    assert isinstance(started, EngineStarted), started.lines
    yield started
    process(["stop", started.name])  # it has ended already, but where a test has failed


async def test_gaze_that_was_streamed_lies_in_the_acts_in_which_it_was_seen(
    session: EngineStarted, scratch: Path
) -> None:
    pytest.importorskip("labrecorder", reason="LabRecorder's wheel (labrecorder) is not there for this system")
    pytest.importorskip("pylsl")
    moments: list[tuple[float, float, int]] = []
    """Session seconds before and after the eye was told to look there."""
    folder = Path(session.folder)
    source = f"stand-in-{ONLY_HERE}"
    outlet = await start("rise_engine", "lsl", session.name)
    tracker = await start("tests.run.recording.eye_tracker", source)
    await line(outlet.stderr, "sending markers")
    await line(tracker.stdout, "streaming")
    async with connect(session.name, "experimenter") as program:
        await program.raise_event("/begin")  # LabRecorder begins with a stream when something comes from it
        sources = f"rise/{folder.name}", source
        recorder = await start("tests.run.recording.lab_recorder", str(scratch / "P01.xdf"), *sources)
        await until_both_are_recorded(recorder)
        origin = program.attach_reply.origin
        assert origin is not None

        async def look(x: int) -> None:
            assert tracker.stdin is not None
            before = time.monotonic()
            tracker.stdin.write(f"{x}\n".encode())
            await line(tracker.stdout, f"looks at {x}")
            moments.append((before - origin, time.monotonic() - origin, x))

        await look(TABLE)
        for act in ("R_Greeting", "R_Smile"):
            task = await program.start(act)
            await look(ROBOT)
            await program.wait_for_task(task, PATIENCE)
            await look(TABLE)
        await program.end("all is recorded")
    await finish(outlet)
    await finish(tracker)
    await finish(recorder)
    export_tables(folder, scratch)
    made = run(scratch, folder, 0, 1, 3, 4)

    acts = made["acts"].set_index("act")
    gaze = made["gaze"]
    assert set(gaze["act"]) == {"R_Greeting", "R_Smile", "nothing"}
    for act in ("R_Greeting", "R_Smile"):
        times = gaze.loc[gaze["act"] == act, "t"]
        assert acts.loc[act, "started_at"] <= times.min() and times.max() < acts.loc[act, "ended_at"]
    # Between the order to look somewhere and its answer the eye may be at either place; else it is where it was told.
    # LSL measures how far two clocks are apart, which a busy machine makes less exact.
    for (_, since, x), (until, _, _) in zip(moments, [*moments[1:], (float("inf"), 0.0, 0)], strict=True):
        seen = gaze.loc[(gaze["t"] > since + CLOCKS) & (gaze["t"] < until - CLOCKS), "x"]
        assert set(seen) <= {x}, (x, since, until)
    assert made["looked"].between(0, 1).all() and len(made["looked"]) == 3


def test_gaze_of_a_tracker_with_a_clock_of_its_own(tmp_path: Path) -> None:
    from tests.results.analysis.samples import play_session

    session = play_session(tmp_path)
    export_tables(session, tmp_path)
    film = tmp_path / "world.mp4"  # any file of that name: it is not looked into
    with wave.open(str(film), "wb") as sound:
        sound.setparams((1, 2, 8000, 0, "NONE", ""))
        sound.writeframes(bytes(2 * 8000 * 60))
    offset, rate = 3.5, 1.00005
    known = [f"{offset + rate * second:.6f}={second}" for second in (1.0, 20.0)]
    added = process(["media", "add", str(session), str(film), "--at", known[0], "--at", known[1]])
    assert added.returncode == 0, added.stderr.decode()
    begin = 1_763_900_000_000_000_000  # the tracker's own clock, in nanoseconds
    with (tmp_path / "tables" / "acts.csv").open(encoding="utf-8", newline="") as rows:
        acts = [
            (each["act"], float(each["started_at"]), float(each["ended_at"]))
            for each in csv.DictReader(rows)
            if each["started_at"] and each["ended_at"]
        ]
    middle = [(act, (since + until) / 2) for act, since, until in acts]
    pictures = [["timestamp [ns]"], [str(begin)], [str(begin + 33_333_333)]]
    samples = [["timestamp [ns]", "gaze x [px]", "gaze y [px]"]]
    samples += [[str(begin + round((offset + rate * at) * 1e9)), str(ROBOT), "300"] for _, at in middle]
    for name, table in (("world_timestamps.csv", pictures), ("gaze.csv", samples)):
        with (tmp_path / name).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(table)
    made = run(tmp_path, session, 2, 3, 4)
    assert sorted(made["gaze"]["t"]) == pytest.approx(sorted(at for _, at in middle), abs=0.001)
    assert (made["looked"] == 1.0).all()
    last = {at: max((since, act) for act, since, until in acts if since <= at)[1] for _, at in middle}
    assert len(last) > 3
    for row in made["gaze"].itertuples():
        nearest = min(last, key=lambda at: abs(at - row.t))
        assert row.act in (last[nearest], "nothing")
    assert json.loads((session / "media.json").read_text(encoding="utf-8"))[0]["rate"] == pytest.approx(rate, abs=1e-6)
