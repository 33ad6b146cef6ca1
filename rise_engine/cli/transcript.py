"""A session told in lines that a person can read: time, who, what happened.

    00:03.2  Speech    "Dear Reader, welcome!"           started

One line for each record that says something new; an action's `accepted` and a task's repeated states are left out.
"""

from __future__ import annotations

from msgspec.structs import replace

from rise_engine.kernel.record_words import RecordWords, words_of
from rise_engine.kernel.records import FINAL, ActionRecord, AnyRecord, FailureRecord, TaskRecord, TimingRecord
from rise_engine.kernel.task_view import ACT_FUNCTIONS, TaskView, add_record

_WHO_WIDTH = 16
_WHAT_WIDTH = 44
_MAX_CLOCK_SECONDS = 1e12
"""Seconds, more than any session has: the clock shows no more."""
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
"""Functions whose success has a record of its own that says more."""


class Transcript:
    """Turns records, in order, into lines."""

    def __init__(self) -> None:
        self._tasks: dict[int, TaskView] = {}
        """Those that are not over."""

    def line_for(self, record: AnyRecord) -> str | None:
        """The line for a record, without line end; None when it tells a reader nothing new."""
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
                words = words_of(replace(record, reason=""), sources=True)  # the act's own record has just told why
                answers = f"repeatAct {record.task}, goOn {record.task} or stopRuleOfAct {record.task}"
                return words._replace(text=f"{words.text}; answers: {answers}")
            case _:
                return words_of(record, sources=True)

    def _task_words(self, record: TaskRecord) -> RecordWords | None:
        if record.status == "PENDING":
            # Every act is PENDING for a moment; when no Blocking act runs it starts at once.
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
    """Whether other acts wait for it."""
    return task.is_act and task.status == "ACTIVE" and task.calling_type != "None"


def clock_text(t: float) -> str:
    """Session time as `mm:ss.t`, from an hour on `h:mm:ss.t`."""
    tenths = int(min(t, _MAX_CLOCK_SECONDS) * 10 + 1e-6)
    seconds, tenth = divmod(tenths, 10)
    minutes, second = divmod(seconds, 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}.{tenth}" if hours else f"{minute:02}:{second:02}.{tenth}"


def _cell(text: str, width: int) -> str:
    text = " ".join(text.split()) if not text.startswith("  ") else "  " + " ".join(text.split())
    return text.ljust(width) if len(text) <= width else text[: width - 1] + "…"
