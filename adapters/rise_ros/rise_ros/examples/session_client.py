"""A feature node's side of a session: tasks in, memory and rule states out. Your own node needs nothing else of RISE.
The names and types are those of docs/reference/rise1-names.md.

    session = SessionClient(transport)
    await session.assign("RecognizedSpeech", "hello")
    await session.raise_event("/H_greets")
    name = await session.read_memory("person_name")
    session.watch_rule_states(lambda state: print(state["rule"], state["state"]))
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from functools import partial
from typing import Any
from uuid import uuid4

from msgspec import Struct
from rise_adapters.ros2.actions.client import ActionClient
from rise_adapters.ros2.transport.port import Message, Transport

from rise_engine.base.errors import RiseError

_STATUS = {4: "SUCCEEDED", 5: "CANCELED", 6: "ABORTED"}
"""The end of an action's goal (action_msgs/msg/GoalStatus), for a server that reports nothing else."""
_POLL_SECONDS = 0.5


class SessionGoneError(RiseError):
    """No session answers. The sentence names the missing part."""


class TaskResult(Struct, frozen=True):
    """The result of a task."""

    status: str
    """SUCCEEDED, ABORTED, CANCELED or REJECTED."""
    reason: str = ""
    task: int = 0
    """Its id in the session's record; 0 if it was rejected."""

    @property
    def succeeded(self) -> bool:
        return self.status == "SUCCEEDED"


class SessionClient:
    """Takes part in the session of this ROS domain."""

    def __init__(self, transport: Transport, *, patience: float = 5.0) -> None:
        """`patience`: seconds for the session to appear, and for its immediate answers."""
        self.patience = patience
        self._transport = transport
        self._tasks = ActionClient(transport, "rise/domain_task", "rise_interfaces/action/DomainTask")
        self._memory = transport.client("rise/get_memory", "rise_interfaces/srv/GetMemory")

    async def submit(self, function: str, behavior: str, calling_type: str = "") -> TaskResult:
        """Submit a DomainTask and wait for its end. For a start, that is the end of the act or rule.

        `function`: startCommunicationRobotAct, stopCommunicationRobotAct, startInteractionRule, stopInteractionRule,
        raiseEventTopic or assignValue. Raises SessionGoneError.
        """
        await self._wait_until(self._tasks.count_servers, "no session offers rise/domain_task")
        goal = uuid4().bytes
        task: Message = {"function_type": function, "domain_task_behavior": behavior, "calling_type": calling_type}
        accepted = await self._wait_for_answer(partial(self._tasks.send, goal, task), "the session did not take a task")
        if not accepted[0]:
            return TaskResult("REJECTED", "the session refused it; rise/task_state and its record say why")
        ended: asyncio.Future[tuple[Any, ...]] = asyncio.get_running_loop().create_future()
        self._tasks.get_result(goal, partial(_set_result, ended))
        while True:  # a session that dies sends nothing
            await asyncio.wait([ended], timeout=_POLL_SECONDS)
            if ended.done():
                status, result = ended.result()
                outcome = result.get("status") or _STATUS.get(status, "ABORTED")
                return TaskResult(outcome, result.get("reason", ""), result.get("task", 0))
            if not self._tasks.count_servers():
                raise SessionGoneError("the session ended before the task did")

    async def assign(self, key: str, value: Any) -> TaskResult:
        """Write a JSON value into the working memory."""
        return await self.submit("assignValue", json.dumps({key: value}, ensure_ascii=False))

    async def raise_event(self, topic: str) -> TaskResult:
        """Raise an event for the rules."""
        return await self.submit("raiseEventTopic", topic)

    async def start_act(self, act: str, calling_type: str = "") -> TaskResult:
        """Start an act, and wait until it has ended."""
        return await self.submit("startCommunicationRobotAct", act, calling_type)

    async def release_stop(self, rules: dict[str, str] | None = None) -> TaskResult:
        """Release a stop. Only nodes that the scenario names may do this: [control] may_release = ["/supervisor"].
        `rules`: the ended rules that continue, each with `enter` or `wait`."""
        return await self.submit("releaseStop", f"{self._transport.node} {json.dumps(rules) if rules else ''}".strip())

    async def read_memory(self, key: str, otherwise: Any = None) -> Any:
        """Return the value of a key of the working memory; `otherwise` if there is none. Raises SessionGoneError."""
        await self._wait_until(self._memory.count_servers, "no session offers rise/get_memory")
        ask = partial(self._memory.call, {"request_by_key": key})
        (answer,) = await self._wait_for_answer(ask, "the session did not say what is in its memory")
        return json.loads(answer["value"]) if answer["found"] else otherwise

    def watch_rule_states(self, on_state: Callable[[Message], None]) -> None:
        """Call `on_state` with each `rise_interfaces/msg/RuleState` from now on: rule, status (started, entered,
        stayed, ended, stopped, faulted), state, previous_state, trigger, priority."""
        self._transport.subscribe("rise/rule_state", "rise_interfaces/msg/RuleState", on_state)

    async def _wait_until(self, count_servers: Callable[[], int], missing: str) -> None:
        """Wait until a server answers. An earlier request would be lost silently."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + self.patience
        while not count_servers():
            if loop.time() > deadline:
                raise SessionGoneError(missing)
            await asyncio.sleep(0.02)

    async def _wait_for_answer(self, ask: Callable[[Callable[..., None]], None], missing: str) -> tuple[Any, ...]:
        answer: asyncio.Future[tuple[Any, ...]] = asyncio.get_running_loop().create_future()
        ask(partial(_set_result, answer))
        try:
            async with asyncio.timeout(self.patience):  # wait_for of Python 3.11 may swallow a cancellation
                return await answer
        except TimeoutError:
            raise SessionGoneError(missing) from None


def _set_result(future: asyncio.Future[tuple[Any, ...]], *values: Any) -> None:
    if not future.done():
        future.set_result(values)
