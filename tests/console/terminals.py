"""Consoles as a person starts them: processes on terminals of their own."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import tempfile
import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from time import monotonic

ROOT = Path(__file__).parents[2]
SEQUENCE = re.compile(rb"\x1b(\[[0-9;?<>=$]*[A-Za-z@`~p]|\][^\x07\x1b]*(\x07|\x1b\\)|[P_^][^\x1b]*\x1b\\|.)")
PATIENCE = 60.0


class Terminal:
    """A pty with a console on it. Waits for what it shows, never for time alone.

    Its sessions live in a folder of their own, `home`; those that still run at the end are ended.
    """

    def __init__(self, *arguments: str, home: str | None = None) -> None:
        # Not pytest's folder: the path of a socket has to be short.
        self.home = home or tempfile.mkdtemp(prefix="rise-", dir="/tmp")
        self.environment = environment_of(self.home)
        self.master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rise_tui.cli", *arguments],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=ROOT,
            env=self.environment,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(slave)
        self.shown = b""

    def read(self, seconds: float) -> bool:
        """Take in what comes; False at the end."""
        if not select.select([self.master], [], [], seconds)[0]:
            return True
        try:
            data = os.read(self.master, 65536)
        except OSError:
            return False
        self.shown += data
        return bool(data)

    def until(self, text: str) -> None:
        """Wait until it has shown this since the last call."""
        end = monotonic() + PATIENCE
        while text not in (plain := SEQUENCE.sub(b"", self.shown).decode(errors="replace")):
            assert monotonic() < end, f"{text!r} was not shown:\n{plain[-3000:]}"
            if not self.read(0.2) and text not in SEQUENCE.sub(b"", self.shown).decode(errors="replace"):
                raise AssertionError(f"it ended without {text!r}:\n{plain[-3000:]}")
        self.shown = b""

    def press(self, keys: bytes) -> None:
        self.shown = b""
        os.write(self.master, keys)

    def engines(self) -> list[int]:
        """The processes of the sessions that run, or have gone without putting their lock away."""
        found = []
        for path in Path(self.home, "run").glob("*.lock"):
            with suppress(FileNotFoundError, ValueError):  # it is just ending, or just beginning
                found.append(int(path.read_text()))
        return found

    @property
    def socket(self) -> Path:
        """Of the one session that runs."""
        return next(Path(self.home, "run").glob("*.sock"))

    def ended(self) -> int:
        end = monotonic() + PATIENCE
        while self.process.poll() is None:
            assert monotonic() < end, "it did not end"
            self.read(0.1)
        return self.process.returncode


def environment_of(home: str) -> dict[str, str]:
    run = Path(home, "run")
    run.mkdir(0o700, exist_ok=True)
    own = {"RISE_RUNTIME": str(run), "RISE_SESSIONS": str(Path(home, "sessions"))}
    return {**os.environ, **own, "TERM": "xterm-256color", "COLORTERM": "truecolor"}


@contextmanager
def terminal(*arguments: str, home: str | None = None) -> Iterator[Terminal]:
    """With `home`, a second terminal for the sessions of a first one, which ends them."""
    found = Terminal(*arguments, home=home)
    try:
        yield found
    finally:
        if found.process.poll() is None:
            found.process.kill()
            found.process.wait()
        if found.master >= 0:
            os.close(found.master)
        if home is None:
            for engine in found.engines():
                with suppress(ProcessLookupError):
                    os.kill(engine, signal.SIGKILL)
            rmtree(found.home, ignore_errors=True)


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
