"""A program on a pseudo terminal that answers like a terminal, for the benchmarks of the console."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
PATIENCE = 30.0


def environment_in(root: str) -> dict[str, str]:
    """The environment of a wizard with all files below a folder, who has seen the tour of the first run."""
    own = {"RISE_RUNTIME": "run", "RISE_SESSIONS": "sessions", "XDG_STATE_HOME": "state", "XDG_CONFIG_HOME": "config"}
    kept = Path(root, "state", "rise-tui")
    kept.mkdir(0o700, parents=True)
    (kept / "console.json").write_text('{"kind": "rise-tui console", "tour": true}')
    return {**os.environ, **{name: f"{root}/{place}" for name, place in own.items()}, "TERM": "xterm-256color"}


class Pty:
    """Counts the output, and keeps the end of it."""

    def __init__(self, command: list[str], environment: Mapping[str, str], size: tuple[int, int] = (120, 40)) -> None:
        self.master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", size[1], size[0], 0, 0))
        self.process = subprocess.Popen(
            command, stdin=slave, stdout=slave, stderr=slave, cwd=ROOT, env=environment, start_new_session=True
        )
        os.close(slave)
        self.count = 0
        self.shown = b""

    def read(self, seconds: float) -> bool:
        """Read the output for some seconds; False: there was none."""
        if not select.select([self.master], [], [], seconds)[0]:
            return False
        try:
            data = os.read(self.master, 65_536)
        except OSError:
            return False
        self.count += len(data)
        self.shown = (self.shown + data)[-100_000:]
        if re.search(rb"\x1b\[\?2026\$p", data):
            os.write(self.master, b"\x1b[?2026;2$y")
        return bool(data)

    def until(self, text: bytes) -> None:
        """Wait for a text since the last call."""
        end = time.monotonic() + PATIENCE
        while text not in self.shown:
            if time.monotonic() > end:
                raise SystemExit(f"{text!r} was not painted:\n{self.shown.decode(errors='replace')}")
            self.read(0.1)
        self.shown = b""

    def read_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.read(left)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self.master)
