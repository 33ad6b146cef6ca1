"""Records in words, for transcripts, trials, explored paths, the console's notices and the log of ROS.

Each user of these words decides only on layout, column widths and omissions.
"""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from rise_engine.base.typed_values import format_value
from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.kernel.records import (
    ENGINE,
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
from rise_engine.scenario.model import ALWAYS
from rise_engine.scenario.speech.ssml import plain_words

FUNCTION_WORDS = {
    "startCommunicationRobotAct": "act",
    "stopCommunicationRobotAct": "stop act",
    "startInteractionRule": "rule",
    "stopInteractionRule": "stop rule",
    "stepBack": "step back",
    "raiseEventTopic": "event",
    "assignValue": "set",
    "deleteValue": "delete",
    "cancelTask": "cancel",
    "moveTask": "move",
    "stopAll": "STOP ALL",
    "releaseStop": "release",
    "cancelOpenGoals": "cancel again",
    "releaseOpenGoals": "release part",
    "say": "say",
    "markCue": "cue",
    "undoCue": "undo cue",
    "nextFiller": "filler",
    "markMistake": "mistake",
    "goOn": "go on",
    "repeatAct": "repeat",
    "stopRuleOfAct": "stop rule",
}
"""A task's function in a word or two."""
ACTIONS_IN_MS = frozenset({"LookAt", "Emotion", "Animation", "Wait", "SocialExpression", "PointAt"})
"""The common actions: their `duration` is in ms. A record does not contain the unit of a scenario's own action."""
_TASK_STATES = {
    "PENDING": "waits",
    "ACTIVE": "started",
    "SUCCEEDED": "done",
    "ABORTED": "failed",
    "CANCELED": "was stopped",
    "REJECTED": "was rejected",
}
_MARKS = {"none": "no mistake after all"}
_OUTCOMES = ("succeeded", "failed", "stopped")
"""The outcomes of an act that a rule waits for, as in the trigger of a `RuleRecord`."""


class RecordWords(NamedTuple):
    """The words of a record."""

    kind: str
    """The subject's kind: `rule`, `act`, `robot`."""
    subject: str
    """The subject's name, or its present state."""
    text: str
    """The statement about it."""
    link: str = " "
    """The text between subject and statement in a sentence."""

    @property
    def sentence(self) -> str:
        """The statement without its kind and full stop."""
        return f"{self.subject}{self.link}{self.text}" if self.subject and self.text else self.subject or self.text

    @property
    def full_sentence(self) -> str:
        """The sentence with its kind."""
        return f"{self.kind} {self.sentence}".rstrip()


def words_of(record: AnyRecord, *, took: float | None = None, sources: bool = False) -> RecordWords:
    """Put a record into words.

    Arguments:
        record: any.
        took: duration in seconds of the task or action that ends with it; None omits it.
        sources: whether to name the requester, the reporter and the participant.

    >>> words_of(KeptRecord(1, 0.5, "", 7, "/yes", "kept", 2.0)).sentence
    '/yes is kept for 2 s: no rule waits for it yet'
    >>> words_of(RuleRecord(2, 0.5, "", "Visit", "faulted", None, reason="it ran away")).full_sentence
    'rule Visit was stopped by a fault: it ran away'
    """
    match record:
        case TaskRecord():
            kind = FUNCTION_WORDS.get(record.function, record.function)
            return RecordWords(
                kind, describe_behavior(record.function, record.behavior), _task_text(record, took, sources)
            )
        case ActionRecord():
            kind = record.type if record.sent_as is None else f"{record.type} as {record.sent_as}"
            ended = f"{record.status.replace('-', ' ')}{_duration_note(took)}"
            return RecordWords(
                kind, parameters_text(record.parameters, in_ms=record.type in ACTIONS_IN_MS), _add(ended, record.reason)
            )
        case RuleRecord():
            return _rule_words(record)
        case EventRecord():
            taken = f"{record.taken_by} takes it" if record.taken_by else "no rule waits for it"
            return RecordWords("event", record.topic, taken, ": ")
        case ConditionRecord():
            return RecordWords("condition", record.expression, _condition_text(record), ": ")
        case MemoryRecord():
            by = f", by {record.source}" if sources and record.source not in ("", ENGINE) else ""
            return RecordWords("memory", record.key, _memory_text(record) + by)
        case CountdownRecord():
            text = f"transition {record.transition + 1} {_countdown_text(record)}"
            return RecordWords("countdown", record.rule, text, ": ")
        case KeptRecord():
            return RecordWords("event", record.topic, _kept_text(record))
        case CueRecord():
            return RecordWords("cue", "the participant's cue", _cue_text(record, sources))
        case FailureRecord():
            return RecordWords("act", record.act, _failure_text(record, sources))
        case StopRecord():
            return _stop_words(record)
        case SessionRecord():
            return _session_words(record, sources)
        case RobotRecord():
            return RecordWords("robot", record.status, record.detail, ": ")
        case ControlRecord():
            return RecordWords("control", record.status, f"by {record.by}; {record.holder or 'nobody'} has it now")
        case NoteRecord():
            return RecordWords(
                "note", record.text, f"by {record.source}" if sources and record.source != ENGINE else ""
            )
        case MistakeRecord():
            what = f"{record.act} (task {record.task})" if record.act else f"task {record.task}"
            return RecordWords(
                "mistake", what, _MARKS.get(record.mark, record.mark) + _source_note(record.source, sources), ": "
            )
        case ScenarioRecord():
            return RecordWords("files", "the session goes on with changed files", ", ".join(record.changes), ": ")
        case TimingRecord():
            return RecordWords("timing", record.act, "")  # other records have the same times
        case CheckRecord() | OutcomeRecord() | RecordingRecord() | SyncRecord():
            return _report_words(record, sources)


def _task_text(record: TaskRecord, took: float | None, sources: bool) -> str:
    state, reason = _TASK_STATES.get(record.status, record.status), record.reason
    if record.status == "SUCCEEDED" and took is not None:
        state = "succeeded"
    if record.status == "PENDING" and record.position:
        state += f", {record.position} before it"
    elif record.status == "CANCELED" and reason.startswith(("stopped ", "interrupted ")):
        state, reason = f"was {reason}", ""
    if not sources or not record.source:
        return _add(f"{state}{_duration_note(took)}", reason)
    if record.status in ("ACTIVE", "SUCCEEDED"):
        return _add(f"{state} by {record.source}{_duration_note(took)}", reason)
    return f"{_add(f'{state}{_duration_note(took)}', reason)} (asked for by {record.source})"


def parameters_text(parameters: dict[str, Any], *, in_ms: bool) -> str:
    """An action's parameters in short: a text or name alone, a point as coordinates, the others by name.

    `in_ms`: whether its `duration` is in milliseconds.
    """
    rest = dict(parameters)
    parts = []
    if "message" in rest:
        message = rest.pop("message")
        parts.append(_json(plain_words(message) if isinstance(message, str) else message))
    if "value" in rest:
        parts.append(str(rest.pop("value")))
    if all(axis in rest for axis in ("pointx", "pointy", "pointz")):
        parts.append("(" + ", ".join(f"{rest.pop(axis)}" for axis in ("pointx", "pointy", "pointz")) + ")")
    if "duration" in rest and in_ms:
        parts.append(f"{rest.pop('duration')} ms")
    parts.extend(f"{name}={_json(value)}" for name, value in rest.items())
    return " ".join(parts)


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def _rule_words(record: RuleRecord) -> RecordWords:
    why, place = trigger_text(record.trigger), f" in {record.state}" if record.state else ""
    if record.status == "entered":
        again = "again " if record.previous == record.state else ""
        moves = f"{record.previous} → {record.state}" if record.previous and not again else f"{again}in {record.state}"
        return RecordWords("rule", record.name, _add(f"{moves}{why}", record.reason), ": ")
    text = {
        "started": f"started{why}",
        "stayed": f"stays{place}{why}",
        "ended": f"has ended{place}",
        "stopped": f"was stopped{place}",
        "faulted": "was stopped by a fault",
    }.get(record.status, record.status)
    return RecordWords("rule", record.name, _add(text, record.reason))


def trigger_text(trigger: str | None) -> str:
    """The trigger that led a rule into a state, as the end of a sentence.

    >>> trigger_text("/tea"), trigger_text("ended Greet failed"), trigger_text("while calm after 2s")
    (' on /tea', ' when Greet failed', ' after 2s of calm')
    >>> trigger_text("visits > 0"), trigger_text("after 2s"), trigger_text("stepped back"), trigger_text("start")
    (' when visits > 0', ' after 2s', ' (stepped back)', '')
    >>> trigger_text("true")
    ' at once'
    """
    if not trigger or trigger == "start":
        return ""
    if trigger.startswith("/"):
        return f" on {trigger}"
    if trigger == ALWAYS:
        return " at once"
    if trigger.startswith("after "):
        return f" {trigger}"
    if trigger.startswith(("resumed", "stepped back", "start,")):
        return f" ({trigger})"
    held, after, time = trigger.removeprefix("while ").rpartition(" after ")
    if trigger.startswith("while ") and after:
        return f" after {time} of {held}"
    first, *rest = trigger.split()
    outcomes = [word for word in rest if word in _OUTCOMES]
    name = rest[: len(rest) - len(outcomes)]
    if first == "ended" and name and name[0][0].isalpha():
        return f" when {' '.join(name)} {' or '.join(outcomes) or 'ended'}"
    return f" when {trigger}"


def _condition_text(record: ConditionRecord) -> str:
    read = ", ".join(
        f"{key} is not set" if key in record.missing else f"{key} is {format_value(value)}"
        for key, value in record.values.items()
    )
    shows_values = read and not (
        len(record.values) == 1 and record.expression.strip() in record.values and not record.missing
    )
    verdict = "true" if record.result else "false"
    verdict = (
        f"cannot be worked out in {record.rule}: {record.error}" if record.error else f"{verdict} in {record.rule}"
    )
    return f"{verdict} ({read})" if shows_values else verdict


def _memory_text(record: MemoryRecord) -> str:
    if record.deleted:
        return f"is deleted (was {format_value(record.old)})"
    if record.source == ENGINE and isinstance(record.value, dict) and isinstance(record.old, dict):
        changed = {name: value for name, value in record.value.items() if record.old.get(name) != value}
        return "has " + ", ".join(f"{name} = {format_value(value)}" for name, value in changed.items()) + " now"
    was = "" if record.created or record.old == record.value else f" (was {format_value(record.old)})"
    return f"= {format_value(record.value)}{was}"


def _countdown_text(record: CountdownRecord) -> str:
    return {
        "began": f"fires in {record.seconds or 0.0:g} s",
        "broken": "is paused: its condition does not hold",
        "failed": f"never fires: {record.reason}",
    }.get(record.status, record.status)


def _kept_text(record: KeptRecord) -> str:
    return {
        "kept": f"is kept for {record.seconds or 0.0:g} s: no rule waits for it yet",
        "taken": f"was kept, and {record.rule} takes it now",
        "expired": "expired: no rule waited for it",
        "taken-back": "is no longer kept",
    }.get(record.status, record.status)


def _cue_text(record: CueRecord, sources: bool) -> str:
    by = f" by {record.source}" if sources else ""
    since = f" after {record.since:.1f} s" if record.since is not None else ""
    return {
        "marked": _add(f"is marked{by}", record.text),
        "undone": f"is taken back{by}",
        "filled": f"is bridged by task {record.task}{since}",
        "answered": f"is answered by task {record.task}{since}",
    }.get(record.status, record.status)


def _failure_text(record: FailureRecord, sources: bool) -> str:
    when = "when the robot is back" if record.seconds is None else f"in {record.seconds:g} s"
    says = _source_note(record.source, sources)
    return {
        "asked": _add("failed, and somebody is asked what to do", record.reason),
        "waiting": _add(f"failed, and is repeated {when}", record.reason),
        "repeated": f"is repeated as task {record.by}{says}" if sources else "is repeated",
        "gone-on": _add("failed, and the study goes on without it", record.reason) + says,
        "dropped": _add("failed, and is no longer asked about", record.reason),
    }.get(record.status, record.status)


def _stop_words(record: StopRecord) -> RecordWords:
    by = f"by {record.source}" if record.source else ""
    if record.status == "let-go":
        text = f"{stopper_words(record.source)} is no longer pressed; everything stays stopped"
        return RecordWords("stop", "let go", text, ": ")
    if record.status != "latched":
        return RecordWords("stop", record.status, by)
    answers = (("confirmed", record.confirmed), ("NOT confirmed", record.unconfirmed))
    texts = [f"{words} by {', '.join(parts)}" for words, parts in answers if parts]
    texts += [f"{', '.join(record.unstoppable)} CANNOT be stopped"] if record.unstoppable else []
    return RecordWords("stop", "latched", "; ".join(texts) or "confirmed by nobody", ": ")


def _session_words(record: SessionRecord, sources: bool) -> RecordWords:
    if record.status == "ended":
        text = "; ".join(filter(None, (record.reason, describe_open_goals(record.open))))
        return RecordWords("session", "ended", text, ": ")
    away = "" if record.downtime is None else f" after {record.downtime:.1f} s without engine"
    about = (
        [f"{record.scenario}, mode {record.mode}, robot {record.robot}, seed {record.seed}"] if record.scenario else []
    )
    who = (record.participant, record.condition) if sources else ()
    waits = "nothing begins on the robot until a wizard takes control" if record.waits_for_wizard else ""
    text = ", ".join(filter(None, (*about, *who, record.reason, waits)))
    return RecordWords("session", f"{record.status}{away}", text, ": ")


def _report_words(record: CheckRecord | OutcomeRecord | RecordingRecord | SyncRecord, sources: bool) -> RecordWords:
    match record:
        case CheckRecord():
            text = _add(record.text or record.id, ", ".join(filter(None, (record.value, record.reason))))
            return RecordWords("check", record.result, text + _source_note(record.source, sources), ": ")
        case OutcomeRecord():
            text = f"{record.reason}{_source_note(record.source, sources)}".removeprefix(", ")
            return RecordWords("session", f"counts as {record.status}", text, ": ")
        case RecordingRecord():
            size = "" if record.bytes is None or not sources else f"{record.bytes:,} bytes"
            parts = (record.reason or record.path, size) if sources else (record.reason,)
            return RecordWords("recording", record.status, _add(record.name, ", ".join(filter(None, parts))), ": ")
        case SyncRecord():
            return RecordWords(
                "sync", f"mark {record.number}", " ".join(filter(None, (record.medium, record.text))), ": "
            )


def _add(text: str, more: str) -> str:
    return f"{text}: {more}" if more else text


def _duration_note(seconds: float | None) -> str:
    return "" if seconds is None else f", {seconds:.1f} s"


def _source_note(source: str, sources: bool) -> str:
    return f", says {source}" if sources and source != ENGINE else ""
