"""The session as other ROS nodes see it (docs/explanation/ros2.md):

    rise/domain_task    action rise_interfaces/action/DomainTask: submit a task, follow it, cancel it
    rise/get_memory     service rise_interfaces/srv/GetMemory: one key of the working memory
    rise/rule_state     what rules do, and in which state they are
    rise/task_state     what becomes of tasks, whoever submitted them
    rise/record         every record of the session
    /diagnostics        how session, robot, recording and connection are, once a second

Whatever comes in, the engine's loop stays free for a wizard's key: goals, requests to cancel, and records that go out
are worked off a slice at a time, and what waits has bounds.
"""

from __future__ import annotations

import asyncio
import logging
from time import time_ns

from rise_adapters.ros2.record_messages import make_header
from rise_adapters.ros2.session_node import diagnostics
from rise_adapters.ros2.session_node.domain_task import DomainTaskServer
from rise_adapters.ros2.session_node.memory_service import MemoryService
from rise_adapters.ros2.session_node.neighbours import NeighbourSessions
from rise_adapters.ros2.session_node.record_topics import RecordTopics
from rise_adapters.ros2.transport.port import Message, PortError, QoS, Transport
from rise_engine.base.lag_meter import LagMeter
from rise_engine.base.time_slicer import TimeSlicer
from rise_engine.kernel.inputs import Note
from rise_engine.kernel.records import TaskRecord
from rise_engine.privacy.private_values import PrivateValues
from rise_engine.run.protocol import client as client_protocol
from rise_engine.run.server.hub import SessionHub

_LOG = logging.getLogger(__name__)

SOURCE = "ros:domain_task"
"""The source of tasks that came as goals. Which node sent a goal, ROS does not say; who releases a stop says it."""

SLICE_SECONDS = 0.0005
"""For which work is done in one turn of the loop. A console's key waits for some turns, and may wait for 10 ms."""
GOODBYE_SECONDS = 1.0
"""For what is still to be published at the end."""
GONE_REASON = "the session is not on ROS any more"


class RosSessionInterface:
    """One session on ROS. All methods belong to the engine's loop."""

    def __init__(
        self, transport: Transport, hub: SessionHub, neighbours: NeighbourSessions, *, rosout: bool = True
    ) -> None:
        """Make it before the engine starts, so that it misses no record, inside the running loop. `neighbours`: other
        sessions under the same names. `rosout`: whether what happens is told on /rosout, too.

        Raises PortError when the transport does not have the types of `rise_interfaces`.
        """
        self._transport = transport
        self._hub = hub
        self._neighbours = neighbours
        self._loop = asyncio.get_running_loop()
        self._client = hub.attach("domain_task", "node", SOURCE)
        self._dropped = 0
        """Of the records that were never published, those that were noted."""
        self._closed = False
        self._slicer = TimeSlicer(self._work, SLICE_SECONDS)
        self._private = PrivateValues(hub.engine.scenario)
        for key, entry in hub.view.memory.items():  # of a session that goes on
            self._private.note_memory(key, entry.value)
        self._topics = RecordTopics(transport, hub, self._client.source, self._private, rosout=rosout)
        self._lag = LagMeter(self._loop)
        self._diagnostics = transport.publisher(diagnostics.TOPIC, diagnostics.TYPE, QoS())
        self._memory = MemoryService(transport, hub, self._private)
        self._tasks = DomainTaskServer(transport, hub, self._client, self._topics, self._slicer.wake)
        hub.subscribe(self._take_update)
        hub.engine.on_ended(self._end_goals)
        self._timer = self._loop.call_later(diagnostics.SECONDS, self._diagnose)

    async def close(self) -> None:
        """End the goals that still run, publish what is still to be said, and leave."""
        if self._closed:
            return
        self._end_goals()
        self._closed = True
        self._timer.cancel()
        self._lag.close()
        self._slicer.cancel()
        self._slicer.run_slice(GOODBYE_SECONDS)
        self._publish_diagnostics()
        await self._tasks.close(GONE_REASON)
        for handle in (self._memory, self._topics, self._diagnostics):
            handle.close()
        self._hub.detach(self._client)

    def _work(self) -> bool:
        """One piece of each kind of work, so that none keeps another waiting."""
        did_task = self._tasks.work()
        return self._topics.publish_next() or did_task

    def _take_update(self, update: client_protocol.Update) -> None:
        """Every record; in the engine's step."""
        if self._closed or isinstance(update, client_protocol.JournalStatus | client_protocol.Heartbeat):
            return
        update = self._private.hide(update)  # whoever listens on ROS is not the wizard
        if isinstance(update, TaskRecord):
            self._tasks.take_record(update)
        self._topics.enqueue(update)
        self._slicer.wake()

    def _end_goals(self) -> None:
        """The session has ended, or this does: no goal waits for what never comes."""
        engine = self._hub.engine
        if engine.failure is not None:
            reason = f"the engine stopped: {engine.failure or type(engine.failure).__name__}"
        elif engine.ended:
            reason = f"the session has ended: {self._hub.view.end_reason}".removesuffix(": ")
        else:
            reason = GONE_REASON
        self._tasks.end_all(reason)

    # --- how it is ----------------------------------------------------------------------------------------------

    def _diagnose(self) -> None:
        self._timer = self._loop.call_later(diagnostics.SECONDS, self._diagnose)
        self._publish_diagnostics()
        dropped = self._topics.dropped
        if dropped > self._dropped and not self._hub.engine.ended:
            text = f"{dropped - self._dropped:,} records were not published on ROS: they came faster than that takes"
            self._dropped = dropped
            self._hub.submit(self._client, Note(text=text), _ignore)

    def _publish_diagnostics(self) -> None:
        statuses = diagnostics.session_statuses(
            self._hub, (self._lag.recent, self._lag.max), self.status(), self._private
        )
        try:
            self._diagnostics.publish({"header": make_header(time_ns()), "status": statuses})
        except PortError as error:
            _LOG.debug("no diagnostics: %s", error)

    def status(self) -> Message:
        """The connection itself, as a diagnostic_msgs/msg/DiagnosticStatus."""
        topics, tasks, lost = self._topics, self._tasks, self._transport.failure()
        others = self._neighbours.others
        level, message = diagnostics.OK, self._transport.about
        if lost:
            level, message = diagnostics.ERROR, lost
        elif topics.error:
            level, message = diagnostics.ERROR, f"records are not published: {topics.error}"
        elif others:
            same = "moves the same robot" if self._neighbours.shared_with(others[0]) else "has the same names"
            level, message = diagnostics.WARN, f"another session {same}: {others[0]}"
        elif topics.dropped > self._dropped:
            level, message = diagnostics.WARN, "records come faster than they can be published; some are missing"
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
        return diagnostics.make_status(self._hub, "ros", level, message, values)


def _ignore(reply: client_protocol.Reply) -> None:
    """Nobody waits for this answer."""
