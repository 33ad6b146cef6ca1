"""ffmpeg: a real one, where there is one, and programs that behave as a bad one."""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.recorders import program as programs
from rise_adapters.recorders.ffmpeg import FfmpegRecorder

from rise_engine.ports.recorder import RecorderError, RecordingPlan
from tests.patience import PATIENCE

PICTURE = ["-re", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=10"]
needs_ffmpeg = pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed here")


def camera(**options: Any) -> FfmpegRecorder:
    return FfmpegRecorder("camera", {"input": PICTURE, "output": ["-c:v", "mpeg4"], **options})


async def begin(recorder: FfmpegRecorder, folder: Path) -> Path:
    await recorder.prepare(RecordingPlan("S1", folder))
    return Path(await recorder.start())


def script(folder: Path, *lines: str) -> str:
    """A program that says which ffmpeg it is, and then does this."""
    path = folder / "ffmpeg-of-test"
    loop = 'for each in "$@"; do [ "$each" = -version ] && echo "ffmpeg version 1 of test" && exit; last=$each; done'
    path.write_text("\n".join(["#!/bin/sh", loop, "last=${last#file:}", *lines, ""]))
    path.chmod(0o700)
    return str(path)


@needs_ffmpeg
@pytest.mark.slow
async def test_a_recording_can_be_read_and_is_its_owners_alone(tmp_path: Path) -> None:
    recorder = camera()
    path = await begin(recorder, tmp_path)
    assert path.name == "S1_camera.mkv"
    first = await recorder.status()
    async with asyncio.timeout(PATIENCE):
        while (await recorder.status()).bytes == first.bytes:  # noqa: ASYNC110  # another process, or the session
            await asyncio.sleep(0.05)
    status = await recorder.status()
    assert status.recording and status.seconds is not None and status.drops == 0
    assert await recorder.stop() == str(path)
    await recorder.close()
    assert path.stat().st_mode & 0o777 == 0o600
    packets = ["ffprobe", "-v", "error", "-count_packets", "-show_entries", "stream=nb_read_packets", "-of", "csv=p=0"]
    found = subprocess.run([*packets, str(path)], capture_output=True, text=True, check=True)  # noqa: ASYNC221  # a moment
    assert int(found.stdout) > 0 and not found.stderr


@needs_ffmpeg
async def test_its_file_grows_every_second_however_little_there_is(tmp_path: Path) -> None:
    """Matroska is written cluster by cluster, of 5 s when nobody says otherwise: each pause would be a stall."""
    picture = ["-f", "lavfi", "-i", "color=size=16x16:rate=5", "-t", "10"]  # ten seconds of film, as fast as it can
    recorder = camera(input=picture)
    path = await begin(recorder, tmp_path)
    with pytest.raises(RecorderError):
        async with asyncio.timeout(PATIENCE):
            while True:
                await recorder.status()
                await asyncio.sleep(0.02)
    await recorder.close()
    assert path.read_bytes().count(b"\x1f\x43\xb6\x75") >= 8  # the id of a cluster


@needs_ffmpeg
@pytest.mark.slow
async def test_one_that_dies_says_why_and_a_new_one_gets_a_new_file(tmp_path: Path) -> None:
    recorder = camera()
    path = await begin(recorder, tmp_path)
    assert recorder._run is not None and recorder._run.process is not None
    os.kill(recorder._run.process.pid, signal.SIGKILL)
    with pytest.raises(RecorderError, match="SIGKILL ended ffmpeg"):
        async with asyncio.timeout(PATIENCE):
            while True:
                await recorder.status()
                await asyncio.sleep(0.02)
    assert await recorder.stop() == str(path)  # what was recorded until then is there
    await recorder.close()
    again = camera()
    assert (await begin(again, tmp_path)).name == "S1_camera_2.mkv"
    await again.stop()
    await again.close()


@needs_ffmpeg
async def test_a_camera_that_is_not_there_is_said_in_its_words(tmp_path: Path) -> None:
    recorder = camera(input=["-f", "v4l2", "-i", "/dev/no-such-camera"])
    with pytest.raises(RecorderError, match="/dev/no-such-camera: No such file"):
        await begin(recorder, tmp_path)
    await recorder.close()
    assert not any(each.suffix == ".mkv" for each in tmp_path.iterdir())  # noqa: ASYNC240


async def test_without_the_program_a_sentence_says_so(tmp_path: Path) -> None:
    with pytest.raises(RecorderError, match="no-ffmpeg-here is not installed here"):
        await camera(program="no-ffmpeg-here").prepare(RecordingPlan("S1", tmp_path))


async def test_one_that_does_not_end_when_it_is_asked_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(programs, "END_SECONDS", 0.1)
    monkeypatch.setattr(programs, "TERMINATE_SECONDS", 0.1)
    deaf = script(
        tmp_path, 'trap "" INT TERM', 'echo x > "$last"', "echo out_time_us=1000", "while :; do sleep 0.1; done"
    )
    recorder = camera(program=deaf)
    await begin(recorder, tmp_path)
    with pytest.raises(RecorderError, match="did not end when it was asked to, and was killed"):
        await recorder.stop()
    await recorder.close()


async def test_one_that_writes_nothing_has_no_size(tmp_path: Path) -> None:
    idle = script(tmp_path, "echo out_time_us=1000", "exec sleep 60")
    recorder = camera(program=idle)
    await begin(recorder, tmp_path)
    assert (await recorder.status()).bytes == 0
    with pytest.raises(RecorderError, match="nothing was recorded"):
        await recorder.stop()
    await recorder.close()
