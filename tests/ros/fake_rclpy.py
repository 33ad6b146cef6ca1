"""As much of `rclpy` as a leaf of a behaviour tree uses, on a wire in memory: what it asks for is done by a real
session, without ROS (`tests.ros.memory`)."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from rise_adapters.ros2.actions import client as actions
from rise_adapters.ros2.transport.port import Message

from tests.ros.memory import MemoryTransport


class Future:
    """As rclpy's: no result yet is None."""

    def __init__(self) -> None:
        self._result: Any = None
        self._is_done = False
        self._callbacks: list[Callable[[Future], None]] = []

    def result(self) -> Any:
        return self._result

    def add_done_callback(self, callback: Callable[[Future], None]) -> None:
        if self._is_done:
            callback(self)
        else:
            self._callbacks.append(callback)

    def set_result(self, result: Any) -> None:
        assert not self._is_done
        self._result, self._is_done = result, True
        for callback in self._callbacks:
            callback(self)


class GoalHandle:
    """As rclpy's ClientGoalHandle."""

    def __init__(self, client: ActionClient, id: bytes, accepted: bool) -> None:
        self._client, self._id, self.accepted = client, id, accepted

    def get_result_async(self) -> Future:
        future = Future()

        def take(status: int, result: Message) -> None:
            future.set_result(SimpleNamespace(status=status, result=DomainTask.Result(**result)))

        self._client.actions.get_result(self._id, take)
        return future

    def cancel_goal_async(self) -> Future:
        future = Future()
        self._client.actions.cancel(self._id, future.set_result)
        return future


class ActionClient:
    """As rclpy's. A node is a transport here."""

    def __init__(self, node: MemoryTransport, type: Any, name: str) -> None:
        self.actions = actions.ActionClient(node, name, type.NAME)
        self.actions.on_feedback = self._take_feedback
        self._on_feedback: dict[bytes, Callable[[Any], None]] = {}

    def server_is_ready(self) -> bool:
        return self.actions.count_servers() > 0

    def send_goal_async(self, goal: Any, feedback_callback: Callable[[Any], None]) -> Future:
        id, future = os.urandom(16), Future()
        self._on_feedback[id] = feedback_callback
        self.actions.send(id, vars(goal), lambda accepted: future.set_result(GoalHandle(self, id, accepted)))
        return future

    def destroy(self) -> None:
        self.actions.close()

    def _take_feedback(self, id: bytes, message: Message) -> None:
        if id in self._on_feedback:
            self._on_feedback[id](SimpleNamespace(feedback=SimpleNamespace(**message)))


class _Result(SimpleNamespace):
    def __init__(self, status: str = "", reason: str = "", task: int = 0) -> None:
        super().__init__(status=status, reason=reason, task=task)


class DomainTask:
    """As rosidl makes it of DomainTask.action."""

    NAME = "rise_interfaces/action/DomainTask"
    Goal, Result = SimpleNamespace, _Result


def install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until the test has ended, what imports rclpy and rise_interfaces gets these."""
    for name, contents in {
        "rclpy": {},
        "rclpy.action": {"ActionClient": ActionClient},
        "rclpy.executors": {"SingleThreadedExecutor": SimpleNamespace},
        "rclpy.signals": {"SignalHandlerOptions": SimpleNamespace},
        "rise_interfaces": {},
        "rise_interfaces.action": {"DomainTask": DomainTask},
    }.items():
        module = ModuleType(name)
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name, module)
