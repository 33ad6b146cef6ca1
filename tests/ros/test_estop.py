"""The emergency stop that a profile names: heard from whoever publishes it, and a fault of the robot when it is not."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace
from rise_adapters.ros2.robot.estop_input import SERVICE_TYPE
from rise_adapters.ros2.transport.port import RELIABLE, STATUS, PortError, QoS, RemoteEndpoint

from rise_engine.base.suspend import suspended_seconds
from rise_engine.kernel.inputs import ActionReport, EstopReport, RobotChanged
from tests.ros.bench import profile
from tests.ros.memory import MemoryTransport
from tests.ros.test_robot import Alone

NAME, TYPE, SOURCE = "/estop_pressed", "std_msgs/msg/Bool", "estop:/estop_pressed"
TOPIC = {"topic": NAME, "type": TYPE, "when": {"data": True}}
AGAIN = "start it again, or begin a new session"
PRESSED, LET_GO = EstopReport(source=SOURCE, pressed=True), EstopReport(source=SOURCE, pressed=False)


def with_estop(**estop: Any) -> Alone:
    return Alone(which=replace(profile(), options={"estop": estop}))


def standing(robot: Alone) -> tuple[str, str]:
    last = robot.of(RobotChanged)[-1]
    return last.status, last.detail


@pytest.mark.parametrize("offered", [QoS(), QoS(reliable=False), STATUS], ids=["usual", "best effort", "latched"])
def test_it_is_heard_whatever_its_publisher_promises(offered: QoS) -> None:
    robot = with_estop(**TOPIC)
    button = robot.far.publisher(NAME, TYPE, offered)
    if offered.latched:
        button.publish({"data": True})
    robot.run(1)
    assert robot.of(EstopReport) == [PRESSED] * offered.latched, "what was said before this session"
    for pressed in (True, True, False, False):
        button.publish({"data": pressed})
        robot.run(robot.clock.now() + 0.1)
    assert robot.of(EstopReport) == [PRESSED, LET_GO], "what is said again is no news"


def test_a_robot_whose_emergency_stop_cannot_be_heard_is_degraded() -> None:
    robot = with_estop(**TOPIC, silent_after=3)
    robot.run(6)
    missing = "the emergency stop at /estop_pressed cannot be heard: nothing publishes it as std_msgs/msg/Bool"
    assert standing(robot) == ("degraded", missing)
    button = robot.far.publisher(NAME, TYPE)
    for _ in range(3):
        robot.run(robot.clock.now() + 1)
        button.publish({"data": False})
    assert standing(robot)[0] == "connected"
    button.publish({"data": True})
    robot.run(robot.clock.now() + 4)
    was = "; it was pressed when it was heard last"
    assert standing(robot) == ("degraded", f"the emergency stop at /estop_pressed has said nothing for 3 s{was}")
    button.close()
    robot.run(robot.clock.now() + 1)
    assert standing(robot) == ("degraded", missing + was)
    assert robot.of(EstopReport)[-1] == PRESSED, "who is not heard any more has let nothing go"


def test_one_that_speaks_only_of_changes_is_not_known_until_then() -> None:
    robot = with_estop(**TOPIC)
    button = robot.far.publisher(NAME, TYPE)
    robot.run(4)
    unknown = "the emergency stop at /estop_pressed has said nothing yet, so whether it is pressed is not known"
    assert standing(robot) == ("degraded", unknown)
    button.publish({"data": False})
    robot.run(60)
    assert standing(robot)[0] == "connected" and robot.of(EstopReport) == [LET_GO]


def test_one_that_comes_and_goes_is_told_a_few_times_only() -> None:
    """As with a `silent_after` near its period."""
    robot = with_estop(**TOPIC, silent_after=1)
    button = robot.far.publisher(NAME, TYPE)
    button.publish({"data": False})
    for _ in range(30):
        robot.run(robot.clock.now() + 1.5)
        button.publish({"data": False})
    assert len(robot.of(RobotChanged)) <= 8 and standing(robot)[0] == "degraded"
    say(robot, 35, (button, False))
    assert standing(robot)[0] == "connected"


def test_one_that_comes_and_goes_and_then_is_missing_is_told_to_be_missing() -> None:
    robot = with_estop(**TOPIC, silent_after=1)
    button = robot.far.publisher(NAME, TYPE)
    button.publish({"data": False})
    for _ in range(4):
        robot.run(robot.clock.now() + 1.5)
        button.publish({"data": False})
    button.close()
    robot.run(robot.clock.now() + 2)
    assert standing(robot)[1].endswith("cannot be heard: nothing publishes it as std_msgs/msg/Bool")


def say(robot: Alone, seconds: int, *buttons: tuple[Any, bool]) -> None:
    """Let each button publish its state twice a second."""
    for _ in range(seconds * 2):
        for button, pressed in buttons:
            button.publish({"data": pressed})
        robot.run(robot.clock.now() + 0.5)


@pytest.mark.parametrize("hangs", [True, False], ids=["hangs", "dies"])
def test_one_publisher_does_not_let_go_of_the_button_of_another(hangs: bool) -> None:
    robot = with_estop(**TOPIC, silent_after=2)
    base = robot.far.publisher(NAME, TYPE)
    panel = MemoryTransport(robot.wire, robot.loop, "/panel").publisher(NAME, TYPE)
    say(robot, 3, (base, False), (panel, True))
    assert [report.pressed for report in robot.of(EstopReport)] == [True], "the other one says that it is not pressed"
    why = "has several publishers (/panel, /robot): a message does not say who sent it; let one program publish for all"
    was = "; it was pressed when it was heard last"
    assert standing(robot) == ("degraded", f"the emergency stop at /estop_pressed {why}{was}")
    if not hangs:
        panel.close()
    say(robot, 10, (base, False))
    assert robot.of(EstopReport)[-1] == PRESSED, "nobody has let go of the button that was pressed"
    gone = f"is not published by /panel any more, where it may be pressed: {AGAIN}"
    assert standing(robot) == ("degraded", f"the emergency stop at /estop_pressed {why if hangs else gone}{was}")


@pytest.mark.parametrize("says_only_changes", [True, False])
def test_a_button_whose_program_is_started_again_lets_go(says_only_changes: bool) -> None:
    robot = with_estop(**TOPIC)
    first, second = (another(robot, "/button", STATUS) for _ in range(2))  # the killed one is still shown
    first.publish({"data": True})
    robot.run(1)
    second.publish({"data": False})
    robot.run(2)
    assert robot.of(EstopReport) == [PRESSED]
    first.home.close()
    say(robot, 3, *(() if says_only_changes else [(second, False)]))
    assert robot.of(EstopReport) == [PRESSED, LET_GO] and standing(robot)[0] == "connected"


def another(robot: Alone, node: str, offered: QoS = RELIABLE) -> Any:
    """Another program with a button."""
    return MemoryTransport(robot.wire, robot.loop, node).publisher(NAME, TYPE, offered)


def test_what_was_latched_before_does_not_press_it_again() -> None:
    robot = with_estop(**TOPIC)
    offered = QoS(depth=10, latched=True)
    other, button = another(robot, "/button", offered), another(robot, "/button", offered)
    for pressed in (False, True, False):
        button.publish({"data": pressed})
        robot.run(robot.clock.now() + 1)
    other.home.close()
    robot.run(robot.clock.now() + 2)
    another(robot, "/button", offered).home.close()
    robot.run(robot.clock.now() + 2)
    assert robot.of(EstopReport) == [PRESSED, LET_GO] and standing(robot)[0] == "connected"


@pytest.mark.parametrize("seconds", [0, 2], ids=["between two looks", "for a while"])
def test_a_program_that_comes_has_not_said_that_its_button_is_not_pressed(seconds: int) -> None:
    robot = with_estop(**TOPIC)
    before = another(robot, "/button")
    say(robot, 2, (before, False))
    before.home.close()
    robot.run(robot.clock.now() + seconds)
    now = another(robot, "/button")
    robot.run(robot.clock.now() + 1)
    robot.start()
    robot.run(robot.clock.now() + 1)
    assert robot.servers["/pepper/rise/speech"].at_once == 0
    say(robot, 1, (now, False))
    assert robot.servers["/pepper/rise/speech"].at_once == 1


def test_a_button_without_its_program_is_not_let_go_by_a_program_of_another_name() -> None:
    robot = with_estop(**TOPIC)
    pressed = another(robot, "/button")
    say(robot, 1, (pressed, True))
    pressed.home.close()
    say(robot, 2, (another(robot, "/panel"), False))
    gone = (
        f"is not published by /button any more, where it may be pressed: {AGAIN}; it was pressed when it was heard last"
    )
    assert robot.of(EstopReport) == [PRESSED] and standing(robot)[1] == f"the emergency stop at {NAME} {gone}"
    say(robot, 2, (another(robot, "/button"), False))
    assert robot.of(EstopReport) == [PRESSED], "there are two now"


@pytest.mark.parametrize("by", ["/panel", ""])
def test_a_button_whose_program_has_no_node_is_let_go_only_by_one_without(by: str) -> None:
    robot = with_estop(**TOPIC)
    pressed = another(robot, "/plain")
    pressed.home.node = ""
    say(robot, 5, (pressed, True))
    pressed.home.close()
    other = another(robot, "/other")
    other.home.node = by
    say(robot, 3, (other, False))
    assert robot.of(EstopReport) == ([PRESSED] if by else [PRESSED, LET_GO])
    assert ("is not published by a program without a node any more" in standing(robot)[1]) is bool(by)


@pytest.mark.parametrize("pressed", [True, False])
def test_a_program_whose_node_is_known_late_is_one_button(pressed: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = with_estop(**TOPIC)
    button = another(robot, "/button")
    find = robot.near.publisher_endpoints
    with monkeypatch.context() as patch:
        patch.setattr(robot.near, "publisher_endpoints", lambda topic: [replace(end, node="") for end in find(topic)])
        say(robot, 32, (button, pressed))
    for state in (True, False):
        say(robot, 5, (button, state))
    assert robot.of(EstopReport)[-2:] == [PRESSED, LET_GO] and standing(robot)[0] == "connected"


def test_a_tool_presses_and_need_not_come_back() -> None:
    robot = with_estop(**TOPIC)
    button = another(robot, "/button")
    say(robot, 3, (button, False))
    tool = another(robot, "/_ros2cli_4711")
    tool.publish({"data": True})
    say(robot, 1, (button, False))
    assert robot.of(EstopReport)[-1] == PRESSED and "has several publishers" in standing(robot)[1]
    tool.home.close()
    robot.run(robot.clock.now() + 2)
    assert robot.of(EstopReport)[-1] == PRESSED, "until the button says its state"
    say(robot, 1, (button, False))
    assert robot.of(EstopReport)[-2:] == [PRESSED, LET_GO] and standing(robot)[0] == "connected"


def test_a_tool_does_not_let_go_of_a_button_whose_program_has_gone() -> None:
    robot = with_estop(**TOPIC)
    button = another(robot, "/button")
    say(robot, 1, (button, True))
    button.home.close()
    say(robot, 2, (another(robot, "/_ros2cli_4711"), False))
    assert robot.of(EstopReport) == [PRESSED]


@pytest.mark.parametrize("gone", [True, False], ids=["whose program has gone", "that is found later"])
def test_a_button_stays_pressed_over_a_new_connection(gone: bool) -> None:
    robot = with_estop(**TOPIC)
    pressed = another(robot, "/button")
    say(robot, 1, (pressed, True))
    other = another(robot, "/panel")
    if gone:
        pressed.home.close()
    say(robot, 2, (other, False))
    robot.near.break_down("the context was shut down")
    robot.run(5)
    robot.wire.forget("/button")
    robot.robot.switch_transport(MemoryTransport(robot.wire, robot.loop, "/engine_again"))
    say(robot, 2, (other, False))
    assert robot.of(EstopReport) == [PRESSED]
    robot.wire.heal("/button")
    say(robot, 1, (other, False))
    assert robot.of(EstopReport) == [PRESSED]


def test_a_button_is_heard_over_a_new_connection_on_which_a_part_of_the_robot_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot = with_estop(**TOPIC)
    button = another(robot, "/button")
    say(robot, 1, (button, False))
    robot.near.break_down("the context was shut down")
    robot.run(5)
    again = MemoryTransport(robot.wire, robot.loop, "/engine_again")

    def fail(*arguments: object) -> None:
        raise PortError("its type is not there")

    monkeypatch.setattr(again, "client", fail)
    with pytest.raises(PortError):
        robot.robot.switch_transport(again)
    say(robot, 1, (button, True))
    assert robot.of(EstopReport)[-1] == PRESSED


def test_a_button_is_let_go_over_a_new_connection() -> None:
    robot = with_estop(**TOPIC)
    button = another(robot, "/button")
    say(robot, 1, (button, True))
    robot.near.break_down("the context was shut down")
    robot.run(5)
    robot.robot.switch_transport(MemoryTransport(robot.wire, robot.loop, "/engine_again"))
    say(robot, 1, (button, False))
    assert robot.of(EstopReport) == [PRESSED, LET_GO] and standing(robot)[0] == "connected"


def test_a_button_stays_pressed_for_an_engine_that_continues_until_it_is_pressed_again() -> None:
    robot = with_estop(**TOPIC)
    pressed = another(robot, "/button")
    say(robot, 1, (pressed, True))
    pressed.home.close()
    robot.recover(held_by=(SOURCE,), estop=TOPIC)
    other = another(robot, "/panel")
    say(robot, 7, (other, False))
    assert robot.of(EstopReport) == [PRESSED], "nobody knows at which button it was pressed"
    why = "was pressed when an engine ended, and it is unknown at which button: press it and let it go"
    assert standing(robot) == ("degraded", f"the emergency stop at {NAME} {why}")
    say(robot, 1, (other, True))
    say(robot, 1, (other, False))
    assert robot.of(EstopReport) == [PRESSED, LET_GO] and standing(robot)[0] == "connected"


@pytest.mark.parametrize("seconds", [10, 40])
def test_two_buttons_may_have_one_name(seconds: int) -> None:
    """Programs that stay together for longer than a killed one is shown."""
    robot = with_estop(**TOPIC)
    one, other = another(robot, "/button"), another(robot, "/button")
    say(robot, seconds, (one, True), (other, False))
    one.home.close()
    say(robot, 3, (other, False))
    assert robot.of(EstopReport)[1:] == ([LET_GO] if seconds == 10 else [])
    assert standing(robot)[0] == ("connected" if seconds == 10 else "degraded")


def test_a_program_whose_node_is_not_known_for_a_moment_is_no_other_one(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = with_estop(**TOPIC)
    before = another(robot, "/button")
    say(robot, 2, (before, False))
    now = another(robot, "/button")
    find = robot.near.publisher_endpoints

    def find_early(topic: str) -> list[RemoteEndpoint]:
        return [replace(end, node="" if end.program == now.home.program else end.node) for end in find(topic)]

    with monkeypatch.context() as patch:
        patch.setattr(robot.near, "publisher_endpoints", find_early)
        say(robot, 1, (now, False))
    before.home.close()
    say(robot, 2, (now, False))
    assert standing(robot)[0] == "connected"


@pytest.mark.parametrize("then", ["not pressed", "pressed", "nothing"])
def test_nothing_begins_before_the_emergency_stop_has_said_its_state(then: str) -> None:
    """A service manager recovers a session by itself, while somebody holds the button and looks at the robot."""
    robot = with_estop(**TOPIC)
    robot.start()
    robot.run(1)
    button = robot.far.publisher(NAME, TYPE)
    robot.run(2)
    assert robot.servers["/pepper/rise/speech"].at_once == 0 and robot.of(RobotChanged) == []
    if then != "nothing":
        button.publish({"data": then == "pressed"})
    robot.run(2.2)
    assert robot.servers["/pepper/rise/speech"].at_once == (then == "not pressed")
    robot.run(6)
    last = robot.of(ActionReport)[-1]
    reason = "the emergency stop at /estop_pressed "
    told = {
        "not pressed": ("succeeded", ""),
        "pressed": ("failed", f"estop-pressed: {reason}is pressed"),
        "nothing": ("failed", f"estop-unknown: {reason}has said nothing yet, so whether it is pressed is not known"),
    }
    assert (last.status, last.reason) == told[then]


def test_nothing_begins_while_the_emergency_stop_is_silent() -> None:
    robot = with_estop(**TOPIC, silent_after=2)
    button = robot.far.publisher(NAME, TYPE)
    say(robot, 3, (button, False))
    robot.run(robot.clock.now() + 3)
    robot.start()
    robot.run(robot.clock.now() + 1)
    assert robot.servers["/pepper/rise/speech"].at_once == 0
    button.publish({"data": False})
    robot.run(robot.clock.now() + 0.2)
    assert robot.servers["/pepper/rise/speech"].at_once == 1


def test_nothing_begins_after_the_computer_has_slept_until_it_is_heard_again(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = with_estop(**TOPIC)
    button = robot.far.publisher(NAME, TYPE)
    say(robot, 2, (button, False))
    slept = suspended_seconds() + 3600  # somebody may have pressed it
    monkeypatch.setattr("rise_adapters.ros2.robot.estop_input.suspended_seconds", lambda: slept)
    robot.start()
    robot.run(robot.clock.now() + 1)
    assert robot.servers["/pepper/rise/speech"].at_once == 0
    say(robot, 1, (button, False))
    assert robot.servers["/pepper/rise/speech"].at_once == 1


def test_a_button_is_heard_although_nobody_can_be_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = with_estop(**TOPIC)

    def fail(topic: str) -> list[RemoteEndpoint]:
        raise RuntimeError("as the middleware, in a call that nothing guards")

    monkeypatch.setattr(robot.near, "publisher_endpoints", fail)
    with pytest.raises(RuntimeError):
        robot.robot._estop._take_message({"data": True})  # type: ignore[union-attr]
    assert robot.of(EstopReport) == [PRESSED]


def test_a_message_that_arrives_after_the_end_of_its_program_does_not_count_for_the_next_one() -> None:
    robot = with_estop(**TOPIC)
    before = another(robot, "/button")
    say(robot, 2, (before, False))
    take = robot.robot._estop._take_message  # type: ignore[union-attr]  # taken from the wire, and not handled yet
    before.home.close()
    another(robot, "/button")
    take({"data": False})
    robot.start()
    robot.run(robot.clock.now() + 1)
    assert robot.servers["/pepper/rise/speech"].at_once == 0


def test_which_values_mean_that_it_is_pressed() -> None:
    robot = with_estop(topic="/safety", type="std_msgs/msg/UInt8", when={"data": [3, 6]})
    button = robot.far.publisher("/safety", "std_msgs/msg/UInt8", STATUS)
    robot.run(1)
    for mode in (1, 3, 6, 7):
        button.publish({"data": mode})
        robot.run(robot.clock.now() + 0.1)
    assert [report.pressed for report in robot.of(EstopReport)] == [False, True, False]


def test_programs_press_it_by_a_service_too() -> None:
    robot = with_estop(service="rise/estop")
    robot.run(1)
    assert standing(robot)[0] == "connected"
    answers: list[Any] = []
    client = robot.far.client("/rise/estop", SERVICE_TYPE)
    for pressed in (True, True, False):
        client.call({"data": pressed}, answers.append)
        robot.run(robot.clock.now() + 0.1)
    assert [(each.source, each.pressed) for each in robot.of(EstopReport)] == [
        ("estop:/rise/estop", True),
        ("estop:/rise/estop", False),
    ]
    assert all(answer["success"] for answer in answers) and answers[0]["message"] == "the emergency stop is pressed"
    robot.robot.close()
    robot.run(robot.clock.now() + 1)
    assert client.count_servers() == 0
