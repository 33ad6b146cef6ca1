"""The companion processes of a running session: its recorders' supervisor and its outlet.

`rise_engine.run.recording.companion` describes them. Each is a child with the session's socket. Any failure of a
companion (it cannot start, dies, hangs, does not finish) becomes a `recording` record, `failed` with the reason, and
has no other effect: nothing here raises, blocks, or takes longer than its limit.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
from asyncio.subprocess import PIPE, Process
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Literal, NamedTuple

from rise_engine.base.text import clean
from rise_engine.kernel.inputs import RecordingReport
from rise_engine.kernel.records import RecordingStatus
from rise_engine.run.recording.companion import CompanionRequest, encode_request

_LOG = logging.getLogger(__name__)

FINISH_SECONDS = 13.0
"""Time limit for the recorders to finish before the session ends: the last mark, and stopping."""
OUTLET_SECONDS = 3.0
"""Time limit for an outlet after the session's end, to pass on the last markers."""
GRACE_SECONDS = 1.0
"""Seconds between the request to end (SIGTERM) and the forced end (SIGKILL)."""
ORPHAN_SECONDS = 3.0
"""Time limit for processes that a companion left running, to complete their files."""
RESTART_DELAY_SECONDS = 5.0
"""Delay before a companion that ended too early is restarted; it continues in a new file."""
MAX_RESTARTS = 3
"""Maximum number of restarts. More would only fill the disk."""
SILENT_SECONDS = 30.0
"""Time without a sign of life after which a companion counts as hung."""
_KEPT = 2_000
"""Stored bytes of a companion's messages. The last line becomes the reason."""
_FINAL_STATUSES: frozenset[RecordingStatus] = frozenset({"stopped", "failed"})


class Companions:
    """All companions of one session. Its methods belong to the engine's loop."""

    def __init__(
        self,
        requests: Sequence[CompanionRequest],
        report: Callable[[RecordingReport], object],
        status_of: Callable[[str], RecordingStatus | None],
        *,
        finish_seconds: float = FINISH_SECONDS,
        silent_seconds: float = SILENT_SECONDS,
        again: int = MAX_RESTARTS,
        again_seconds: float = RESTART_DELAY_SECONDS,
    ) -> None:
        """Make the companions without starting them.

        :param requests: one for each companion.
        :param report: takes a `recording` report at any moment; after the session's end it drops it.
        :param status_of: returns a recording's status in the last record; None: there is none.
        :param finish_seconds: their time limit to finish.
        :param silent_seconds: time without a sign of life after which one counts as hung.
        :param again: how often one that ended too early is restarted.
        :param again_seconds: delay before a restart.
        """
        self._companions: list[_Companion] = []
        for request in requests:
            limit = finish_seconds if request.kind == "recorders" else min(finish_seconds, OUTLET_SECONDS)
            lives = _Lives(again, again_seconds)
            self._companions.append(_Companion(request, report, status_of, limit, silent_seconds, lives))
        self._tasks: list[asyncio.Task[None]] = []

    def start(self) -> None:
        """Start them; they run in the background."""
        loop = asyncio.get_running_loop()
        self._tasks = [loop.create_task(each.run()) for each in self._companions]

    @property
    def recording(self) -> bool:
        """Whether the session must wait for a companion before it ends: for recorders, never for outlets."""
        return any(not task.done() for each, task in self._pairs() if each.request.kind == "recorders")

    def end_quickly(self) -> None:
        """End all companions without waiting any longer, even if their files stay incomplete."""
        for each in self._companions:
            each.finish()
            each.hurrying.set()

    async def finish_recorders(self) -> None:
        """Let the recorders finish and exit, before the session ends.

        It takes at most `finish_seconds`, and twice GRACE_SECONDS and ORPHAN_SECONDS to end processes by force.
        """
        await self._finish([(each, task) for each, task in self._pairs() if each.request.kind == "recorders"])

    async def finish(self) -> None:
        """Let all other companions finish and exit, after outlets have sent the session's end.

        The limits are the same (an outlet's is OUTLET_SECONDS).
        """
        await self._finish(self._pairs())

    def _pairs(self) -> list[tuple[_Companion, asyncio.Task[None]]]:
        return list(zip(self._companions, self._tasks, strict=False))

    @staticmethod
    async def _finish(chosen: list[tuple[_Companion, asyncio.Task[None]]]) -> None:
        for each, _ in chosen:
            each.finish()
        if chosen:
            await asyncio.wait([task for _, task in chosen])


class _Lives(NamedTuple):
    again: int
    seconds: float


class _Companion:
    """One companion, from its start to its end."""

    def __init__(
        self,
        request: CompanionRequest,
        report: Callable[[RecordingReport], object],
        status_of: Callable[[str], RecordingStatus | None],
        finish_seconds: float,
        silent_seconds: float,
        lives: _Lives,
    ) -> None:
        self.request = request
        self.report = report
        self.status_of = status_of
        self.finish_seconds, self.silent_seconds = finish_seconds, silent_seconds
        self.lives = lives
        self.finishing, self.hurrying = asyncio.Event(), asyncio.Event()
        self._last_output = b""
        """The end of its standard error."""
        self._reading: asyncio.Task[None]

    def finish(self) -> None:
        self.finishing.set()

    async def run(self) -> None:
        """Run the companion, with restarts. Never raises: failures only become records."""
        for life in range(1 + self.lives.again):
            if life:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self.finishing.wait(), self.lives.seconds)
            if self.finishing.is_set():
                return
            self._last_output = b""
            await self._run_once()

    async def _run_once(self) -> None:
        try:
            process = await asyncio.create_subprocess_exec(
                *self.request.arguments, stdin=PIPE, stdout=PIPE, stderr=PIPE, start_new_session=True
            )
        except (OSError, ValueError) as error:
            self._fail(f"its process cannot be started: {error}")
            return
        self._reading = asyncio.create_task(self._read_errors(process))
        try:
            await self._attend(process)
        except Exception as error:
            _LOG.exception("a companion cannot be followed")
            self._fail(f"its process cannot be followed: {error}")
        finally:
            await _end_group(process.pid)
            self._reading.cancel()
            process._transport.close()  # type: ignore[attr-defined]  # its children may hold the pipes open

    async def _attend(self, process: Process) -> None:
        """Attend the companion until it has gone."""
        assert process.stdin is not None
        with suppress(OSError):
            process.stdin.write(encode_request(self.request))
            await process.stdin.drain()
        following = asyncio.create_task(self._follow_signs(process))
        finishing = asyncio.create_task(self.finishing.wait())
        hurrying = asyncio.create_task(self.hurrying.wait())
        try:
            await asyncio.wait({following, finishing}, return_when=asyncio.FIRST_COMPLETED)
            if not following.done():
                process.stdin.close()
                limit = self.finish_seconds
                await asyncio.wait({following, hurrying}, timeout=limit, return_when=asyncio.FIRST_COMPLETED)
            if following.done() and following.result() == "gone":
                await self._report_exit(process)
                return
            if following.done():
                what = f"gave no sign of life for {self.silent_seconds:g} s"
            else:
                what = "was not waited for" if hurrying.done() else f"did not finish within {self.finish_seconds:g} s"
            self._fail(f"its process {what}, and was ended")
            await _end(process)
        finally:
            for task in (following, finishing, hurrying):
                task.cancel()

    async def _follow_signs(self, process: Process) -> Literal["gone", "silent"]:
        """Wait until the companion is silent for too long, or its output ends because it has gone.

        Silence is counted in steps, so that a pause of this process or of the computer does not count.
        """
        assert process.stdout is not None
        step = min(GRACE_SECONDS, self.silent_seconds)
        silent = 0.0
        while silent <= self.silent_seconds:
            try:
                async with asyncio.timeout(step):
                    if not await process.stdout.read(4096):
                        return "gone"
                silent = 0.0
            except TimeoutError:
                if process.returncode is not None:
                    return "gone"
                silent += step
        return "silent"

    async def _report_exit(self, process: Process) -> None:
        """Report the recordings that it left open as failed. Those that it has ended need no report."""
        status = await _exit_status(process)
        if status == 0 and self.finishing.is_set():
            return  # as requested
        await asyncio.wait({self._reading}, timeout=GRACE_SECONDS)
        lines = [clean(line).strip() for line in self._last_output.decode("utf-8", "replace").splitlines()]
        reason = next((line for line in reversed(lines) if line), "")
        if status is not None and status < 0:
            with suppress(ValueError):
                reason = f"{signal.Signals(-status).name} ended its process"
        if status == 0:
            reason = "its process ended before the session"
        self._fail(reason or f"its process ended with exit status {status}")

    def _fail(self, reason: str) -> None:
        for name in self.request.recordings:
            if self.status_of(name) not in _FINAL_STATUSES:
                self.report(RecordingReport(name=name, status="failed", reason=reason))

    async def _read_errors(self, process: Process) -> None:
        assert process.stderr is not None
        while chunk := await process.stderr.read(_KEPT):
            self._last_output = (self._last_output + chunk)[-_KEPT:]
            _LOG.warning("%s: %s", self.request.kind, chunk.decode("utf-8", "replace").rstrip())


async def _end(process: Process) -> None:
    """End a process: by request, then by force. Takes two seconds at most."""
    for ask in (process.terminate, process.kill):
        with suppress(ProcessLookupError):
            ask()
        if await _exit_status(process) is not None:
            return


async def _exit_status(process: Process) -> int | None:
    """Return the exit status as soon as there is one; None after GRACE_SECONDS.

    On some versions of Python, `Process.wait` would also wait for other holders of its pipes.
    """
    for _ in range(round(GRACE_SECONDS / 0.02)):
        if process.returncode is not None:
            break
        await asyncio.sleep(0.02)
    return process.returncode


async def _end_group(group: int) -> None:
    """End the processes that a dead companion has left (a camera's program). SIGINT lets them complete their files.

    SIGKILL makes sure that nothing records any longer.
    """
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGINT)
        for _ in range(round(ORPHAN_SECONDS / 0.05)):
            await asyncio.sleep(0.05)
            os.killpg(group, 0)  # raises if no process is left
        os.killpg(group, signal.SIGKILL)
