"""Actions on a topic: who gets an order, and who is told that it is over. (`simple_goal_model` explores the rest.)"""

from __future__ import annotations

from typing import Any

import pytest
from rise_adapters.ros2.transport.port import PortError, QoS

from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from tests.ros.badrobot import Plan
from tests.ros.bench import SPEECH
from tests.ros.memory import MemoryTransport
from tests.ros.test_robot import EYES, OTHERS, Alone, Eyes

RESET: dict[str, Any] = {"reset": {"data": "neutral"}}
NOT_HEARD = "it may not have heard that it should stop"


def listen(eyes: Eyes, node: str, qos: QoS | None = None) -> list[str]:
    """What a new program hears."""
    heard: list[str] = []
    there = MemoryTransport(eyes.wire, eyes.loop, node)
    there.subscribe("/pepper/eyes", EYES["type"], lambda message: heard.append(message["data"]), qos or QoS())
    return heard


@pytest.mark.parametrize("case", ["started again while the dead one is shown", "started in the middle, beside a bag"])
def test_a_base_that_comes_up_in_the_middle_does_not_begin(case: str) -> None:
    eyes = Eyes(listening="again" in case, rate=5.0, **RESET)
    if "bag" in case:
        listen(eyes, "/bag")
    eyes.run(7)
    eyes.show("1/a", "drive", 60)
    eyes.run(9)
    if "again" in case:
        eyes.wire.kill("/robot")
    eyes.run(9.15)
    base = listen(eyes, "/base")
    eyes.run(20)
    assert set(base) == {"neutral"}
    (end,) = eyes.of(ActionReport)[1:]
    why = "server-restarted: something else listens to /pepper/eyes now, and must not begin midway"
    assert (end.status, end.aborted, end.reason) == ("failed", True, why)
    eyes.show("2/a", "drive", 1)
    eyes.run(22)
    assert base.count("drive") == 5 and eyes.statuses("2/a") == ["accepted", "succeeded"]


def test_who_comes_just_before_a_repetition_does_not_belong_to_those_who_began(monkeypatch: pytest.MonkeyPatch) -> None:
    eyes = Eyes(rate=5.0, **RESET)
    eyes.run(1)
    eyes.show("1/a", "drive", 10)
    eyes.run(3.05)
    publisher = eyes.robot._endpoint_of["Emotion"].publisher  # type: ignore[union-attr]
    publish, heard = publisher.publish, []

    def publish_and_find(message: Any) -> None:
        publish(message)
        if not heard:
            heard.append(listen(eyes, "/base2"))

    monkeypatch.setattr(publisher, "publish", publish_and_find)
    eyes.run(8)
    assert set(heard[0]) == {"neutral"} and eyes.statuses("1/a") == ["accepted", "failed"]


@pytest.mark.parametrize("lossy", ["our side", "their side", "neither"])
def test_where_messages_may_be_lost_the_reset_is_repeated_less_and_less_often(lossy: str) -> None:
    eyes = Eyes(listening=False, **RESET, **({"qos": {"reliability": "best_effort"}} if lossy == "our side" else {}))
    heard = listen(eyes, "/base", QoS(reliable=lossy == "neither"))
    eyes.run(1)
    eyes.show("1/a", "happy", 2)
    eyes.run(2)
    eyes.wire.drop("/pepper/eyes", what="message", times=2)
    eyes.run(60)
    assert len(eyes.wire.messages("/pepper/eyes")) == (2 if lossy == "neither" else 8)
    assert (heard[-1] == "neutral") is (lossy != "neither")
    assert eyes.of(RobotChanged)[-1].status == "connected" and eyes.of(RobotChanged)[-1].open == ()


def test_a_repetition_ends_with_the_next_order() -> None:
    eyes = Eyes(listening=False, **RESET)
    heard = listen(eyes, "/base", QoS(reliable=False))
    eyes.run(1)
    eyes.show("1/a", "happy", 2)
    eyes.run(3.2)
    eyes.show("2/a", "sad", 60)
    eyes.run(30)
    assert heard == ["happy", "neutral", "sad"]


def test_who_has_just_begun_to_listen_is_told_until_it_can_hear() -> None:
    """The middleware lists it before messages reach it."""
    eyes = Eyes(**RESET)
    eyes.run(1)
    eyes.show("1/a", "happy", 2)
    eyes.wire.forget("/robot")
    eyes.run(5)
    eyes.wire.heal("/robot")
    deaf = eyes.wire.drop("/pepper/eyes")
    eyes.run(5.4)
    deaf.stop()
    eyes.run(8)
    assert eyes.seen[-1][1] == "neutral" and eyes.of(RobotChanged)[-1].open == ()


@pytest.mark.parametrize("tool_at", [3, 7], ids=["before it is cut off", "afterwards"])
def test_a_base_that_is_cut_off_has_not_heard_because_a_tool_begins_to_listen(tool_at: int) -> None:
    eyes = Eyes(**RESET)
    eyes.run(1)
    eyes.show("1/a", "drive", 60)
    for at in (3, 5, 7):
        eyes.run(at)
        if at == tool_at:
            listen(eyes, "/rqt_plot")
        if at == 5:
            eyes.wire.forget("/robot")
    report = eyes.stop()
    eyes.run(60)
    assert eyes.seen[-1][1] == "drive"
    assert [goal.reason for goal in eyes.of(RobotChanged)[-1].open] == [NOT_HEARD]
    assert f"pepper/eyes ({NOT_HEARD})" in report.unconfirmed
    base = listen(eyes, "/robot")  # it was started again
    eyes.run(62)
    assert set(base) == {"neutral"} and eyes.of(RobotChanged)[-1].open == ()


def test_a_base_that_wants_another_quality_is_named_although_a_bag_hears_everything() -> None:
    eyes = Eyes(listening=False, **RESET, qos={"reliability": "best_effort"})
    listen(eyes, "/base", QoS(reliable=True))
    listen(eyes, "/rosbag2_recorder", QoS(reliable=False))
    eyes.run(8)
    assert "/pepper/eyes is wanted reliably by the node /base" in eyes.of(RobotChanged)[-1].detail


def test_a_base_that_is_listed_after_its_first_order_has_heard_the_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    eyes = Eyes(listening=False, **RESET)
    heard = listen(eyes, "/base")
    with monkeypatch.context() as patch:
        patch.setattr(eyes.near, "subscriber_endpoints", lambda topic: [])
        eyes.run(3)
        eyes.show("1/a", "happy", 2)
        eyes.run(4)
    eyes.run(10)
    assert heard == ["happy", "neutral"] and eyes.of(RobotChanged)[-1].open == ()


@pytest.mark.parametrize("nodes", [("",), ("/base", "/lights")], ids=["without a name", "one after the other"])
def test_a_base_that_is_started_again_is_known_by_its_nodes(nodes: tuple[str, ...]) -> None:
    """A program with several nodes ends them one by one; a plain program of DDS has none."""
    eyes = Eyes(listening=False, **RESET)

    def start() -> list[MemoryTransport]:
        made = [MemoryTransport(eyes.wire, eyes.loop, node or "/nameless") for node in nodes]
        for node, each in zip(nodes, made, strict=True):
            each.node, each.program = node, made[0].program
            each.subscribe("/pepper/eyes", EYES["type"], lambda message: None, QoS())
        return made

    base = start()
    eyes.run(1)
    eyes.show("1/a", "happy", 2)
    for at, each in enumerate(base, 2):
        eyes.run(at)
        each.close()
    eyes.run(5)
    assert [goal.reason for goal in eyes.of(RobotChanged)[-1].open] == [NOT_HEARD]
    listen(eyes, "/rqt_plot")
    eyes.run(8)
    assert eyes.of(RobotChanged)[-1].open, "a tool is no base"
    start()
    eyes.run(12)
    assert eyes.of(RobotChanged)[-1].open == ()


@pytest.mark.parametrize("node", ["/rosbag2_recorder", "/_ros2cli_4711"])
def test_who_only_looks_on_is_owed_nothing_and_disturbs_nothing(node: str) -> None:
    eyes = Eyes(rate=5.0, **RESET)
    eyes.run(1)
    eyes.show("1/a", "drive", 4)
    eyes.run(2)
    listen(eyes, node)
    eyes.run(3)
    eyes.wire.forget(node)
    eyes.run(6)
    assert eyes.statuses("1/a") == ["accepted", "succeeded"]
    listen(eyes, node)
    eyes.show("2/a", "drive", 4)
    eyes.run(11)
    eyes.wire.forget(node)
    eyes.run(15)
    assert eyes.statuses("2/a") == ["accepted", "succeeded"] and len(eyes.of(RobotChanged)) == 1


@pytest.mark.parametrize("more", [{}, {"rate": 5.0}])
def test_an_order_goes_out_only_to_somebody_who_does_more_than_look_on(more: dict[str, Any]) -> None:
    eyes = Eyes(listening=False, **RESET, **more)
    bag = listen(eyes, "/rosbag2_recorder")
    eyes.run(1)
    eyes.show("1/a", "drive", 1)
    eyes.run(10)
    assert eyes.statuses("1/a") == ["failed"] and bag == []
    assert eyes.stop().unconfirmed[-1] == "pepper/eyes (never seen)"


def test_an_order_is_lost_with_its_base_although_a_bag_listens() -> None:
    eyes = Eyes(**RESET)
    listen(eyes, "/rosbag2_recorder")
    eyes.run(1)
    eyes.show("1/a", "drive", 10)
    eyes.run(3)
    eyes.wire.forget("/robot")
    eyes.run(20)
    assert eyes.statuses("1/a") == ["accepted", "lost"]


def failing(monkeypatch: pytest.MonkeyPatch, eyes: Eyes) -> None:
    def publish(message: Any) -> None:
        raise PortError("the middleware refuses")

    monkeypatch.setattr(eyes.robot._endpoint_of["Emotion"].publisher, "publish", publish)  # type: ignore[union-attr]


def test_a_reset_that_cannot_be_published_is_open_until_it_can(monkeypatch: pytest.MonkeyPatch) -> None:
    eyes = Eyes(**RESET)
    eyes.run(1)
    eyes.show("1/a", "happy", 2)
    eyes.run(2)
    with monkeypatch.context() as broken:
        failing(broken, eyes)
        eyes.run(5)
        assert [goal.reason for goal in eyes.of(RobotChanged)[-1].open] == [NOT_HEARD]
        assert eyes.stop().unconfirmed[-1] == f"pepper/eyes ({NOT_HEARD})"
    eyes.run(10)
    assert eyes.seen[-1][1] == "neutral" and eyes.of(RobotChanged)[-1].open == ()
    assert eyes.of(StopReport)[-1].unconfirmed == ("pepper/eyes (told to stop; a topic gives no answer)",)


def test_a_topic_that_could_not_be_told_is_not_called_told_although_nobody_has_an_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    eyes = Eyes(**RESET)
    eyes.run(1)
    with monkeypatch.context() as broken:
        failing(broken, eyes)
        assert eyes.stop().unconfirmed[-1] == f"pepper/eyes ({NOT_HEARD})"
    eyes.run(8)
    assert eyes.of(StopReport)[-1].unconfirmed == ("pepper/eyes (told to stop; a topic gives no answer)",)


def test_an_order_that_cannot_be_repeated_is_not_begun_again(monkeypatch: pytest.MonkeyPatch) -> None:
    eyes = Eyes(rate=5.0, **RESET)
    eyes.run(1)
    eyes.show("1/a", "drive", 60)
    eyes.run(2)
    with monkeypatch.context() as broken:
        failing(broken, eyes)
        eyes.run(3)
    end = eyes.of(ActionReport)[-1]
    why = "standstill: it cannot be repeated, so the robot does not go on (the middleware refuses)"
    assert (end.status, end.aborted, end.reason) == ("failed", True, why)


def test_over_a_new_connection_the_reset_is_told() -> None:
    eyes = Eyes(**RESET)
    eyes.run(1)
    eyes.show("1/a", "happy", 60)
    eyes.run(2)
    eyes.near.break_down("the context was shut down")
    eyes.run(3)
    assert [goal.reason for goal in eyes.of(RobotChanged)[-1].open] == [NOT_HEARD]
    eyes.robot.switch_transport(MemoryTransport(eyes.wire, eyes.loop, "/engine_again"))
    eyes.run(6)
    assert eyes.seen[-1][1] == "neutral" and eyes.of(RobotChanged)[-1].open == ()
    eyes.show("2/a", "sad", 1)
    eyes.run(10)
    assert eyes.statuses("2/a") == ["accepted", "succeeded"]


def test_a_stop_that_is_in_force_asks_again_over_a_new_connection() -> None:
    robot = Alone(Plan(seconds=60))
    robot.start()
    robot.run(1)
    assert robot.stop().confirmed == ("pepper/look_at", "pepper/speech")
    robot.near.break_down("the context was shut down")
    robot.run(6)
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=60))
    robot.robot.switch_transport(MemoryTransport(robot.wire, robot.loop, "/engine_again"))
    robot.run(14)
    assert robot.of(StopReport)[-1] == StopReport(confirmed=("pepper/look_at", "pepper/speech"))
    assert not robot.servers[SPEECH].running(), "what was begun meanwhile is stopped, too"
    robot.servers[SPEECH].foreign(bytes(range(1, 17)), Plan(seconds=60))
    robot.run(17)
    why = "pepper/speech (something was begun there after the stop)"
    assert robot.of(StopReport)[-1].unconfirmed == (why,)
