"""The supervisor of a running session's recorders: it starts, watches and stops each of them, and gives the marks.

It runs in a companion process (`companion`). A recorder that does not answer, refuses, stalls or dies affects neither
the others nor the session, which only gets records.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TypeAlias

from msgspec.structs import replace

from rise_engine.base.errors import RiseError
from rise_engine.base.files import fingerprint, make_private_folder
from rise_engine.ports.recorder import RecorderError, RecordingPlan
from rise_engine.run.client import EngineGone, LinkLost, Session, connect
from rise_engine.run.protocol.client import Rejected
from rise_engine.run.recording.companion import CompanionRequest
from rise_engine.run.recording.marks import GivenMark, give_mark
from rise_engine.run.recording.one_recorder import (
    RecordedFile,
    RecordingState,
    SupervisedRecorder,
    call_within,
    recording_size,
)
from rise_engine.session.folder import without_home
from rise_engine.session.media import MediaFile, register_media
from rise_engine.study.model import SyncSettings

# --- reports to the session -------------------------------------------------------------------------------------------

RETRY_SECONDS = 1.0
"""Interval before it repeats a report that the session did not accept, or attaches again."""
LAST_SECONDS = 1.0
"""Time limit for the last reports at the end."""


class SessionReports:
    """The connection to a running session. `run` keeps it open; `session` is set while it is open."""

    def __init__(self, socket: str, name: str) -> None:
        """:param socket: the session's.
        :param name: the source of the reports, in the record.
        """
        self.socket, self.name = socket, name
        self.session: Session | None = None
        """The session, while this program is attached."""
        self.last_mark = 0
        """The number of the last mark begun here, even if it was interrupted: its record may still come."""
        self.attached, self.over = asyncio.Event(), asyncio.Event()
        """Set when the session was first reached, and when it has ended or its engine has gone."""
        self._waiting: deque[tuple[str, RecordingState] | str] = deque()
        self._news, self._all_reported = asyncio.Event(), asyncio.Event()
        self._all_reported.set()

    def recording(self, name: str, state: RecordingState) -> None:
        """Report the state of a recording."""
        self._queue_report((name, state))

    def note(self, text: str) -> None:
        """Add a remark."""
        self._queue_report(text)

    def _queue_report(self, what: tuple[str, RecordingState] | str) -> None:
        self._waiting.append(what)
        self._news.set()
        self._all_reported.clear()

    async def flush(self) -> None:
        """Wait until everything is reported, LAST_SECONDS are over, or the session is over."""
        tasks = [asyncio.create_task(each.wait()) for each in (self._all_reported, self.over)]
        await asyncio.wait(tasks, timeout=LAST_SECONDS, return_when=asyncio.FIRST_COMPLETED)
        for task in tasks:
            task.cancel()

    async def run(self) -> None:
        """Attach, and attach again when the connection was cut, until the session is over."""
        while True:
            try:
                async with connect(self.socket, self.name) as session:
                    self.session = session
                    self.attached.set()
                    await self._send_reports(session)
            except LinkLost:
                await asyncio.sleep(RETRY_SECONDS)
            except EngineGone:
                break
            finally:
                self.session = None
        self.over.set()

    async def _send_reports(self, session: Session) -> None:
        """Send all reports. Raises EngineGone when the session is over, LinkLost when the connection was cut."""
        ending = asyncio.create_task(session.wait_until(lambda view: view.ended))
        try:
            while not ending.done():
                while self._waiting and not ending.done():
                    if await self._report_first(session):
                        self._waiting.popleft()
                    else:
                        await asyncio.sleep(RETRY_SECONDS)
                if not self._waiting:
                    self._all_reported.set()
                self._news.clear()
                news = asyncio.create_task(self._news.wait())
                await asyncio.wait({news, ending}, return_when=asyncio.FIRST_COMPLETED)
                news.cancel()
            ending.result()
            raise EngineGone("the session has ended")
        finally:
            ending.cancel()
            with suppress(asyncio.CancelledError, EngineGone):
                await ending

    async def _report_first(self, session: Session) -> bool:
        """Send the first report; return whether the session has accepted it."""
        first = self._waiting[0]
        try:
            if isinstance(first, str):
                await session.add_note(first)
            else:
                name, state = first
                await session.report_recording(
                    name, state.status, path=state.path, bytes=state.bytes, reason=state.reason
                )
        except Rejected:  # nothing can be recorded now, or the session has just begun
            return False
        return True


OWN_FOLDER = "recordings"
"""In the session's folder."""
START_MARK_SECONDS, END_MARK_SECONDS = 8.0, 3.0
"""Time limits of the marks."""
TAIL_SECONDS = {"sound": 2.5, "flash": 1.0}
"""Recording time after the last mark, so that the files contain it. ffmpeg's PulseAudio input holds back two seconds
(measured: a film's sound ended 1.9 s before its picture), and a flash must still be drawn."""
START_SECONDS = 10.0
"""Maximum wait of the first mark until all recorders record."""

GiveMark: TypeAlias = Callable[[Session, int, SyncSettings], Awaitable[GivenMark]]


async def supervise(request: CompanionRequest, finish: asyncio.Event, mark: GiveMark = give_mark) -> None:
    """Record a session until it ends or `finish` is set; then everything is stopped within 13 s.

    :param request: the recorders and their settings.
    :param finish: set when everything should stop.
    :param mark: gives a mark (`rise_engine.run.recording.marks`).
    :raises RiseError: nothing can be recorded at all; a sentence.
    """
    plan = _make_plan(request)
    reports = SessionReports(request.socket, "recorders")
    attending = asyncio.create_task(reports.run())
    settings = request.settings
    folder = Path(request.folder)

    def say(name: str, state: RecordingState) -> None:
        reports.recording(name, replace(state, path=path_in_record(state.path, folder)))

    def session_time() -> float:
        return reports.session.now() if reports.session is not None else 0.0

    recorders = [SupervisedRecorder(each, plan, say, session_time) for each in settings.recorders]
    stop = asyncio.Event()
    working: list[asyncio.Task[None]] = []
    try:
        if await _first(reports.attached, reports.over, finish) is reports.attached:
            working = [asyncio.create_task(each.run(stop)) for each in recorders]
            if settings.sync is not None and settings.sync.start:
                await _mark_start(reports, settings.sync, recorders, finish, mark)
            await _first(finish, reports.over)
            if settings.sync is not None and settings.sync.end:
                given = await _mark(reports, settings.sync, END_MARK_SECONDS, mark)
                if given and any(each.records for each in recorders):
                    await asyncio.sleep(TAIL_SECONDS[settings.sync.medium])
        stop.set()
        if working:
            await asyncio.wait(working)
        await reports.flush()
        await asyncio.to_thread(_register, [file for each in recorders for file in each.files], folder)
    finally:
        attending.cancel()


def _make_plan(request: CompanionRequest) -> RecordingPlan:
    """Make the plan. Raises RecorderError if there is no place for files."""
    named = request.settings.folder
    folder = Path(named) / request.session if named else Path(request.folder) / OWN_FOLDER
    try:
        if named and not Path(named).is_dir():
            raise RecorderError(f"the folder for recordings is not there: {named}")
        if request.settings.recorders:
            make_private_folder(folder)
    except OSError as error:
        raise RecorderError(f"the folder {folder} for recordings cannot be made: {error.strerror or error}") from None
    return RecordingPlan(request.session, folder, request.participant, request.task, request.run)


def path_in_record(path: str, folder: Path) -> str:
    """Convert a path for the record: relative to the session's folder if it is inside, and without the owner's login.

    :param path: of a recording; empty: unknown.
    :param folder: the session's.
    """
    if not path:
        return ""
    if Path(path).is_relative_to(folder):
        return str(Path(path).relative_to(folder))
    return without_home(path)


async def _mark_start(
    reports: SessionReports,
    sync: SyncSettings,
    recorders: list[SupervisedRecorder],
    finish: asyncio.Event,
    mark: GiveMark,
) -> None:
    """Give the first mark, once every working recorder records."""
    settled = [asyncio.create_task(each.settled.wait()) for each in recorders]
    ending = asyncio.create_task(_first(finish, reports.over))
    try:
        if settled:
            everything = asyncio.ensure_future(asyncio.wait(settled, timeout=START_SECONDS))
            await asyncio.wait({everything, ending}, return_when=asyncio.FIRST_COMPLETED)
            everything.cancel()
        if not ending.done():
            marking = asyncio.create_task(_mark(reports, sync, START_MARK_SECONDS, mark))
            await asyncio.wait({marking, ending}, return_when=asyncio.FIRST_COMPLETED)
            marking.cancel()
    finally:
        for task in (*settled, ending):
            task.cancel()


async def _mark(reports: SessionReports, sync: SyncSettings, seconds: float, mark: GiveMark) -> bool:
    """Give one mark, or add a remark why there is none; return whether it was given."""
    session = reports.session
    if session is None:
        return False
    number = max(session.view.sync.number if session.view.sync is not None else 0, reports.last_mark) + 1
    reports.last_mark = number
    try:
        return await call_within(seconds, _give_mark(mark, session, number, sync), f"for mark {number}")
    except RecorderError as error:
        reports.note(f"mark {number} was not given: {error}")
        return False


async def _give_mark(mark: GiveMark, session: Session, number: int, sync: SyncSettings) -> bool:
    try:
        return not (await mark(session, number, sync)).problem
    except (EngineGone, Rejected) as error:
        raise RecorderError(f"the session did not take it: {error}") from None
    except RiseError as error:
        raise RecorderError(str(error)) from None


def _register(files: list[RecordedFile], folder: Path) -> None:
    """Add the recordings to the session's media.json. Blocks."""
    for file in files:
        path = Path(file.path).expanduser()
        inside = path.is_relative_to(folder)
        register_media(
            folder,
            MediaFile(
                path=str(path.relative_to(folder) if inside else path),
                kind=file.kind,
                name=file.name,
                bytes=recording_size(file.path) or file.bytes,
                fingerprint=_fingerprint(path),
                offset=-round(file.started_at, 3),
                aligned_by="start",
                added=datetime.now().astimezone().isoformat(timespec="seconds"),
            ),
        )


def _fingerprint(path: Path) -> str:
    """Return the fingerprint of a recording; empty: it is not on this computer, or cannot be read."""
    try:
        return fingerprint(path)
    except OSError:
        return ""


async def _first(*events: asyncio.Event) -> asyncio.Event:
    """Return the event that is set first; the first argument, if several are."""
    tasks = [asyncio.create_task(each.wait()) for each in events]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
    return next(each for each in events if each.is_set())
