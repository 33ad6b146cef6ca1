"""The events of a trial and their causes, in lines made only from records."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.author.trial.trial import Trial
from rise_engine.kernel.behaviors import describe_behavior, started_rule
from rise_engine.kernel.record_words import words_of
from rise_engine.kernel.records import (
    ENDINGS,
    ENGINE,
    FINAL,
    ActionRecord,
    AnyRecord,
    ConditionRecord,
    CountdownRecord,
    CueRecord,
    EventRecord,
    FailureRecord,
    KeptRecord,
    MemoryRecord,
    NoteRecord,
    RuleRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.kernel.task_view import ACT_FUNCTIONS
from rise_engine.scenario.speech.ssml import plain_words

HistoryKind: TypeAlias = Literal["done", "state", "event", "memory", "condition", "act", "says", "note", "problem"]
_GOOD_STATUSES = ("succeeded", "accepted")


class HistoryLine(Struct, frozen=True):
    """One line of the history: a sentence without a full stop."""

    t: float
    """Session time in seconds."""
    kind: HistoryKind
    """`done`: a person requested it. `problem`: the author will want to know it."""
    text: str
    key: str = ""
    """The label of the study's key that caused it; only in the first line of a step."""
    rule: str = ""
    """The affected rule."""


def history_lines(trial: Trial, first: int = 0) -> list[HistoryLine]:
    """Return the lines of all steps from index `first` on."""
    return [line for number in range(first, len(trial.steps)) for line in step_lines(trial, number)]


def step_lines(trial: Trial, number: int) -> list[HistoryLine]:
    """Return the lines of one step, by its index in `Trial.steps`; -1: of the last one."""
    if not trial.steps:
        return []
    step = trial.steps[number]
    lines = list(lines_of(trial.records_of(number)))
    if step.task is None:
        return lines
    if not lines:
        lines = [HistoryLine(step.at, "done", f"{step.task.function} {step.task.behavior}".strip())]
    first = lines[0]
    return [HistoryLine(first.t, first.kind, first.text, step.key, first.rule), *lines[1:]]


def lines_of(records: Iterable[AnyRecord]) -> Iterator[HistoryLine]:
    """Yield a line for each record with news; values that are set together share one."""
    waiting: list[MemoryRecord] = []
    for record in records:
        if waiting and not _goes_with(record, waiting[-1]):
            yield _memory_line(waiting)
            waiting = []
        if isinstance(record, MemoryRecord):
            if record.source not in (ENGINE, "file"):
                waiting.append(record)
        elif (line := _line(record)) is not None:
            yield line
    if waiting:
        yield _memory_line(waiting)


def _goes_with(record: AnyRecord, before: MemoryRecord) -> bool:
    """Return whether a record adds nothing between two values that are set together."""
    if isinstance(record, TaskRecord):
        return record.function == "assignValue" and record.source == before.source and record.status == "SUCCEEDED"
    return isinstance(record, MemoryRecord) and (record.source, record.t) == (before.source, before.t)


def _memory_line(records: list[MemoryRecord]) -> HistoryLine:
    first = records[0]
    text = " · ".join(words_of(record).sentence for record in records)
    return HistoryLine(first.t, "memory", text, rule=first.source.removeprefix("rule:"))


def _line(record: AnyRecord) -> HistoryLine | None:
    sentence = words_of(record).sentence
    match record:
        case TaskRecord():
            return _task_line(record)
        case ActionRecord():
            return _action_line(record)
        case RuleRecord(status="started"):
            return None  # the line about its first state follows
        case RuleRecord():
            kind: HistoryKind = "problem" if record.status == "faulted" else "state"
            return HistoryLine(record.t, kind, sentence, rule=record.name)
        case EventRecord() if record.taken_by and record.topic.startswith("ended "):
            return None  # the rule's own act: the next state's line shows it
        case EventRecord():
            by = f"rule {rule} raises " if (rule := _rule_of(record.source)) else ""
            return HistoryLine(record.t, "event", f"{by}{sentence}", rule=record.taken_by or rule)
        case ConditionRecord():
            return HistoryLine(record.t, "problem" if record.error else "condition", sentence, rule=record.rule)
        case CountdownRecord():
            return HistoryLine(record.t, "problem" if record.status == "failed" else "note", sentence, rule=record.rule)
        case KeptRecord():
            return HistoryLine(record.t, "event", sentence, rule=record.rule or "")
        case CueRecord():
            return HistoryLine(record.t, "note", sentence)
        case FailureRecord():
            return HistoryLine(record.t, "problem" if record.status in ("asked", "waiting") else "note", sentence)
        case StopRecord():
            return HistoryLine(record.t, "note", words_of(record).full_sentence)
        case NoteRecord():
            return HistoryLine(record.t, "problem", sentence)
        case _:
            return None


def _rule_of(source: str) -> str:
    """Return the rule of a source; empty: it is not a rule."""
    return source.removeprefix("rule:") if source.startswith("rule:") else ""


def _task_line(record: TaskRecord) -> HistoryLine | None:
    what = describe_behavior(record.function, record.behavior)
    rule = _rule_of(record.source)
    if record.status in ("REJECTED", "ABORTED") and record.reason:
        return HistoryLine(record.t, "problem", words_of(record).full_sentence, rule=rule)
    if record.function in ACT_FUNCTIONS:
        return _act_line(record, what, rule)
    if record.function == "startInteractionRule":
        if record.status != "PENDING":
            return None  # its RuleRecords show it
        return HistoryLine(record.t, "done", f"starts rule {what}", rule=started_rule(record.behavior))
    if record.status not in FINAL or record.function in ("raiseEventTopic", "assignValue"):
        return None  # the record of the event or of the value shows more
    words = {"stopCommunicationRobotAct": "stops", "stopInteractionRule": "stops rule", "deleteValue": "deletes"}
    return HistoryLine(record.t, "done", f"{words.get(record.function, record.function)} {what}".strip(), rule=rule)


def _act_line(record: TaskRecord, what: str, rule: str) -> HistoryLine | None:
    match record.status:
        case "ACTIVE":
            return HistoryLine(record.t, "act", f"starts {what}", rule=rule)
        case "PENDING":
            return HistoryLine(record.t, "act", f"{what} waits its turn", rule=rule) if record.position else None
        case "SUCCEEDED":
            return HistoryLine(record.t, "act", f"{what} has ended", rule=rule)
        case _:
            return HistoryLine(record.t, "problem", words_of(record).sentence, rule=rule)


def _action_line(record: ActionRecord) -> HistoryLine | None:
    if record.status in ENDINGS and record.status not in _GOOD_STATUSES:
        words = words_of(record)
        return HistoryLine(record.t, "problem", f"{words.kind} {words.text}")
    if record.status != "started":
        return None
    message = words_of_action(record.parameters)
    return HistoryLine(record.t, "says", f"says “{message}”") if message else None


def words_of_action(parameters: dict[str, Any]) -> str:
    """Return the words of an action with these parameters; empty: none."""
    message = parameters.get("message")
    return plain_words(message).strip() if isinstance(message, str) else ""
