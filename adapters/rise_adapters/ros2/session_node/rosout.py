"""What a session tells on `/rosout`, where people who work with ROS look first (`ros2 topic echo /rosout`,
rqt_console): that it began and ended, how the robot stands, what was stopped, and what went wrong. The whole is on
`rise/record`.

It is published as rcl does (rcl_interfaces/msg/Log, latched, 1,000 deep), but not through rclpy's logger: that also
writes to standard error, and a pipe that nobody reads would hold the session up.
"""

from __future__ import annotations

from typing import Final, TypeAlias

from rise_adapters.ros2.transport.port import Message, QoS
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    NoteRecord,
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
_LONGEST = 200
"""Characters of what somebody asked for."""

LogLine: TypeAlias = tuple[int, str]
"""A level, and what happened."""


def log_line_for_record(record: AnyRecord) -> LogLine | None:
    """What is told of a record; None: nothing."""
    match record:
        case SessionRecord():
            return _session(record)
        case RobotRecord():
            level = {"connected": INFO, "degraded": WARN}.get(record.status, ERROR)
            return level, _with(f"robot {record.status}", record.detail)
        case StopRecord():
            return _stop(record)
        case TaskRecord(status="REJECTED"):
            return WARN, _with(
                f"task rejected: {_task(record.function, record.behavior, record.source)}", record.reason
            )
        case TaskRecord(status="ABORTED"):
            what = "act failed" if record.function == "startCommunicationRobotAct" else "task failed"
            return WARN, _with(f"{what}: {_task(record.function, record.behavior, record.source)}", record.reason)
        case ActionRecord(status="failed" | "timed-out" | "lost"):
            return WARN, _with(f"action {record.status}: {record.type} of {record.act}", record.reason)
        case RuleRecord(status="faulted"):
            return ERROR, _with(f"rule faulted: {record.name}", record.reason)
        case NoteRecord() if record.source == "engine" or record.source.startswith("ros:"):
            return INFO, f"note: {record.text}"
        case _:
            return None


def log_line_for_refusal(task: Message) -> LogLine:
    """Of a task that was rejected before it came to the record, as it stands on `rise/task_state`."""
    what = _task(task["function_type"], task["domain_task_behavior"], task["source"])
    return WARN, _with(f"task rejected: {what}", task["reason"])


def _session(record: SessionRecord) -> LogLine:
    if record.status == "ended":
        return INFO, _with("session ended", record.reason)
    about = f"{record.scenario}, mode {record.mode}, robot {record.robot}" if record.scenario else record.reason
    return (INFO if record.status == "started" else WARN), _with(f"session {record.status}", about)


def _stop(record: StopRecord) -> LogLine:
    if record.status == "requested":
        return WARN, f"stop requested by {record.source}"
    if record.status == "released":
        return INFO, f"stop released by {record.source}"
    if record.unconfirmed:
        return ERROR, f"stopped, but NOT confirmed by {', '.join(record.unconfirmed)}"
    return WARN, _with("stopped", (record.confirmed and f"confirmed by {', '.join(record.confirmed)}") or "")


def _task(function: str, behavior: str, source: str) -> str:
    return f"{' '.join(filter(None, [function, behavior]))[:_LONGEST]} (from {source})"


def _with(what: str, why: str) -> str:
    return f"{what}: {why}" if why else what
