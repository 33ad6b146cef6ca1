"""A session told in lines that a person can read: time, who, what happened.

    00:03.2  Speech    "Dear Reader, welcome!"           started

One line for each record that says something new; an action's `accepted` and a task's repeated states are left out.
"""

from __future__ import annotations

import json
from typing import Any

from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.kernel.records import (
    ENDINGS,
    ENGINE,
    FINAL,
    ActionRecord,
    AnyRecord,
    CheckRecord,
    ConditionRecord,
    ControlRecord,
    CountdownRecord,
    CueRecord,
    EventRecord,
    FailureRecord,
    KeptRecord,
    MemoryRecord,
    MistakeRecord,
    NoteRecord,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    ScenarioRecord,
    SessionRecord,
    StopRecord,
    SyncRecord,
    TaskRecord,
    TimingRecord,
    describe_open_goals,
    stopper_words,
)
from rise_engine.kernel.task_view import ACT_FUNCTIONS, TaskView, add_record
from rise_engine.scenario.ssml import plain_words

_WHO_WIDTH = 16
_WHAT_WIDTH = 44
_FUNCTION_LABELS = {
    "startCommunicationRobotAct": "act",
    "stopCommunicationRobotAct": "stop act",
    "startInteractionRule": "start rule",
    "stopInteractionRule": "stop rule",
    "stepBack": "step back",
    "raiseEventTopic": "raise",
    "assignValue": "assign",
    "deleteValue": "delete",
    "cancelTask": "cancel task",
    "moveTask": "move task",
    "stopAll": "stop all",
    "releaseStop": "release stop",
    "cancelOpenGoals": "cancel again",
    "releaseOpenGoals": "release part",
    "markCue": "mark cue",
    "undoCue": "undo cue",
    "nextFiller": "next filler",
    "markMistake": "mark mistake",
    "goOn": "go on without",
    "repeatAct": "repeat act",
    "stopRuleOfAct": "stop rule of act",
}
_MARK_LABELS = {"none": "no mistake after all"} | {mark: mark for mark in ("wrong", "late", "early", "double")}
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
        cells = self._describe(record)
        if cells is None:
            return None
        who, what, how = cells
        return f"{clock_text(record.t)}  {_cell(who, _WHO_WIDTH)}  {_cell(what, _WHAT_WIDTH)}  {how}".rstrip()

    def _describe(self, record: AnyRecord) -> tuple[str, str, str] | None:
        match record:
            case SessionRecord():
                return self._describe_session(record)
            case TaskRecord():
                return self._describe_task(record)
            case ActionRecord():
                return self._describe_action(record)
            case RuleRecord():
                return "rule", record.name, _rule_text(record)
            case EventRecord():
                return "event", record.topic, f"taken by {record.taken_by}" if record.taken_by else "nobody takes it"
            case ConditionRecord():
                return "condition", record.expression, _condition_text(record)
            case MemoryRecord():
                return "memory", record.key, _memory_text(record)
            case RobotRecord():
                return "robot", record.status, record.detail
            case StopRecord():
                return "stop", record.status, _stop_text(record)
            case ControlRecord():
                return "control", record.status, f"by {record.by}; it is with {record.holder or 'nobody'}"
            case CueRecord():
                return "cue", *_cue_text(record)
            case MistakeRecord():
                what = f"{record.act} (task {record.task})" if record.act else f"task {record.task}"
                return "mistake", what, f"{_MARK_LABELS[record.mark]}, says {record.source}"
            case CountdownRecord():
                return "countdown", f"{record.rule}: {record.state}", _countdown_text(record)
            case KeptRecord():
                return "kept", record.topic, _kept_text(record)
            case FailureRecord():
                return "failed act", record.act, _failure_text(record)
            case ScenarioRecord():
                return "files", "the session goes on with changed ones", ", ".join(record.changes)
            case TimingRecord():
                return None  # its times are those of other records
            case NoteRecord():
                return "note", record.text, "" if record.source == "engine" else f"by {record.source}"
            case CheckRecord() | OutcomeRecord() | RecordingRecord() | SyncRecord():
                return _describe_report(record)

    def _describe_session(self, record: SessionRecord) -> tuple[str, str, str]:
        if record.status == "ended":
            return "session", "ended", "; ".join(filter(None, (record.reason, describe_open_goals(record.open))))
        who = "".join(f", {word}" for word in (record.participant, record.condition) if word)
        away = "" if record.downtime is None else f" after {record.downtime:.1f} s without engine"
        how = f"{record.status}{away}, {record.mode}, robot {record.robot}, seed {record.seed}{who}"
        return "session", record.scenario, how

    def _describe_task(self, record: TaskRecord) -> tuple[str, str, str] | None:
        who = _FUNCTION_LABELS.get(record.function, record.function)
        what = describe_behavior(record.function, record.behavior)
        by = f" by {record.source}" if record.source else ""
        if record.status == "REJECTED":
            return who, what, f"REJECTED{by}: {record.reason}"
        if record.status == "PENDING":
            # Every act is PENDING for a moment; when no Blocking act runs it starts at once.
            if record.function not in ACT_FUNCTIONS or not any(map(_blocks, self._tasks.values())):
                return None
            before = f", {record.position} before it" if record.position else ""
            return who, what, f"waits{before}, asked{by}"
        if record.status == "ACTIVE":
            return None if record.function == "startInteractionRule" else (who, what, f"started{by}")
        if record.status not in FINAL:
            return who, what, f"{record.status}{by}"
        task = self._tasks.pop(record.id)
        began = task.started
        if record.function == "startInteractionRule" and began is not None:
            return None
        if began is None and record.function in _WITH_OWN_RECORD:
            return None
        took = "" if began is None else f", {record.t - began:.1f} s"
        reason = f": {record.reason}" if record.reason else ""
        done = {"SUCCEEDED": "succeeded" if began is not None else f"done{by}"}.get(record.status, record.status)
        return who, what, f"{done}{took}{reason}"

    def _describe_action(self, record: ActionRecord) -> tuple[str, str, str] | None:
        name = record.type if record.sent_as is None else f"{record.type} as {record.sent_as}"
        what = parameters_text(record.parameters)
        if record.status == "started":
            return f"  {name}", what, "started"
        if record.status == "accepted":
            return None
        if record.status not in ENDINGS:
            return f"  {name}", what, record.status
        task = self._tasks.get(record.task)
        action = task.actions.get(record.action) if task is not None else None
        took = f", {record.t - action.since:.1f} s" if action is not None and action.began else ""
        reason = f": {record.reason}" if record.reason else ""
        return f"  {name}", what or record.action, f"{record.status}{took}{reason}"


def _blocks(task: TaskView) -> bool:
    """Whether other acts wait for it."""
    return task.is_act and task.status == "ACTIVE" and task.calling_type != "None"


def _describe_report(
    record: CheckRecord | OutcomeRecord | RecordingRecord | SyncRecord,
) -> tuple[str, str, str]:
    match record:
        case CheckRecord():
            found = ", ".join(filter(None, (record.value, record.reason)))
            result = record.result if record.result == "passed" else record.result.upper()
            return "check", record.text or record.id, f"{result}{found and f': {found}'}, says {record.source}"
        case OutcomeRecord():
            return "outcome", record.status, f"{record.reason and f'{record.reason}, '}says {record.source}"
        case RecordingRecord():
            status = record.status.upper() if record.status in ("stalled", "failed") else record.status
            size = "" if record.bytes is None else f"{record.bytes:,} bytes"
            return "recording", record.name, ": ".join((status, *filter(None, (record.reason or record.path, size))))
        case SyncRecord():
            return "sync", f"mark {record.number}", ", ".join(filter(None, (record.medium, record.text)))


def _countdown_text(record: CountdownRecord) -> str:
    if record.status == "began":
        return f"way {record.transition + 1} is taken in {record.seconds:g} s"
    if record.status == "broken":
        return f"way {record.transition + 1} begins anew: what must hold does not"
    return f"way {record.transition + 1} is never taken: {record.reason}"


def _kept_text(record: KeptRecord) -> str:
    match record.status:
        case "kept":
            return f"for up to {record.seconds:g} s, until a rule waits for it"
        case "taken":
            return f"until now, for {record.rule}"
        case "expired":
            return "in vain: no rule waited for it"
        case "taken-back":
            return "no more: it was taken back"


def clock_text(t: float) -> str:
    """Session time as `mm:ss.t`, from an hour on `h:mm:ss.t`."""
    tenths = int(min(t, _MAX_CLOCK_SECONDS) * 10 + 1e-6)
    seconds, tenth = divmod(tenths, 10)
    minutes, second = divmod(seconds, 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}.{tenth}" if hours else f"{minute:02}:{second:02}.{tenth}"


def parameters_text(parameters: dict[str, Any]) -> str:
    """An action's parameters in short: a text or name by itself, a point as coordinates, the rest by name."""
    rest = dict(parameters)
    parts = []
    if "message" in rest:
        message = rest.pop("message")
        parts.append(_json(plain_words(message) if isinstance(message, str) else message))
    if "value" in rest:
        parts.append(str(rest.pop("value")))
    if all(axis in rest for axis in ("pointx", "pointy", "pointz")):
        parts.append("(" + ", ".join(f"{rest.pop(axis)}" for axis in ("pointx", "pointy", "pointz")) + ")")
    if "duration" in rest:
        parts.append(f"{rest.pop('duration')} ms")
    parts.extend(f"{name}={_json(value)}" for name, value in rest.items())
    return " ".join(parts)


def _rule_text(record: RuleRecord) -> str:
    trigger = f" on {record.trigger}" if record.trigger and record.trigger != "start" else ""
    if record.previous is None and trigger:
        trigger = f" ({record.trigger})"
    reason = f": {record.reason}" if record.reason else ""
    if record.status == "entered":
        if record.previous is None:
            return f"in {record.state}{trigger}{reason}"
        if record.previous == record.state:
            return f"again in {record.state}{trigger}{reason}"
        return f"{record.previous} -> {record.state}{trigger}{reason}"
    if record.status == "stayed":
        return f"stays in {record.state}{trigger}{reason}"
    status = record.status.upper() if record.status == "faulted" else record.status
    return f"{status}{trigger}{reason}"


def _condition_text(record: ConditionRecord) -> str:
    result = f"error: {record.error}" if record.error else "true" if record.result else "false"
    values = ", ".join(f"{key} = {_json(value)}" for key, value in record.values.items() if key not in record.missing)
    missing = f"no value for {', '.join(record.missing)}" if record.missing else ""
    detail = "; ".join(part for part in (values, missing) if part)
    return f"{result} in {record.rule}" + (f" ({detail})" if detail else "")


def _memory_text(record: MemoryRecord) -> str:
    by = f" by {record.source}" if record.source else ""
    if record.deleted:
        return f"deleted, was {_json(record.old)}{by}"
    if record.source == ENGINE and isinstance(record.value, dict) and isinstance(record.old, dict):
        changed = {name: value for name, value in record.value.items() if record.old.get(name) != value}
        return ", ".join(f"{name} = {_json(value)}" for name, value in changed.items())  # how the session stands
    was = "" if record.created else f", was {_json(record.old)}"
    return f"= {_json(record.value)}{was}{by}"


def _cue_text(record: CueRecord) -> tuple[str, str]:
    if record.status == "marked":
        return record.text or "the participant's turn has ended", f"marked by {record.source}"
    if record.status == "undone":
        return "the participant has not finished", f"taken back by {record.source}"
    return f"{record.status} by task {record.task}", f"after {record.since:.1f} s"


def _failure_text(record: FailureRecord) -> str:
    answers = f"repeatAct {record.task}, goOn {record.task} or stopRuleOfAct {record.task}"
    match record.status:
        case "asked":
            return f"WAITS FOR AN ANSWER: {answers}"
        case "waiting":
            when = "when the robot is back" if record.seconds is None else f"in {record.seconds:g} s"
            return f"is repeated {when}, or at an answer: {answers}"
        case "repeated":
            return f"task {record.by} repeats it" + ("" if record.source == "engine" else f", says {record.source}")
        case "gone-on":
            why = record.reason or f"says {record.source}"
            return f"the study goes on without it: {why}"
        case "dropped":
            return f"nobody is asked any more: {record.reason}"


def _stop_text(record: StopRecord) -> str:
    if record.status == "requested":
        return f"by {record.source}" if record.source else ""
    if record.status == "let-go":
        return f"{stopper_words(record.source)} is not pressed any more"
    if record.status != "latched":
        return ""
    text = f"confirmed: {', '.join(record.confirmed) or 'nobody'}"
    for words, parts in (("NOT CONFIRMED", record.unconfirmed), ("CANNOT BE STOPPED", record.unstoppable)):
        text += f"; {words}: {', '.join(parts)}" if parts else ""
    return text


def _cell(text: str, width: int) -> str:
    text = " ".join(text.split()) if not text.startswith("  ") else "  " + " ".join(text.split())
    return text.ljust(width) if len(text) <= width else text[: width - 1] + "…"


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)
