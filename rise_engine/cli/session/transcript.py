"""A session as readable lines or as JSON lines, written while it runs.

    00:03.2  Speech    "Dear Reader, welcome!"           started

The transcript has one line for each record with news; it omits an action's `accepted` and a task's repeated states. In
real time a separate thread writes, so that an unread terminal or pipe does not block the robot. Nothing is dropped
silently: a record that cannot be written is a `failure`, which ends the session.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from queue import SimpleQueue

from msgspec.structs import replace

from rise_engine.base.text import clean
from rise_engine.cli.terminal import discard_rest, escape_json
from rise_engine.kernel.record_words import RecordWords, words_of
from rise_engine.kernel.records import FINAL, ActionRecord, AnyRecord, FailureRecord, TaskRecord, TimingRecord
from rise_engine.kernel.task_view import ACT_FUNCTIONS, TaskView, add_record
from rise_engine.session.journal_format import encode_record

_WHO_WIDTH = 16
_WHAT_WIDTH = 44
_MAX_CLOCK_SECONDS = 1e12
"""Maximum seconds that the clock shows, more than any session lasts."""
_WITH_OWN_RECORD = {
    "stopAll",
    "releaseStop",
    "raiseEventTopic",
    "assignValue",
    "deleteValue",
    "markCue",
    "undoCue",
    "markMistake",
}
"""Functions whose success has its own, more detailed record."""


class Transcript:
    """Converts records, in order, into lines."""

    def __init__(self) -> None:
        self._tasks: dict[int, TaskView] = {}

    def line_for(self, record: AnyRecord) -> str | None:
        """Return the line for a record, without line end; None: it has no news for a reader."""
        add_record(self._tasks, record)
        words = self._words(record)
        if words is None:
            return None
        kind, subject, text, _ = words
        return f"{clock_text(record.t)}  {_cell(kind, _WHO_WIDTH)}  {_cell(subject, _WHAT_WIDTH)}  {text}".rstrip()

    def _words(self, record: AnyRecord) -> RecordWords | None:
        match record:
            case TaskRecord():
                return self._task_words(record)
            case ActionRecord(status="accepted") | TimingRecord():
                return None
            case ActionRecord():
                task = self._tasks.get(record.task)
                action = task.actions.get(record.action) if task is not None else None
                ended = action is not None and action.began and action.ended is not None
                words = words_of(record, took=record.t - action.since if action is not None and ended else None)
                return words._replace(kind=f"  {words.kind}", subject=words.subject or record.action)
            case FailureRecord(status="asked" | "waiting"):
                words = words_of(replace(record, reason=""), sources=True)  # the act's record just gave the reason
                answers = f"repeatAct {record.task}, goOn {record.task} or stopRuleOfAct {record.task}"
                return words._replace(text=f"{words.text}; answers: {answers}")
            case _:
                return words_of(record, sources=True)

    def _task_words(self, record: TaskRecord) -> RecordWords | None:
        if record.status == "PENDING":
            # Every act is PENDING for a moment; it starts immediately if no Blocking act runs.
            waits = record.function in ACT_FUNCTIONS and any(map(_blocks, self._tasks.values()))
            return words_of(record, sources=True) if waits else None
        starts_rule = record.function == "startInteractionRule"
        if record.status not in FINAL:
            return None if starts_rule else words_of(record, sources=True)
        began = self._tasks.pop(record.id).started
        if began is not None:
            return None if starts_rule else words_of(record, took=record.t - began)
        if record.function in _WITH_OWN_RECORD and record.status != "REJECTED":
            return None
        return words_of(record, sources=True)


def _blocks(task: TaskView) -> bool:
    """Return whether other acts wait for a task."""
    return task.is_act and task.status == "ACTIVE" and task.calling_type != "None"


def clock_text(t: float) -> str:
    """Format session time as `mm:ss.t`, from an hour on as `h:mm:ss.t`."""
    tenths = int(min(t, _MAX_CLOCK_SECONDS) * 10 + 1e-6)
    seconds, tenth = divmod(tenths, 10)
    minutes, second = divmod(seconds, 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}.{tenth}" if hours else f"{minute:02}:{second:02}.{tenth}"


def _cell(text: str, width: int) -> str:
    text = " ".join(text.split()) if not text.startswith("  ") else "  " + " ".join(text.split())
    return text.ljust(width) if len(text) <= width else text[: width - 1] + "…"


# --- output during a session ----------------------------------------------------------------------------------------


class Output:
    """A sink for records, which writes and flushes every line immediately."""

    def __init__(self, *, json: bool) -> None:
        """:param json: JSON lines instead of a transcript."""
        self.broken = False
        """Whether the output can no longer be written (a closed pipe, a full disk)."""
        self.failure: Exception | None = None
        """The first error because of which a record was not written; a closed pipe does not count."""
        self.on_failure: Callable[[], None] | None = None
        """Called when either of these changes, on the thread of the change."""
        self._transcript = None if json else Transcript()
        self._encoding = getattr(sys.stdout, "encoding", None) or "utf-8"

    def __call__(self, record: AnyRecord) -> None:
        try:
            line = self._format_record(record)
        except Exception as error:  # this record is lost; the following ones (the robot's stop, the end) may not be
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
        except BrokenPipeError:  # nobody can receive a message
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
    """A sink that writes in its own thread, so that callers never wait."""

    CLOSE_SECONDS = 5.0
    """Seconds that a reader who has stopped reading gets at the end of a session that is ended in a hurry."""

    def __init__(self, *, json: bool) -> None:
        super().__init__(json=json)
        self._lines: SimpleQueue[bytes | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="rise-output", daemon=True)
        self._thread.start()

    def close(self, hurried: Callable[[], bool]) -> None:
        """Wait until everything is written, however slow the reader (a pager) is, unless it becomes `hurried`."""
        self._lines.put(None)
        deadline = None
        while self._thread.is_alive() and (deadline is None or time.monotonic() < deadline):
            self._thread.join(0.1)
            if deadline is None and hurried():
                deadline = time.monotonic() + self.CLOSE_SECONDS
        if self._thread.is_alive():
            # The thread hangs in a write with the stream's lock: the interpreter's flush at exit would hang, too.
            discard_rest(sys.stdout)
            self._fail(TimeoutError("nobody has read the last of the output"))

    def _write(self, line: bytes) -> None:
        self._lines.put(line)

    def _run(self) -> None:
        while (line := self._lines.get()) is not None:
            super()._write(line)
