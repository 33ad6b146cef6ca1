"""Where `rise-engine run` writes: records as JSON lines, or a readable account, to standard output.

In real time a thread of its own writes, because a terminal or pipe that is not read must not hold up the robot.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from queue import SimpleQueue

import msgspec

from rise_engine.account import Account
from rise_engine.kernel.records import AnyRecord


class Output:
    """A sink for records. Every line is written and flushed at once."""

    def __init__(self, *, json: bool) -> None:
        self.broken = False
        """True when nobody reads any more (a closed pipe)."""
        self.when_broken: Callable[[], None] | None = None
        """Called once when that happens, on the thread that writes."""
        self._account = None if json else Account()
        self._encode = msgspec.json.Encoder().encode

    def __call__(self, record: AnyRecord) -> None:
        if self._account is None:
            self._put(self._encode(record) + b"\n")
        else:
            line = self._account.line(record)
            if line is not None:
                self._put(line.encode() + b"\n")

    def close(self) -> None:
        """Everything is written when this returns."""

    def _put(self, line: bytes) -> None:
        self._write(line)

    def _write(self, line: bytes) -> None:
        if self.broken:
            return
        try:
            sys.stdout.buffer.write(line)
            sys.stdout.buffer.flush()
        except OSError:  # a closed pipe, a full disk: there is nobody to tell
            self.broken = True
            _no_more_output()
            if self.when_broken is not None:
                self.when_broken()


class ThreadedOutput(Output):
    """The same, but whoever puts a record in never waits."""

    CLOSE_SECONDS = 5.0
    """What a reader that has stopped reading gets at the end."""

    def __init__(self, *, json: bool) -> None:
        super().__init__(json=json)
        self._lines: SimpleQueue[bytes | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="rise-output", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._lines.put(None)
        self._thread.join(self.CLOSE_SECONDS)
        if self._thread.is_alive():
            # It is stuck in a write and holds the stream's lock: the interpreter's own flush at exit would hang too.
            _no_more_output()

    def _put(self, line: bytes) -> None:
        self._lines.put(line)

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            self._write(line)


def _no_more_output() -> None:
    """Let what is still buffered, and the flush at exit, go nowhere."""
    try:
        descriptor = sys.stdout.fileno()
    except (OSError, ValueError):
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, descriptor)
    os.close(nowhere)
