"""One recorder from its start to its end, whatever it does: no answer, a refusal, standing still, dying."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rise_engine.ports.recorder import RecorderError, RecordingPlan
from rise_engine.run.recording.one_recorder import RETRY_SECONDS, RecordingState, SupervisedRecorder
from rise_engine.study.model import RecorderSettings
from tests.run.recording.recorders import ScriptedRecorder, fail, hang, refuse


class Supervised:
    """A recorder under supervision, and everything that was said about it."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> None:
        self.made: list[ScriptedRecorder] = []
        self.does: dict[str, Any] = {}
        self.said: list[RecordingState] = []
        self.finish = asyncio.Event()
        self.loop = asyncio.get_running_loop()
        monkeypatch.setattr("rise_engine.run.recording.one_recorder.open_recorder", self.open)
        self.recorder = SupervisedRecorder(
            RecorderSettings("camera", "scripted", **settings),
            RecordingPlan("S1", folder),
            lambda name, state: self.said.append(state),
            lambda: self.loop.time() - self.began,
        )
        self.began = self.loop.time()
        self.running = self.loop.create_task(self.recorder.run(self.finish))

    def open(self, driver: str, name: str, options: Any) -> ScriptedRecorder:
        assert driver == "scripted"
        self.made.append(ScriptedRecorder(name, options, **self.does))
        return self.made[-1]

    async def end(self) -> float:
        """Let it finish; how long that took."""
        began = self.loop.time()
        self.finish.set()
        await self.running
        return self.loop.time() - began

    @property
    def statuses(self) -> list[str]:
        return [each.status for each in self.said]


@pytest.fixture
def supervised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    yield lambda **settings: Supervised(tmp_path, monkeypatch, **settings)


async def test_what_is_said_is_what_has_changed(supervised: Any, tmp_path: Path) -> None:
    camera = supervised()
    await asyncio.sleep(600)
    await camera.end()
    path = str(tmp_path / "S1_camera.mkv")
    assert camera.said == [
        RecordingState("started", path),
        RecordingState("running", path, 100),
        RecordingState("stopped", path, 100),
    ]
    assert camera.made[0].calls[:3] == ["prepare", "start", "status"]
    assert camera.made[0].calls[-2:] == ["stop", "close"] and len(camera.made) == 1
    (file,) = camera.recorder.files
    assert (file.name, file.kind, file.path, file.started_at) == ("camera", "video", path, 0.0)


async def test_one_that_does_not_grow_for_three_seconds_has_stalled_until_it_grows_again(supervised: Any) -> None:
    camera = supervised()
    await asyncio.sleep(10.5)
    camera.made[0].grows = False
    await asyncio.sleep(2)
    assert camera.statuses == ["started", "running"]
    await asyncio.sleep(2)
    assert camera.statuses == ["started", "running", "stalled"]
    assert camera.said[-1].reason == "it has not grown for 3 s"
    await asyncio.sleep(60)
    assert len(camera.said) == 3  # said once
    camera.made[0].grows = True
    await asyncio.sleep(1)
    assert camera.statuses == ["started", "running", "stalled", "running"]
    await camera.end()


async def test_one_that_never_grows_has_stalled(supervised: Any) -> None:
    camera = supervised()
    await asyncio.sleep(0)
    camera.made[0].grows = False
    await asyncio.sleep(5)
    assert camera.statuses == ["started", "stalled"] and camera.recorder.settled.is_set()
    await camera.end()


async def test_study_toml_can_say_how_long_it_may_stand_still(supervised: Any) -> None:
    camera = supervised(stalled_after=30.0)
    await asyncio.sleep(5.5)
    camera.made[0].grows = False
    await asyncio.sleep(28)
    assert camera.statuses == ["started", "running"]
    await asyncio.sleep(4)
    assert camera.statuses[-1] == "stalled"
    await camera.end()


@pytest.mark.parametrize(
    ("call", "behaviour", "reason"),
    [
        ("prepare", hang, "it was asked what it is and did not answer within 5 s"),
        ("prepare", refuse, "the lens cap is on"),
        ("prepare", fail, "it was asked what it is and failed: ZeroDivisionError: division by zero"),
        ("start", hang, "it was asked to start and did not answer within 5 s"),
        ("start", refuse, "the lens cap is on"),
        ("start", fail, "it was asked to start and failed: ZeroDivisionError: division by zero"),
    ],
)
async def test_one_that_cannot_begin_says_so_once_and_is_tried_again(
    supervised: Any, call: str, behaviour: Any, reason: str
) -> None:
    camera = supervised()
    camera.does[call] = behaviour
    await asyncio.sleep(60)
    assert [(each.status, each.reason) for each in camera.said] == [("failed", reason)]
    assert len(camera.made) >= 4
    # What may have begun is stopped: nobody is recorded unawares.
    assert [each.calls.count("stop") for each in camera.made[:-1]] == [call == "start"] * (len(camera.made) - 1)
    camera.does.clear()
    await asyncio.sleep(RETRY_SECONDS + 10)
    assert camera.statuses == ["failed", "started", "running"]
    await camera.end()
    assert camera.statuses[-1] == "stopped"


async def test_one_that_has_ended_is_started_anew(supervised: Any) -> None:
    async def end(recorder: ScriptedRecorder) -> None:
        if recorder.calls.count("status") > 3:
            recorder.recording = False
            raise RecorderError("ffmpeg has ended: /dev/video0: No such device", ended=True)

    camera = supervised()
    camera.does["status"] = end
    await asyncio.sleep(4.5)
    assert camera.said[-1].status == "failed"
    assert camera.said[-1].reason == "ffmpeg has ended: /dev/video0: No such device"
    camera.does.clear()
    await asyncio.sleep(RETRY_SECONDS + 2)
    assert camera.statuses == ["started", "running", "failed", "started", "running"]
    await camera.end()
    assert len(camera.recorder.files) == 2


async def test_one_that_gives_no_answer_for_a_while_is_not_given_up(supervised: Any) -> None:
    async def mute(recorder: ScriptedRecorder) -> None:
        if 3 < recorder.calls.count("status") < 8:
            raise RecorderError("the connection to OBS was cut")

    camera = supervised()
    camera.does["status"] = mute
    await asyncio.sleep(20)
    assert camera.statuses == ["started", "running", "failed", "running"] and len(camera.made) == 1
    await camera.end()


async def test_one_that_somebody_else_has_stopped_is_said_and_left_to_them(supervised: Any) -> None:
    camera = supervised()
    await asyncio.sleep(5)
    camera.made[0].recording = False
    await asyncio.sleep(20)
    assert camera.said[-1].reason == "it does not record any more" and len(camera.made) == 1
    await camera.end()


@pytest.mark.parametrize("call", ["prepare", "start", "status", "stop", "close"])
async def test_the_end_never_waits_for_one_that_hangs(supervised: Any, call: str) -> None:
    camera = supervised()
    camera.does[call] = hang
    await asyncio.sleep(1.5)
    took = await camera.end()
    assert took <= 6.0
    assert camera.said == [] or camera.said[-1].status in ("stopped", "failed")


async def test_what_cannot_be_stopped_has_failed_and_says_so(supervised: Any) -> None:
    camera = supervised()
    camera.does["stop"] = refuse
    await asyncio.sleep(5)
    await camera.end()
    assert camera.said[-1].status == "failed" and camera.said[-1].reason == "the lens cap is on"
    assert len(camera.recorder.files) == 1  # there may be something


async def test_one_that_ends_the_moment_it_is_to_finish_is_stopped_once(supervised: Any) -> None:
    camera = supervised()
    await asyncio.sleep(0)
    await camera.end()
    assert camera.made[0].calls.count("stop") <= 1


async def test_a_size_that_is_forgotten_at_the_end_is_the_one_that_was_known_last(supervised: Any) -> None:
    """OBS says 0 bytes once it has stopped, and its file may lie on another computer, or not be written yet."""

    async def leave_no_file(recorder: ScriptedRecorder) -> None:
        recorder.path.write_bytes(b"")
        recorder.recording = False

    camera = supervised()
    camera.does["stop"] = leave_no_file
    await asyncio.sleep(5.5)
    await camera.end()
    assert camera.said[-1].status == "stopped" and camera.said[-1].bytes == 500
    assert camera.recorder.files[0].bytes == 500
