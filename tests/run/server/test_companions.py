"""Companions of a session: whatever one does, the session gets a record, in time, and nothing more."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Any

import pytest

from rise_engine.kernel.inputs import RecordingReport
from rise_engine.kernel.records import RecordingStatus
from rise_engine.run.recording.companion import CompanionRequest, companions_for, decode_request, encode_request
from rise_engine.run.server.companions import Companions
from rise_engine.run.server.process import _SessionProcess
from rise_engine.study.model import MarkerSettings, RecorderSettings, RecordingSettings, SyncSettings
from tests.patience import PATIENCE

CAMERA = RecordingSettings((RecorderSettings("camera", "ffmpeg"), RecorderSettings("bag", "rosbag2")))


class ScriptedRequest(CompanionRequest, frozen=True):
    """A companion that is a Python script."""

    script: str = ""

    @property
    def arguments(self) -> list[str]:
        return [sys.executable, "-S", "-c", self.script]


class NoProgram(CompanionRequest, frozen=True):
    @property
    def arguments(self) -> list[str]:
        return ["/no/such/program"]


def request(made_as: type[CompanionRequest] = CompanionRequest, /, **more: Any) -> CompanionRequest:
    fields: dict[str, Any] = {"kind": "recorders", "settings": CAMERA, **more}
    return made_as(
        socket="/run/x.sock", session="S1", folder="/s/S1", study="/s", task="lab", participant="P07", run=1, **fields
    )


class Reports:
    """What companions have told, and how each recording stands."""

    def __init__(self, *requests: CompanionRequest, **limits: Any) -> None:
        self.told: list[tuple[str, str, str]] = []
        self.standing: dict[str, RecordingStatus] = {}
        self.companions = Companions(
            requests, self.take, self.standing.get, **{"again": 0, "again_seconds": 0.0, **limits}
        )

    def take(self, report: RecordingReport) -> None:
        self.standing[report.name] = report.status
        self.told.append((report.name, report.status, report.reason))

    async def gone(self) -> None:
        async with asyncio.timeout(PATIENCE):
            await asyncio.wait(self.companions._tasks)

    async def finish(self) -> None:
        async with asyncio.timeout(PATIENCE):
            await self.companions.finish()


def test_what_a_companion_is_to_do_comes_whole_and_unseen() -> None:
    settings = RecordingSettings(CAMERA.recorders, MarkerSettings("link"), SyncSettings())
    whole = request(settings=settings)
    assert decode_request(encode_request(whole)) == whole and "P07" not in " ".join(whole.arguments)
    assert [(each.kind, each.recordings) for each in companions_for(whole)] == [
        ("recorders", ("camera", "bag")),
        ("outlet", ("lsl",)),
    ]
    only_marks = companions_for(request(settings=RecordingSettings(sync=SyncSettings())))
    assert [each.recordings for each in only_marks] == [("marks",)]
    assert companions_for(request(settings=RecordingSettings())) == []


@pytest.mark.slow
async def test_one_that_finishes_when_its_leash_ends_needs_no_word(tmp_path: Path) -> None:
    script = f"import sys; open({str(tmp_path / 'got')!r}, 'w').write(sys.stdin.readline()); sys.stdin.read()"
    reports = Reports(request(ScriptedRequest, script=script))
    reports.companions.start()
    assert reports.companions.recording
    async with asyncio.timeout(PATIENCE):
        while not (tmp_path / "got").exists() or not (tmp_path / "got").read_text():  # noqa: ASYNC110  # another process, or the session
            await asyncio.sleep(0.02)
    await reports.finish()
    assert reports.told == [] and not reports.companions.recording
    assert '"participant":"P07"' in (tmp_path / "got").read_text()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "reason"),
    [
        ("import sys; sys.stderr.write('one\\nno camera here\\n'); sys.exit(1)", "no camera here"),
        ("import sys; sys.exit(7)", "its process ended with exit status 7"),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "SIGKILL ended its process"),
        ("pass", "its process ended before the session"),
    ],
)
async def test_one_that_dies_is_on_record_with_the_reason(script: str, reason: str) -> None:
    reports = Reports(request(ScriptedRequest, script=script))
    reports.standing["bag"] = "stopped"  # of this one nothing is left to say
    reports.companions.start()
    await reports.gone()
    assert reports.told == [("camera", "failed", reason)] and not reports.companions.recording
    await reports.finish()
    assert len(reports.told) == 1


async def test_one_that_cannot_be_started_is_on_record() -> None:
    reports = Reports(request(NoProgram))
    reports.companions.start()
    await reports.gone()
    assert [told[:2] for told in reports.told] == [("camera", "failed"), ("bag", "failed")]
    assert "its process cannot be started" in reports.told[0][2]


@pytest.mark.slow
async def test_one_that_dies_is_started_again_some_times(tmp_path: Path) -> None:
    script = f"open({str(tmp_path / 'lives')!r}, 'a').write('x'); raise SystemExit('no camera here')"
    reports = Reports(request(ScriptedRequest, script=script), again=2, again_seconds=0.0)
    reports.standing["bag"] = "stopped"
    reports.companions.start()
    await reports.gone()
    assert (tmp_path / "lives").read_text() == "xxx"
    assert reports.told == [("camera", "failed", "no camera here")]  # the record says it once


@pytest.mark.slow
async def test_one_that_is_to_be_started_again_holds_up_no_end(tmp_path: Path) -> None:
    reports = Reports(request(ScriptedRequest, script="raise SystemExit(1)"), again=2, again_seconds=1_000.0)
    reports.companions.start()
    async with asyncio.timeout(PATIENCE):
        while not reports.told:  # noqa: ASYNC110  # another process
            await asyncio.sleep(0.02)
    await reports.finish()
    assert not reports.companions.recording


DEAF = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); print(flush=True); time.sleep(60)"


@pytest.mark.slow
async def test_one_that_gives_no_sign_of_life_is_ended() -> None:
    reports = Reports(request(ScriptedRequest, script=DEAF), silent_seconds=0.3)
    reports.companions.start()
    await reports.gone()
    assert reports.told[0] == ("camera", "failed", "its process gave no sign of life for 0.3 s, and was ended")


@pytest.mark.slow
async def test_one_that_does_not_finish_is_ended_in_time() -> None:
    reports = Reports(request(ScriptedRequest, script=DEAF), finish_seconds=0.3)
    reports.companions.start()
    await asyncio.sleep(0)
    await reports.finish()
    assert reports.told[0] == ("camera", "failed", "its process did not finish within 0.3 s, and was ended")


@pytest.mark.slow
async def test_an_outlet_is_left_alone_until_the_session_is_over(tmp_path: Path) -> None:
    """It has its end to pass on."""
    script = (
        f"import sys; open({str(tmp_path / 'ready')!r}, 'w').close(); sys.stdin.read(); print('x', file=sys.stderr)"
    )
    reports = Reports(request(ScriptedRequest, script=script, kind="outlet"))
    reports.companions.start()
    assert not reports.companions.recording, "a session waits for no outlet before it ends"
    async with asyncio.timeout(PATIENCE):
        while not (tmp_path / "ready").exists():  # noqa: ASYNC110  # another process
            await asyncio.sleep(0.02)
    await reports.companions.finish_recorders()
    [outlet] = reports.companions._tasks
    assert not outlet.done()
    await reports.finish()
    assert outlet.done() and reports.told == []


@pytest.mark.slow
async def test_an_outlet_that_does_not_go_is_ended_in_time() -> None:
    reports = Reports(request(ScriptedRequest, script=DEAF, kind="outlet"), finish_seconds=0.3)
    reports.companions.start()
    await asyncio.sleep(0)
    await reports.finish()
    assert reports.told == [("lsl", "failed", "its process did not finish within 0.3 s, and was ended")]


@pytest.mark.slow
async def test_who_is_in_a_hurry_waits_for_none() -> None:
    reports = Reports(request(ScriptedRequest, script=DEAF), request(ScriptedRequest, script=DEAF, kind="outlet"))
    reports.companions.start()
    await asyncio.sleep(0)
    asyncio.get_running_loop().call_later(0.1, reports.companions.end_quickly)
    await reports.finish()
    assert {told[2] for told in reports.told} == {"its process was not waited for, and was ended"}


@pytest.mark.slow
async def test_what_a_dead_one_has_left_running_is_asked_to_end(tmp_path: Path) -> None:
    """A camera's program: it completes its file, and records nobody any longer."""
    done = tmp_path / "complete"
    child = (
        "import signal, sys, time\n"
        f"def end(*_): open({str(done)!r}, 'w').write('x'); sys.exit()\n"
        "signal.signal(signal.SIGINT, end)\n"
        f"open({str(tmp_path / 'ready')!r}, 'w').close()\n"
        "time.sleep(60)\n"
    )
    script = (
        "import os, signal, subprocess, sys, time\n"
        f"subprocess.Popen([sys.executable, '-S', '-c', {child!r}])\n"
        f"while not os.path.exists({str(tmp_path / 'ready')!r}): time.sleep(0.02)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    reports = Reports(request(ScriptedRequest, script=script))
    reports.companions.start()
    await reports.gone()
    async with asyncio.timeout(PATIENCE):
        while not done.exists():  # noqa: ASYNC110  # another process, or the session
            await asyncio.sleep(0.02)
    assert reports.told[0][2] == "SIGKILL ended its process"


@pytest.mark.parametrize("a_console_asked", [True, False])
def test_only_a_second_signal_does_not_wait_for_recorders(a_console_asked: bool) -> None:
    class Told(Companions):
        hurried = 0

        def end_quickly(self) -> None:
            self.hurried += 1

    class Process(_SessionProcess):
        def end(self, reason: str) -> None:
            self.ending = True

    process = Process.__new__(Process)
    process.ending, process.signals = a_console_asked, 0
    process.companions = companions = Told([], lambda report: None, lambda name: None)
    for hurried in (0, 1):
        process._end_by_signal("ended by SIGTERM")
        assert companions.hurried == hurried
