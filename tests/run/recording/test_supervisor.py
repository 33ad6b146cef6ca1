"""Everything that records a session, beside a session that runs: records, marks, media.json, and an end in time."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from rise_engine.base.errors import RiseError
from rise_engine.base.files import fingerprint
from rise_engine.kernel.records import AnyRecord, NoteRecord, RecordingRecord, SyncRecord
from rise_engine.ports.recorder import RecorderError
from rise_engine.run.client import Session
from rise_engine.run.recording import supervisor
from rise_engine.run.recording.companion import CompanionRequest
from rise_engine.run.recording.marks import GivenMark
from rise_engine.run.recording.one_recorder import SupervisedRecorder
from rise_engine.run.recording.supervisor import path_in_record, supervise
from rise_engine.session.media import read_media
from rise_engine.study.model import RecorderSettings, RecordingSettings, SyncSettings
from tests.patience import PATIENCE
from tests.run.recording.recorders import ScriptedRecorder, hang, refuse
from tests.run.server.serving import Served, served

CAMERA, BAG = RecorderSettings("camera", "scripted"), RecorderSettings("bag", "scripted")


class Supervision:
    """A session, and what supervises its recorders in the loop of the test."""

    def __init__(self, session: Served, settings: RecordingSettings) -> None:
        self.session = session
        self.records: list[AnyRecord] = []
        session.hub.subscribe(lambda update: self.records.append(update))  # type: ignore[arg-type]
        self.finish = asyncio.Event()
        self.marks: list[int] = []
        self.hanging_mark = 0
        self.request = CompanionRequest(
            kind="recorders",
            socket=str(session.path),
            session=session.folder.name,
            folder=str(session.folder),
            study="",
            task="lab",
            participant="P07",
            run=1,
            settings=settings,
        )
        self.running = asyncio.create_task(supervise(self.request, self.finish, self.mark))

    async def mark(self, session: Session, number: int, sync: SyncSettings) -> GivenMark:
        self.marks.append(number)
        if number == self.hanging_mark:
            await asyncio.Event().wait()
        await session.mark_sync(number, sync.medium)
        return GivenMark(number)

    def of(self, name: str) -> list[str]:
        return [each.status for each in self.records if isinstance(each, RecordingRecord) and each.name == name]

    async def until(self, name: str, status: str) -> None:
        async with asyncio.timeout(PATIENCE):
            while status not in self.of(name):  # noqa: ASYNC110  # another process, or the session
                await asyncio.sleep(0.01)

    async def end(self) -> None:
        self.finish.set()
        async with asyncio.timeout(PATIENCE):
            await self.running


@pytest.fixture
def does(monkeypatch: pytest.MonkeyPatch) -> dict[str, dict[str, Any]]:
    """What each recorder does, by its name."""
    behaviour: dict[str, dict[str, Any]] = {}
    monkeypatch.setattr(
        "rise_engine.run.recording.one_recorder.open_recorder",
        lambda driver, name, options: ScriptedRecorder(name, options, **behaviour.get(name, {})),
    )
    monkeypatch.setattr("rise_engine.run.recording.one_recorder.CALL_SECONDS", 0.3)
    quick = partial(SupervisedRecorder, check_seconds=0.05, retry_seconds=0.1)
    monkeypatch.setattr(supervisor, "SupervisedRecorder", quick)
    monkeypatch.setattr(supervisor, "TAIL_SECONDS", {"sound": 0.0, "flash": 0.0})
    return behaviour


@asynccontextmanager
async def supervision(scratch: Path, *recorders: RecorderSettings, **more: Any) -> AsyncIterator[Supervision]:
    async with served(scratch) as session:
        made = Supervision(session, RecordingSettings(recorders, **more))
        yield made
        if not made.running.done():
            await made.end()


async def test_each_is_started_and_stopped_with_marks_and_is_registered(scratch: Path, does: dict[str, Any]) -> None:
    async with supervision(scratch, CAMERA, BAG, sync=SyncSettings(medium="flash")) as it:
        await it.until("camera", "running")
        await it.until("bag", "running")
        async with asyncio.timeout(PATIENCE):
            while not it.marks:  # noqa: ASYNC110  # another process, or the session
                await asyncio.sleep(0.01)
        await it.end()
    assert it.of("camera") == it.of("bag") == ["started", "running", "stopped"]
    kinds = [each for each in it.records if isinstance(each, RecordingRecord | SyncRecord)]
    first, last = (kinds.index(each) for each in kinds if isinstance(each, SyncRecord))
    words = [each.status if isinstance(each, RecordingRecord) else "mark" for each in kinds]
    # The first mark when everything has begun, the last one before anything is stopped.
    assert it.marks == [1, 2] and words[:first].count("started") == 2 and words.index("stopped") == last + 1
    stopped = kinds[-1]
    assert isinstance(stopped, RecordingRecord) and stopped.bytes == 100 and stopped.source == "node:recorders"
    assert stopped.path.startswith("recordings/") and (it.session.folder / stopped.path).stat().st_size == 100
    files = {each.name: each for each in read_media(it.session.folder)}
    assert set(files) == {"camera", "bag"} and files["camera"].aligned_by == "start"
    path = f"recordings/{it.session.folder.name}_camera.mkv"
    assert files["camera"].path == path and files["camera"].fingerprint == fingerprint(it.session.folder / path)


async def test_the_mark_at_the_end_has_another_number_than_one_that_the_end_interrupts(
    scratch: Path, does: dict[str, Any]
) -> None:
    """Its record may come later."""
    async with supervision(scratch, sync=SyncSettings(medium="flash")) as it:
        it.hanging_mark = 1
        async with asyncio.timeout(PATIENCE):
            while not it.marks:  # noqa: ASYNC110  # another process, or the session
                await asyncio.sleep(0.01)
        await it.end()
    assert it.marks == [1, 2]


MISBEHAVES: dict[str, dict[str, Any]] = {
    f"{call}-{behaviour.__name__}": {call: behaviour}
    for call in ("prepare", "start", "status", "stop", "close")
    for behaviour in (hang, refuse)
}


async def test_those_that_misbehave_are_nobody_elses_concern(scratch: Path, does: dict[str, Any]) -> None:
    """All ten beside one that records."""
    does |= MISBEHAVES
    async with supervision(scratch, CAMERA, *(RecorderSettings(name, "scripted") for name in MISBEHAVES)) as it:
        await it.until("camera", "running")
        for name in MISBEHAVES:
            if name.startswith(("prepare", "start", "status")):
                await it.until(name, "failed")
        await it.end()
        assert not it.session.engine.ended
    assert it.of("camera") == ["started", "running", "stopped"]
    for name in MISBEHAVES:
        assert it.of(name)[-1] == ("stopped" if name.startswith(("status", "close")) else "failed"), name


async def test_a_mark_that_cannot_be_given_is_a_remark(scratch: Path, does: dict[str, Any]) -> None:
    async def fail(session: Session, number: int, sync: SyncSettings) -> GivenMark:
        raise RiseError("there is no loudspeaker")

    async with served(scratch) as session:
        it = Supervision(session, RecordingSettings((CAMERA,), sync=SyncSettings()))
        it.running.cancel()
        it.running = asyncio.create_task(supervise(it.request, it.finish, fail))
        await it.until("camera", "running")
        await it.end()
    notes = [each.text for each in it.records if isinstance(each, NoteRecord)]
    assert "mark 1 was not given: there is no loudspeaker" in notes


async def test_when_the_session_is_over_everything_is_stopped_and_registered(
    scratch: Path, does: dict[str, Any]
) -> None:
    async with supervision(scratch, CAMERA) as it:
        await it.until("camera", "running")
        it.session.engine.end("done")
        async with asyncio.timeout(PATIENCE):
            await it.session.server.close()
            await it.running
        assert [each.name for each in read_media(it.session.folder)] == ["camera"]


async def test_a_cut_connection_ends_no_recording(scratch: Path, does: dict[str, Any]) -> None:
    async with supervision(scratch, CAMERA) as it:
        await it.until("camera", "running")
        (attached,) = it.session.server._attached  # as who floods it is cut
        attached.abort()
        async with asyncio.timeout(PATIENCE):
            while attached in it.session.server._attached or not it.session.server._attached:  # noqa: ASYNC110  # another process, or the session
                await asyncio.sleep(0.01)
        await it.end()
    assert it.of("camera") == ["started", "running", "stopped"]


async def test_files_go_where_study_toml_says_or_it_says_that_there_is_no_such_place(
    scratch: Path, does: dict[str, Any]
) -> None:
    (scratch / "videos").mkdir()
    async with supervision(scratch, CAMERA, folder=str(scratch / "videos")) as it:
        await it.until("camera", "running")
    place = scratch / "videos" / it.session.folder.name
    assert [each.name for each in place.iterdir()] == [f"{it.session.folder.name}_camera.mkv"]
    async with served(scratch) as session:
        it = Supervision(session, RecordingSettings((CAMERA,), folder=str(scratch / "no-disk")))
        with pytest.raises(RecorderError, match="the folder for recordings is not there"):
            await it.end()


def test_a_path_on_record_names_no_login(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/anna")
    folder = Path("/home/anna/study/sessions/S1")
    assert path_in_record("/home/anna/study/sessions/S1/recordings/a.mkv", folder) == "recordings/a.mkv"
    assert path_in_record("/home/anna/Videos/a.mkv", folder) == "~/Videos/a.mkv"
    assert path_in_record("/data/a.mkv", folder) == "/data/a.mkv" and path_in_record("", folder) == ""
