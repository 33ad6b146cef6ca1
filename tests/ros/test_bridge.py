"""A session's connection: opened, refused, lost and made anew (`rise_adapters.ros2.bridge`)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from pathlib import Path

import pytest
from rise_adapters.ros2 import bridge as bridges
from rise_adapters.ros2.actions.server import ActionServer
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.bridge import Ros2Bridge
from rise_adapters.ros2.session_node import neighbours
from rise_adapters.ros2.transport.port import QoS, Transport

from rise_engine.base.errors import AdapterError
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import NoteRecord
from rise_engine.kernel.view import SessionView
from rise_engine.ports.bridge import RosConnection
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import make_robot, open_bridge
from rise_engine.run.engine.engine import Engine
from rise_engine.run.server.hub import SessionHub
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from tests.patience import PATIENCE
from tests.ros.memory import MemoryTransport, MemoryWire
from tests.ros.session_node_bench import until

ACTS = '<Dialogs><Dialog name="A"><Speech><actionID>1</actionID><message>x</message></Speech></Dialog></Dialogs>'


def study(folder: Path, *, robot: str = "rise", mode: str = "real") -> Scenario:
    (folder / "acts").mkdir(exist_ok=True)
    (folder / "acts" / "a.xml").write_text(ACTS)
    loaded = load(folder, robot=robot, mode=mode)
    assert loaded.scenario is not None, loaded.diagnostics
    return loaded.scenario


class Wired:
    """What `open_bridge` opens instead of a real transport."""

    def __init__(self) -> None:
        self.wire = MemoryWire()
        self.made: list[MemoryTransport] = []
        self.namespace = ""
        """Of the next nodes."""
        self.fails = 0
        """How many of the next attempts find no middleware."""

    async def open(
        self, choice: str = "auto", arguments: Sequence[str] = (), *, node: str, share: Sequence[Path] = ()
    ) -> Transport:
        if self.fails:
            self.fails -= 1
            raise AdapterError("no middleware")
        self.made.append(MemoryTransport(self.wire, asyncio.get_running_loop(), f"{self.namespace}/{node}"))
        return self.made[-1]

    def robot(self) -> None:
        """The `rise` robot: each of its actions is done at once."""
        loop = asyncio.get_running_loop()
        node = MemoryTransport(self.wire, loop, "robot")

        def act(goal: ServerGoal) -> None:
            goal.accept()
            goal.succeed({})

        for name, type in {
            "speech": "Speech", "look_at": "LookAt", "emotion": "Emotion", "animation": "Animation",
            "social_expression": "SocialExpression", "point_at": "PointAt",
        }.items():  # fmt: skip
            full = f"rise_interfaces/action/{type}"
            ActionServer(node, f"rise/robot/{name}", full, act, clock=RealClock(loop, 1.0, 0.0))


@pytest.fixture
async def wired(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Wired]:
    it = Wired()
    monkeypatch.setattr(bridges, "open_transport", it.open)
    monkeypatch.setattr(bridges, "WATCH_SECONDS", 0.01)
    monkeypatch.setattr(neighbours, "LISTEN_SECONDS", 0.05)
    yield it


class Session:
    def __init__(self, scenario: Scenario, bridge: Ros2Bridge) -> None:
        clock = RealClock(asyncio.get_running_loop(), 1.0, 0.0)
        robot = make_robot(scenario.robot, scenario.mode, clock, 1, (), bridge)
        self.engine = Engine(scenario, robot, clock, 1)
        self.hub = SessionHub(self.engine)
        self.notes: list[str] = []
        self.hub.subscribe(lambda update: self.notes.append(update.text) if isinstance(update, NoteRecord) else None)
        bridge.join(self.hub)
        self.engine.start()

    @property
    def view(self) -> SessionView:
        return self.hub.view

    async def act(self) -> str:
        """Run the act, and say what became of it."""
        self.engine.accept(Submit(function="startCommunicationRobotAct", behavior="A"))
        task = max(self.view.tasks)
        await until(lambda: self.view.tasks[task].ended is not None)
        return self.view.tasks[task].status


async def test_a_connection_that_is_lost_is_made_anew(tmp_path: Path, wired: Wired) -> None:
    """A27: the robot is lost and comes back, others find the session again, and the study goes on."""
    wired.robot()
    scenario = study(tmp_path)
    bridge = await open_bridge(RosConnection("dds"), scenario.robot, scenario.mode)
    assert isinstance(bridge, Ros2Bridge)
    session = Session(scenario, bridge)
    await until(lambda: session.view.robot is not None and session.view.robot.status == "connected")
    assert await session.act() == "SUCCEEDED"

    wired.fails = 1_000_000
    wired.made[0].break_down()
    await until(lambda: session.view.robot is not None and session.view.robot.status == "lost")
    assert "shut down" in session.view.robot.detail  # type: ignore[union-attr]
    wired.fails = 0
    await until(lambda: len(wired.made) == 2 and wired.made[0].closed)
    await until(lambda: session.view.robot is not None and session.view.robot.status == "connected")
    assert await session.act() == "SUCCEEDED"
    assert any(server.name.endswith("rise/domain_task/_action/send_goal") for server in wired.made[1].servers)
    assert len(session.hub.clients) == 1, "the face that was before has left"
    assert [text.partition(":")[0] for text in session.notes if "ROS" in text] == [
        "the connection to ROS is lost",
        "ROS cannot be reached again yet",
        "ROS is reached again",
    ]
    await bridge.close()


async def test_what_is_wrong_with_a_profile_is_said_before_anything_runs(tmp_path: Path, wired: Wired) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "mine.toml").write_text(
        'driver = "ros2"\n[options]\nfrme = "x"\n[actions.Speech]\ncarrier = { action = "say" }\n'
    )
    scenario = study(tmp_path, robot="mine")
    with pytest.raises(AdapterError) as refused:
        await open_bridge(RosConnection("dds"), scenario.robot, scenario.mode)
    said = "\n".join(refused.value.lines)
    assert "frme" in said and "type" in said and len(refused.value.lines) >= 2
    assert all(transport.closed for transport in wired.made)


async def test_without_ros_a_real_robot_is_not_reached(tmp_path: Path) -> None:
    scenario = study(tmp_path)
    assert await open_bridge(RosConnection("off"), scenario.robot, scenario.mode) is None
    with pytest.raises(AdapterError, match="ROS 2"):
        make_robot(scenario.robot, scenario.mode, RealClock(asyncio.get_running_loop(), 1.0, 0.0), 1)


async def test_a_rehearsal_is_on_ros_only_if_that_is_said(tmp_path: Path, wired: Wired) -> None:
    scenario = study(tmp_path, mode="debug")
    assert await open_bridge(RosConnection("auto"), scenario.robot, scenario.mode) is None
    bridge = await open_bridge(RosConnection("dds"), scenario.robot, scenario.mode)
    assert isinstance(bridge, Ros2Bridge)
    session = Session(scenario, bridge)
    assert await session.act() == "SUCCEEDED", "the simulated robot did it"
    assert not wired.wire.messages("*/robot/*") and wired.wire.messages("*rise/record")
    await bridge.close()


# --- other sessions ---------------------------------------------------------------------------------------------------


async def opened(scenario: Scenario) -> Ros2Bridge:
    bridge = await open_bridge(RosConnection("dds"), scenario.robot, scenario.mode)
    assert isinstance(bridge, Ros2Bridge)
    return bridge


async def test_a_second_session_under_the_same_names_is_refused(tmp_path: Path, wired: Wired) -> None:
    """E5: both would offer /rise/domain_task, and a node's task would be done by both."""
    scenario = study(tmp_path, mode="debug")
    first = await opened(scenario)
    session = Session(scenario, first)
    with pytest.raises(AdapterError) as refused:
        await opened(scenario)
    about, todo = refused.value.lines
    assert f"“{scenario.title}”" in about and "node /rise on" in about and "process" in about
    assert "--ros-args -r __ns:=/lab2" in todo and "ROS_DOMAIN_ID" in todo
    assert wired.made[1].closed and not wired.made[0].closed
    assert session.notes == [], "the one that runs is not disturbed"
    await first.close()
    await (await opened(scenario)).close()


async def test_a_session_that_has_crashed_is_in_nobodys_way(tmp_path: Path, wired: Wired) -> None:
    """The network shows it for the seconds of its lease. It says nothing, though."""
    scenario = study(tmp_path, mode="debug")
    first = await opened(scenario)
    Session(scenario, first)
    wired.wire.kill("/rise")
    second = await opened(scenario)
    Session(scenario, second)
    wired.wire.killed.clear()
    await first.close()
    await second.close()


@pytest.mark.parametrize("at_once", [2, 5])
async def test_of_sessions_that_begin_at_once_exactly_one_does(tmp_path: Path, wired: Wired, at_once: int) -> None:
    scenario = study(tmp_path, mode="debug")
    begun = await asyncio.gather(*(opened(scenario) for _ in range(at_once)), return_exceptions=True)
    (one,) = [each for each in begun if isinstance(each, Ros2Bridge)]
    assert sum(isinstance(each, AdapterError) for each in begun) == at_once - 1
    await one.close()


async def test_of_two_that_begin_at_once_both_decide_the_same_whatever_their_clocks_say() -> None:
    wire = MemoryWire()
    loop = asyncio.get_running_loop()
    for since in ((5, 9), (9, 5), (7, 7)):
        made = [
            neighbours.NeighbourSessions(
                MemoryTransport(wire, loop, f"n{number}"), neighbours.SessionAnnouncement(f"id{number}", each, "asking")
            )
            for number, each in enumerate(since)
        ]
        stands_back = [await asyncio.wait_for(each.find_earlier(), PATIENCE) is not None for each in made]
        assert sorted(stands_back) == [False, True]
        for each in made:
            each.close()


async def test_a_session_says_so_when_it_finds_that_it_is_not_alone(tmp_path: Path, wired: Wired) -> None:
    """Two networks that are joined while both are running."""
    scenario = study(tmp_path, mode="debug")
    first = await opened(scenario)
    one = Session(scenario, first)
    wired.wire.forget("/rise")
    second = await opened(scenario)
    other = Session(scenario, second)
    assert one.notes == other.notes == []
    wired.wire.heal("/rise")
    for session in (one, other):
        (note,) = await until(lambda session=session: session.notes)
        assert note.startswith(f"another session is on ROS under the same names now: “{scenario.title}”")
        assert not session.engine.ended
    status = first._interface.status()  # type: ignore[union-attr]
    assert status["level"] == 1 and status["message"].startswith("another session has the same names")
    await second.close()
    await until(lambda: not first._neighbours.others)
    await first.close()


ZORA = """
driver = "ros2"
[actions.Speech]
carrier = { action = "/zora/say", type = "rise_interfaces/action/Speech", goal = { message = "{message}" } }
"""


def zora(folder: Path) -> Scenario:
    """A study on a robot whose names begin with a slash: they are the same in every namespace."""
    (folder / "robots").mkdir()
    (folder / "robots" / "zora.toml").write_text(ZORA)
    return study(folder, robot="zora")


async def test_a_second_session_on_the_same_robot_is_refused_in_any_namespace(tmp_path: Path, wired: Wired) -> None:
    """F6: each would start and stop what the other one does."""
    scenario = zora(tmp_path)
    first = await opened(scenario)
    Session(scenario, first)
    wired.namespace = "/lab2"
    with pytest.raises(AdapterError) as refused:
        await opened(scenario)
    about, todo = refused.value.lines
    assert about.startswith("another session moves the same robot (in memory, node /lab2/rise): “")
    assert "node /rise on" in about and about.endswith("both would use /zora/say") and "a robot of its own" in todo
    relative = study(tmp_path, robot="rise")
    other = await opened(relative)
    await other.close()
    wired.namespace = ""
    await first.close()


async def test_of_sessions_on_one_robot_that_begin_at_once_exactly_one_does(tmp_path: Path, wired: Wired) -> None:
    scenario, beginning = zora(tmp_path), []
    for number in range(3):
        wired.namespace = f"/lab{number}"
        beginning.append(asyncio.ensure_future(opened(scenario)))
        await until(lambda number=number: len(wired.made) > number)
    begun = await asyncio.gather(*beginning, return_exceptions=True)
    (one,) = [each for each in begun if isinstance(each, Ros2Bridge)]
    assert sum(isinstance(each, AdapterError) for each in begun) == 2
    await one.close()


async def test_sessions_on_one_robot_whose_networks_are_joined_say_so(
    tmp_path: Path, wired: Wired, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(neighbours, "BEAT_SECONDS", 0.01)
    scenario, sessions, bridges_ = zora(tmp_path), [], []
    for namespace in ("/lab1", "/lab2"):
        wired.namespace = namespace
        bridges_.append(await opened(scenario))
        sessions.append(Session(scenario, bridges_[-1]))
        wired.wire.forget("/lab1/rise")
    wired.wire.heal("/lab1/rise")
    for session in sessions:
        (note,) = await until(lambda session=session: [each for each in session.notes if "another session" in each])
        assert note.startswith("another session moves the same robot now, by /zora/say: “")
    status = bridges_[0]._interface.status()  # type: ignore[union-attr]
    assert status["message"].startswith("another session moves the same robot: ")
    for bridge in bridges_:
        await bridge.close()


async def test_what_is_no_word_of_a_session_is_passed_over(tmp_path: Path, wired: Wired) -> None:
    loop = asyncio.get_running_loop()
    failures: list[object] = []
    loop.set_exception_handler(lambda _, context: failures.append(context))
    noise = MemoryTransport(wired.wire, loop, "/noise")
    publisher = noise.publisher("/rise/session", "std_msgs/msg/String", QoS(depth=1, latched=True))
    for data in ("", "{}", '{"id": 1}', "[" * 5000):
        publisher.publish({"data": data})
    scenario = study(tmp_path, mode="debug")
    bridge = await opened(scenario)
    for data in ("", "{}", '{"id": 1}', "[" * 5000):
        publisher.publish({"data": data})
    await asyncio.sleep(0.01)
    await bridge.close()
    assert failures == []
