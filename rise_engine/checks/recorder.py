"""The check of recorders: each records for three seconds, and its file must grow.

Otherwise nobody would notice in time that a recorder reports recording but writes nothing.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp

from msgspec import Struct

from rise_engine.checks.child import ChildRequest
from rise_engine.checks.outcome import Finding
from rise_engine.ports.recorder import CALL_SECONDS, Recorder, RecorderError, RecorderStatus, RecordingPlan
from rise_engine.run.recording.one_recorder import call_within, recording_size
from rise_engine.session.unfinished_files import erase_folder
from rise_engine.study.model import RecorderSettings, RecordingSettings
from rise_engine.study.recording_table import open_recorder

TEST_SECONDS = 3.0
"""Seconds that each recorder records."""
LOOK_SECONDS = 0.5
TEST_SESSION = "check"
"""The session's name in the names of test files."""


class RecorderTrial(Struct, frozen=True):
    """The result of one recorder's test."""

    name: str
    found: str = ""
    problem: str = ""
    left: str = ""
    """Where the test file still is; empty: it was deleted, or there was none."""


async def look_at_recorders(request: ChildRequest) -> Finding:
    """Check that every recorder of the study records. Test files on this computer are deleted.

    :param request: with the recorders.
    """
    settings = request.recording or RecordingSettings()
    if not settings.recorders:
        return Finding(True, "the study has no recorders")
    try:
        folder = Path(mkdtemp(prefix="rise-check-", dir=settings.folder or None))
    except OSError as error:
        return Finding(False, reason=f"there is no place for a test file: {error.strerror or error}")
    try:
        plan = RecordingPlan(TEST_SESSION, folder, task=request.task)
        trials = await asyncio.gather(*(_try(each, plan) for each in settings.recorders))
    finally:
        rmtree(folder, ignore_errors=True)
    found = [f"{each.name}: {each.found}" for each in trials if each.found]
    found += [f"the test file of {each.name} is still at {each.left}" for each in trials if each.left]
    problems = [f"{each.name}: {each.problem}" for each in trials if each.problem]
    return Finding(not problems, "; ".join(found), "; ".join(problems))


async def _try(settings: RecorderSettings, plan: RecordingPlan) -> RecorderTrial:
    """Test one recorder, and report any failure."""
    name = settings.name
    try:
        recorder = open_recorder(settings.driver, name, settings.options)
    except RecorderError as error:
        return RecorderTrial(name, problem=" ".join(str(error).split()))
    found = problem = path = ""
    grown = 0.0
    try:
        found = await call_within(CALL_SECONDS, recorder.prepare(plan), "what it is")
        try:
            path = await call_within(CALL_SECONDS, recorder.start(), "to start")
            first, last = await _watch(recorder)
        except RecorderError:
            with suppress(RecorderError):  # it may have begun
                path = await call_within(CALL_SECONDS, recorder.stop(), "to stop") or path
            raise
        path = last.path or path
        path = await call_within(CALL_SECONDS, recorder.stop(), "to stop") or path
        grown = await _growth(first, last, path)
    except RecorderError as error:
        problem = str(error)
    finally:
        with suppress(RecorderError):
            await call_within(CALL_SECONDS, recorder.close(), "to let go")
    if not problem and grown <= 0:
        problem = f"it said that it records, and in {TEST_SECONDS:g} s its file did not grow"
    return RecorderTrial(name, found, problem, await asyncio.to_thread(_erase, path))


async def _watch(recorder: Recorder) -> tuple[RecorderStatus, RecorderStatus]:
    """Return its status at the beginning and after TEST_SECONDS."""
    first = last = await call_within(CALL_SECONDS, recorder.status(), "its state")
    for _ in range(round(TEST_SECONDS / LOOK_SECONDS)):
        await asyncio.sleep(LOOK_SECONDS)
        last = await call_within(CALL_SECONDS, recorder.status(), "its state")
        if not last.recording:
            raise RecorderError("it does not record any more")
    return first, last


async def _growth(first: RecorderStatus, last: RecorderStatus, path: str) -> float:
    """Measure a recording's growth in bytes or seconds, also after its end; without a measure, it counts as growing."""
    whole = await asyncio.to_thread(recording_size, path)
    if first.bytes is not None:
        return max(whole or 0, last.bytes or 0) - first.bytes
    if first.seconds is not None:
        return (last.seconds or 0.0) - first.seconds
    return 1.0 if whole is None else whole


def _erase(path: str) -> str:
    """Delete the test file; return where it still is; empty: it is gone."""
    if not path:
        return ""
    place = Path(path).expanduser()
    with suppress(OSError):
        if place.is_dir():
            erase_folder(place)
        elif place.exists():
            place.unlink()
        else:
            return path  # on another computer
        return ""
    return path
