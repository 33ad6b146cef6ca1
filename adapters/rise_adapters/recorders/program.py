"""A program that records until it is asked to end, as by Ctrl-C."""

from __future__ import annotations

import asyncio
import ctypes
import re
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from rise_engine.base.text import clean
from rise_engine.ports.recorder import RecorderError, RecordingPlan

# --- files of a recorder ----------------------------------------------------------------------------------------------


def new_path(folder: Path, stem: str, suffix: str = "") -> Path:
    """A path in a folder at which nothing lies yet: the second is called `..._2`.

    :param folder: where it is to be.
    :param stem: how its name begins.
    :param suffix: how it ends, with its dot.
    """
    number = 1
    while True:
        path = folder / (f"{stem}{suffix}" if number == 1 else f"{stem}_{number}{suffix}")
        if not path.exists() and not path.is_symlink():
            return path
        number += 1


def recording_stem(plan: RecordingPlan, name: str) -> str:
    """How the file of a recorder is called: the session's name and its own.

    :param plan: what is recorded.
    :param name: of the recorder.
    """
    return re.sub(r"[^A-Za-z0-9._-]", "-", f"{plan.session}_{name}")


def size_of(path: Path) -> int | None:
    """Bytes of a file, or of all that lie in a folder; None: there is nothing."""
    try:
        if path.is_dir():
            return sum(each.stat().st_size for each in path.rglob("*") if each.is_file())
        return path.stat().st_size
    except OSError:
        return None


END_SECONDS = 3.0
"""After SIGINT, for the program to complete its file."""
TERMINATE_SECONDS = 0.5
"""After SIGTERM, and after SIGKILL."""
_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG, prctl(2)
_C_LIBRARY = ctypes.CDLL(None) if sys.platform == "linux" else None
_KEPT_LINES = 20
_LINE_BYTES = 2_000


class RecordingProgram:
    """One run of a program, in the process group of whoever started it. What it writes is read all the time."""

    def __init__(self, name: str) -> None:
        """
        :param name: what sentences call it.
        """
        self.name = name
        self.process: Process | None = None
        self.lines: list[str] = []
        """The last lines on its standard error."""
        self.gone = asyncio.Event()
        """Set when it has ended."""
        self._readers: list[asyncio.Task[None]] = []

    async def start(self, arguments: Sequence[str], on_line: Callable[[str], object] = lambda line: None) -> None:
        """Start it. Its files are their owner's alone.

        :param arguments: the program and its arguments.
        :param on_line: gets each line of its standard output.
        :raises RecorderError: it cannot be started.
        """
        try:
            self.process = await asyncio.create_subprocess_exec(
                *arguments, stdin=DEVNULL, stdout=PIPE, stderr=PIPE, umask=0o077, preexec_fn=_end_with_parent
            )
        except FileNotFoundError:
            raise RecorderError(f"{arguments[0]} is not installed here, or not in the PATH") from None
        except (OSError, ValueError) as error:
            raise RecorderError(f"{arguments[0]} cannot be started: {error}") from None
        assert self.process.stdout is not None and self.process.stderr is not None
        self._readers = [
            asyncio.create_task(_read_lines(self.process.stdout, on_line)),
            asyncio.create_task(_read_lines(self.process.stderr, self._keep)),
            asyncio.create_task(self._wait()),
        ]

    @property
    def runs(self) -> bool:
        """Whether it has been started and has not ended."""
        return self.process is not None and not self.gone.is_set()

    def ending(self) -> str:
        """How it has ended, in a sentence, with the last thing that it said."""
        status = self.process.returncode if self.process is not None else None
        said = self.lines[-1] if self.lines else ""
        how = f"{self.name} has ended"
        if status is not None and status < 0:
            with suppress(ValueError):
                how = f"{signal.Signals(-status).name} ended {self.name}"
        elif status:
            how = f"{self.name} ended with exit status {status}"
        return f"{how}: {said}" if said else how

    async def end(self) -> bool:
        """Ask it to end, and see to it; four seconds at most. Whether it did so when it was asked."""
        process = self.process
        if process is None:
            return True
        asked = self.runs
        for number, seconds in (
            (signal.SIGINT, END_SECONDS),
            (signal.SIGTERM, TERMINATE_SECONDS),
            (signal.SIGKILL, TERMINATE_SECONDS),
        ):
            if self.runs:
                with suppress(ProcessLookupError):
                    process.send_signal(number)
                with suppress(TimeoutError):
                    async with asyncio.timeout(seconds):
                        await self.gone.wait()
        return not asked or (process.returncode is not None and process.returncode != -signal.SIGKILL)

    def close(self) -> None:
        """Kill it if it still runs, and let go of its pipes."""
        for reader in self._readers:
            reader.cancel()
        if self.process is not None:
            self.process._transport.close()  # type: ignore[attr-defined]  # its children may hold the pipes open

    async def _wait(self) -> None:
        assert self.process is not None
        # `Process.wait` would also wait for whoever else holds its pipes open, on some versions of Python.
        while self.process.returncode is None:  # noqa: ASYNC110
            await asyncio.sleep(0.05)
        await asyncio.wait(self._readers[:2], timeout=TERMINATE_SECONDS)  # what it said last
        self.gone.set()

    def _keep(self, line: str) -> None:
        self.lines = [*self.lines[1 - _KEPT_LINES :], line]


async def _read_lines(stream: asyncio.StreamReader, on_line: Callable[[str], object]) -> None:
    """Give each line that says anything; of one that never ends, the beginning."""
    rest = b""
    while chunk := await stream.read(_LINE_BYTES):
        *lines, rest = (rest + chunk).replace(b"\r", b"\n").split(b"\n")
        rest = rest[:_LINE_BYTES]
        for line in lines:
            if text := clean(line.decode("utf-8", "replace")).strip():
                on_line(text)
    if text := clean(rest.decode("utf-8", "replace")).strip():
        on_line(text)


def _end_with_parent() -> None:
    """In the new process, before it becomes the program: on Linux it is asked to end when whoever started it dies, even
    by SIGKILL, so that it records nobody any longer. Elsewhere the engine's process sees to that, while it lives."""
    if _C_LIBRARY is not None:
        _C_LIBRARY.prctl(_PARENT_DEATH_SIGNAL, signal.SIGINT, 0, 0, 0)
