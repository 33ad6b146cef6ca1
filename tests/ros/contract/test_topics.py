"""Messages on topics: order, those who come late, and all that can be in a message."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest

from .conftest import Pair
from .peers import Peer, Refused, until

pytestmark = pytest.mark.dds

STRING = "std_msgs/msg/String"


def joined(pair: Pair, topic: str, type: str, **qos: Any) -> str:
    """A publisher on the far side and a subscription on the near one that have found each other."""
    name = f"{pair.name}/{topic}"
    pair.near.subscribe(key=name, topic=name, type=type, **qos)
    pair.far.publisher(key=name, topic=name, type=type, **qos)
    until(lambda: pair.far.subscribers(key=name) == 1)
    return name


def across(pair: Pair, type: str, message: dict[str, Any], topic: str = "value") -> dict[str, Any]:
    """What arrives when `message` is sent."""
    key = joined(pair, topic, type)
    pair.far.publish(key=key, messages=[message])
    taken: dict[str, Any] = pair.near.event("taken", key=key)["message"]
    return taken


def test_messages_come_complete_and_in_order(pair: Pair) -> None:
    key = joined(pair, "count", "std_msgs/msg/Int32", depth=200)
    pair.far.publish(key=key, messages=[{"data": number} for number in range(100)])
    assert [pair.near.event("taken", key=key)["message"]["data"] for _ in range(100)] == list(range(100))


def test_a_reliable_subscription_does_not_hear_what_was_said_before_it(pair: Pair) -> None:
    name = f"{pair.name}/chat"
    pair.far.publisher(key=name, topic=name, type=STRING)
    pair.far.publish(key=name, messages=[{"data": "early"}])
    pair.near.subscribe(key=name, topic=name, type=STRING)
    until(lambda: pair.far.subscribers(key=name) == 1)
    pair.far.publish(key=name, messages=[{"data": "late"}])
    assert pair.near.event("taken", key=name)["message"] == {"data": "late"}


@pytest.mark.parametrize("depth", [1, 5])
def test_who_comes_late_to_a_latched_topic_gets_the_last_messages(pair: Pair, depth: int) -> None:
    name = f"{pair.name}/state"
    pair.far.publisher(key=name, topic=name, type="std_msgs/msg/Int32", latched=True, depth=depth)
    pair.far.publish(key=name, messages=[{"data": number} for number in range(20)])
    pair.near.subscribe(key=name, topic=name, type="std_msgs/msg/Int32", latched=True, depth=depth)
    expected = list(range(20))[-depth:]
    assert [pair.near.event("taken", key=name)["message"]["data"] for _ in expected] == expected
    pair.far.publish(key=name, messages=[{"data": 20}])
    assert pair.near.event("taken", key=name)["message"] == {"data": 20}


def test_best_effort(pair: Pair) -> None:
    key = joined(pair, "quick", STRING, reliable=False)
    until(lambda: pair.far.publish(key=key, messages=[{"data": "x"}]) or not pair.near.none("taken", key=key))


def test_several_subscribers_and_leaving(pair: Pair) -> None:
    name = joined(pair, "chat", STRING)
    pair.near.subscribe(key="second", topic=name, type=STRING)
    pair.far.subscribe(key="own", topic=name, type=STRING)
    until(lambda: pair.far.subscribers(key=name) == 3)
    pair.far.publish(key=name, messages=[{"data": "all"}])
    assert pair.near.event("taken", key=name) and pair.near.event("taken", key="second")
    assert pair.far.event("taken", key="own")
    pair.near.close(key=name)
    pair.far.close(key="own")
    until(lambda: pair.far.subscribers(key=name) == 1)
    pair.far.publish(key=name, messages=[{"data": "one"}])
    assert pair.near.event("taken", key="second")["message"] == {"data": "one"}
    assert pair.near.none("taken", key=name) and pair.far.none("taken", key="own")
    pair.near.close(key="second")
    pair.far.close(key=name)


def test_a_closed_subscription_is_silent_and_can_be_made_again(pair: Pair) -> None:
    key = joined(pair, "again", STRING)
    for turn in range(3):
        pair.far.publish(key=key, messages=[{"data": str(turn)}])
        assert pair.near.event("taken", key=key)["message"] == {"data": str(turn)}
        pair.near.close(key=key)
        until(lambda: pair.far.subscribers(key=key) == 0)
        pair.far.publish(key=key, messages=[{"data": "to nobody"}])
        pair.near.subscribe(key=key, topic=key, type=STRING)
        until(lambda: pair.far.subscribers(key=key) == 1)
    assert pair.near.none("taken", key=key)


def test_a_flood_is_not_lost_when_the_depth_allows_it(pair: Pair) -> None:
    key = joined(pair, "flood", "std_msgs/msg/Int32", depth=6000)
    pair.far.publish(key=key, messages=[{"data": number} for number in range(5000)])
    assert [pair.near.event("taken", key=key)["message"]["data"] for _ in range(5000)] == list(range(5000))


def test_a_loop_that_is_busy_gets_everything_afterwards(pair: Pair) -> None:
    key = joined(pair, "busy", "std_msgs/msg/Int32", depth=6000)
    pair.near.freeze(seconds=0.2)
    pair.far.publish(key=key, messages=[{"data": number} for number in range(5000)])
    pair.near.freeze(seconds=0.2)
    assert [pair.near.event("taken", key=key)["message"]["data"] for _ in range(5000)] == list(range(5000))


# --- what can be in a message -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["", "a", "Grüße, 世界 🤖", "line\nline\ttab", "' \" \\ {} <&>", "x" * 1_000_000, "ä" * 70_001],
    ids=["empty", "one", "unicode", "lines", "signs", "a million", "odd"],
)
def test_texts(pair: Pair, text: str) -> None:
    assert across(pair, STRING, {"data": text}) == {"data": text}


@pytest.mark.parametrize(
    "type, value",
    [
        ("Bool", True),
        ("Byte", 255),
        ("Char", 200),
        ("Int8", -128),
        ("Int8", 127),
        ("UInt8", 255),
        ("Int16", -(2**15)),
        ("UInt16", 2**16 - 1),
        ("Int32", -(2**31)),
        ("UInt32", 2**32 - 1),
        ("Int64", -(2**63)),
        ("Int64", 2**63 - 1),
        ("UInt64", 2**64 - 1),
        ("Float32", -1.5),
        ("Float64", 0.1),
        ("Float64", 5e-324),
        ("Float64", -1.7976931348623157e308),
        ("Float32", math.inf),
        ("Float64", -math.inf),
        ("Float64", -0.0),
    ],
)
def test_numbers(pair: Pair, type: str, value: Any) -> None:
    taken = across(pair, f"std_msgs/msg/{type}", {"data": value})["data"]
    assert taken == value and isinstance(taken, value.__class__)
    if isinstance(value, float):
        assert math.copysign(1, taken) == math.copysign(1, value)


@pytest.mark.parametrize("type", ["Float32", "Float64"])
def test_not_a_number(pair: Pair, type: str) -> None:
    assert math.isnan(across(pair, f"std_msgs/msg/{type}", {"data": math.nan})["data"])


def test_a_float32_is_rounded_once(pair: Pair) -> None:
    taken = across(pair, "std_msgs/msg/Float32", {"data": 0.1})["data"]
    assert taken == struct.unpack("f", struct.pack("f", 0.1))[0]


def test_whole_numbers_are_taken_for_floats(pair: Pair) -> None:
    taken = across(pair, "geometry_msgs/msg/Point32", {"x": 3, "y": -2.5})
    assert taken == {"x": 3.0, "y": -2.5, "z": 0.0} and isinstance(taken["x"], float)


def test_what_is_left_out_is_zero_not_the_default(pair: Pair) -> None:
    """A quaternion's w is 1 by its definition."""
    assert across(pair, "geometry_msgs/msg/Quaternion", {}) == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
    taken = across(pair, "geometry_msgs/msg/PoseStamped", {"header": {"frame_id": "map"}}, "nested")
    assert taken == {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "map"},
        "pose": {
            "position": {"x": 0.0, "y": 0.0, "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0},
        },
    }


def test_sequences_of_every_kind(pair: Pair) -> None:
    message = {
        "type": 9,
        "bool_value": True,
        "integer_value": -(2**63),
        "double_value": 0.25,
        "string_value": "ü",
        "byte_array_value": b"\x00\x01\xff",
        "bool_array_value": [True, False, True],
        "integer_array_value": [0, 2**63 - 1, -(2**63)],
        "double_array_value": [0.5, -math.inf, 1e300],
        "string_array_value": ["", "one", "zwölf"],
    }
    assert across(pair, "rcl_interfaces/msg/ParameterValue", message) == message
    empty = across(pair, "rcl_interfaces/msg/ParameterValue", {}, "empty")
    assert empty["byte_array_value"] == b"" and empty["string_array_value"] == empty["double_array_value"] == []


def test_bytes(pair: Pair) -> None:
    data = bytes(range(256)) * 1000
    message = {"header": {"stamp": {"sec": -1, "nanosec": 999_999_999}, "frame_id": "c"}, "format": "png", "data": data}
    assert across(pair, "sensor_msgs/msg/CompressedImage", message) == message


def test_nested_sequences_and_a_single_byte(pair: Pair) -> None:
    status = {
        "level": 2,
        "name": "engine",
        "message": "",
        "hardware_id": "h",
        "values": [{"key": "a", "value": "b"}] * 3,
    }
    message = {"header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": ""}, "status": [status, status]}
    assert across(pair, "diagnostic_msgs/msg/DiagnosticArray", message) == message


def test_fixed_arrays_and_bounded_sequences(pair: Pair) -> None:
    pose = {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    message = {"pose": pose, "covariance": [float(number) for number in range(36)]}
    assert across(pair, "geometry_msgs/msg/PoseWithCovariance", message) == message
    shape = {"type": 1, "dimensions": [1.0, 2.0, 3.0], "polygon": {"points": [{"x": 1.0, "y": 2.0, "z": 0.5}]}}
    assert across(pair, "shape_msgs/msg/SolidPrimitive", shape, "shape") == shape
    id = bytes(range(16))
    assert across(pair, "unique_identifier_msgs/msg/UUID", {"uuid": id}, "id") == {"uuid": id}


MISFITS: list[tuple[str, dict[str, Any], str]] = [
    ("std_msgs/msg/String", {"data": 5}, "data"),
    ("std_msgs/msg/String", {"data": "a\0b"}, "data"),
    ("std_msgs/msg/String", {"data": "half \ud83d"}, "data"),
    ("std_msgs/msg/String", {"text": "a"}, "text"),
    ("std_msgs/msg/Int8", {"data": 128}, "data"),
    ("std_msgs/msg/UInt64", {"data": -1}, "data"),
    ("std_msgs/msg/Int32", {"data": 1.5}, "data"),
    ("std_msgs/msg/Int32", {"data": "1"}, "data"),
    ("std_msgs/msg/Int32", {"data": None}, "data"),
    ("std_msgs/msg/Float64", {"data": "1"}, "data"),
    ("std_msgs/msg/Float32", {"data": 1e39}, "data"),
    ("std_msgs/msg/Bool", {"data": "yes"}, "data"),
    ("geometry_msgs/msg/PointStamped", {"point": {"x": "left"}}, "point.x"),
    ("geometry_msgs/msg/PointStamped", {"point": 3}, "point"),
    ("geometry_msgs/msg/PoseWithCovariance", {"covariance": [1.0]}, "covariance"),
    ("geometry_msgs/msg/PoseWithCovariance", {"covariance": [0.0] * 35 + ["x"]}, "covariance[35]"),
    ("shape_msgs/msg/SolidPrimitive", {"dimensions": [1.0] * 4}, "dimensions"),
    ("diagnostic_msgs/msg/DiagnosticArray", {"status": [{}, {"values": [{"key": 1}]}]}, "status[1].values[0].key"),
    ("diagnostic_msgs/msg/DiagnosticArray", {"status": "none"}, "status"),
    ("unique_identifier_msgs/msg/UUID", {"uuid": b"short"}, "uuid"),
]


@pytest.mark.parametrize("side", ["near", "far"])
def test_what_does_not_fit_is_refused_with_its_place(pair: Pair, side: str) -> None:
    peer: Peer = getattr(pair, side)
    for number, (type, message, place) in enumerate(MISFITS):
        key = f"{pair.name}/misfit{number}"
        peer.publisher(key=key, topic=key, type=type)
        with pytest.raises(Refused) as refused:
            peer.publish(key=key, messages=[message])
        assert place in str(refused.value), (type, message)
        peer.close(key=key)


@pytest.mark.parametrize(("offered", "asked", "matched"), [(True, True, 1), (True, False, 1), (False, False, 1)])
def test_a_subscription_counts_the_publishers_that_it_takes_from(
    pair: Pair, offered: bool, asked: bool, matched: int
) -> None:
    name = f"{pair.name}/gaze"
    pair.near.subscribe(key=name, topic=name, type=STRING, reliable=asked)
    assert pair.near.publishers(key=name) == 0
    pair.far.publisher(key=name, topic=name, type=STRING, reliable=offered)
    until(lambda: pair.near.publishers(key=name) == matched)
    pair.far.close(key=name)
    until(lambda: pair.near.publishers(key=name) == 0)


def test_a_subscription_that_asks_for_more_than_is_promised_does_not_count_it(pair: Pair) -> None:
    """So a node can tell that it hears nothing of a publisher that it sees."""
    name = f"{pair.name}/gaze"
    pair.near.subscribe(key=name, topic=name, type=STRING)
    pair.far.publisher(key=name, topic=name, type=STRING, reliable=False)
    until(lambda: [end["type"] for end in pair.near.ends(what="publisher", name=name)] == [STRING])
    assert pair.near.publishers(key=name) == 0 and pair.far.subscribers(key=name) == 0


def test_of_what_comes_while_a_subscription_pauses_the_newest_is_read(pair: Pair) -> None:
    name = f"{pair.name}/points"
    pair.near.subscribe(key=name, topic=name, type=STRING, depth=1, reliable=False, pause=0.05)
    pair.far.publisher(key=name, topic=name, type=STRING)
    until(lambda: pair.far.subscribers(key=name) == pair.near.publishers(key=name) == 1)
    pair.far.publish(key=name, messages=[{"data": f"{number:02}"} for number in range(50)])
    taken = [""]
    while taken[-1] != "49":
        taken.append(pair.near.event("taken", key=name)["message"]["data"])
    assert taken == sorted(set(taken))


def test_feature_nodes_hear_what_is_promised_and_what_is_not(pair: Pair) -> None:
    """A14: of best-effort publishers a reliable subscription hears nothing, 0 of 20 messages."""
    name = f"{pair.name}/gaze"
    pair.near.hear(key=name, topic=name, type=STRING)
    assert "nobody publishes on" in pair.near.event("says", key=name)["text"]
    pair.far.publisher(key="promised", topic=name, type=STRING)
    until(lambda: pair.far.subscribers(key="promised") == 1)
    pair.far.publish(key="promised", messages=[{"data": "at once"}])
    assert pair.near.event("taken", key=name)["message"] == {"data": "at once"}
    pair.far.publisher(key="tracker", topic=name, type=STRING, reliable=False)

    def heard() -> bool:
        pair.far.publish(key="tracker", messages=[{"data": "robot"}])
        return not pair.near.none("taken", key=name)

    until(heard)
    pair.far.close(key="promised")
    pair.far.close(key="tracker")
