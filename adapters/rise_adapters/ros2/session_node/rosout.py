"""What a session tells on `/rosout`, where people who work with ROS look first (`ros2 topic echo /rosout`,
rqt_console): that it began and ended, how the robot stands, what was stopped, and what went wrong. The whole is on
`rise/record`.

It is published as rcl does (rcl_interfaces/msg/Log, latched, 1,000 deep), but not through rclpy's logger: that also
writes to standard error, and a pipe that nobody reads would hold the session up.
"""

from __future__ import annotations

from typing import Final, TypeAlias

from rise_adapters.ros2.transport.port import QoS
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
    stopper_words,
)

TOPIC, TYPE = "/rosout", "rcl_interfaces/msg/Log"
QOS: Final = QoS(depth=1000, latched=True)
INFO, WARN, ERROR = 20, 30, 40
"""Of rcl_interfaces/msg/Log."""
_LONGEST = 200
"""Characters of what somebody asked for."""

LogLine: TypeAlias = tuple[int, str]
"""A level, and what happened."""


def log_line_for_record(record: AnyRecord) -> LogLine | None:
    """What is told of a record; None: nothing."""
    match record:
        case SessionRecord():
            return _session_line(record)
        case RobotRecord():
            level = {"connected": INFO, "degraded": WARN}.get(record.status, ERROR)
            return level, _add_reason(f"robot {record.status}", record.detail)
        case StopRecord():
            return _stop_line(record)
        case TaskRecord(status="REJECTED"):
            return WARN, _add_reason(f"task rejected: {_describe_task(record)}", record.reason)
        case TaskRecord(status="ABORTED"):
            what = "act failed" if record.function == "startCommunicationRobotAct" else "task failed"
            return WARN, _add_reason(f"{what}: {_describe_task(record)}", record.reason)
        case ActionRecord(status="failed" | "timed-out" | "lost"):
            return WARN, _add_reason(f"action {record.status}: {record.type} of {record.act}", record.reason)
        case RuleRecord(status="faulted"):
            return ERROR, _add_reason(f"rule faulted: {record.name}", record.reason)
        case RecordingRecord(status="stalled" | "failed"):
            return WARN, _add_reason(f"recording {record.name} {record.status}", record.reason)
        case OutcomeRecord():
            return INFO, _add_reason(f"the session counts as {record.status}", record.reason)
        case NoteRecord() if record.source == "engine" or record.source.startswith("ros:"):
            return INFO, f"note: {record.text}"
        case _:
            return None


def _session_line(record: SessionRecord) -> LogLine:
    if record.status == "ended":
        return INFO, _add_reason("session ended", record.reason)
    about = f"{record.scenario}, mode {record.mode}, robot {record.robot}" if record.scenario else record.reason
    return (INFO if record.status == "started" else WARN), _add_reason(f"session {record.status}", about)


def _stop_line(record: StopRecord) -> LogLine:
    if record.status == "requested":
        return WARN, f"stop requested by {record.source}"
    if record.status == "released":
        return INFO, f"stop released by {record.source}"
    if record.status == "let-go":
        return INFO, f"{stopper_words(record.source)} is not pressed any more; the stop can be released"
    if record.unconfirmed:
        return ERROR, f"stopped, but NOT confirmed by {', '.join(record.unconfirmed)}"
    return WARN, _add_reason("stopped", f"confirmed by {', '.join(record.confirmed)}" if record.confirmed else "")


def _describe_task(record: TaskRecord) -> str:
    return f"{' '.join(filter(None, [record.function, record.behavior]))[:_LONGEST]} (from {record.source})"


def _add_reason(what: str, why: str) -> str:
    return f"{what}: {why}" if why else what
