"""What tasks are and what became of them, in words. Pure; knows no screen."""

from __future__ import annotations

import json

from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.kernel.records import (
    AnyRecord,
    CheckRecord,
    KeptRecord,
    NoteRecord,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    StopRecord,
    TaskRecord,
    stopper_words,
)
from rise_engine.scenario.model import normal_topic
from rise_tui.model import control
from rise_tui.model.notice import Notice
from rise_tui.rendering.text import format_value

FUNCTION_LABELS = {
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
    "note": "note",
    "robot": "robot",
    "fault": "rule",
    "check": "check",
    "outcome": "outcome",
    "recording": "recording",
    "sync": "sync",
}
"""A task's function in a word or two."""


def task_label(function: str, behavior: str) -> str:
    """A task in words."""
    return f"{FUNCTION_LABELS.get(function, function)} {describe_behavior(function, behavior)}".strip()


def act_label(function: str, behavior: str) -> str:
    """An act by its name; free speech by what is said."""
    return f"“{behavior}”" if function == "say" else behavior


def completion_message(function: str, behavior: str) -> str:
    """What a task without any row of its own has done, in words; empty for others."""
    match function:
        case "raiseEventTopic":
            return f"raised {normal_topic(behavior)}"
        case "assignValue":
            try:
                values = json.loads(behavior)
            except (ValueError, RecursionError):
                return behavior.strip()
            if not isinstance(values, dict):
                return behavior.strip()
            return ", ".join(f"{key} = {format_value(value)}" for key, value in values.items())
        case _:
            return ""


def record_notice(record: AnyRecord) -> Notice | None:
    """What to tell the wizard about a record, whoever caused it; None for most."""
    match record:
        case TaskRecord(status="REJECTED"):
            return Notice(f"{task_label(record.function, record.behavior)} was rejected: {record.reason}", "wait")
        case TaskRecord(status="ABORTED"):
            return Notice(f"{task_label(record.function, record.behavior)} failed: {record.reason}", "fault")
        case KeptRecord(status="kept"):
            event = normal_topic(record.topic)
            return Notice(f"{event} is kept for {record.seconds:g} s: no rule waits for it yet", "wait")
        case KeptRecord(status="taken"):
            return Notice(f"{normal_topic(record.topic)} was kept, and {record.rule} takes it now")
        case KeptRecord(status="taken-back"):
            return Notice(f"{normal_topic(record.topic)} is not kept any more")
        case RuleRecord(status="faulted"):
            return Notice(f"rule {record.name} was stopped by a fault: {record.reason}", "fault")
        case StopRecord(status="let-go"):
            return Notice(f"{stopper_words(record.source)} is not pressed any more; everything stays stopped", "wait")
        case NoteRecord(source="engine"):
            return Notice(record.text, "wait")
        case NoteRecord():
            return Notice(f"note by {control.short_name(record.source)}: {record.text}")
        case CheckRecord(result="failed"):
            return Notice(f"the check failed: {record.text or record.id}{_add(record.reason)}", "fault")
        case OutcomeRecord():
            return Notice(f"the session counts as {record.status}{_add(record.reason)}")
        case RecordingRecord(status="stalled" | "failed"):
            return Notice(f"the recording {record.name} has {record.status}{_add(record.reason)}", "fault")
        case RobotRecord(status="lost" | "degraded"):
            return Notice(f"robot {record.status}: {record.detail}", "fault")
        case _:
            return None


def _add(reason: str) -> str:
    return f": {reason}" if reason else ""
