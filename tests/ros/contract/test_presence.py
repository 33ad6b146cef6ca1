"""Who is there: servers and nodes that come, leave, are terminated, and die."""

from __future__ import annotations

import signal
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from tests.patience import PATIENCE

from .conftest import Pair
from .peers import LEASE, Peer, until

pytestmark = pytest.mark.dds

SET, TRIGGER = "std_srvs/srv/SetBool", "std_srvs/srv/Trigger"
FIBONACCI = "example_interfaces/action/Fibonacci"


def _leave(peer: Peer) -> None:
    assert peer.leave() == 0


def _terminate(peer: Peer) -> None:
    peer.process.send_signal(signal.SIGTERM)
    assert peer.wait() == 0


def _kill(peer: Peer) -> None:
    peer.process.send_signal(signal.SIGKILL)
    assert peer.wait() == -signal.SIGKILL


@pytest.mark.slow
@pytest.mark.parametrize("end", [_leave, _terminate, _kill])
def test_a_server_is_seen_until_its_process_ends(pair: Pair, end: Callable[[Peer], None]) -> None:
    name = f"{pair.name}/ask"
    pair.near.client(key=name, name=name, type=SET)
    pair.near.action_client(key=f"{name}/count", name=f"{name}/count", type=FIBONACCI)
    pair.near.publisher(key=f"{name}/said", topic=f"{name}/said", type="std_msgs/msg/String")
    assert pair.near.servers(key=name) == 0
    for _ in range(1 if end is _kill else 2):  # whose end is seen only after its lease
        with Peer(pair.far.kind) as far:
            far.serve(key="ask", name=name, type=SET)
            far.action_server(key="count", name=f"{name}/count", type=FIBONACCI)
            far.subscribe(key="said", topic=f"{name}/said", type="std_msgs/msg/String")
            until(lambda: pair.near.servers(key=name) == 1)
            until(lambda: pair.near.servers(key=f"{name}/count") == 1)
            until(lambda: pair.near.subscribers(key=f"{name}/said") == 1)
            pair.near.call(key=name, number=1, message={"data": True})
            assert far.event("asked")
            end(far)
            limit = LEASE + PATIENCE if end is _kill else PATIENCE
            until(lambda: pair.near.servers(key=name) == 0, limit)
            until(lambda: pair.near.servers(key=f"{name}/count") == 0, limit)
            until(lambda: pair.near.subscribers(key=f"{name}/said") == 0, limit)
    assert pair.near.none("answer")


def test_two_servers_of_one_name_are_two(pair: Pair) -> None:
    name = f"{pair.name}/ask"
    pair.near.client(key=name, name=name, type=SET)
    pair.far.serve(key=name, name=name, type=SET)
    with Peer(pair.far.kind) as second:
        second.serve(key="ask", name=name, type=SET)
        until(lambda: pair.near.servers(key=name) == 2)
        assert second.leave() == 0
    until(lambda: pair.near.servers(key=name) == 1)


def test_nodes_are_seen_with_their_names(pair: Pair) -> None:
    own, other = pair.near.about()["node"], pair.far.about()["node"]
    assert own.startswith("/peer_")
    until(lambda: {own, other} <= set(pair.near.nodes()))
    with Peer(pair.far.kind, "--ros-args", "-r", f"__ns:=/{pair.name}", "-r", "__node:=lab") as far:
        assert far.about()["node"] == f"/{pair.name}/lab"
        until(lambda: f"/{pair.name}/lab" in pair.near.nodes())
        assert far.leave() == 0
    until(lambda: f"/{pair.name}/lab" not in pair.near.nodes())


def test_what_others_publish_and_listen_to_is_seen_as_it_is(pair: Pair) -> None:
    name, text = f"{pair.name}/thing", "std_msgs/msg/String"
    assert pair.near.ends(what="publisher", name=name) == pair.near.ends(what="subscriber", name=name) == []
    pair.near.publisher(key="own", topic=name, type="std_msgs/msg/Int32")
    pair.far.publisher(key=name, topic=name, type=text, reliable=False)
    pair.far.subscribe(key="taken", topic=name, type=text, latched=True)
    node = pair.far.about()["node"]
    for what, qos in (("publisher", {"reliable": False, "latched": False}), ("subscriber", {"latched": True})):
        found = until(lambda: [end for end in pair.near.ends(what=what, name=name) if end["node"] == node])  # noqa: B023
        assert len(pair.near.ends(what=what, name=name)) == 1, "its own are not meant"
        assert found[0]["type"] == text
        assert found[0]["hash"] in ("", pair.far.type_hash(type=text))
        assert found[0]["qos"] is None or qos.items() <= found[0]["qos"].items()
    until(lambda: f"/{name}" in pair.near.topics())
    assert node not in [who for who, _ in pair.near.strangers()]
    pair.near.close(key="own")
    pair.far.close(key="taken")


def test_what_others_serve_is_seen_with_its_types(pair: Pair) -> None:
    name = f"{pair.name}/ask"
    pair.near.client(key=name, name=name, type=SET)
    pair.near.serve(key="own", name=name, type=SET)
    pair.far.serve(key=name, name=name, type=TRIGGER)
    node = pair.far.about()["node"]

    def seen() -> list[dict[str, Any]]:
        return [end for end in pair.near.ends(what="server", name=name) if end["node"] == node]

    until(lambda: len(seen()) == 2)
    assert len(pair.near.ends(what="server", name=name)) == 2, "its own are not meant"
    for end in seen():
        assert end["hash"] in ("", pair.far.type_hash(type=end["type"]))
    assert {end["type"] for end in seen()} == {f"{TRIGGER}_Request", f"{TRIGGER}_Response"}
    pair.near.close(key="own")


def test_a_server_of_another_type_does_not_count(pair: Pair) -> None:
    """A call to it would vanish."""
    name = f"{pair.name}/ask"
    pair.near.client(key=name, name=name, type=SET)
    pair.far.serve(key=name, name=name, type=TRIGGER)
    until(lambda: pair.near.ends(what="server", name=name))
    assert pair.near.servers(key=name) == 0


@pytest.mark.slow
def test_the_nodes_that_call_a_service_are_known_by_name(pair: Pair) -> None:
    """By that a session knows that a node which says who it is may be right."""
    name = f"/{pair.name}/ask"
    pair.near.serve(key=name, name=name, type=SET)
    assert pair.near.clients_of(service=name) == []
    with (
        Peer(pair.far.kind, "--ros-args", "-r", "__ns:=/lab", node="boss") as boss,
        Peer(pair.far.kind, node="other") as other,
    ):
        boss.client(key=name, name=name, type=SET)
        until(lambda: pair.near.clients_of(service=name) == ["/lab/boss"])
        other.client(key=name, name=name, type=SET)
        other.client(key="trigger", name=f"{name}/else", type=TRIGGER)
        until(lambda: pair.near.clients_of(service=name) == ["/lab/boss", "/other"])
        assert boss.leave() == 0
        until(lambda: pair.near.clients_of(service=name) == ["/other"])
    pair.near.close(key=name)


def _ask(peer: Peer, service: str, request: dict[str, Any]) -> dict[str, Any]:
    """The answer of a service that may be asked twice.

    An rclpy server on Fast DDS drops its answer if it has not found the client within 100 ms (`__rmw_send_response` in
    rmw_fastrtps_shared_cpp), and a client cannot see whether it has been found. On a busy machine, that happens.
    """
    for number in range(1, 5):
        peer.call(key=service, number=number, message=request)
        with suppress(AssertionError):
            answer: dict[str, Any] = peer.event("answer", PATIENCE / 4, key=service)["message"]
            return answer
    raise AssertionError(f"{service} gave no answer to four requests")


def test_parameters_are_read_across(pair: Pair) -> None:
    with Peer(pair.far.kind, node="eyes") as eyes:
        eyes.parameters(dwell=0.5, region=["a", "b"], topic="gaze")
        answers = {}
        for service, type, request in (
            ("list_parameters", "ListParameters", {}),
            ("get_parameters", "GetParameters", {"names": ["dwell", "region", "use_sim_time"]}),
            ("set_parameters", "SetParameters", {"parameters": [{"name": "dwell"}]}),
        ):
            pair.near.client(key=service, name=f"/eyes/{service}", type=f"rcl_interfaces/srv/{type}")
            until(lambda service=service: pair.near.servers(key=service) == 1)
            answers[service] = _ask(pair.near, service, request)
        assert answers["list_parameters"]["result"]["names"] == ["dwell", "region", "topic", "use_sim_time"]
        values = answers["get_parameters"]["values"]
        assert [each["type"] for each in values] == [3, 9, 1] and values[1]["string_array_value"] == ["a", "b"]
        (result,) = answers["set_parameters"]["results"]
        assert not result["successful"] and "is read when the program starts" in result["reason"]
        for service in ("list_parameters", "get_parameters", "set_parameters"):
            pair.near.close(key=service)
