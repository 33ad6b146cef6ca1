"""A robot whose node has a lifecycle: while it is not active nothing is sent, and people are told what to do."""

from __future__ import annotations

import pytest
from rise_adapters.ros2.robot.lifecycle import EVENT_TYPE, STATE_TYPE

from rise_engine.kernel.inputs import ActionReport, RobotChanged
from tests.ros.memory import MemoryTransport
from tests.ros.test_robot import Alone

ACTIVATE = "/robot is inactive; activate it (ros2 lifecycle set /robot activate)"


class LifecycleNode:
    """What a node with a lifecycle offers beside its own."""

    def __init__(self, transport: MemoryTransport, state: str = "inactive") -> None:
        self.state = state
        transport.serve(
            f"{transport.node}/get_state",
            STATE_TYPE,
            lambda request, reply: reply({"current_state": {"id": 2, "label": self.state}}),
        )
        self._events = transport.publisher(f"{transport.node}/transition_event", EVENT_TYPE)

    def go(self, state: str, *, told: bool = True) -> None:
        self.state = state
        if told:
            self._events.publish({"goal_state": {"label": state}})


def standings(robot: Alone) -> list[tuple[str, str]]:
    return [(each.status, each.detail) for each in robot.of(RobotChanged)]


def test_an_inactive_robot_is_lost_gets_nothing_and_is_back_when_it_is_activated() -> None:
    robot = Alone(serving=False)
    node = LifecycleNode(robot.far)
    robot.serve()
    robot.run(2)
    assert standings(robot)[1:] == [("lost", f"inactive: Pepper is not active ({ACTIVATE})")]
    robot.start()
    assert robot.of(ActionReport)[-1].reason == f"inactive: {ACTIVATE}"
    assert robot.wire.messages("*/send_goal") == []
    node.go("active")
    robot.run(3)
    assert standings(robot)[-1][0] == "connected"
    robot.start("2/a")
    robot.run(10)
    assert [each.status for each in robot.of(ActionReport)][1:] == ["accepted", "succeeded"]


@pytest.mark.parametrize("told", [True, False], ids=["told", "found by asking"])
def test_a_robot_that_is_deactivated_says_what_to_do_at_each_state(told: bool) -> None:
    robot = Alone(serving=False)
    node = LifecycleNode(robot.far, "active")
    robot.serve()
    robot.run(1)
    for state in ("deactivating", "inactive", "unconfigured", "finalized"):
        node.go(state, told=told)
        robot.run(robot.clock.now() + 3)
    configure = "configure and activate it (ros2 lifecycle set /robot configure, then activate)"
    assert standings(robot)[0][0] == "connected"
    assert [detail.removeprefix("inactive: Pepper is not active ") for _, detail in standings(robot)[1:]] == [
        "(/robot is deactivating; wait until it is active)",
        f"({ACTIVATE})",
        f"(/robot is unconfigured; {configure})",
        "(/robot is finalized; start its program again)",
    ]


def test_a_node_without_a_lifecycle_is_asked_nothing() -> None:
    robot = Alone()
    robot.run(10)
    assert standings(robot)[-1][0] == "connected"
    assert not [client for client in robot.near.clients if "get_state" in client.name]


def test_one_that_is_replaced_is_asked_anew() -> None:
    robot = Alone(serving=False)
    LifecycleNode(robot.far, "active")
    robot.serve()
    robot.run(1)
    robot.far.close()
    robot.run(2)
    robot.far = MemoryTransport(robot.wire, robot.loop, "/robot")
    LifecycleNode(robot.far, "unconfigured")
    robot.serve()
    robot.run(6)
    assert standings(robot)[-1][1].startswith("inactive: Pepper is not active (/robot is unconfigured")
