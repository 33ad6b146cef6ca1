"""Where `rise-engine run` writes: records as JSON lines, or a readable transcript, to standard output.

In real time a thread of its own writes, because a terminal or pipe that is not read must not hold up the robot. Nothing
is dropped in silence: a record that cannot be written is a `failure`, and whoever runs the session ends it.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from queue import SimpleQueue

from rise_engine.cli.terminal import discard_rest, escape_json
from rise_engine.cli.transcript import Transcript
from rise_engine.kernel.records import AnyRecord
from rise_engine.session.journal_format import encode_record
from rise_engine.text import clean


class Output:
    """A sink for records. Every line is written and flushed at once."""

    def __init__(self, *, json: bool) -> None:
        """`json`: JSON lines instead of a transcript."""
        self.broken = False
        """True when nothing can be written any more (a closed pipe, a full disk)."""
        self.failure: Exception | None = None
        """The first thing that kept a record from being written; a closed pipe is none."""
        self.on_failure: Callable[[], None] | None = None
        """Called when either of these changes, on the thread where it happens."""
        self._transcript = None if json else Transcript()
        self._encoding = getattr(sys.stdout, "encoding", None) or "utf-8"

    def __call__(self, record: AnyRecord) -> None:
        try:
            line = self._format_record(record)
        except Exception as error:  # this one is lost, those that follow (the robot's stop, the end) may not be
            self._fail(error)
        else:
            if line is not None:
                self._write(line + b"\n")

    def _format_record(self, record: AnyRecord) -> bytes | None:
        if self._transcript is not None:
            line = self._transcript.line_for(record)
            return None if line is None else clean(line).encode(self._encoding, "backslashreplace")
        return escape_json(encode_record(record))

    def _write(self, line: bytes) -> None:
        if self.broken:
            return
        try:
            sys.stdout.buffer.write(line)
            sys.stdout.buffer.flush()
        except BrokenPipeError:  # there is nobody to tell
            self.broken = True
            discard_rest(sys.stdout)
            self._notify()
        except (OSError, ValueError) as error:  # a full disk, a closed file
            self.broken = True
            discard_rest(sys.stdout)
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        if self.failure is None:
            self.failure = error
            self._notify()

    def _notify(self) -> None:
        if self.on_failure is not None:
            self.on_failure()


class ThreadedOutput(Output):
    """The same, written by a thread of its own: whoever calls it never waits."""

    CLOSE_SECONDS = 5.0
    """What a reader that has stopped reading gets at the end of a session that somebody wants to end in a hurry."""

    def __init__(self, *, json: bool) -> None:
        super().__init__(json=json)
        self._lines: SimpleQueue[bytes | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="rise-output", daemon=True)
        self._thread.start()

    def close(self, hurried: Callable[[], bool]) -> None:
        """Wait until all is written, as long as the reader takes (a pager) unless it becomes `hurried`."""
        self._lines.put(None)
        deadline = None
        while self._thread.is_alive() and (deadline is None or time.monotonic() < deadline):
            self._thread.join(0.1)
            if deadline is None and hurried():
                deadline = time.monotonic() + self.CLOSE_SECONDS
        if self._thread.is_alive():
            # It is stuck in a write and holds the stream's lock: the interpreter's own flush at exit would hang too.
            discard_rest(sys.stdout)
            self._fail(TimeoutError("nobody has read the last of the output"))

    def _write(self, line: bytes) -> None:
        self._lines.put(line)

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            super()._write(line)
