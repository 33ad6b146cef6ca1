"""The whole way of a mark: given in a running session, heard by a camera with a clock of its own, found in its film."""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path
from time import monotonic

import pytest
from click.testing import CliRunner

from rise_engine.base.files import Disk
from rise_engine.cli import main
from rise_engine.run.client import connect
from rise_engine.run.recording.chirp import LEAD_SECONDS, SOUND_SECONDS
from rise_engine.run.recording.marks import give_mark
from rise_engine.session.media import read_media
from rise_engine.study.model import SyncSettings
from tests.patience import PATIENCE
from tests.run.server.serving import GREETING, served

from .sounds import record_marks, write_wav

PLAYER = """import sys, time
assert open(sys.argv[1], "rb").read(4) == b"RIFF"
begun = time.monotonic()
time.sleep({seconds})
with open({log!r}, "a") as log:
    log.write(f"{{begun}}\\n")
"""
BEGAN, RATE = 1.7, 1.000_05
"""The camera began so many seconds before the session, and runs 50 ppm fast."""


@pytest.mark.slow
async def test_a_film_is_aligned_as_well_as_the_marks_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RISE_RUNTIME", str(tmp_path / "runtime"))
    log, player = tmp_path / "played", tmp_path / "player.py"
    player.write_text(PLAYER.format(seconds=SOUND_SECONDS, log=str(log)))
    settings = SyncSettings(play=(sys.executable, str(player), "{file}"))
    async with served(tmp_path, GREETING, speed=1.0, disk=Disk()) as running:
        began = monotonic() - running.engine.clock.now()
        async with connect(running.path, name="recorders") as session:
            given = [await give_mark(session, number, settings) for number in (1, 2)]
            assert [each.problem for each in given] == ["", ""]
            await session.wait_until(lambda view: view.sync is not None and view.sync.number == 2, PATIENCE)
        folder = running.folder
    heard = [float(line) + LEAD_SECONDS - began for line in log.read_text().split()]  # by the session's clock
    for mark, at in zip(given, heard, strict=True):
        assert mark.at is not None and mark.within is not None
        assert abs(mark.at - at) <= mark.within + 0.01, "a hundredth for the way to the session and back"
    sound = record_marks(
        [(1, heard[0]), (2, heard[1])], offset=BEGAN, rate=RATE, seconds=heard[1] + 5, noise=0.02, samples=16_000
    )
    film = write_wav(tmp_path / "camera.wav", sound, 16_000)
    done = await asyncio.to_thread(
        CliRunner().invoke, main, ["media", "add", str(folder), str(film), "--find-marks", "--json"]
    )
    assert done.exit_code == 0, done.output
    [found] = json.loads(done.output)["files"]
    [file] = read_media(folder)
    assert found["aligned_by"] == "marks" and len(file.marks) == 2 and file.offset is not None
    # Two marks near each other and off in opposite directions make the rate wrong, and with it what is between them.
    bound = max(each.within or 0.0 for each in given) * max(1.0, file.rate) + 0.01
    for at in (heard[0], sum(heard) / 2, heard[1]):
        assert abs(file.offset + file.rate * at - (BEGAN + RATE * at)) <= bound
