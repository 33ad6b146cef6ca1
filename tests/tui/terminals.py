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
from codecs import getincrementaldecoder
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import rmtree
from time import monotonic, sleep
from typing import Any

import pyte

from rise_tui.console.input import CHANGE_SECONDS
from tests.forked import Forked, run_engine
from tests.patience import PATIENCE

ROOT = Path(__file__).parents[2]
STARTED = (sys.executable, "-m", "rise_tui")
"""A console that is started as a person starts it."""
LOADED = ("tests.tui.loaded",)
SEQUENCE = re.compile(rb"\x1b(\[[0-9;?<>=$]*[A-Za-z@`~p]|\][^\x07\x1b]*(\x07|\x1b\\)|[P_^][^\x1b]*\x1b\\|.)")
STILL = 0.25
"""Seconds without a byte after which the screen counts as painted."""
FINGERS = 0.03
"""Seconds between what is seen and the next key. A test sees at once, and keys within 12 ms are a paste
(`rise_tui.console.input.TOGETHER_SECONDS`), of which the console takes no letter."""
ASKED = re.compile(rb"\x1b\[\?(2026|2048)\$p")
"""A program asks the terminal which modes it knows."""
ANSWERS = {b"2026": b"\x1b[?2026;2$y", b"2048": b"\x1b[?2048;0$y"}
UNKNOWN_TO_PYTE = re.compile(r"\x1b\[[<>=][0-9;]*[a-z]|\x1b\[\?[0-9;]*\$p")


class Terminal:
    """A pty with a console on it, which answers what terminals answer. Waits for what it shows, never for time alone.

    Its sessions live in a folder of their own, `home`; those that still run at the end are ended. The console is a fork
    of one that has loaded everything, which takes a tenth of what a start takes; `program`: what is started instead.
    """

    def __init__(
        self,
        *arguments: str,
        home: str | None = None,
        size: tuple[int, int] = (120, 40),
        program: Sequence[str] = (),
        folder: Path = ROOT,
        environment: Mapping[str, str] | None = None,
        screen: type[pyte.Screen] = pyte.Screen,
    ) -> None:
        # Not pytest's folder: the path of a socket has to be short.
        self.home = home or tempfile.mkdtemp(prefix="rise-", dir="/tmp")
        self.environment = {**environment_of(self.home), **(environment or {})}
        self._arguments, self._program, self._folder = arguments, program, folder
        self._size, self._make_screen = size, screen
        self._open()

    def _open(self) -> None:
        self.master, slave = pty.openpty()
        self._resize(slave, *self._size)
        streams: dict[str, Any] = {"stdin": slave, "stdout": slave, "stderr": slave}
        streams |= {"cwd": self._folder, "env": self.environment}
        self.process: subprocess.Popen[bytes] | Forked
        if self._program:
            self.process = subprocess.Popen(
                [*self._program, *self._arguments],
                start_new_session=True,
                preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
                **streams,
            )
        else:
            self.process = Forked(*self._arguments, module="rise_tui", loads=LOADED, terminal=True, **streams)
        os.close(slave)
        self.shown = b""
        """What came since the last `until` or `press`."""
        self.count = 0
        """Bytes that came in all."""
        self._screen = self._make_screen(*self._size)
        self._stream = pyte.Stream(self._screen)
        self._decode = getincrementaldecoder("utf-8")(errors="replace").decode
        self._unread = ""
        self._question = b""

    def close_and_open(self) -> None:
        """Close the window, whatever runs in it, and open a new one with the same program."""
        os.close(self.master)
        self.process.wait(PATIENCE)
        self._open()

    def read(self, seconds: float) -> bool:
        """Take in what comes; False at the end."""
        if not select.select([self.master], [], [], seconds)[0]:
            return True
        try:
            data = os.read(self.master, 65536)
        except OSError:
            return False
        self.shown += data
        self.count += len(data)
        self._unread += self._decode(data)
        self._question = (self._question + data)[-64:]
        for asked in ASKED.findall(self._question):
            os.write(self.master, ANSWERS[asked])
            self._question = b""
        return bool(data)

    def still(self, seconds: float = STILL) -> int:
        """Wait until nothing has come for so long from a console that had nothing to do; returns how many bytes came.

        On a busy machine a console may paint late: then it does not wait, it works, or would if it got its turn.
        """
        before, end = self.count, monotonic() + PATIENCE
        while (select.select([self.master], [], [], seconds)[0] and self.read(0)) or works(self.in_front):
            assert monotonic() < end, "it goes on painting"
        return self.count - before

    @property
    def in_front(self) -> int:
        """The program that has the keyboard: the one that was started, or what a shell has started."""
        with suppress(OSError):
            return os.tcgetpgrp(self.master)
        return self.process.pid

    def cost(self, keys: bytes) -> int:
        """Bytes that it paints after these keys, until it is still."""
        before = self.count
        self.press(keys)
        end = monotonic() + PATIENCE
        while self.count == before:
            assert monotonic() < end, f"{keys!r} changed nothing on the screen"
            self.read(0.2)
        self.still()
        return self.count - before

    @property
    def lines(self) -> list[str]:
        """What a terminal shows now."""
        text, self._unread = UNKNOWN_TO_PYTE.sub("", self._unread), ""
        self._stream.feed(text)
        return [line.rstrip() for line in self._screen.display]

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    def forget_screen(self) -> None:
        """What was shown is gone, as in a window that was made smaller for a moment."""
        _ = self.lines
        self._screen.reset()

    @property
    def cells(self) -> list[list[pyte.screens.Char]]:
        """What a terminal shows now, with colours."""
        _ = self.lines
        columns = range(self._screen.columns)
        return [[self._screen.buffer[row][column] for column in columns] for row in range(self._screen.lines)]

    @property
    def cursor(self) -> tuple[int, int] | None:
        """Row and column, from 0; None: hidden."""
        return None if self._screen.cursor.hidden else (self._screen.cursor.y, self._screen.cursor.x)

    def until_screen(self, text: str, *, gone: bool = False) -> None:
        """Wait until a terminal shows this, or (`gone`) shows it no more."""
        end = monotonic() + PATIENCE
        while (text in self.text) is gone:
            assert monotonic() < end, f"{text!r} is {'still' if gone else 'not'} on the screen:\n{self.text}"
            assert self.read(0.2) or (text in self.text) is not gone, f"it ended:\n{self.text}"

    def resize(self, columns: int, rows: int) -> None:
        """Of the window; the program is told by the system."""
        _ = self.lines
        self._screen.resize(rows, columns)
        self._resize(self.master, columns, rows)

    @staticmethod
    def _resize(descriptor: int, columns: int, rows: int) -> None:
        fcntl.ioctl(descriptor, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def until(self, text: str) -> None:
        """Wait until it has shown this since the last call, or shows it now: only cells that differ are written."""
        end = monotonic() + PATIENCE
        while not self._has_shown(text):
            assert monotonic() < end, f"{text!r} was not shown:\n{self.text}"
            if not self.read(0.2) and not self._has_shown(text):
                raise AssertionError(f"it ended without {text!r}:\n{self.text}")
        self.shown = b""

    def _has_shown(self, text: str) -> bool:
        return text in SEQUENCE.sub(b"", self.shown).decode(errors="replace") or text in self.text

    def press(self, keys: bytes) -> None:
        """As a person does, who is never quicker than a finger, and looks at what has opened before an Enter."""
        looks = keys == b"\r" and "  EDIT" not in self.lines[0]  # in the editor no Enter starts anything
        sleep(CHANGE_SECONDS + FINGERS if looks else FINGERS)
        self.shown = b""
        os.write(self.master, keys)

    def engines(self) -> list[int]:
        """The processes of the sessions that run, or have gone without putting their lock away."""
        return engines_of(self.home)

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


def run_rise_tui(*arguments: str, **more: Any) -> subprocess.CompletedProcess[str]:
    """`rise-tui` without a terminal, run to its end. `more` is for `Forked`."""
    return run_engine(*arguments, module="rise_tui", loads=LOADED, cwd=ROOT, **more)


def environment_of(home: str) -> dict[str, str]:
    run = Path(home, "run")
    run.mkdir(0o700, exist_ok=True)
    own = {"RISE_RUNTIME": str(run), "RISE_SESSIONS": str(Path(home, "sessions"))}
    own |= {"XDG_CONFIG_HOME": str(Path(home, "config")), "XDG_STATE_HOME": str(Path(home, "state"))}
    kept = Path(home, "state", "rise-tui", "console.json")
    if not kept.exists():  # somebody who has seen the tour of the first run
        kept.parent.mkdir(0o700, parents=True, exist_ok=True)
        kept.write_text('{"kind": "rise-tui console", "tour": true}')
    inherited = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
    return {**inherited, **own, "TERM": "xterm-256color", "COLORTERM": "truecolor"}


def press_keys(it: Terminal, *keys: bytes) -> None:
    """Like a person: what came of a key is seen before the next one."""
    for key in keys:
        it.press(key)
        it.still()


@contextmanager
def terminal(
    *arguments: str, home: str | None = None, size: tuple[int, int] = (120, 40), program: Sequence[str] = ()
) -> Iterator[Terminal]:
    """With `home`, a second terminal for the sessions of a first one, which ends them."""
    found = Terminal(*arguments, home=home, size=size, program=program)
    try:
        yield found
    finally:
        if found.process.poll() is None:
            found.process.kill()
            found.process.wait()
        if found.master >= 0:
            os.close(found.master)
        if home is None:
            kill_engines(found.home)
            rmtree(found.home, ignore_errors=True)


def engines_of(home: str) -> list[int]:
    """The processes of the sessions that run, or have gone without putting their lock away."""
    found = []
    for path in Path(home, "run").glob("*.lock"):
        with suppress(FileNotFoundError, ValueError):  # it is just ending, or just beginning
            found.append(int(path.read_text().split()[0]))
    return [engine for engine in found if engine != os.getpid()]  # a test may be the engine itself


def kill_engines(home: str) -> None:
    for engine in engines_of(home):
        with suppress(ProcessLookupError):
            os.kill(engine, signal.SIGKILL)


def works(process: int) -> bool:
    """Whether one of its threads runs or wants to run. Where the system does not tell, as on macOS: no."""
    for stat in Path(f"/proc/{process}/task").glob("*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):  # it has just ended
            if stat.read_text().rpartition(")")[2].split()[0] in "RD":
                return True
    return False


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
