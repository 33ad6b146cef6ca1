"""Sentences for the wizard about tasks and their results. Pure, without a screen."""

from __future__ import annotations

import json
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.kernel.record_words import FUNCTION_WORDS, words_of
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
from rise_tui.rendering.text import clean, format_value, quoted

Level: TypeAlias = Literal["info", "wait", "fault"]
"""Information, needs attention, wrong."""


class Notice(Struct, frozen=True):
    """A sentence and its importance."""

    text: str
    level: Level = "info"


def short_name(name: str | None) -> str:
    """`anna` for `wizard:anna`; a program keeps its whole name."""
    return clean(stopper_words(name or "nobody").removeprefix("wizard:").removeprefix("observer:"))


FUNCTION_LABELS = FUNCTION_WORDS | {
    **{kind: kind for kind in ("note", "robot", "check", "outcome", "recording", "sync")},
    "fault": "rule",
}
"""The topic of a log row in a word or two: a task's function, or the kind of a remark."""


def task_label(function: str, behavior: str) -> str:
    """A task in words."""
    return f"{FUNCTION_WORDS.get(function, function)} {describe_behavior(function, behavior)}".strip()


def act_label(function: str, behavior: str) -> str:
    """An act by its name, free speech by its words."""
    return quoted(behavior) if function == "say" else behavior


def completion_message(function: str, behavior: str) -> str:
    """The effect of a task without a row of its own, in words; empty for others."""
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
    """The notice about a record, whatever its source; None for most."""
    words = words_of(record)
    match record:
        case TaskRecord(status="REJECTED"):
            return Notice(words.full_sentence, "wait")
        case OutcomeRecord():
            return Notice(f"the {words.full_sentence}")
        case TaskRecord(status="ABORTED") | RuleRecord(status="faulted") | CheckRecord(result="failed"):
            return Notice(words.full_sentence, "fault")
        case RecordingRecord(status="stalled" | "failed") | RobotRecord(status="lost" | "degraded"):
            return Notice(words.full_sentence, "fault")
        case KeptRecord(status="kept" | "taken" | "taken-back"):
            return Notice(words.sentence, "wait" if record.status == "kept" else "info")
        case StopRecord(status="let-go"):
            return Notice(words.text, "wait")
        case NoteRecord(source="engine"):
            return Notice(record.text, "wait")
        case NoteRecord():
            return Notice(f"note by {short_name(record.source)}: {record.text}")
        case _:
            return None
