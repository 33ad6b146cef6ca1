"""The action `rise/domain_task`: other nodes submit tasks, follow them, and cancel them.

A goal is accepted with its task, once that is on the disk, and ends with it. If its client disappears, the goal
continues, like every task whose wizard has gone. ROS does not report this to a server.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import cast

from msgspec import Struct, field

from rise_adapters.ros2.actions.server import ActionServer, Decide
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.session_node.record_topics import RecordTopics
from rise_adapters.ros2.transport.port import SEND_GOAL, PortError, Transport, action_topic
from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import FINAL, TaskRecord
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.protocol import client as client_protocol
from rise_engine.run.protocol.messages import MAX_MESSAGE_BYTES
from rise_engine.run.server.hub import AttachedClient, SessionHub

_LOG = logging.getLogger(__name__)

DOMAIN_TASK, DOMAIN_TASK_TYPE = "rise/domain_task", "rise_interfaces/action/DomainTask"

MAX_UNDECIDED = 1000
"""Maximum number of goals that wait for the engine or the disk."""
MAX_OPEN = 1000
"""Maximum number of unfinished acts and rules started by goals."""
MAX_RELEASING = 10
"""Maximum number of goals that wait to release a stop."""
MAX_REFUSALS_NOTED = 100
"""Maximum number of different refusals to release a stop in the record."""
KNOWN_SECONDS, KNOWN_POLL = 1.0, 0.05
"""Seconds for which a node that releases a stop may be unknown: its goal can arrive before its name."""
FETCH_SECONDS, FETCH_POLL = 0.5, 0.01
"""Seconds that results of goals wait for their clients at the end of the session."""


class _GoalTask(Struct):
    """The task of a goal (`ServerGoal.data`)."""

    id: int = 0
    source: str = ""
    """The source under which it was submitted."""
    accepted: bool = False
    records: list[TaskRecord] = field(default_factory=list)
    """Records that arrived before the goal was accepted."""


class DomainTaskServer:
    """Passes goals to the session as tasks, and the results back to the goals."""

    def __init__(
        self,
        transport: Transport,
        hub: SessionHub,
        client: AttachedClient,
        topics: RecordTopics,
        wake: Callable[[], object],
    ) -> None:
        """`client`: submits the tasks. `topics` publish tasks that never reach the record. `wake` is called when `work`
        is needed. Raises PortError if the transport does not have the type."""
        self.refused = 0
        """Goals that were rejected without a task."""
        self._transport = transport
        self._hub = hub
        self._client = client
        self._topics = topics
        self._wake = wake
        self._loop = asyncio.get_running_loop()
        self._answers: deque[Callable[[], object]] = deque()
        """Results that must still be sent to clients."""
        self._cancels: deque[tuple[ServerGoal, Decide]] = deque()
        self._goals: deque[ServerGoal] = deque()
        """Goals that must still be submitted."""
        self._submitted: dict[str, ServerGoal] = {}
        """Submitted goals that were not accepted yet, by id."""
        self._running: dict[int, ServerGoal] = {}
        """Goals whose task has not ended, by task."""
        self._ended_here: list[ServerGoal] = []
        """Goals that ended because the session or this server ended."""
        self._releasing: set[bytes] = set()
        """Goals that wait to release a stop until their node is known."""
        self._refused_releases: set[str] = set()
        """Refusals that the record has already."""
        self._gone = ""
        """Why no more goals are accepted; empty: they are."""
        self._server = ActionServer(
            transport,
            DOMAIN_TASK,
            DOMAIN_TASK_TYPE,
            self._take_goal,
            self._take_cancel,
            clock=RealClock(self._loop),
        )
        self._adopt_running()

    @property
    def running(self) -> int:
        """The number of goals whose task has not ended."""
        return len(self._running)

    @property
    def waiting(self) -> int:
        """The number of goals that were neither accepted nor rejected."""
        return len(self._goals) + len(self._submitted)

    def work(self) -> bool:
        """Do one piece of each kind of waiting work. False: there was none."""
        did = bool(self._answers or self._cancels or self._goals)
        if self._answers:
            self._send_answer(self._answers.popleft())
        if self._cancels:
            self._cancel_task(*self._cancels.popleft())
        if self._goals:
            self._begin_task(self._goals.popleft())
        return did

    def end_all(self, reason: str) -> None:
        """End all goals, so that none waits forever."""
        while self._answers:
            self._send_answer(self._answers.popleft())
        while self._goals:
            self._refuse(self._goals.popleft(), reason)
        while self._cancels:
            self._cancels.popleft()[1](False)
        self._submitted.clear()
        self._running.clear()
        for goal in self._server.goals:
            if not goal.is_decided:
                self._refuse(goal, reason)
            else:
                self._ended_here.append(goal)
                goal.abort({"status": "ABORTED", "reason": reason, "task": _task_of(goal).id})

    async def close(self, reason: str) -> None:
        """Accept no more goals, wait briefly until clients have the last results, and stop offering the action."""
        self._gone = reason
        await self._wait_for_fetches()
        self._server.close({"status": "ABORTED", "reason": reason})
        await asyncio.sleep(0)

    async def _wait_for_fetches(self) -> None:
        """Wait for clients that have just got an acceptance and will now request the result."""
        for _ in range(round(FETCH_SECONDS / FETCH_POLL)):
            if all(goal.is_result_fetched for goal in self._ended_here):
                return
            await asyncio.sleep(FETCH_POLL)

    # --- goals in -----------------------------------------------------------------------------------------------

    def _take_goal(self, goal: ServerGoal) -> None:
        submit = _make_submit(goal)
        is_stop = submit.function == "stopAll"
        if self._gone:
            self._refuse(goal, self._gone)
        elif len(submit.function) + len(submit.behavior) + len(submit.calling_type) > MAX_MESSAGE_BYTES:
            beginning = {"function_type": submit.function[:100], "domain_task_behavior": submit.behavior[:100]}
            goal.message.update(beginning, calling_type="")
            self._refuse(goal, f"a task may have {MAX_MESSAGE_BYTES:,} characters at most")
        elif self.waiting >= (2 * MAX_UNDECIDED if is_stop else MAX_UNDECIDED):
            self._refuse(goal, f"{self.waiting:,} goals are waiting already; send the next when one has been accepted")
        else:
            if is_stop:
                self._goals.appendleft(goal)  # a stop waits for nothing
            else:
                self._goals.append(goal)
            self._wake()

    def _begin_task(self, goal: ServerGoal) -> None:
        submit = _make_submit(goal)
        if submit.function == "releaseStop":
            self._release_stop(goal, self._loop.time() + KNOWN_SECONDS)
        elif submit.function.startswith("start") and len(self._running) >= MAX_OPEN:
            self._refuse(goal, f"{MAX_OPEN:,} tasks that came as goals are running or waiting already")
        else:
            self._submit(goal, submit, self._client)

    def _submit(self, goal: ServerGoal, submit: Submit, client: AttachedClient) -> None:
        goal.data = _GoalTask(source=client.source)
        self._submitted[goal.id.hex()] = goal
        try:
            self._hub.submit(client, submit, partial(self._take_reply, goal))
        except Exception as error:  # the engine's own failure, which ends the session
            if self._submitted.pop(goal.id.hex(), None) is not None:
                self._refuse(goal, f"the engine stopped: {error or type(error).__name__}")

    def _take_reply(self, goal: ServerGoal, reply: client_protocol.Reply) -> None:
        """Process whether the session accepts the task. This may be called in a step, so the answer is sent later."""
        self._submitted.pop(goal.id.hex(), None)
        task = _task_of(goal)
        if not reply.accepted:  # its records give the reason, if it has any
            self._answer_later(goal.reject if task.records else partial(self._refuse, goal, reply.reason))
            return
        task.accepted = True
        self._answer_later(goal.accept)
        for record in task.records:
            self._answer_later(partial(_update_goal, goal, record))
        task.records = []

    def _refuse(self, goal: ServerGoal, reason: str) -> None:
        """Reject a goal that did not reach the record. The topic gives the reason, because the answer cannot."""
        submit = _make_submit(goal)
        self.refused += 1
        goal.reject()
        self._topics.enqueue_refusal(submit, reason)
        self._wake()

    def _adopt_running(self) -> None:
        """Take over the goals of a recovered session whose tasks still run."""
        for task in self._hub.changing_tasks():
            if task.source != self._client.source or task.ref is None or task.status in FINAL:
                continue
            try:
                goal = self._server.adopt(bytes.fromhex(task.ref))
            except ValueError:
                continue
            goal.data = _GoalTask(task.id, task.source, accepted=True)
            self._running[task.id] = goal

    # --- releasing a stop ---------------------------------------------------------------------------------------

    def _release_stop(self, goal: ServerGoal, until: float) -> None:
        """Release a stop for a node. Only the wizard with control and nodes named in the scenario may do this. The node
        gives its own name, and must be visible here as a client of the action. ROS offers no better proof."""
        self._releasing.discard(goal.id)
        if goal.is_decided:
            return
        node, _, resumptions = str(goal.message["domain_task_behavior"]).strip().partition(" ")
        allowed = self._hub.engine.scenario.may_release
        if not node.startswith("/") or node not in allowed:
            self._refuse_release(goal, _why_not_released(node, allowed))
            return
        action = self._transport.resolve(DOMAIN_TASK)
        if node in self._transport.client_nodes(action_topic(action, SEND_GOAL)):
            client = self._hub.attach("node", "node", f"ros:{node}")
            self._submit(goal, Submit(function="releaseStop", behavior=resumptions.strip(), ref=goal.id.hex()), client)
            self._loop.call_soon(self._hub.detach, client)
        elif self._loop.time() < until and not self._gone and len(self._releasing) < MAX_RELEASING:
            self._releasing.add(goal.id)
            self._loop.call_later(KNOWN_POLL, self._release_stop, goal, until)
        else:
            self._refuse_release(goal, f"it says that it is {node}, and no node of that name uses {action}")

    def _refuse_release(self, goal: ServerGoal, reason: str) -> None:
        self._refuse(goal, reason)
        text = f"a node asked to release the stop and may not: {reason}"
        if text not in self._refused_releases and len(self._refused_releases) < MAX_REFUSALS_NOTED:
            self._refused_releases.add(text)
            self._hub.submit(self._client, Note(text=text), _ignore)

    # --- results ------------------------------------------------------------------------------------------------

    def take_record(self, record: TaskRecord) -> None:
        """Process the record of a task, in the engine's step."""
        goal = self._running.get(record.id)
        if goal is None:
            goal = self._submitted.get(record.ref) if record.ref is not None else None
            if goal is None or record.source != _task_of(goal).source:
                return
            _task_of(goal).id = record.id
        if record.status in FINAL:
            self._running.pop(record.id, None)
        else:
            self._running[record.id] = goal
        if _task_of(goal).accepted:
            self._answer_later(partial(_update_goal, goal, record))
        else:
            _task_of(goal).records.append(record)

    def _answer_later(self, answer: Callable[[], object]) -> None:
        """Send a result to a goal's client later, in order."""
        self._answers.append(answer)
        self._wake()

    def _send_answer(self, answer: Callable[[], object]) -> None:
        try:
            answer()
        except PortError as error:
            _LOG.warning("a client could not be told about its goal: %s", error)

    # --- cancelling ---------------------------------------------------------------------------------------------

    def _take_cancel(self, goal: ServerGoal, decide: Decide) -> None:
        self._cancels.append((goal, decide))
        self._wake()

    def _cancel_task(self, goal: ServerGoal, decide: Decide) -> None:
        task = _task_of(goal).id
        if task not in self._running:  # it has ended, and its client gets the result
            self._answer_later(partial(decide, False))
            return
        submit = Submit(function="cancelTask", behavior=str(task))
        self._hub.submit(self._client, submit, partial(self._take_cancel_reply, submit, decide))

    def _take_cancel_reply(self, submit: Submit, decide: Decide, reply: client_protocol.Reply) -> None:
        if not reply.accepted and reply.task is None:
            self._topics.enqueue_refusal(submit, reply.reason)
        self._answer_later(partial(decide, reply.accepted))


def _update_goal(goal: ServerGoal, record: TaskRecord) -> None:
    """Update a goal to the state of its task."""
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
            goal.publish_feedback({"status": status, "reason": record.reason, "position": position})


def _why_not_released(node: str, allowed: tuple[str, ...]) -> str:
    """Why a node may not release a stop. `node`: the name that it gives; `allowed`: the scenario's nodes."""
    reason = "a stop can be released by the wizard who holds control, "
    reason += f"or by {', '.join(allowed)}" if allowed else "or by a node that scenario.toml names"
    if not node:
        return reason + "; a node gives its full name in domain_task_behavior"
    if not allowed:
        return reason + f': [control] may_release = ["{node if node.startswith("/") else f"/{node}"}"]'
    return reason + f", and not by {node}"


def _make_submit(goal: ServerGoal) -> Submit:
    message = goal.message
    return Submit(
        function=message["function_type"],
        behavior=message["domain_task_behavior"],
        calling_type=message["calling_type"],
        ref=goal.id.hex(),
    )


def _task_of(goal: ServerGoal) -> _GoalTask:
    return cast(_GoalTask, goal.data)


def _ignore(reply: client_protocol.Reply) -> None:
    """Ignore an answer."""
