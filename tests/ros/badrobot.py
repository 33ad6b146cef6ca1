"""A robot that does everything wrong, on request: action servers on the bare port, each following a list of plans.

    server = BadServer(transport, "/r/speech", "rise_interfaces/action/Speech", loop.call_later, [Plan(accept=None)])

The first goal meets the first plan, the second the second, and all further ones the last. Works on any transport; as a
process of its own it serves over DDS on the loopback and prints what happens, one JSON object a line:

    python -m tests.ros.badrobot '{"names": {"/r/speech": "rise_interfaces/action/Speech"}, "plans": [{"seconds": 60}]}'
"""

from __future__ import annotations

import asyncio
import json
import signal
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any, Literal

import msgspec
from msgspec import Struct
from rise_adapters.ros2.actions.client import (
    ABORTED,
    ACCEPTED,
    CANCELED,
    CANCELING,
    EXECUTING,
    FINAL_STATUSES,
    SUCCEEDED,
)
from rise_adapters.ros2.transport.port import (
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    SEND_GOAL,
    STATUS,
    STATUS_TOPIC,
    Message,
    SendReply,
    Transport,
    action_topic,
    action_types,
)

Later = Callable[[float, Callable[[], None]], object]
"""`loop.call_later`."""


class Plan(Struct, frozen=True):
    """What becomes of one goal."""

    accept: bool | None = True
    """None: no answer, ever."""
    accept_after: float = 0.0
    decides_after: float = 0.0
    """Seconds for which its goal callback runs: until then the server does not know the goal."""
    runs: bool = True
    """Whether it is carried out (also one that was not answered)."""
    seconds: float = 1.0
    """Until it ends."""
    end: int | None = SUCCEEDED
    """None: it never ends by itself. 0 is what no result should be."""
    result: dict[str, Any] = {}
    answers: bool = True
    """False: its result is never sent (rclpy does that when `execute` returns something of a wrong type)."""
    cancel: Literal["yes", "refuse", "reject", "silent", "ignore"] = "yes"
    """refuse: code 0 and an empty list, as rclpy; reject: code 1; silent: no answer; ignore: accepted, and goes on."""
    cancel_seconds: float = 0.05
    status: bool = True
    """Whether the status topic says anything about it."""
    feedback_every: float = 0.0
    feedback_after: int = 0
    """How many are sent after its end."""
    block: float = 0.0
    """Seconds for which the whole server stands still when it begins."""


class _Goal:
    def __init__(self, id: bytes, plan: Plan) -> None:
        self.id = id
        self.plan = plan
        self.status = ACCEPTED
        self.askers: list[SendReply] = []


class BadServer:
    """One action server."""

    def __init__(
        self,
        transport: Transport,
        name: str,
        type: str,
        later: Later,
        plans: Sequence[Plan] = (Plan(),),
        said: Callable[..., None] = lambda **what: None,
    ) -> None:
        full = transport.resolve(name)
        types = action_types(type)
        self.name = full
        self._transport = transport
        self.plans = list(plans)
        self.goals: dict[bytes, _Goal] = {}
        self.received: list[bytes] = []
        """The id of every request for a goal, in order."""
        self.executed: list[bytes] = []
        """What the participant has seen begin."""
        self.cancels: list[bytes] = []
        """The id of every request to cancel."""
        self.at_once = 0
        """The most goals that ran at one time."""
        self._later = later
        self._said = said
        self._feedback = transport.publisher(action_topic(full, FEEDBACK), types[FEEDBACK])
        self._status = transport.publisher(action_topic(full, STATUS_TOPIC), types[STATUS_TOPIC], STATUS)
        self._services = [
            transport.serve(action_topic(full, part), types[part], asked)
            for part, asked in (
                (SEND_GOAL, self._asked),
                (CANCEL_GOAL, self._cancel_asked),
                (GET_RESULT, self._result_asked),
            )
        ]

    def close(self) -> None:
        for part in (*self._services, self._feedback, self._status):
            part.close()

    def foreign(self, id: bytes, plan: Plan) -> None:
        """A goal of somebody else begins."""
        self.goals[id] = goal = _Goal(id, plan)
        self._begin(goal)

    def running(self) -> list[bytes]:
        """What the participant sees going on."""
        return [id for id in self.executed if self.goals[id].status in (EXECUTING, CANCELING)]

    # --- the three services ---

    def _asked(self, request: Message, reply: SendReply) -> None:
        id = bytes(request["goal_id"]["uuid"])
        self.received.append(id)
        self._said(event="goal", name=self.name, id=id.hex())
        if id in self.goals:  # as rclpy: the same id twice is refused
            reply({"accepted": False})
            return
        plan = self.plans.pop(0) if len(self.plans) > 1 else self.plans[0]
        if plan.decides_after:
            self._later(plan.decides_after, lambda: self._decide(id, plan, reply))
        else:
            self._decide(id, plan, reply)

    def _decide(self, id: bytes, plan: Plan, reply: SendReply) -> None:
        if self._gone or plan.accept is False:
            self._said(event="refused", name=self.name, id=id.hex())
            reply({"accepted": False})
            return
        self.goals[id] = goal = _Goal(id, plan)
        if plan.accept:
            if plan.accept_after:
                self._later(plan.accept_after, lambda: reply({"accepted": True}))
            else:
                reply({"accepted": True})
        if plan.runs:
            self._begin(goal)

    def _result_asked(self, request: Message, reply: SendReply) -> None:
        goal = self.goals.get(bytes(request["goal_id"]["uuid"]))
        if goal is None:
            reply({"status": 0})
        elif not goal.plan.answers:
            pass
        elif goal.status in FINAL_STATUSES or goal.status == 0:
            reply({"status": goal.status, "result": goal.plan.result})
        else:
            goal.askers.append(reply)

    def _cancel_asked(self, request: Message, reply: SendReply) -> None:
        id = bytes(request["goal_info"]["goal_id"]["uuid"])
        self.cancels.append(id)
        self._said(event="cancel", name=self.name, id=id.hex())
        if any(id):
            one = self.goals.get(id)
            if one is None or one.status in FINAL_STATUSES:
                reply({"return_code": 2 if one is None else 3})
                return
            meant = [one]
        else:
            meant = [goal for goal in self.goals.values() if goal.status not in FINAL_STATUSES]
        if any(goal.plan.cancel == "silent" for goal in meant):
            return
        stopping = [goal for goal in meant if goal.plan.cancel in ("yes", "ignore")]
        rejected = any(goal.plan.cancel == "reject" for goal in meant)
        reply({"return_code": int(rejected), "goals_canceling": [{"goal_id": {"uuid": g.id}} for g in stopping]})
        for goal in stopping:
            goal.status = CANCELING
            self._tell()
            if goal.plan.cancel == "yes":
                self._later(goal.plan.cancel_seconds, lambda goal=goal: self._end(goal, CANCELED))  # type: ignore[misc]

    # --- what it does ---

    @property
    def _gone(self) -> bool:
        """Its process has ended, and everything that it did with it."""
        return bool(getattr(self._transport, "closed", False))

    def _begin(self, goal: _Goal) -> None:
        plan = goal.plan
        goal.status = EXECUTING
        self.executed.append(goal.id)
        self.at_once = max(self.at_once, len(self.running()))
        self._said(event="begin", name=self.name, id=goal.id.hex())
        self._tell()
        if plan.feedback_every:
            self._later(plan.feedback_every, lambda: self._report(goal))
        if plan.block:
            self._later(0.0, lambda: time.sleep(plan.block))
        if plan.end is not None:
            self._later(plan.seconds, lambda: self._end(goal, plan.end or 0))

    def _report(self, goal: _Goal, more: int = 0) -> None:
        over = goal.status in FINAL_STATUSES
        if self._gone or (over and not more):
            return
        self._feedback.publish({"goal_id": {"uuid": goal.id}})
        self._later(goal.plan.feedback_every, lambda: self._report(goal, more - 1 if over else more))

    def _end(self, goal: _Goal, status: int) -> None:
        if goal.status in FINAL_STATUSES or self._gone:
            return
        goal.status = status
        self._said(event="end", name=self.name, id=goal.id.hex(), status=status)
        self._tell()
        if goal.plan.answers:
            for reply in goal.askers:
                reply({"status": status, "result": goal.plan.result})
        goal.askers.clear()
        for _ in range(goal.plan.feedback_after):
            self._feedback.publish({"goal_id": {"uuid": goal.id}})

    def _tell(self) -> None:
        shown = [goal for goal in self.goals.values() if goal.plan.status]
        if shown:
            listed = [{"goal_info": {"goal_id": {"uuid": goal.id}}, "status": goal.status} for goal in shown]
            self._status.publish({"status_list": listed})


__all__ = ["ABORTED", "CANCELED", "SUCCEEDED", "BadServer", "Plan"]


# --- as a process ---------------------------------------------------------------------------------------------------


class _Order(Struct, frozen=True):
    names: dict[str, str]
    plans: list[Plan]
    node: str = "/badrobot"


def _say(**what: Any) -> None:
    print(json.dumps({"at": time.monotonic(), **what}), flush=True)


async def _serve(order: _Order) -> None:
    from rise_adapters.ros2.transport.dds import DdsTransport

    loop = asyncio.get_running_loop()
    over = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, over.set)
    transport = DdsTransport(loop, node=order.node.strip("/"))
    for name, type in order.names.items():
        BadServer(transport, name, type, loop.call_later, order.plans, _say)
    _say(event="ready")
    await over.wait()
    transport.close()


if __name__ == "__main__":
    asyncio.run(_serve(msgspec.json.decode(sys.argv[1], type=_Order)))
