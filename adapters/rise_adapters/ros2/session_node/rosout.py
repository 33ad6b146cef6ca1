"""What a session tells on `/rosout`, where people who work with ROS look first (`ros2 topic echo /rosout`,
rqt_console): that it began and ended, how the robot stands, what was stopped, and what went wrong. The whole is on
`rise/record`.

It is published as rcl does (rcl_interfaces/msg/Log, latched, 1,000 deep), but not through rclpy's logger: that also
writes to standard error, and a pipe that nobody reads would hold the session up.
"""

from __future__ import annotations

from typing import Final, TypeAlias

from rise_adapters.ros2.transport.port import QoS
from rise_engine.kernel.record_words import words_of
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    NoteRecord,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    SessionRecord,
    StopRecord,
    TaskRecord,
)

TOPIC, TYPE = "/rosout", "rcl_interfaces/msg/Log"
QOS: Final = QoS(depth=1000, latched=True)
INFO, WARN, ERROR = 20, 30, 40
"""Of rcl_interfaces/msg/Log."""
_LONGEST = 1_000
"""Characters of a line."""

LogLine: TypeAlias = tuple[int, str]
"""A level, and what happened."""


def log_line_for_record(record: AnyRecord) -> LogLine | None:
    """What is told of a record; None: nothing."""
    words = words_of(record)
    said = words.full_sentence[:_LONGEST]
    match record:
        case SessionRecord(status=status):
            return WARN if status == "recovered" else INFO, said
        case RobotRecord(status=status):
            return {"connected": INFO, "degraded": WARN}.get(status, ERROR), said
        case StopRecord(status="let-go"):
            return INFO, words.text
        case StopRecord(status=status):
            level = ERROR if record.unconfirmed else INFO if status == "released" else WARN
            return level, said
        case TaskRecord(status="REJECTED" | "ABORTED"):
            return WARN, words_of(record, sources=True).full_sentence[:_LONGEST]
        case ActionRecord(status="failed" | "timed-out" | "lost"):
            return WARN, f"{words.kind} of {record.act} {words.text}"
        case RuleRecord(status="faulted"):
            return ERROR, said
        case RecordingRecord(status="stalled" | "failed"):
            return WARN, said
        case OutcomeRecord():
            return INFO, f"the {said}"
        case NoteRecord() if record.source == "engine" or record.source.startswith("ros:"):
            return INFO, f"note: {record.text}"
        case _:
            return None
