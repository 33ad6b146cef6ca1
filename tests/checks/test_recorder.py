"""The recorders before a session: each records three seconds, and its file must grow."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import pytest

from rise_engine.checks.devices import check_recorders
from rise_engine.checks.outcome import CheckContext, Finding
from rise_engine.checks.programs import ChildRequest
from rise_engine.checks.runner import run_check
from rise_engine.ports.recorder import RecorderStatus
from rise_engine.study.model import RecorderSettings, RecordingSettings, StudyCheck
from tests.run.recording.recorders import ScriptedRecorder, hang, refuse
from tests.study.studies import DESIGN, HEAD, PEOPLE, write_study


class TestRecorder(ScriptedRecorder):
    """As those of the tests, and its file lies on the disk from the start."""

    __test__ = False

    async def start(self) -> str:
        path = await super().start()
        self.path.write_bytes(b"x")
        return path


def request(monkeypatch: pytest.MonkeyPatch, **recorders: dict[str, Any]) -> tuple[ChildRequest, list[TestRecorder]]:
    made: list[TestRecorder] = []

    def open_recorder(driver: str, name: str, options: Any) -> TestRecorder:
        made.append(TestRecorder(name, options, **recorders[name]))
        return made[-1]

    monkeypatch.setattr("rise_engine.checks.devices.open_recorder", open_recorder)
    settings = RecordingSettings(tuple(RecorderSettings(name, "scripted") for name in recorders))
    return ChildRequest("recorder", recording=settings, task="lab"), made


@pytest.fixture(autouse=True)
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


async def test_what_records_and_grows_has_passed_and_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, scratch: Path
) -> None:
    asked, made = request(monkeypatch, camera={}, bag={})
    assert await check_recorders(asked) == Finding(
        True, "camera: a recorder of the tests; bag: a recorder of the tests"
    )
    assert all(each.calls[-2:] == ["stop", "close"] for each in made) and not list(scratch.glob("*"))  # noqa: ASYNC240


async def test_what_says_that_it_records_and_writes_nothing_has_failed(
    monkeypatch: pytest.MonkeyPatch, scratch: Path
) -> None:
    async def empty(recorder: ScriptedRecorder) -> None:
        recorder.grows = False

    async def nothing(recorder: ScriptedRecorder) -> None:
        recorder.path.unlink(missing_ok=True)
        recorder.recording = False

    asked, _ = request(monkeypatch, camera={"status": empty, "stop": nothing}, bag={})
    found = await check_recorders(asked)
    assert not found.passed
    assert found.reason == "camera: it said that it records, and in 3 s its file did not grow"


@pytest.mark.parametrize(
    ("call", "behaviour", "reason"),
    [
        ("prepare", refuse, "the lens cap is on"),
        ("start", refuse, "the lens cap is on"),
        ("status", hang, "it was asked for its state and did not answer within 5 s"),
        ("stop", hang, "it was asked to stop and did not answer within 5 s"),
    ],
)
async def test_one_that_fails_says_why_and_is_stopped(
    monkeypatch: pytest.MonkeyPatch, scratch: Path, call: str, behaviour: Any, reason: str
) -> None:
    asked, made = request(monkeypatch, camera={call: behaviour}, bag={})
    found = await check_recorders(asked)
    assert not found.passed and found.reason == f"camera: {reason}"
    assert ("stop" in made[0].calls) == (call != "prepare") and made[0].calls[-1] == "close"
    assert not list(scratch.glob("*"))  # noqa: ASYNC240


async def test_a_test_file_that_lies_elsewhere_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, _ = request(monkeypatch, obs={})

    async def stop(self: TestRecorder) -> str:
        return "D:/videos/test.mkv"

    async def status(self: TestRecorder) -> RecorderStatus:
        self.size += 100
        return RecorderStatus(True, bytes=self.size)

    monkeypatch.setattr(TestRecorder, "stop", stop)
    monkeypatch.setattr(TestRecorder, "status", status)
    found = await check_recorders(asked)
    assert found.passed and "the test file of obs is still at D:/videos/test.mkv" in found.value


async def test_nobody_who_has_not_consented_is_recorded_for_a_trial(tmp_path: Path) -> None:
    design = DESIGN + '[recording]\ncamera = { by = "ffmpeg", input = ["-i", "x"] }\n'
    study = write_study(tmp_path / "study", design, HEAD + PEOPLE)
    context = CheckContext(study, "P01", str(tmp_path / "study" / "scenario"), "real")
    outcome = await run_check(StudyCheck("recorders", auto="recorder"), context)
    assert outcome.result == "passed"
    assert outcome.value.startswith("nothing is recorded: P01 has not consented to it")
