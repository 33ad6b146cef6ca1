"""The session as other ROS nodes see it (docs/reference/ros2.md):

    rise/domain_task    action rise_interfaces/action/DomainTask: submit a task, follow it, cancel it
    rise/get_memory     service rise_interfaces/srv/GetMemory: one key of the working memory
    rise/rule_state     what rules do, and in which state they are
    rise/task_state     what becomes of tasks, whoever submitted them
    rise/record         every record of the session
    /diagnostics        how session, robot, recording and connection are, once a second

A goal is accepted when its task is: when it is on the disk. It ends as its task does. A goal whose client has gone goes
on, as every task does whose wizard has gone; ROS tells a server nothing of that anyway.

Whatever comes in, the engine's loop stays free for a wizard's key: goals, requests to cancel, and records that go out
are worked off in portions, and what waits has bounds.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from time import time_ns
from typing import Any, cast

from msgspec import Struct, field

from rise_adapters.ros2.action_server import ActionServer, Decide, ServerGoal
from rise_adapters.ros2.face import diagnostics
from rise_adapters.ros2.face.portions import Portions
from rise_adapters.ros2.face.record_topics import RecordTopics, as_json
from rise_adapters.ros2.neighbours import Neighbours
from rise_adapters.ros2.port import SEND_GOAL, Message, PortError, QoS, Reply, Transport, action_topic
from rise_engine.clock import RealClock
from rise_engine.expression import lookup
from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import FINAL, TaskRecord
from rise_engine.lag_meter import LagMeter
from rise_engine.link import client as link
from rise_engine.link.messages import MESSAGE_LIMIT
from rise_engine.link.room import Member, Room
from rise_engine.view import MemoryView

_LOG = logging.getLogger(__name__)

DOMAIN_TASK, DOMAIN_TASK_TYPE = "rise/domain_task", "rise_interfaces/action/DomainTask"
GET_MEMORY, GET_MEMORY_TYPE = "rise/get_memory", "rise_interfaces/srv/GetMemory"

SOURCE = "ros:domain_task"
"""The source of tasks that came as goals. Which node sent a goal, ROS does not say; who releases a stop says it."""

UNDECIDED = 1000
"""Goals that wait to be taken, or for the disk, at most."""
OPEN = 1000
"""Acts and rules that goals have started and that have not ended, at most."""
GOODBYE_SECONDS = 1.0
"""For what is still to be published at the end."""
RELEASING = 10
"""Goals to release a stop that wait for that at most."""
REFUSALS_NOTED = 100
"""Different refusals to release a stop that come to the record at most."""
KNOWN_SECONDS, KNOWN_LOOK = 1.0, 0.05
"""For which a node that releases a stop may still be unknown: its goal can be here before word of its name is."""
FETCH_SECONDS, FETCH_LOOK = 0.5, 0.01
"""For which results of goals that end with the session wait to be asked for."""
GONE = "the session is not on ROS any more"


class _Asked(Struct):
    """What is known about a goal's task."""

    id: int = 0
    source: str = SOURCE
    """Under which it was submitted."""
    accepted: bool = False
    records: list[TaskRecord] = field(default_factory=list)
    """Those that came before the goal was accepted."""


class Face:
    """One session's face. All methods belong to the engine's loop."""

    def __init__(
        self, transport: Transport, room: Room, neighbours: Neighbours | None = None, *, rosout: bool = True
    ) -> None:
        """Make it before the engine starts, so that it misses no record, inside the running loop. `neighbours`: other
        sessions under the same names. `rosout`: whether what happens is told on /rosout, too.

        Raises PortError when the transport does not have the types of `rise_interfaces`.
        """
        self._transport = transport
        self._room = room
        self._neighbours = neighbours
        self._loop = asyncio.get_running_loop()
        self._member = room.attach("domain_task", "node", SOURCE)
        self._topics = RecordTopics(transport, room, self._member.source, rosout=rosout)
        self._moves: deque[Callable[[], object]] = deque()
        """What has become of goals and is still to be told to their clients."""
        self._cancels: deque[tuple[ServerGoal, Decide]] = deque()
        self._goals: deque[ServerGoal] = deque()
        """Those that are still to be submitted."""
        self._submitted: dict[str, ServerGoal] = {}
        """By id, those that are submitted and not accepted yet."""
        self._running: dict[int, ServerGoal] = {}
        """By task, those whose task has not ended."""
        self._parting: list[ServerGoal] = []
        """Those that have ended because the session, or this, has."""
        self._refused = 0
        self._releasing: set[bytes] = set()
        """Goals to release a stop that wait until their node is known."""
        self._refused_releases: set[str] = set()
        """What the record says already."""
        self._dropped = 0
        self._closed = False
        self._portions = Portions(
            self._loop, self._tell_one, self._cancel_one, self._submit_one, self._topics.publish_some
        )
        self._lag = LagMeter(self._loop)
        self._diagnostics = transport.publisher(diagnostics.TOPIC, diagnostics.TYPE, QoS())
        self._memory = transport.serve(GET_MEMORY, GET_MEMORY_TYPE, self._memory_asked)
        self._server = ActionServer(
            transport, DOMAIN_TASK, DOMAIN_TASK_TYPE, self._wanted, self._cancel, clock=RealClock(self._loop)
        )
        self._take_up()
        room.subscribe(self._update)
        room.engine.when_ended(self._over)
        self._timer = self._loop.call_later(diagnostics.SECONDS, self._diagnose)

    async def close(self) -> None:
        """End the goals that still run, publish what is still to be said, and leave."""
        if self._closed:
            return
        self._over()
        self._closed = True
        self._timer.cancel()
        self._lag.close()
        self._portions.finish(GOODBYE_SECONDS)
        self._publish_diagnostics()
        await self._let_results_be_fetched()
        self._server.close({"status": "ABORTED", "reason": GONE})
        await asyncio.sleep(0)
        for handle in (self._memory, self._topics, self._diagnostics):
            handle.close()
        self._room.leave(self._member)

    # --- goals in -----------------------------------------------------------------------------------------------

    def _wanted(self, goal: ServerGoal) -> None:
        message = goal.message
        function, behavior, calling_type = (
            message[name] for name in ("function_type", "domain_task_behavior", "calling_type")
        )
        stop = function == "stopAll"
        waiting = len(self._goals) + len(self._submitted)
        if self._closed:
            self._refuse(goal, GONE)
        elif len(function) + len(behavior) + len(calling_type) > MESSAGE_LIMIT:
            message.update(function_type=function[:100], domain_task_behavior=behavior[:100], calling_type="")
            self._refuse(goal, f"a task may have {MESSAGE_LIMIT:,} characters at most")
        elif waiting >= (2 * UNDECIDED if stop else UNDECIDED):
            self._refuse(goal, f"{waiting:,} goals are waiting already; send the next when one has been accepted")
        elif self._portions.at_leisure():
            self._submit(goal)
        else:
            if stop:
                self._goals.appendleft(goal)  # nothing waits for less than who wants everything to stop
            else:
                self._goals.append(goal)
            self._portions.wake()

    def _submit_one(self) -> bool:
        if not self._goals:
            return False
        self._submit(self._goals.popleft())
        return True

    def _submit(self, goal: ServerGoal) -> None:
        submit = _submit_of(goal)
        if submit.function == "releaseStop":
            self._release(goal, self._loop.time() + KNOWN_SECONDS)
            return
        if submit.function.startswith("start") and len(self._running) >= OPEN:
            self._refuse(goal, f"{OPEN:,} tasks that came as goals are running or waiting already")
            return
        self._send(goal, submit, self._member)

    def _send(self, goal: ServerGoal, submit: Submit, member: Member) -> None:
        goal.data = _Asked(source=member.source)
        self._submitted[goal.hex] = goal
        try:
            self._room.send(member, submit, partial(self._answered, goal))
        except Exception as error:  # the engine's own failure, which ends the session
            if self._submitted.pop(goal.hex, None) is not None:
                self._refuse(goal, f"the engine stopped: {error or type(error).__name__}")

    def _release(self, goal: ServerGoal, until: float) -> None:
        """A stop is released by whoever holds control, and by nodes that the scenario names. Which node this one is, it
        says itself, and it must be seen here as a client of the action; better than that ROS knows no one."""
        self._releasing.discard(goal.id)
        if goal.decided:
            return
        who = str(goal.message["domain_task_behavior"]).strip()
        named = self._room.engine.scenario.may_release
        action = action_topic(self._transport.resolve(DOMAIN_TASK), SEND_GOAL)
        if not who.startswith("/") or who not in named:
            reason = "a stop is released by who holds control, "
            reason += f"or by {', '.join(named)}" if named else "or by a node that scenario.toml names"
            if not who:
                reason += "; a node says who it is: domain_task_behavior is its full name"
            elif not named:
                reason += f': [control] may_release = ["{who if who.startswith("/") else f"/{who}"}"]'
            else:
                reason += f", and not by {who}"
        elif who in self._transport.clients_of(action):
            member = self._room.attach("node", "node", f"ros:{who}")
            self._send(goal, Submit(function="releaseStop", ref=goal.hex), member)
            self._loop.call_soon(self._room.leave, member)
            return
        elif self._loop.time() < until and not self._closed and len(self._releasing) < RELEASING:
            self._releasing.add(goal.id)
            self._loop.call_later(KNOWN_LOOK, self._release, goal, until)
            return
        else:
            reason = f"it says that it is {who}, and no node of that name uses {self._transport.resolve(DOMAIN_TASK)}"
        self._refuse(goal, reason)
        text = f"a node asked to release the stop and may not: {reason}"
        if text not in self._refused_releases and len(self._refused_releases) < REFUSALS_NOTED:
            self._refused_releases.add(text)
            self._room.send(self._member, Note(text=text), _nobody)

    def _answered(self, goal: ServerGoal, reply: link.Reply) -> None:
        """May be called in a step; so may what follows it, because nothing of it comes back at once."""
        self._submitted.pop(goal.hex, None)
        asked = _asked(goal)
        if not reply.accepted:
            if asked.records:  # which say why
                self._soon(goal.reject)
            else:
                self._soon(partial(self._refuse, goal, reply.reason))
            return
        asked.accepted = True
        self._soon(goal.accept)
        for record in asked.records:
            self._soon(partial(self._move, goal, record))
        asked.records = []

    def _refuse(self, goal: ServerGoal, reason: str) -> None:
        """Reject what has not come to the record; the topic says why, because the wire cannot."""
        submit = _submit_of(goal)
        self._refused += 1
        goal.reject()
        self._topics.refused(submit, reason)
        self._portions.wake()

    def _take_up(self) -> None:
        """Of a session that goes on: the goals whose tasks still run."""
        for task in self._room.tasks()[0]:
            if task.source != self._member.source or task.ref is None or task.status in FINAL:
                continue
            try:
                goal = self._server.adopt(bytes.fromhex(task.ref))
            except ValueError:
                continue
            goal.data = _Asked(task.id, accepted=True)
            self._running[task.id] = goal

    # --- what becomes of them -----------------------------------------------------------------------------------

    def _update(self, update: link.Update) -> None:
        """Every record; in the engine's step."""
        if self._closed or isinstance(update, link.Journaling | link.Pulse):
            return
        if isinstance(update, TaskRecord):
            self._task_changed(update)
        self._topics.take(update)
        self._portions.wake()

    def _task_changed(self, record: TaskRecord) -> None:
        goal = self._running.get(record.id)
        if goal is None:
            goal = self._submitted.get(record.ref) if record.ref is not None else None
            if goal is None or record.source != _asked(goal).source:
                return
            _asked(goal).id = record.id
        asked = _asked(goal)
        if record.status in FINAL:
            self._running.pop(record.id, None)
        else:
            self._running[record.id] = goal
        if asked.accepted:
            self._soon(partial(self._move, goal, record))
        else:
            asked.records.append(record)

    def _move(self, goal: ServerGoal, record: TaskRecord) -> None:
        result = {"status": record.status, "reason": record.reason, "task": record.id}
        match record.status:
            case "SUCCEEDED":
                goal.succeed(result)
            case "CANCELED":
                goal.cancel(result)
            case "ABORTED" | "REJECTED":
                goal.abort(result)
            case status:
                if status == "ACTIVE":
                    goal.execute()
                position = -1 if record.position is None else record.position
                goal.feedback({"status": status, "reason": record.reason, "position": position})

    def _soon(self, told: Callable[[], object]) -> None:
        """Tell a client what has become of its goal: at once if the loop is free, and in any case in order."""
        if not self._moves and self._portions.at_leisure():
            self._tell(told)
        else:
            self._moves.append(told)
            self._portions.wake()

    def _tell_one(self) -> bool:
        if not self._moves:
            return False
        self._tell(self._moves.popleft())
        return True

    def _tell(self, told: Callable[[], object]) -> None:
        try:
            told()
        except PortError as error:
            _LOG.warning("a client could not be told about its goal: %s", error)

    # --- cancelling ---------------------------------------------------------------------------------------------

    def _cancel(self, goal: ServerGoal, decide: Decide) -> None:
        self._cancels.append((goal, decide))
        self._portions.wake()

    def _cancel_one(self) -> bool:
        if not self._cancels:
            return False
        goal, decide = self._cancels.popleft()
        task = _asked(goal).id
        if task not in self._running:  # it has ended, and its client is about to be told
            self._soon(partial(decide, False))
            return True
        submit = Submit(function="cancelTask", behavior=str(task))
        self._room.send(self._member, submit, partial(self._cancel_answered, submit, decide))
        return True

    def _cancel_answered(self, submit: Submit, decide: Decide, reply: link.Reply) -> None:
        if not reply.accepted and reply.task is None:
            self._topics.refused(submit, reply.reason)
        self._soon(partial(decide, reply.accepted))

    # --- the memory ---------------------------------------------------------------------------------------------

    def _memory_asked(self, request: Message, reply: Reply) -> None:
        found, value = lookup(_Values(self._room.view.memory), request["request_by_key"])
        answer: Message = {"found": False}
        if found:
            answer = {"found": True, "value": as_json(value), "type": _json_type(value)}
        try:
            reply(answer)
        except PortError as error:
            _LOG.warning("a request for the memory could not be answered: %s", error)

    # --- how it is ----------------------------------------------------------------------------------------------

    def _diagnose(self) -> None:
        self._timer = self._loop.call_later(diagnostics.SECONDS, self._diagnose)
        self._publish_diagnostics()
        dropped = self._topics.dropped
        if dropped > self._dropped and not self._room.engine.ended:
            text = f"{dropped - self._dropped:,} records were not published on ROS: they came faster than that takes"
            self._dropped = dropped
            self._room.send(self._member, Note(text=text), _nobody)

    def _publish_diagnostics(self) -> None:
        room = self._room
        statuses = diagnostics.statuses(room, (self._lag.recent, self._lag.max), self._status())
        seconds, rest = divmod(time_ns(), 1_000_000_000)
        try:
            self._diagnostics.publish({"header": {"stamp": {"sec": seconds, "nanosec": rest}}, "status": statuses})
        except PortError as error:
            _LOG.debug("no diagnostics: %s", error)

    def _status(self) -> Message:
        topics, lost = self._topics, self._transport.lost()
        others = self._neighbours.others if self._neighbours is not None else []
        level, message = diagnostics.OK, self._transport.about
        if lost:
            level, message = diagnostics.ERROR, lost
        elif topics.trouble:
            level, message = diagnostics.ERROR, f"records are not published: {topics.trouble}"
        elif others:
            level, message = diagnostics.WARN, f"another session has the same names: {others[0]}"
        elif topics.dropped > self._dropped:
            level, message = diagnostics.WARN, "records come faster than they can be published; some are missing"
        values = {
            "node": self._transport.node,
            "transport": self._transport.kind,
            "goals running": len(self._running),
            "goals waiting to be accepted": len(self._goals) + len(self._submitted),
            "goals refused": self._refused,
            "records waiting": topics.waiting,
            "records dropped": topics.dropped,
            "other sessions": len(others),
        }
        return diagnostics.status(self._room, "ros", level, message, values)

    # --- the end ------------------------------------------------------------------------------------------------

    async def _let_results_be_fetched(self) -> None:
        """Whoever has just heard that a goal was accepted is only about to ask for its result."""
        for _ in range(round(FETCH_SECONDS / FETCH_LOOK)):
            if all(goal.told for goal in self._parting):
                return
            await asyncio.sleep(FETCH_LOOK)

    def _over(self) -> None:
        """The session has ended, or the face goes: no goal waits for what never comes."""
        engine = self._room.engine
        if engine.failure is not None:
            reason = f"the engine stopped: {engine.failure or type(engine.failure).__name__}"
        elif engine.ended:
            reason = f"the session has ended: {self._room.end_reason}".removesuffix(": ")
        else:
            reason = GONE
        while self._moves:
            self._tell_one()
        while self._goals:
            self._refuse(self._goals.popleft(), reason)
        while self._cancels:
            self._cancels.popleft()[1](False)
        self._submitted.clear()
        self._running.clear()
        for goal in self._server.goals:
            if not goal.decided:
                self._refuse(goal, reason)
            else:
                self._parting.append(goal)
                goal.abort({"status": "ABORTED", "reason": reason, "task": _asked(goal).id})


class _Values(Mapping[str, Any]):
    """The memory as the expression language sees it: keys and plain values."""

    def __init__(self, memory: Mapping[str, MemoryView]) -> None:
        self._memory = memory

    def __getitem__(self, key: str) -> Any:
        return self._memory[key].value

    def __contains__(self, key: object) -> bool:
        return key in self._memory

    def __iter__(self) -> Iterator[str]:
        return iter(self._memory)

    def __len__(self) -> int:
        return len(self._memory)


def _json_type(value: object) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return "boolean"
        case int() | float():
            return "number"
        case str():
            return "string"
        case list() | tuple():
            return "array"
        case _:
            return "object"


def _submit_of(goal: ServerGoal) -> Submit:
    message = goal.message
    return Submit(
        function=message["function_type"],
        behavior=message["domain_task_behavior"],
        calling_type=message["calling_type"],
        ref=goal.hex,
    )


def _asked(goal: ServerGoal) -> _Asked:
    return cast(_Asked, goal.data)


def _nobody(reply: link.Reply) -> None:
    """Nobody waits for this answer."""
