"""The topics on which a session tells what happens: `rise/record`, `rise/task_state`, `rise/rule_state`, and `/rosout`
for those who look there.

What a session tells on `/rosout`, where people who work with ROS look first (`ros2 topic echo /rosout`,
rqt_console): that it began and ended, how the robot stands, what was stopped, and what went wrong. The whole is on
`rise/record`.

It is published as rcl does (rcl_interfaces/msg/Log, latched, 1,000 deep), but not through rclpy's logger: that also
writes to standard error, and a pipe that nobody reads would hold the session up.
"""

from __future__ import annotations

import logging
from collections import deque
from datetime import datetime
from pathlib import Path
from time import time_ns
from typing import Final, TypeAlias

from rise_adapters.ros2.record_messages import (
    RECORD,
    RECORD_TYPE,
    RECORDS_LATCHED,
    RULE_STATE,
    RULE_STATE_TYPE,
    RULES_LATCHED,
    TASK_STATE,
    TASK_STATE_TYPE,
    TASKS_LATCHED,
    make_header,
    record_message,
    rule_state_message,
    task_state_message,
    wall_to_nanoseconds,
)
from rise_adapters.ros2.transport.port import Message, PortError, Publisher, QoS, Transport
from rise_engine.base.text import escape_all_surrogates
from rise_engine.kernel.inputs import Submit
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
from rise_engine.privacy.private_values import PrivateValues
from rise_engine.run.server.hub import SessionHub

# --- records as lines of a log ----------------------------------------------------------------------------------------

ROSOUT, ROSOUT_TYPE = "/rosout", "rcl_interfaces/msg/Log"
ROSOUT_QOS: Final = QoS(depth=1000, latched=True)
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


_LOG = logging.getLogger(__name__)

MAX_WAITING = 20_000
"""Records that wait to be published at most; it takes 2 seconds or so to publish them."""

_NO_SEQ = 0
"""Of a task that never came to the record; that begins with 1."""
REPEATED_STATUS = "repeated"
"""The status of a rule state that is said again only for those who subscribe later: nothing has happened."""


class RecordTopics:
    """Publishes records. `enqueue` is quick and may be called in a step of the engine; `publish_next` does the work."""

    def __init__(
        self, transport: Transport, hub: SessionHub, source: str, private: PrivateValues, *, rosout: bool = True
    ) -> None:
        """`source`: of tasks whose `ref` is the id of a DomainTask goal. `private`: what stays out of what is refused;
        the records that come have gone through it. Raises PortError."""
        self._private = private
        self.dropped = 0
        """Records that were never published, because too many were waiting."""
        self.error = ""
        """Why the latest message could not be published; empty when it was."""
        self._session = Path(hub.folder).name
        self._source = source
        self._waiting: deque[AnyRecord] = deque()
        self._records = transport.publisher(RECORD, RECORD_TYPE, QoS(RECORDS_LATCHED, latched=True))
        self._tasks = transport.publisher(TASK_STATE, TASK_STATE_TYPE, QoS(TASKS_LATCHED, latched=True))
        # A latched topic holds so many of the latest messages, whatever they are about. So that they always hold the
        # state of each running rule, a rule's last message is sent again when it is about to fall out.
        self._depth = max(RULES_LATCHED, 2 * len(hub.engine.scenario.rules))
        self._rules = transport.publisher(RULE_STATE, RULE_STATE_TYPE, QoS(self._depth, latched=True))
        self._rosout = transport.publisher(ROSOUT, ROSOUT_TYPE, ROSOUT_QOS) if rosout else None
        self._logger = transport.node.strip("/").replace("/", ".")
        self._rule_messages = 0
        self._running: dict[str, tuple[int, Message]] = {}
        """By running rule, the number of its latest message, and that; the one that was said first comes first."""
        for name, rule in hub.view.rules.items():  # of a session that goes on
            if rule.running:
                state = rule_state_message(name, REPEATED_STATUS, rule, make_header(time_ns()))
                self._publish_rule_message(name, state, state)

    @property
    def waiting(self) -> int:
        return len(self._waiting)

    def enqueue(self, record: AnyRecord) -> None:
        if len(self._waiting) >= MAX_WAITING:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append(record)

    def enqueue_refusal(self, task: Submit, reason: str) -> None:
        """Tell of a task that was rejected before it came to the record. Its `ref` is the goal's id, if it was one."""
        wall = datetime.now().astimezone().isoformat()
        what = (task.function, task.behavior, task.calling_type, self._source)
        refused = TaskRecord(_NO_SEQ, 0.0, wall, 0, *what, "REJECTED", reason, ref=task.ref)
        self.enqueue(self._private.hide(refused))

    def publish_next(self) -> bool:
        """Publish one of those that wait; false when nothing did."""
        if not self._waiting:
            return False
        self._publish_record(self._waiting.popleft())
        return True

    def close(self) -> None:
        for publisher in (self._rules, self._tasks, self._records, self._rosout):
            if publisher is not None:
                publisher.close()

    def _publish_record(self, record: AnyRecord) -> None:
        header = make_header(wall_to_nanoseconds(record.wall))
        self._publish_log_line(log_line_for_record(record), header)
        # What is about one thing comes first: a node that hears the whole record is seldom the one in a hurry.
        if isinstance(record, RuleRecord):
            self._publish_rule(record, header)
        elif isinstance(record, TaskRecord):  # also while nobody hears it: who comes later gets the latest of them
            self._publish(
                self._tasks,
                task_state_message(record, header),
            )
        if record.seq != _NO_SEQ:
            self._publish(
                self._records,
                record_message(record, self._session, header),
            )

    def _publish_log_line(self, line: LogLine | None, header: Message) -> None:
        if line is None or self._rosout is None:
            return
        level, text = line
        self._publish(
            self._rosout, {"stamp": header["stamp"], "level": level, "name": self._logger, "msg": text, "file": "rise"}
        )

    def _publish_rule(self, record: RuleRecord, header: Message) -> None:
        message = rule_state_message(record.name, record.status, record, header)
        is_running = record.status in ("started", "entered", "stayed")
        self._publish_rule_message(record.name, message, {**message, "status": REPEATED_STATUS} if is_running else None)

    def _publish_rule_message(self, name: str, message: Message, again: Message | None) -> None:
        """`again`: how to say it for those who come later; None when the rule has ended."""
        running = self._running
        self._publish(self._rules, message)
        self._rule_messages += 1
        running.pop(name, None)
        if again is not None:
            running[name] = (self._rule_messages, again)
        while running:
            name = next(iter(running))
            number, again = running[name]
            if self._rule_messages - number < self._depth - 1:
                break
            self._publish(self._rules, again)
            self._rule_messages += 1
            del running[name]
            running[name] = (self._rule_messages, again)

    def _publish(self, publisher: Publisher, message: Message) -> None:
        try:
            try:
                publisher.publish(message)
            except UnicodeEncodeError:  # half a character, as it stands for the bytes of a file name that is no text
                publisher.publish(escape_all_surrogates(message))
        except PortError as error:
            if not self.error:
                _LOG.warning("what happens in the session could not be published: %s", error)
            self.error = str(error)
        else:
            self.error = ""
