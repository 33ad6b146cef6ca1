"""Records as messages of `rise_interfaces`, the same on a session's topics and in the bag of a recorded session."""

from __future__ import annotations

from datetime import datetime

from rise_adapters.ros2.transport.port import Message
from rise_engine.kernel.records import AnyRecord, RuleRecord, TaskRecord
from rise_engine.kernel.view import RuleView
from rise_engine.session.journal_format import encode_record

RECORD, TASK_STATE, RULE_STATE = "rise/record", "rise/task_state", "rise/rule_state"
RECORD_TYPE = "rise_interfaces/msg/Record"
TASK_STATE_TYPE = "rise_interfaces/msg/TaskState"
RULE_STATE_TYPE = "rise_interfaces/msg/RuleState"

RECORDS_LATCHED = 1000
TASKS_LATCHED = 100
RULES_LATCHED = 100
"""Minimum number; otherwise twice the number of the scenario's rules."""


def record_message(record: AnyRecord, session: str, header: Message) -> Message:
    """A `rise_interfaces/msg/Record`. `session`: its name; `header`: the result of `make_header`."""
    return {
        "header": header,
        "session": session,
        "seq": record.seq,
        "t": record.t,
        "kind": record.__struct_config__.tag,
        "json": encode_record(record).decode(),
    }


def task_state_message(record: TaskRecord, header: Message) -> Message:
    """A `rise_interfaces/msg/TaskState`."""
    return {
        "header": header,
        "id": record.id,
        "domain_task_behavior": record.behavior,
        "function_type": record.function,
        "calling_type": record.calling_type,
        "source": record.source,
        "status": record.status,
        "reason": record.reason,
        "position": -1 if record.position is None else record.position,
        "goal_id": record.ref if record.ref is not None and record.source.startswith("ros:") else "",
    }


def rule_state_message(name: str, status: str, rule: RuleRecord | RuleView, header: Message) -> Message:
    """A `rise_interfaces/msg/RuleState`."""
    return {
        "header": header,
        "rule": name,
        "status": status,
        "state": rule.state or "",
        "previous_state": rule.previous or "",
        "trigger": rule.trigger or "",
        "priority": float(rule.priority),
    }


def wall_to_nanoseconds(wall: str) -> int:
    """The time of a record's label, in nanoseconds since 1970; 0 without one."""
    if not wall:
        return 0
    return round(datetime.fromisoformat(wall).timestamp() * 1e6) * 1000


def make_header(since_1970: int) -> Message:
    """The std_msgs/msg/Header of a time in nanoseconds."""
    seconds, rest = divmod(since_1970, 1_000_000_000)
    return {"stamp": {"sec": seconds, "nanosec": rest}}
