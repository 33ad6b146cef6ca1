"""`metadata.yaml` of a bag, version 9, as ROS 2 Jazzy and later write it
(https://github.com/ros2/rosbag2/blob/jazzy/rosbag2_storage/src/rosbag2_storage/yaml.hpp).

Written without a library: every text is in double quotes, as JSON has it, which YAML 1.2 reads the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
from msgspec import Struct

VERSION = 9
DISTRIBUTION = "jazzy"
"""Whose layout it is."""
_FOREVER = "{sec: 9223372036, nsec: 854775807}"


class TopicFacts(Struct, frozen=True):
    """What metadata.yaml says of a topic."""

    name: str
    type: str
    type_hash: str
    """`RIHS01_...` (REP 2016)."""
    depth: int
    messages: int = 0


def bag_metadata(
    file: str, topics: Sequence[TopicFacts], start: int, duration: int, custom_data: Mapping[str, str]
) -> str:
    """The text of metadata.yaml.

    :param file: the name of the bag's one file.
    :param topics: in the order of the file.
    :param start: of the first message, in nanoseconds since 1970.
    :param duration: in nanoseconds.
    :param custom_data: what is said of it besides.
    """
    count = sum(topic.messages for topic in topics)
    times = [f"starting_time: {{nanoseconds_since_epoch: {start}}}", f"duration: {{nanoseconds: {duration}}}"]
    lines = [
        "rosbag2_bagfile_information:",
        f"  version: {VERSION}",
        "  storage_identifier: mcap",
        *(f"  {each}" for each in times),
        f"  message_count: {count}",
        "  topics_with_message_count:",
    ]
    for topic in topics:
        lines += [
            "    - topic_metadata:",
            f"        name: {_quote(topic.name)}",
            f"        type: {_quote(topic.type)}",
            "        serialization_format: cdr",
            "        offered_qos_profiles:",
            *(f"          {line}" for line in qos_profile(topic.depth).splitlines()),
            f"        type_description_hash: {_quote(topic.type_hash)}",
            f"      message_count: {topic.messages}",
        ]
    lines += [
        '  compression_format: ""',
        '  compression_mode: ""',
        "  relative_file_paths:",
        f"    - {_quote(file)}",
        "  files:",
        f"    - path: {_quote(file)}",
        *(f"      {each}" for each in times),
        f"      message_count: {count}",
        "  custom_data:",
        *(f"    {_quote(name)}: {_quote(value)}" for name, value in custom_data.items()),
        f"  ros_distro: {DISTRIBUTION}",
    ]
    return "\n".join(lines) + "\n"


def qos_profile(depth: int) -> str:
    """How a topic of a session is offered: reliable, and its latest messages also to who comes late."""
    return "\n".join(
        [
            "- history: keep_last",
            f"  depth: {depth}",
            "  reliability: reliable",
            "  durability: transient_local",
            f"  deadline: {_FOREVER}",
            f"  lifespan: {_FOREVER}",
            "  liveliness: automatic",
            f"  liveliness_lease_duration: {_FOREVER}",
            "  avoid_ros_namespace_conventions: false",
        ]
    )


def _quote(text: str) -> str:
    return msgspec.json.encode(text).decode()
