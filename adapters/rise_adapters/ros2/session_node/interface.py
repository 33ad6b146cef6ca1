"""The session for other ROS nodes (docs/explanation/ros2.md):

    rise/domain_task    action rise_interfaces/action/DomainTask: submit a task, follow it, cancel it
    rise/get_memory     service rise_interfaces/srv/GetMemory: one key of the working memory
    rise/rule_state     the steps and states of rules
    rise/task_state     the status of all tasks
    rise/record         every record of the session
    /diagnostics        the state of session, robot, recording and connection, once a second

The engine's loop stays free for a wizard's key: goals, requests to cancel and outgoing records are handled in slices,
and their waiting number is bounded.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from pathlib import Path
from time import time_ns

from rise_adapters.ros2.record_messages import make_header
from rise_adapters.ros2.session_node.domain_task import DomainTaskServer
from rise_adapters.ros2.session_node.neighbours import NeighbourSessions
from rise_adapters.ros2.session_node.record_topics import RecordTopics
from rise_adapters.ros2.transport.port import Message, PortError, QoS, SendReply, Transport
from rise_engine.base.json_codec import encode
from rise_engine.base.lag_meter import LagMeter
from rise_engine.base.text import escape_surrogates
from rise_engine.base.time_slicer import TimeSlicer
from rise_engine.expression import lookup
from rise_engine.kernel.inputs import Note
from rise_engine.kernel.records import TaskRecord
from rise_engine.privacy.private_values import PrivateValues
from rise_engine.run.protocol import client as client_protocol
from rise_engine.run.server.hub import SessionHub

_LOG = logging.getLogger(__name__)

# --- the memory -------------------------------------------------------------------------------------------------------

GET_MEMORY, GET_MEMORY_TYPE = "rise/get_memory", "rise_interfaces/srv/GetMemory"
_JSON_TYPES = {"{": "object", "[": "array", '"': "string", "t": "boolean", "f": "boolean", "n": "null"}
"""The type by the first character of a JSON value; all others are numbers."""


class MemoryService:
    """Answers from the view of the session, so that it never waits for the engine."""

    def __init__(self, transport: Transport, hub: SessionHub, private: PrivateValues) -> None:
        """`private`: clients get `{key}` instead of its values. Raises PortError if the transport lacks the type."""
        self._private = private
        self._hub = hub
        self._service = transport.serve(GET_MEMORY, GET_MEMORY_TYPE, self._take_request)

    def close(self) -> None:
        self._service.close()

    def _take_request(self, request: Message, reply: SendReply) -> None:
        memory = self._hub.engine.scenario.table_memory
        memory.update((key, entry.value) for key, entry in self._hub.view.memory.items())
        found, value = lookup(memory, request["request_by_key"])
        response: Message = {"found": found}
        if found:
            value = self._private.read(request["request_by_key"], value)
            text = encode(value).decode()
            response |= {"value": text, "type": _JSON_TYPES.get(text[0], "number")}
        try:
            reply(response)
        except PortError as error:
            _LOG.warning("a request for the memory could not be answered: %s", error)


# --- diagnostics ------------------------------------------------------------------------------------------------------

DIAGNOSTICS_TOPIC = "/diagnostics"
DIAGNOSTICS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
DIAGNOSTICS_SECONDS = 1.0

OK, WARN, ERROR, STALE = range(4)
"""Levels of diagnostic_msgs/msg/DiagnosticStatus."""

LAG_WARN, LAG_ERROR = 0.05, 0.5
"""Maximum delays of the engine's loop in seconds. A key that takes longer than the first feels slow."""


def session_statuses(hub: SessionHub, lag: tuple[float, float], ros: Message, private: PrivateValues) -> list[Message]:
    """One DiagnosticStatus for each part of the session.

    `lag`: the maximum delay of the loop in seconds, recently and ever. `ros`: the status of the connection to ROS.
    `private`: the values to omit.
    """
    return [_session_status(hub, private), _robot_status(hub), _journal_status(hub), _lag_status(hub, *lag), ros]


def make_status(hub: SessionHub, name: str, level: int, message: str, values: Mapping[str, object]) -> Message:
    """A DiagnosticStatus whose hardware is the robot."""
    return {
        "level": level,
        "name": f"rise: {name}",
        "message": escape_surrogates(message),
        "hardware_id": hub.engine.scenario.robot.name,
        "values": [{"key": key, "value": escape_surrogates(str(value))} for key, value in values.items()],
    }


def _session_status(hub: SessionHub, private: PrivateValues) -> Message:
    engine, view = hub.engine, hub.view
    scenario = engine.scenario
    level, message = OK, "running" if view.running else "idle"
    if engine.failure is not None:
        level, message = ERROR, f"the engine stopped: {engine.failure or type(engine.failure).__name__}"
    elif view.ended or engine.ended:
        level, message = STALE, f"the session has ended: {view.end_reason}".removesuffix(": ")
    elif view.session is None:
        level, message = STALE, "the session has not begun yet"
    elif view.stop.latched:
        level, message = WARN, "everything is stopped, until the stop is released"
        if view.stop.unconfirmed:
            level, message = ERROR, f"stopped, but not confirmed by {', '.join(view.stop.unconfirmed)}"
    running = [view.tasks[id].behavior for id in view.running if id in view.tasks]
    values = {
        "title": scenario.title,
        "mode": scenario.mode,
        "scenario_hash": scenario.hash,
        "seconds": f"{max(engine.clock.now(), 0.0):.1f}",
        "records": view.seq,
        "acts running": private.hide_value(", ".join(running[:20])),
        "acts waiting": len(view.waiting),
        "rules running": ", ".join(view.running_rules()[:20]),
        "control": view.control or "nobody",
        "clients": len(hub.clients),
        "stop": view.stop.status,
        "stop confirmed": ", ".join(view.stop.confirmed),
        "stop not confirmed": ", ".join(view.stop.unconfirmed),
    }
    return make_status(hub, "session", level, message, values)


def _robot_status(hub: SessionHub) -> Message:
    robot = hub.view.robot
    if robot is None:
        level, message = STALE, "no word from the robot yet"
    else:
        level = {"connected": OK, "degraded": WARN}.get(robot.status, ERROR)
        message = f"{robot.status}: {robot.detail}" if robot.detail else robot.status
    profile = hub.engine.scenario.robot
    driver = "simulated" if hub.engine.scenario.mode == "debug" else profile.driver
    since = {"since": robot.wall} if robot is not None else {}
    return make_status(hub, "robot link", level, message, {"robot": profile.title, "driver": driver, **since})


def _journal_status(hub: SessionHub) -> Message:
    journaling = hub.engine.journal_status
    if journaling.trouble:
        level, message = ERROR, f"nothing can be recorded, so the session is paused: {journaling.sentence}"
    elif journaling.behind:
        level, message = WARN, f"the disk is {journaling.behind:.1f} s behind"
    elif not hub.folder:
        level, message = OK, "this session is not recorded"
    else:
        level, message = OK, "recording"
    values = {"folder": Path(hub.folder).name, "durable": journaling.durable, "behind": f"{journaling.behind:.1f}"}
    return make_status(hub, "journal", level, message, values)


def _lag_status(hub: SessionHub, recent: float, most: float) -> Message:
    level = OK if recent < LAG_WARN else WARN if recent < LAG_ERROR else ERROR
    message = "in time" if level == OK else f"the engine was up to {recent:.2f} s late in the last seconds"
    return make_status(hub, "loop lag", level, message, {"recent (s)": f"{recent:.4f}", "most (s)": f"{most:.4f}"})


SOURCE = "ros:domain_task"
"""The source of tasks that arrive as goals. ROS does not name the sender; a node that releases a stop names itself."""

SLICE_SECONDS = 0.0005
"""Seconds of work in one turn of the loop. A console's key waits for some turns, and may wait for 10 ms."""
LAST_MESSAGES_SECONDS = 1.0
"""Seconds for the last messages at the end."""
GONE_REASON = "the session is not on ROS any more"


class RosSessionInterface:
    """One session on ROS. All methods belong to the engine's loop."""

    def __init__(
        self, transport: Transport, hub: SessionHub, neighbours: NeighbourSessions, *, rosout: bool = True
    ) -> None:
        """Create it in the running loop, before the engine starts, so that it misses no record. `neighbours`: other
        sessions under the same names. `rosout`: whether events also go to /rosout.

        Raises PortError if the transport does not have the types of `rise_interfaces`.
        """
        self._transport = transport
        self._hub = hub
        self._neighbours = neighbours
        self._loop = asyncio.get_running_loop()
        self._client = hub.attach("domain_task", "node", SOURCE)
        self._dropped = 0
        """The number of unpublished records that were noted."""
        self._closed = False
        self._slicer = TimeSlicer(self._run_piece, SLICE_SECONDS)
        self._private = PrivateValues(hub.engine.scenario)
        for key, entry in hub.view.memory.items():  # of a recovered session
            self._private.note_memory(key, entry.value)
        self._topics = RecordTopics(transport, hub, self._client.source, self._private, rosout=rosout)
        self._lag = LagMeter(self._loop)
        self._diagnostics = transport.publisher(DIAGNOSTICS_TOPIC, DIAGNOSTICS_TYPE, QoS())
        self._memory = MemoryService(transport, hub, self._private)
        self._tasks = DomainTaskServer(transport, hub, self._client, self._topics, self._slicer.wake)
        hub.subscribe(self._take_update)
        hub.engine.on_ended(self._end_goals)
        self._timer = self._loop.call_later(DIAGNOSTICS_SECONDS, self._diagnose)

    async def close(self) -> None:
        """End the running goals, publish the rest, and leave."""
        if self._closed:
            return
        self._end_goals()
        self._closed = True
        self._timer.cancel()
        self._lag.close()
        self._slicer.cancel()
        self._slicer.run_slice(LAST_MESSAGES_SECONDS)
        self._publish_diagnostics()
        await self._tasks.close(GONE_REASON)
        for handle in (self._memory, self._topics, self._diagnostics):
            handle.close()
        self._hub.detach(self._client)

    def _run_piece(self) -> bool:
        """Do one piece of each kind of work, so that none delays another."""
        did_task = self._tasks.work()
        return self._topics.publish_next() or did_task

    def _take_update(self, update: client_protocol.Update) -> None:
        """Process every record, in the engine's step."""
        if self._closed or isinstance(update, client_protocol.JournalStatus | client_protocol.Heartbeat):
            return
        update = self._private.hide(update)  # listeners on ROS are not the wizard
        if isinstance(update, TaskRecord):
            self._tasks.take_record(update)
        self._topics.enqueue(update)
        self._slicer.wake()

    def _end_goals(self) -> None:
        """End all goals because the session or this node ends, so that none waits forever."""
        engine = self._hub.engine
        if engine.failure is not None:
            reason = f"the engine stopped: {engine.failure or type(engine.failure).__name__}"
        elif engine.ended:
            reason = f"the session has ended: {self._hub.view.end_reason}".removesuffix(": ")
        else:
            reason = GONE_REASON
        self._tasks.end_all(reason)

    # --- status -------------------------------------------------------------------------------------------------

    def _diagnose(self) -> None:
        self._timer = self._loop.call_later(DIAGNOSTICS_SECONDS, self._diagnose)
        self._publish_diagnostics()
        dropped = self._topics.dropped
        if dropped > self._dropped and not self._hub.engine.ended:
            text = f"{dropped - self._dropped:,} records were not published on ROS: they came faster than that takes"
            self._dropped = dropped
            self._hub.submit(self._client, Note(text=text), _ignore)

    def _publish_diagnostics(self) -> None:
        statuses = session_statuses(self._hub, (self._lag.recent, self._lag.max), self.status(), self._private)
        try:
            self._diagnostics.publish({"header": make_header(time_ns()), "status": statuses})
        except PortError as error:
            _LOG.debug("no diagnostics: %s", error)

    def status(self) -> Message:
        """The state of the connection, as a diagnostic_msgs/msg/DiagnosticStatus."""
        topics, tasks, lost = self._topics, self._tasks, self._transport.failure()
        others = self._neighbours.others
        level, message = OK, self._transport.about
        if lost:
            level, message = ERROR, lost
        elif topics.error:
            level, message = ERROR, f"records are not published: {topics.error}"
        elif others:
            same = "moves the same robot" if self._neighbours.shared_with(others[0]) else "has the same names"
            level, message = WARN, f"another session {same}: {others[0]}"
        elif topics.dropped > self._dropped:
            level, message = WARN, "records come faster than they can be published; some are missing"
        values = {
            "node": self._transport.node,
            "transport": self._transport.kind,
            "goals running": tasks.running,
            "goals waiting to be accepted": tasks.waiting,
            "goals refused": tasks.refused,
            "records waiting": topics.waiting,
            "records dropped": topics.dropped,
            "other sessions": len(others),
        }
        return make_status(self._hub, "ros", level, message, values)


def _ignore(reply: client_protocol.Reply) -> None:
    """Ignore an answer."""
