"""A terminal for one browser: a pty with a console on it, which lives as long as the browser's connection."""

from __future__ import annotations

import asyncio
import fcntl
import os
import pty
import signal
import struct
import sys
import termios
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress

PATIENCE = 7.0
"""Seconds that a console gets to say goodbye; longer than it grants itself (`app.DETACH_PATIENCE`)."""
_CHUNK = 65_536
_OTHERS = ("TMUX", "TMUX_PANE", "STY", "TERM_PROGRAM", "TERM_PROGRAM_VERSION", "SSH_TTY", "COLUMNS", "LINES")
"""What the terminal of the server says of itself is not true of this one."""


class WebTerminal:
    """Bytes in, bytes out; knows nothing of browsers."""

    def __init__(self, master: int, process: Process, keyboard: asyncio.WriteTransport) -> None:
        self._master, self._process, self._keyboard = master, process, keyboard

    @classmethod
    async def open(cls, arguments: Sequence[str], width: int, height: int) -> WebTerminal:
        """Start a console with these arguments. Raises OSError."""
        master, slave = pty.openpty()
        try:
            _resize(slave, width, height)
            os.set_blocking(master, False)
            environment = {name: value for name, value in os.environ.items() if name not in _OTHERS}
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "rise_tui", *arguments),
                stdin=slave,
                stdout=slave,
                stderr=slave,
                env={**environment, "TERM": "xterm-256color", "COLORTERM": "truecolor"},
                start_new_session=True,
            )
            keyboard, _ = await asyncio.get_running_loop().connect_write_pipe(
                asyncio.BaseProtocol, os.fdopen(os.dup(master), "wb", buffering=0)
            )
        except BaseException:
            os.close(master)
            raise
        finally:
            os.close(slave)
        return cls(master, process, keyboard)

    async def read_output(self) -> AsyncIterator[bytes]:
        """What the console writes, until it ends. Who takes it slowly slows the console down, and nobody else."""
        loop, readable = asyncio.get_running_loop(), asyncio.Event()
        loop.add_reader(self._master, readable.set)
        try:
            while True:
                await readable.wait()
                readable.clear()
                try:
                    data = os.read(self._master, _CHUNK)
                except BlockingIOError:
                    continue
                except OSError:  # nobody has the other end any more
                    return
                if not data:
                    return
                yield data
        finally:
            loop.remove_reader(self._master)

    def write_input(self, data: bytes) -> None:
        """What was typed; kept until the console takes it."""
        self._keyboard.write(data)

    def resize(self, width: int, height: int) -> None:
        with suppress(OSError):
            _resize(self._master, width, height)

    async def close(self) -> None:
        """Hang up, as a closed terminal does: the console detaches and ends. One that does not is killed."""
        self._keyboard.abort()
        os.close(self._master)
        try:
            await asyncio.wait_for(self._process.wait(), PATIENCE)
        except TimeoutError:
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
            await self._process.wait()


def _resize(descriptor: int, width: int, height: int) -> None:
    width, height = min(max(width, 20), 500), min(max(height, 6), 300)
    fcntl.ioctl(descriptor, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))
