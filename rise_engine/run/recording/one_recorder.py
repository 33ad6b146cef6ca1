"""One recorder of a running session: prepared, started, watched and stopped, however it behaves."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from msgspec import Struct

from rise_engine.base.text import clean
from rise_engine.kernel.records import RecordingStatus
from rise_engine.ports.recorder import (
    CALL_SECONDS,
    MediaKind,
    Recorder,
    RecorderError,
    RecorderStatus,
    RecordingPlan,
)
from rise_engine.study.model import RecorderSettings
from rise_engine.study.recording_table import open_recorder

# --- watching a file --------------------------------------------------------------------------------------------------


class GrowthWatch:
    """Repeated observation of one recording.

    >>> watch = GrowthWatch(3.0, now=0.0)
    >>> watch.observe(RecorderStatus(True, bytes=10), 1.0), watch.observe(RecorderStatus(True, bytes=10), 3.9)
    (True, True)
    >>> watch.observe(RecorderStatus(True, bytes=10), 4.0), watch.observe(RecorderStatus(True, bytes=11), 4.5)
    (False, True)
    """

    def __init__(self, stalled_after: float, now: float) -> None:
        """:param stalled_after: seconds without growth after which it has stalled.
        :param now: the time in seconds from which it should grow.
        """
        self.stalled_after = stalled_after
        self.has_grown = False
        """Whether it has ever grown."""
        self._most = -1.0
        self._grown_at = now

    def observe(self, status: RecorderStatus, now: float) -> bool:
        """Return whether it grows, or may still do so.

        :param status: its status; without a size or length it counts as growing.
        :param now: the time.
        """
        size = status.bytes if status.bytes is not None else status.seconds
        if size is None:
            self.has_grown = True
            return True
        if size > max(self._most, 0):
            self.has_grown = True
            self._grown_at = now
        elif size < self._most:  # another file
            self._grown_at = now
        self._most = size
        return now - self._grown_at < self.stalled_after

    def seconds_since_growth(self, now: float) -> float:
        """Return the seconds since its last growth."""
        return now - self._grown_at


# --- calls of a recorder ----------------------------------------------------------------------------------------------

Result = TypeVar("Result")


async def call_within(
    seconds: float, call: Coroutine[Any, Any, Result], what: str, unless: asyncio.Event | None = None
) -> Result:
    """Return the result of a call within a time limit; after it, the call is cancelled without waiting for that.

    :param seconds: the limit.
    :param call: of a driver.
    :param what: the request, for the sentence: `to start`.
    :param unless: set when the answer is not needed any more.
    :raises RecorderError: it gave no answer or raised an exception, or `unless` was set first.
    """
    task = asyncio.create_task(call)
    waiting: set[asyncio.Task[Any]] = {task}
    if unless is not None:
        waiting.add(asyncio.create_task(unless.wait()))
    try:
        await asyncio.wait(waiting, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for each in waiting:
            each.cancel()
    if not task.done():
        task.add_done_callback(lambda ended: ended.cancelled() or ended.exception())
        if unless is not None and unless.is_set():
            raise RecorderError(f"{what} is not needed any more")
        raise RecorderError(f"it was asked {what} and did not answer within {seconds:g} s")
    try:
        return task.result()
    except RecorderError:
        raise
    except asyncio.CancelledError:
        raise RecorderError(f"it was asked {what} and gave up") from None
    except Exception as error:
        raise RecorderError(f"it was asked {what} and failed: {type(error).__name__}: {clean(str(error))}") from error


CHECK_SECONDS = 1.0
"""Interval between two checks of a recorder."""
CLOSE_SECONDS = 1.0
"""Time limit for closing a stopped recorder."""
RETRY_SECONDS = 5.0
"""Interval between two attempts to start a recorder."""


class RecordingState(Struct, frozen=True):
    """The state of a recording, as in the record."""

    status: RecordingStatus
    path: str = ""
    bytes: int | None = None
    reason: str = ""


class RecordedFile(Struct, frozen=True):
    """A finished recording."""

    name: str
    kind: MediaKind
    path: str
    started_at: float
    """The start of its recorder, by the caller's clock."""
    bytes: int | None = None
    """Its last known size; None: unknown."""


class SupervisedRecorder:
    """One recorder. `run` controls it from start to end, and reports a `RecordingState` after every change."""

    def __init__(
        self,
        settings: RecorderSettings,
        plan: RecordingPlan,
        say: Callable[[str, RecordingState], object],
        now: Callable[[], float],
        *,
        check_seconds: float = CHECK_SECONDS,
        retry_seconds: float = RETRY_SECONDS,
    ) -> None:
        """:param settings: which recorder, with its options.
        :param plan: what is recorded.
        :param say: gets the name and the state after every change.
        :param now: returns the session's time.
        """
        self.name = settings.name
        self.settings, self.plan, self.say, self.now = settings, plan, say, now
        self.check_seconds, self.retry_seconds = check_seconds, retry_seconds
        self.files: list[RecordedFile] = []
        """Its recordings, once it is stopped."""
        self.settled = asyncio.Event()
        """Set when its file has begun to grow, or at the first problem."""
        self._state: RecordingState | None = None
        self._path = ""

    @property
    def records(self) -> bool:
        """Whether it records, as far as known."""
        return self._state is not None and self._state.status in ("started", "running", "stalled")

    async def run(self, finish: asyncio.Event) -> None:
        """Record until `finish`, then stop within CALL_SECONDS and CLOSE_SECONDS. Never raises."""
        while not finish.is_set():
            recorder = await self._begin(finish)
            if recorder is None:
                self.settled.set()
            else:
                ended = await self._watch(recorder, finish)
                await self._stop(recorder, ended)
            if finish.is_set():
                return
            await _wait(finish, self.retry_seconds)

    async def _begin(self, finish: asyncio.Event) -> Recorder | None:
        """Start and return the recorder; None: it does not record, and the reason was reported."""
        try:
            recorder = open_recorder(self.settings.driver, self.name, self.settings.options)
        except RecorderError as error:
            self._fail(error)
            return None
        self._kind, self._path, self._started_at = recorder.kind, "", self.now()
        self._bytes: int | None = None
        asked_to_start = False
        try:
            await call_within(CALL_SECONDS, recorder.prepare(self.plan), "what it is", finish)
            asked_to_start = True
            self._started_at = self.now()
            self._path = await call_within(CALL_SECONDS, recorder.start(), "to start", finish)
        except RecorderError as error:
            if not finish.is_set():
                self._fail(error)
            if asked_to_start:  # it may have started, and must not record people unnoticed
                await _quietly(CALL_SECONDS, recorder.stop(), "to stop")
            await _quietly(CLOSE_SECONDS, recorder.close(), "to let go")
            return None
        self._set(RecordingState("started", self._path))
        return recorder

    async def _watch(self, recorder: Recorder, finish: asyncio.Event) -> str:
        """Watch the recorder until it should finish or has ended by itself; return why it ended."""
        loop = asyncio.get_running_loop()
        stalled_after = self.settings.stalled_after or recorder.stalled_after
        watch = GrowthWatch(stalled_after, loop.time())
        while not await _wait(finish, self.check_seconds):
            try:
                status = await call_within(CALL_SECONDS, recorder.status(), "for its state", finish)
            except RecorderError as error:
                if finish.is_set():
                    break
                if error.ended:
                    return str(error)
                self._fail(error)
                continue
            self._path = status.path or self._path
            self._bytes = status.bytes or self._bytes  # OBS reports 0 once it has stopped
            if not status.recording:
                self._set(RecordingState("failed", self._path, status.bytes, "it does not record any more"))
            elif not watch.observe(status, loop.time()):
                why = f"it has not grown for {watch.seconds_since_growth(loop.time()):.0f} s"
                self._set(RecordingState("stalled", self._path, status.bytes, why))
            elif watch.has_grown:
                self._set(RecordingState("running", self._path, status.bytes, _drops_text(status)))
        return ""

    async def _stop(self, recorder: Recorder, ended: str) -> None:
        problem = ended
        try:
            path = await call_within(CALL_SECONDS, recorder.stop(), "to stop")
            self._path = path or self._path
        except RecorderError as error:
            problem = problem or str(error)
        size = await asyncio.to_thread(recording_size, self._path) or self._bytes
        self._set(RecordingState("failed" if problem else "stopped", self._path, size, problem))
        if self._path:
            self.files.append(RecordedFile(self.name, self._kind, self._path, self._started_at, size))
        await _quietly(CLOSE_SECONDS, recorder.close(), "to let go")

    def _fail(self, error: RecorderError) -> None:
        self._set(RecordingState("failed", self._path, None, " ".join(str(error).split())))

    def _set(self, state: RecordingState) -> None:
        """Report a new state. Changes of size or lost frames alone are not reported."""
        before = self._state
        if state.status != "started":
            self.settled.set()
        is_same = before is not None and (before.status, before.path) == (state.status, state.path)
        if is_same and before is not None and (state.status in ("running", "stalled") or before.reason == state.reason):
            return
        self._state = state
        self.say(self.name, state)


def recording_size(path: str) -> int | None:
    """Return the bytes of a file, or of all files in a folder (blocking); None: it is not on this computer."""
    place = Path(path).expanduser()
    try:
        if not path:
            return None
        if place.is_dir():
            return sum(each.stat().st_size for each in place.rglob("*") if each.is_file())
        return place.stat().st_size
    except OSError:
        return None


def _drops_text(status: RecorderStatus) -> str:
    return f"{status.drops} lost so far" if status.drops else ""


async def _quietly(seconds: float, call: Coroutine[Any, Any, object], what: str) -> None:
    with suppress(RecorderError):
        await call_within(seconds, call, what)


async def _wait(event: asyncio.Event, seconds: float) -> bool:
    """Return whether the event has come within these seconds."""
    try:
        async with asyncio.timeout(seconds):
            await event.wait()
    except TimeoutError:
        return False
    return True
