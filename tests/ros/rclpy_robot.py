"""A robot that somebody else wrote: an action server of rclpy, as its tutorials have it, with a slow mind of its own.

    python -m tests.ros.rclpy_robot '{"plans": [{"decides_after": 6, "seconds": 4}]}'

It follows the plans of `tests.ros.badrobot`, as far as rclpy can do wrong, and prints the same lines.
"""

from __future__ import annotations

import json
import os
import sys
import time
from contextlib import suppress
from typing import Any

import msgspec
import rclpy
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rise_adapters.ros2.actions.client import ABORTED, CANCELED, SUCCEEDED
from rise_interfaces.action import Speech

from tests.ros.badrobot import Plan
from tests.ros.bench import SPEECH


def say(**what: Any) -> None:
    line = json.dumps({"at": time.monotonic(), "name": SPEECH, **what})
    os.write(1, f"{line}\n".encode())  # at once: there are several threads


class Robot:
    """One action server on one node."""

    def __init__(self, node: Any, plans: list[Plan]) -> None:
        self._plans = plans
        self._plan: dict[bytes, Plan] = {}
        self._next = 0
        self._server = ActionServer(
            node,
            Speech,
            SPEECH,
            self._carry_out,
            goal_callback=self._decide,
            cancel_callback=self._take_cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    def _decide(self, request: Any) -> GoalResponse:
        plan = self._plans[min(self._next, len(self._plans) - 1)]
        self._next += 1
        say(event="goal", id="")
        time.sleep(plan.decides_after)
        if plan.accept is False:
            say(event="refused", id="")
        return GoalResponse.ACCEPT if plan.accept is not False else GoalResponse.REJECT

    def _take_cancel(self, goal: Any) -> CancelResponse:
        say(event="cancel", id=bytes(goal.goal_id.uuid).hex())
        plan = self._plans[min(self._next, len(self._plans)) - 1]
        return CancelResponse.REJECT if plan.cancel in ("refuse", "reject") else CancelResponse.ACCEPT

    def _carry_out(self, goal: Any) -> Any:
        plan = self._plans[min(self._next, len(self._plans)) - 1]
        id = bytes(goal.goal_id.uuid).hex()
        say(event="begin", id=id)
        over = time.monotonic() + (plan.seconds if plan.end is not None else 1e6)
        while time.monotonic() < over and not (plan.cancel == "yes" and goal.is_cancel_requested):
            time.sleep(0.01)
        stopped = plan.cancel == "yes" and goal.is_cancel_requested
        status = CANCELED if stopped else plan.end
        say(event="end", id=id, status=status)
        {SUCCEEDED: goal.succeed, ABORTED: goal.abort, CANCELED: goal.canceled}[status]()
        return Speech.Result()


def main() -> None:
    plans = msgspec.convert(json.loads(sys.argv[1])["plans"], list[Plan])
    rclpy.init()
    node = rclpy.create_node("foreign_robot")
    robot = Robot(node, plans)
    executor = MultiThreadedExecutor(4)
    executor.add_node(node)
    say(event="ready", id="")
    with suppress(ExternalShutdownException, KeyboardInterrupt):
        executor.spin()
    del robot


if __name__ == "__main__":
    main()
