"""The topics of a session's events: `rise/record`, `rise/task_state`, `rise/rule_state`, and `/rosout`.

People who work with ROS look at `/rosout` first (`ros2 topic echo /rosout`, rqt_console). A session reports there its
start and end, the state of the robot, stops and faults. `rise/record` has everything.

It is published as by rcl (rcl_interfaces/msg/Log, latched, 1,000 deep), but not through rclpy's logger. That logger
also writes to standard error, and an unread pipe would block the session.
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
"""Levels of rcl_interfaces/msg/Log."""
_LONGEST = 1_000
"""Maximum number of characters of a line."""

LogLine: TypeAlias = tuple[int, str]
"""A level and a sentence."""


def log_line_for_record(record: AnyRecord) -> LogLine | None:
    """The line for a record; None: no line."""
    words = words_of(record)
    sentence = words.full_sentence[:_LONGEST]
    match record:
        case SessionRecord(status=status):
            return WARN if status == "recovered" else INFO, sentence
        case RobotRecord(status=status):
            return {"connected": INFO, "degraded": WARN}.get(status, ERROR), sentence
        case StopRecord(status="let-go"):
            return INFO, words.text
        case StopRecord(status=status):
            level = ERROR if record.unconfirmed else INFO if status == "released" else WARN
            return level, sentence
        case TaskRecord(status="REJECTED" | "ABORTED"):
            return WARN, words_of(record, sources=True).full_sentence[:_LONGEST]
        case ActionRecord(status="failed" | "timed-out" | "lost"):
            return WARN, f"{words.kind} of {record.act} {words.text}"
        case RuleRecord(status="faulted"):
            return ERROR, sentence
        case RecordingRecord(status="stalled" | "failed"):
            return WARN, sentence
        case OutcomeRecord():
            return INFO, f"the {sentence}"
        case NoteRecord() if record.source == "engine" or record.source.startswith("ros:"):
            return INFO, f"note: {record.text}"
        case _:
            return None


_LOG = logging.getLogger(__name__)

MAX_WAITING = 20_000
"""Maximum number of waiting records. Publishing them takes about 2 seconds."""

_NO_SEQ = 0
"""The number of a task that never reached the record, whose numbers begin with 1."""
REPEATED_STATUS = "repeated"
"""The status of a rule state that is repeated for later subscribers: nothing has happened."""


class RecordTopics:
    """Publishes records. `enqueue` is quick and may be called in a step of the engine. `publish_next` does the work."""

    def __init__(
        self, transport: Transport, hub: SessionHub, source: str, private: PrivateValues, *, rosout: bool = True
    ) -> None:
        """`source`: the source of tasks whose `ref` is the id of a DomainTask goal. `private`: the values to omit in
        refusals; records are already filtered. Raises PortError."""
        self._private = private
        self.dropped = 0
        """The number of records that were not published, because too many were waiting."""
        self.error = ""
        """Why the latest message could not be published; empty: it was."""
        self._session = Path(hub.folder).name
        self._source = source
        self._waiting: deque[AnyRecord] = deque()
        self._records = transport.publisher(RECORD, RECORD_TYPE, QoS(RECORDS_LATCHED, latched=True))
        self._tasks = transport.publisher(TASK_STATE, TASK_STATE_TYPE, QoS(TASKS_LATCHED, latched=True))
        # A latched topic keeps this many messages. A rule's last message is sent again before it drops out, so that the
        # topic always contains the state of each running rule.
        self._depth = max(RULES_LATCHED, 2 * len(hub.engine.scenario.rules))
        self._rules = transport.publisher(RULE_STATE, RULE_STATE_TYPE, QoS(self._depth, latched=True))
        self._rosout = transport.publisher(ROSOUT, ROSOUT_TYPE, ROSOUT_QOS) if rosout else None
        self._logger = transport.node.strip("/").replace("/", ".")
        self._rule_messages = 0
        self._running: dict[str, tuple[int, Message]] = {}
        """The latest message of each running rule, with its number; the oldest message first."""
        for name, rule in hub.view.rules.items():  # of a recovered session
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
        """Add a task that was rejected before it reached the record. Its `ref` is the goal's id, if any."""
        wall = datetime.now().astimezone().isoformat()
        what = (task.function, task.behavior, task.calling_type, self._source)
        refused = TaskRecord(_NO_SEQ, 0.0, wall, 0, *what, "REJECTED", reason, ref=task.ref)
        self.enqueue(self._private.hide(refused))

    def publish_next(self) -> bool:
        """Publish one waiting record. False: there was none."""
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
        # Specific topics come first: nodes that read the whole record are rarely in a hurry.
        if isinstance(record, RuleRecord):
            self._publish_rule(record, header)
        elif isinstance(record, TaskRecord):  # even without listeners: later ones get the latest
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
        """Publish a rule's message. `again`: its form for later subscribers; None: the rule has ended."""
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
            except UnicodeEncodeError:  # a lone surrogate, from bytes of a file name that are not text
                publisher.publish(escape_all_surrogates(message))
        except PortError as error:
            if not self.error:
                _LOG.warning("what happens in the session could not be published: %s", error)
            self.error = str(error)
        else:
            self.error = ""
