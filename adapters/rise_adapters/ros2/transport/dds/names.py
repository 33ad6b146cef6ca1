"""The names of topics, services and types on DDS, as in rmw_cyclonedds."""

from __future__ import annotations

from collections.abc import Mapping


def dds_topic(name: str) -> str:
    return f"rt{name}"


def ros_topic(name: str) -> str:
    """The reverse; empty: the topic is not of ROS, or belongs to a service."""
    return name[2:] if name.startswith("rt/") else ""


def request_topic(service: str) -> str:
    return f"rq{service}Request"


def reply_topic(service: str) -> str:
    return f"rr{service}Reply"


def dds_type(type: str) -> str:
    """`std_msgs/msg/String` -> `std_msgs::msg::dds_::String_`."""
    package, kind, name = type.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(name: str) -> str:
    """The reverse; empty: no type of ROS."""
    parts = name.split("::")
    if len(parts) != 4 or parts[2] != "dds_" or not parts[3].endswith("_"):
        return ""
    return f"{parts[0]}/{parts[1]}/{parts[3][:-1]}"


def encode_user_data(entries: Mapping[str, str]) -> bytes:
    """Encode `typehash=RIHS01_...;` and similar, as on every endpoint and participant of ROS."""
    return "".join(f"{key}={value};" for key, value in entries.items()).encode()


def decode_user_data(data: bytes) -> dict[str, str]:
    pairs = (entry.partition("=") for entry in data.decode("ascii", "replace").split(";"))
    return {key: value for key, equals, value in pairs if equals}
