"""A program that records until it gets SIGINT, as by Ctrl-C."""

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
    """Return a new path in a folder; the second one is `..._2`.

    :param folder: the folder.
    :param stem: the beginning of its name.
    :param suffix: its ending, with the dot.
    """
    number = 1
    while True:
        path = folder / (f"{stem}{suffix}" if number == 1 else f"{stem}_{number}{suffix}")
        if not path.exists() and not path.is_symlink():
            return path
        number += 1


def recording_stem(plan: RecordingPlan, name: str) -> str:
    """Return the name of a recorder's file: the session's name and the recorder's.

    :param plan: the recording's plan.
    :param name: the recorder's name.
    """
    return re.sub(r"[^A-Za-z0-9._-]", "-", f"{plan.session}_{name}")


def size_of(path: Path) -> int | None:
    """The bytes of a file, or of everything in a folder; None: there is nothing."""
    try:
        if path.is_dir():
            return sum(each.stat().st_size for each in path.rglob("*") if each.is_file())
        return path.stat().st_size
    except OSError:
        return None


END_SECONDS = 3.0
"""Seconds after SIGINT for the program to complete its file."""
TERMINATE_SECONDS = 0.5
"""Seconds after SIGTERM, and after SIGKILL."""
_PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG, prctl(2)
_C_LIBRARY = ctypes.CDLL(None) if sys.platform == "linux" else None
_KEPT_LINES = 20
_LINE_BYTES = 2_000


class RecordingProgram:
    """One run of a program, in the process group of its starter. Its output is read continuously."""

    def __init__(self, name: str) -> None:
        """:param name: its name in sentences."""
        self.name = name
        self.process: Process | None = None
        self.lines: list[str] = []
        """The last lines on its standard error."""
        self.gone = asyncio.Event()
        """Set when it has ended."""
        self._readers: list[asyncio.Task[None]] = []

    async def start(self, arguments: Sequence[str], on_line: Callable[[str], object] = lambda line: None) -> None:
        """Start it. Only the owner can read its files.

        :param arguments: the program and its arguments.
        :param on_line: receives each line of its standard output.
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
        """Describe its end in a sentence, with its last line."""
        status = self.process.returncode if self.process is not None else None
        last = self.lines[-1] if self.lines else ""
        how = f"{self.name} has ended"
        if status is not None and status < 0:
            with suppress(ValueError):
                how = f"{signal.Signals(-status).name} ended {self.name}"
        elif status:
            how = f"{self.name} ended with exit status {status}"
        return f"{how}: {last}" if last else how

    async def end(self) -> bool:
        """Ask it to end, then force it; takes four seconds at most. Returns whether it ended without force."""
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
        """Kill it if it still runs, and close its pipes."""
        for reader in self._readers:
            reader.cancel()
        if self.process is not None:
            self.process._transport.close()  # type: ignore[attr-defined]  # its children may hold the pipes open

    async def _wait(self) -> None:
        assert self.process is not None
        # On some versions of Python, `Process.wait` also waits for other programs that hold its pipes open.
        while self.process.returncode is None:  # noqa: ASYNC110
            await asyncio.sleep(0.05)
        await asyncio.wait(self._readers[:2], timeout=TERMINATE_SECONDS)  # its last lines
        self.gone.set()

    def _keep(self, line: str) -> None:
        self.lines = [*self.lines[1 - _KEPT_LINES :], line]


async def _read_lines(stream: asyncio.StreamReader, on_line: Callable[[str], object]) -> None:
    """Pass on each line that is not empty. Of an endless line, pass on the beginning."""
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
    """Ask the kernel of Linux to send SIGINT to this new process when its starter dies, even by SIGKILL, so that it
    stops recording. It runs before the program. Elsewhere the engine's process does this while it lives."""
    if _C_LIBRARY is not None:
        _C_LIBRARY.prctl(_PARENT_DEATH_SIGNAL, signal.SIGINT, 0, 0, 0)
