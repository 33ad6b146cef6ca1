"""The transport over Cyclone DDS: what the contract of all transports (`tests/ros/contract`) does not ask for.
Everything stays on the loopback interface, in a domain of its own."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds", reason="the extra dds is not installed")
pytest.importorskip("rosbags", reason="the extra dds is not installed")

from cyclonedds.qos import Policy
from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.dds import DdsTransport, domain, graph, names, reader_thread
from rise_adapters.ros2.transport.dds.reader_thread import dds_qos, list_matched
from rise_adapters.ros2.transport.port import PortError, QoS, RemoteEndpoint

from tests.forked import PIPE, Forked
from tests.patience import PATIENCE
from tests.ros.dds_peer import SET, TEXT
from tests.ros.domains import own_domain

pytestmark = pytest.mark.dds

ROOT = Path(__file__).parents[2]
LATCHED = QoS(depth=3, latched=True)
ENVIRONMENT = {
    "ROS_DOMAIN_ID": str(own_domain()),
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "CYCLONEDDS_URI": '<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces></General>',
}


def opened(node: str = "here", **options: Any) -> DdsTransport:
    return DdsTransport(asyncio.get_running_loop(), node=node, environment=ENVIRONMENT, **options)


@pytest.fixture
async def transport() -> AsyncIterator[DdsTransport]:
    one = opened()
    yield one
    one.close()


@contextmanager
def peer(role: str) -> Iterator[Forked]:
    process = Forked(
        role,
        module="tests.ros.dds_peer",
        stdin=PIPE,
        stderr=None,
        cwd=ROOT,
        env={**{k: v for k, v in os.environ.items() if k != "AMENT_PREFIX_PATH"}, **ENVIRONMENT},
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


async def until(holds: Callable[[], Any], patience: float = PATIENCE) -> Any:
    limit = time.monotonic() + patience
    while not (found := holds()):
        assert time.monotonic() < limit, "it did not come to that"
        await asyncio.sleep(0.002)
    return found


def stand_still(seconds: float) -> None:
    """Block the loop."""
    time.sleep(seconds)


# --- two processes -------------------------------------------------------------------------------------------------


async def test_a_topic_a_service_and_an_end(transport: DdsTransport) -> None:
    heard: list[Any] = []
    answers: list[Any] = []
    transport.subscribe("said", TEXT, heard.append)
    say, ask = transport.publisher("heard", TEXT), transport.client("set", SET)
    with peer("echo") as process:
        await until(lambda: ask.count_servers() and say.count_subscribers())
        say.publish({"data": "Grüß dich"})
        ask.call({"data": True}, answers.append)
        await until(lambda: heard and answers)
        assert heard == [{"data": "Grüß dich"}]
        assert answers == [{"success": True, "message": "from the peer"}]
        await until(lambda: transport.nodes() == ["/here", "/peer"])
        # A node says what is whose a moment after it has said that it is there.
        await until(lambda: all(end.node for end in transport.server_endpoints("set")))
        await until(lambda: all(end.node for end in transport.publisher_endpoints("said")))
        types = [f"{SET}_Request", f"{SET}_Response"]
        usual = QoS(depth=10)
        (said,) = transport.publisher_endpoints("said")
        assert len(said.program) == 12
        assert said == RemoteEndpoint("/peer", TEXT, transport.type_hash(TEXT), "0110", usual, said.program)
        assert transport.server_endpoints("set") == [
            RemoteEndpoint("/peer", type, transport.type_hash(type), "0110", usual, said.program) for type in types
        ]
        assert transport.publisher_endpoints("heard") == []
        process.kill()
        await until(lambda: not ask.count_servers())
        await until(lambda: transport.nodes() == ["/here"] and transport.server_endpoints("set") == [])


async def test_what_was_said_just_before_closing_arrives(transport: DdsTransport) -> None:
    heard: list[Any] = []
    transport.subscribe("said", TEXT, heard.append, QoS(depth=10))
    first = opened("first")
    latched = first.publisher("said", TEXT, QoS(depth=10))
    await until(latched.count_subscribers)
    for number in range(5):
        latched.publish({"data": str(number)})
    first.close()
    await until(lambda: len(heard) == 5)


async def test_a_thousand_messages_a_second_leave_room(transport: DdsTransport) -> None:
    """The loop serves others all the while, and nothing is lost."""
    heard: list[str] = []
    transport.subscribe("said", TEXT, lambda message: heard.append(message["data"]), QoS(depth=2000))
    say = transport.publisher("heard", TEXT)
    with peer("burst"):
        await until(say.count_subscribers)
        await until(lambda: transport.publisher_endpoints("said"))
        turns = 0
        say.publish({"data": "2"})
        while len(heard) < 2000:
            await asyncio.sleep(0.001)
            turns += 1
    assert heard == [str(number) for number in range(2000)]
    assert turns > 20


async def test_a_reader_that_pauses_is_left_alone_and_then_gives_the_newest(
    transport: DdsTransport, monkeypatch: pytest.MonkeyPatch
) -> None:
    every: list[str] = []
    newest: list[str] = []
    transport.subscribe("said", TEXT, lambda message: every.append(message["data"]))
    transport.subscribe("said", TEXT, lambda message: newest.append(message["data"]), QoS(depth=3), pause=3600.0)
    other = opened("other")
    say = other.publisher("said", TEXT)
    await until(lambda: say.count_subscribers() == 2)
    say.publish({"data": "first"})
    await until(lambda: every == newest == ["first"])
    for number in range(20):
        say.publish({"data": str(number)})
    await until(lambda: len(every) == 21)
    assert newest == ["first"]
    monkeypatch.setattr(reader_thread, "monotonic", lambda: time.monotonic() + 7200.0)
    say.publish({"data": "last"})  # wakes the thread
    await until(lambda: len(newest) > 1 and newest[-1] == "last")
    assert newest[1:] == ["18", "19", "last"]
    other.close()


async def test_a_loop_that_is_busy_gets_what_was_sent_meanwhile_in_slices(transport: DdsTransport) -> None:
    heard: list[int] = []
    turns: list[int] = []
    transport.subscribe("said", TEXT, lambda message: _slow(heard), QoS(depth=500))
    other = opened("other")
    say = other.publisher("said", TEXT, QoS(depth=500))
    await until(say.count_subscribers)
    for number in range(300):
        say.publish({"data": str(number)})
    stand_still(0.2)  # everything has come before the loop goes on
    while len(heard) < 300:
        turns.append(len(heard))
        await asyncio.sleep(0)
    other.close()
    biggest = max(after - before for before, after in pairwise(turns))
    assert biggest < 100


def _slow(heard: list[int]) -> None:
    time.sleep(0.0001)
    heard.append(1)


async def test_a_reader_that_stands_still_holds_nobody_up(transport: DdsTransport) -> None:
    heard: list[Any] = []
    transport.subscribe("said", TEXT, heard.append, QoS(depth=10))
    say = transport.publisher("heard", TEXT, QoS(depth=200))
    with peer("echo") as process:
        await until(say.count_subscribers)
        process.send_signal(signal.SIGSTOP)
        for _ in range(300):  # a writer that waited once its history is full would wait for ever
            say.publish({"data": "x" * 50_000})
            await asyncio.sleep(0)
        process.send_signal(signal.SIGCONT)
        await until(lambda: heard)


# --- one process ---------------------------------------------------------------------------------------------------


async def test_callbacks_come_on_the_loop_and_never_inside_a_call(transport: DdsTransport) -> None:
    heard: list[Any] = []
    transport.subscribe("said", TEXT, heard.append)
    say = transport.publisher("said", TEXT)
    await until(say.count_subscribers)
    say.publish({"data": "x"})
    stand_still(0.05)  # long enough for the reading thread
    assert heard == []
    await until(lambda: heard)


async def test_a_callback_that_fails_is_told_and_stops_nothing(transport: DdsTransport) -> None:
    told: list[dict[str, Any]] = []
    heard: list[Any] = []
    asyncio.get_running_loop().set_exception_handler(lambda loop, context: told.append(context))

    def taken(message: Any) -> None:
        heard.append(message)
        raise ValueError("not mine")

    transport.subscribe("said", TEXT, taken)
    say = transport.publisher("said", TEXT)
    await until(say.count_subscribers)
    say.publish({})
    say.publish({})
    await until(lambda: len(heard) == 2)
    assert [str(context["exception"]) for context in told] == ["not mine", "not mine"]
    assert transport.failure() == ""


async def test_after_closing_nothing_comes_and_nothing_hangs(transport: DdsTransport) -> None:
    heard: list[Any] = []
    other = opened("other")
    taking = other.subscribe("said", TEXT, heard.append)
    say = transport.publisher("said", TEXT)
    ask = other.client("set", SET)
    await until(say.count_subscribers)
    say.publish({})
    stand_still(0.05)
    taking.close()
    taking.close()
    await until(lambda: not say.count_subscribers())
    other.close()
    other.close()
    ask.close()
    assert heard == []
    assert other.failure() == "the transport is closed"
    with pytest.raises(PortError, match="the transport is closed"):
        other.publisher("said", TEXT)
    await until(lambda: transport.nodes() == ["/here"])


async def test_a_type_of_the_same_structure_is_another_type(tmp_path: Path) -> None:
    for name in ("A", "B"):
        path = tmp_path / "lab" / "srv" / f"{name}.srv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("string text\n---\nstring text\n", encoding="utf-8")
    one = opened(share=[tmp_path])
    right, wrong = one.client("right", "lab/srv/A"), one.client("wrong", "lab/srv/A")
    one.serve("right", "lab/srv/A", lambda asked, reply: reply(asked))
    one.serve("wrong", "lab/srv/B", lambda asked, reply: reply(asked))
    await until(lambda: right.count_servers() == 1)
    assert wrong.count_servers() == 0
    one.close()


def test_nobody_is_asked_about_the_structure_of_types() -> None:
    """Nodes of ROS 2 Jazzy with Cyclone DDS 0.10.5 do not survive that."""
    assert Policy.TypeConsistency.DisallowTypeCoercion() in dds_qos(QoS(), {}, reader=True)
    assert Policy.TypeConsistency.DisallowTypeCoercion() in dds_qos(LATCHED, {}, reader=True)


async def test_names_types_and_messages_that_cannot_be(transport: DdsTransport) -> None:
    with pytest.raises(PortError, match="'a b' cannot be a name in ROS"):
        transport.publisher("a b", TEXT)
    with pytest.raises(PortError, match="std_msgs/msg/Sting is not known"):
        transport.subscribe("a", "std_msgs/msg/Sting", lambda message: None)
    with pytest.raises(PortError, match=r"there is no srv/SetBoool\.srv"):
        transport.client("a", "std_srvs/srv/SetBoool")
    with pytest.raises(PortError, match="has no field 'text'"):
        transport.publisher("a", TEXT).publish({"text": "x"})
    assert transport.type_hash("no_such/msg/Type") == ""


async def test_about_says_what_it_is(transport: DdsTransport) -> None:
    assert transport.about.startswith("dds, Cyclone DDS ")
    assert transport.about.endswith(f"without ROS, domain {ENVIRONMENT['ROS_DOMAIN_ID']}")
    assert (transport.kind, transport.node, transport.failure()) == ("dds", "/here", "")
    assert transport.programs_of_other_vendors() == [] and transport.vendor == vendors.CYCLONE


# --- configuration -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("environment", "inside", "not_inside"),
    [
        ({}, ["<ParticipantIndex>auto<"], ["AllowMulticast", "<Peers>"]),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, ["<ParticipantIndex>auto<"], ["AllowMulticast", "<Peers>"]),
        ({"ROS_STATIC_PEERS": "10.0.0.2; robot"}, ['<Peer address="10.0.0.2"/><Peer address="robot"/>'], ["Multicast"]),
        (
            {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_STATIC_PEERS": "robot"},
            ["<AllowMulticast>false<", '<Peer address="localhost"/><Peer address="robot"/>'],
            [],
        ),
        (
            {"ROS_LOCALHOST_ONLY": "1", "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF", "ROS_STATIC_PEERS": "robot"},
            ["<AllowMulticast>false<", '<Peer address="localhost"/></Peers>'],
            ["robot", "<Tag>"],
        ),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, ["<AllowMulticast>false<", "<Tag>ros_discovery_off_"], ["<Peers>"]),
        (
            {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT", "ROS_STATIC_PEERS": "robot"},
            [],
            ["robot", "Participant"],
        ),
        ({"CYCLONEDDS_URI": "file:///a.xml"}, ["</CycloneDDS>,file:///a.xml"], []),
    ],
)
def test_the_configuration_is_that_of_ros(
    environment: dict[str, str], inside: list[str], not_inside: list[str]
) -> None:
    config = domain.make_configuration(environment)
    assert "<LeaseDuration>1.000s</LeaseDuration><SPDPInterval>0.250s</SPDPInterval>" in config
    for text in inside:
        assert text in config
    for text in not_inside:
        assert text not in config


def test_settings_that_cannot_be_are_said() -> None:
    with pytest.raises(PortError, match="must be one of SUBNET, LOCALHOST, OFF, SYSTEM_DEFAULT"):
        domain.make_configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LAN"})
    for number in ("x", "-1", "233", "1.5"):
        with pytest.raises(PortError, match="ROS_DOMAIN_ID must be a number from 0 to 232"):
            domain.read_domain_id({"ROS_DOMAIN_ID": number})
    assert domain.read_domain_id({}) == domain.read_domain_id({"ROS_DOMAIN_ID": ""}) == 0


async def test_a_configuration_that_cyclone_does_not_take_is_said() -> None:
    wrong = {**ENVIRONMENT, "ROS_DOMAIN_ID": "201", "CYCLONEDDS_URI": "<General><NoSuchThing>1</NoSuchThing></General>"}
    with pytest.raises(PortError, match=r"does not take its configuration for ROS domain 201"):
        DdsTransport(asyncio.get_running_loop(), node="here", environment=wrong)


# --- who is there --------------------------------------------------------------------------------------------------


def test_user_data_of_endpoints() -> None:
    entries = {"serviceid": "1.a", "typehash": "RIHS01_0"}
    assert names.encode_user_data(entries) == b"serviceid=1.a;typehash=RIHS01_0;"
    assert names.decode_user_data(b"serviceid=1.a;typehash=RIHS01_0;") == entries
    assert names.decode_user_data(b"") == names.decode_user_data(b"\xff\x00") == {}


def test_type_names_there_and_back() -> None:
    assert names.dds_type(TEXT) == "std_msgs::msg::dds_::String_"
    assert names.ros_type("std_msgs::msg::dds_::String_") == TEXT
    assert names.ros_type("Sensor::Data") == names.ros_type("a::b::c::d") == ""


def test_programs_with_other_software_are_named() -> None:
    own, fast, other = (bytes(vendor) + bytes(14) for vendor in ([1, 16], [1, 15], [1, 99]))
    seen = graph.DdsGraph(own)
    for key in (own, fast, other):
        seen.update_participant(graph.DdsParticipant(key))
    seen.set_nodes(fast, [("/camera", []), ("/microphone", [])])
    assert seen.programs_of_other_vendors() == [
        ("/camera, /microphone", "010f"),
        ("without named nodes (016300000000000000000000)", "0163"),
    ]
    assert seen.nodes() == ["/camera", "/microphone"]
    seen.update_participant(graph.DdsParticipant(fast, alive=False))
    assert len(seen.programs_of_other_vendors()) == 1
    assert seen.nodes() == []


def test_endpoints_of_others_come_and_go() -> None:
    own, key = bytes([1, 16] + [1] * 14), bytes([1, 16] + [2] * 14)
    seen = graph.DdsGraph(own)
    end = graph.DdsEndpoint(key, "rt/a", TEXT, {"typehash": "RIHS01_1"})
    seen.update_writer(end)
    seen.update_writer(graph.DdsEndpoint(own, "rt/a", TEXT, {}))
    assert seen.find_writers("rt/a") == [RemoteEndpoint("", TEXT, "RIHS01_1", "0110", program=key[:12])]
    seen.set_nodes(key, [("/camera", [key])])
    assert [end.node for end in seen.find_writers("rt/a")] == ["/camera"]
    assert seen.topics("") == ["/a"] and seen.topics("/b") == []
    assert seen.find_readers("rt/a") == seen.find_writers("rt/b") == []
    seen.update_writer(graph.DdsEndpoint(key, alive=False))
    assert seen.find_writers("rt/a") == []


async def test_the_graph_has_another_version_when_somebody_comes_or_goes(transport: DdsTransport) -> None:
    other = opened("there")
    before = transport.graph_version()
    publisher = other.publisher("/chat", TEXT)
    await until(lambda: transport.publisher_endpoints("/chat"))
    between = transport.graph_version()
    publisher.close()
    await until(lambda: not transport.publisher_endpoints("/chat"))
    assert before < between < transport.graph_version()
    other.close()


def test_who_is_matched_is_listed_anew_when_somebody_comes_while_dds_counts() -> None:
    answers: list[list[int] | IndexError] = [IndexError("invalid index"), [7, 8]]

    def handles() -> list[int]:
        answer = answers.pop(0)
        if isinstance(answer, IndexError):
            raise answer
        return answer

    assert list_matched(handles) == [7, 8]
