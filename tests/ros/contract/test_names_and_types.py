"""Names after namespace and remappings, and what is known about types: the same with every transport."""

from __future__ import annotations

import pytest

from .conftest import Pair
from .peers import Peer, Refused, until

pytestmark = pytest.mark.dds

HASHES = {
    "std_msgs/msg/String": "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "example_interfaces/action/Fibonacci": "RIHS01_9508051da1ea4658de144b09bd0690ff3de52104683d847aed764d2915906f51",
    "example_interfaces/action/Fibonacci_SendGoal": (
        "RIHS01_d1a57fb2a4afe8c21e34fb10db206f16ce6729b28531141472df92277c55b557"
    ),
    "example_interfaces/action/Fibonacci_FeedbackMessage": (
        "RIHS01_c1de71afd52e49a89c53d8262366884185bc0a02f78ce051c4e46b0a7fe59bb2"
    ),
    "std_srvs/srv/Trigger": "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "std_srvs/srv/Trigger_Request": "RIHS01_d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199",
}
"""As rosidl writes them on Jazzy."""


def test_fields_are_written_as_ros_writes_them(pair: Pair) -> None:
    for peer in (pair.near, pair.far):
        assert peer.fields(type="geometry_msgs/msg/PoseWithCovariance") == {
            "pose": "geometry_msgs/msg/Pose",
            "covariance": "float64[36]",
        }
        assert peer.fields(type="rcl_interfaces/msg/ParameterValue") == {
            "type": "uint8",
            "bool_value": "bool",
            "integer_value": "int64",
            "double_value": "float64",
            "string_value": "string",
            "byte_array_value": "byte[]",
            "bool_array_value": "bool[]",
            "integer_array_value": "int64[]",
            "double_array_value": "float64[]",
            "string_array_value": "string[]",
        }
        assert peer.fields(type="shape_msgs/msg/SolidPrimitive") == {
            "type": "uint8",
            "dimensions": "float64[<=3]",
            "polygon": "geometry_msgs/msg/Polygon",
        }
        assert peer.fields(type="diagnostic_msgs/msg/DiagnosticStatus")["level"] == "byte"
        assert peer.fields(type="unique_identifier_msgs/msg/UUID") == {"uuid": "uint8[16]"}
        assert list(peer.fields(type="std_msgs/msg/Header").items()) == [
            ("stamp", "builtin_interfaces/msg/Time"),
            ("frame_id", "string"),
        ]


def test_fields_of_what_services_and_actions_imply(pair: Pair) -> None:
    for peer in (pair.near, pair.far):
        assert peer.fields(type="example_interfaces/action/Fibonacci_Goal") == {"order": "int32"}
        assert peer.fields(type="example_interfaces/action/Fibonacci_Feedback") == {"sequence": "int32[]"}
        assert peer.fields(type="example_interfaces/action/Fibonacci_FeedbackMessage") == {
            "goal_id": "unique_identifier_msgs/msg/UUID",
            "feedback": "example_interfaces/action/Fibonacci_Feedback",
        }
        assert peer.fields(type="example_interfaces/action/Fibonacci_SendGoal_Request") == {
            "goal_id": "unique_identifier_msgs/msg/UUID",
            "goal": "example_interfaces/action/Fibonacci_Goal",
        }
        assert peer.fields(type="std_srvs/srv/Trigger_Request") == {}
        assert peer.fields(type="std_srvs/srv/Trigger_Response") == {"success": "bool", "message": "string"}


@pytest.mark.parametrize(
    "type, what",
    [
        ("no_such_msgs/msg/Thing", "no_such_msgs"),
        ("std_msgs/msg/Strong", "std_msgs/msg/Strong"),
        ("std_msgs/String", "std_msgs/String"),
        ("std_srvs/srv/Trigger", "std_srvs/srv/Trigger"),
        ("example_interfaces/action/Fibonacci", "example_interfaces/action/Fibonacci"),
        ("example_interfaces/action/Fibonacci_Nothing", "example_interfaces/action/Fibonacci_Nothing"),
    ],
)
def test_what_is_no_message_is_named(pair: Pair, type: str, what: str) -> None:
    for peer in (pair.near, pair.far):
        with pytest.raises(Refused, match=what):
            peer.fields(type=type)
        with pytest.raises(Refused, match=what):
            peer.publisher(key="never", topic=f"{pair.name}/never", type=type)


def test_types_of_another_kind_are_refused(pair: Pair) -> None:
    for peer in (pair.near, pair.far):
        with pytest.raises(Refused, match="std_msgs/msg/String"):
            peer.client(key="never", name=f"{pair.name}/never", type="std_msgs/msg/String")
        with pytest.raises(Refused, match="std_msgs/msg/String"):
            peer.serve(key="never", name=f"{pair.name}/never", type="std_msgs/msg/String")


def test_hashes_are_those_of_rosidl(pair: Pair) -> None:
    for peer in (pair.near, pair.far):
        assert {type: peer.type_hash(type=type) for type in HASHES} == HASHES


def test_names_are_resolved(pair: Pair) -> None:
    rules = ("rise/domain_task:=/lab/tasks", "chat:=talk", "/abs:=/else/where", "~/mine:=/yours")
    remaps = [word for rule in rules for word in ("-r", rule)]
    for kind in {pair.near.kind, pair.far.kind}:
        with Peer(kind, "--ros-args", "-r", "__ns:=/pepper", *remaps, node="engine") as peer:
            assert peer.about()["node"] == "/pepper/engine"
            names = ("rise/domain_task", "chat", "/abs", "~/mine", "~/other", "rise/robot/speech", "/a/b", "~")
            assert [peer.resolve(name=name) for name in names] == [
                "/lab/tasks",
                "/pepper/talk",
                "/else/where",
                "/yours",
                "/pepper/engine/other",
                "/pepper/rise/robot/speech",
                "/a/b",
                "/pepper/engine",
            ]
            peer.subscribe(key="chat", topic="chat", type="std_msgs/msg/String")
            pair.far.publisher(key="chat", topic="/pepper/talk", type="std_msgs/msg/String")
            until(lambda: pair.far.subscribers(key="chat") == 1)
            pair.far.close(key="chat")
            assert peer.leave() == 0


@pytest.mark.parametrize("name", ["", "a b", "5a", "a//b", "a/", "ä"])
def test_a_name_that_cannot_be(pair: Pair, name: str) -> None:
    for peer in (pair.near, pair.far):
        with pytest.raises(Refused):
            peer.resolve(name=name)
        with pytest.raises(Refused):
            peer.publisher(key="never", topic=name, type="std_msgs/msg/String")


def test_it_says_what_it_is(pair: Pair) -> None:
    for peer in (pair.near, pair.far):
        about = peer.about()
        assert about["kind"] == peer.kind and peer.kind in about["about"]
        assert "domain" in about["about"]
        assert about["lost"] == ""
