"""The format `mcap`: a folder for each session with `metadata.yaml` and one MCAP file, as `ros2 bag` makes and opens
it.

The messages and topics are those of the session's node (`rise_adapters.ros2.record_messages`), so a bag can be played
to any listener of a session. Every part of the file has a checksum, so that readers find a changed byte
(https://mcap.dev/spec).

Times in the file are the wall clock at the session's start plus session time and the gaps of a recovered session. At
levels without times of day they begin in 1970.

`metadata.yaml` has version 9, as in ROS 2 Jazzy and later
(https://github.com/ros2/rosbag2/blob/jazzy/rosbag2_storage/src/rosbag2_storage/yaml.hpp).

It is written without a library. Every text is in double quotes, which JSON and YAML 1.2 read in the same way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import Struct

from rise_adapters.ros2.record_messages import (
    RECORD,
    RECORD_TYPE,
    RECORDS_LATCHED,
    RULE_STATE,
    RULE_STATE_TYPE,
    RULES_LATCHED,
    TASK_STATE,
    TASK_STATE_TYPE,
    TASKS_LATCHED,
    make_header,
    record_message,
    rule_state_message,
    task_state_message,
)
from rise_adapters.ros2.transport.interfaces import RISE_INTERFACES, InterfaceCatalog, MessageCodec
from rise_adapters.ros2.transport.port import Message
from rise_engine.kernel.records import AnyRecord, RuleRecord, TaskRecord
from rise_engine.results.analysis.course import records_by_wall_clock
from rise_engine.results.analysis.markers import describe_session
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.export.format import ExportContext, ExportError, ExportFormat

if TYPE_CHECKING:
    from mcap.writer import Writer

# --- metadata.yaml ----------------------------------------------------------------------------------------------------

VERSION = 9
DISTRIBUTION = "jazzy"
"""The distribution of this layout."""
_FOREVER = "{sec: 9223372036, nsec: 854775807}"


class TopicFacts(Struct, frozen=True):
    """A topic in metadata.yaml."""

    name: str
    type: str
    type_hash: str
    """`RIHS01_...` (REP 2016)."""
    depth: int
    messages: int = 0


def bag_metadata(
    file: str, topics: Sequence[TopicFacts], start: int, duration: int, custom_data: Mapping[str, str]
) -> str:
    """Return the text of metadata.yaml.

    :param file: the name of the bag's one file.
    :param topics: the topics in the order of the file.
    :param start: the time of the first message, in nanoseconds since 1970.
    :param duration: the duration in nanoseconds.
    :param custom_data: further entries.
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
    """The quality of service of a session's topic: reliable, with the latest messages for late subscribers."""
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


# --- message types as text --------------------------------------------------------------------------------------------

_SEPARATOR = "=" * 80


def message_schema(catalog: InterfaceCatalog, type: str) -> str:
    """Return the definition of a message of `rise_interfaces`, with its comments, and then those of its types.

    :param catalog: the source of definitions.
    :param type: `rise_interfaces/msg/Record`.
    :raises PortError: a type is unknown.
    """
    parts = [(RISE_INTERFACES / "msg" / f"{type.rpartition('/')[2]}.msg").read_text("utf-8").strip()]
    for nested in _nested(catalog, type):
        fields = "\n".join(f"{_short(str(each.type))} {each.name}" for each in catalog.definition(nested).fields)
        parts.append(f"{_SEPARATOR}\nMSG: {_short(nested)}\n{fields}")
    return "\n".join(parts) + "\n"


def _nested(catalog: InterfaceCatalog, type: str) -> list[str]:
    """Every type that a type contains, each once, required types first."""
    found: dict[str, None] = {}
    pending = [type]
    while pending:
        for field in catalog.definition(pending.pop(0)).fields:
            if field.type.is_nested and field.type.base not in found:
                found[field.type.base] = None
                pending.append(field.type.base)
    return list(found)


def _short(name: str) -> str:
    """A type's name in definitions: `std_msgs/Header`."""
    return name.replace("/msg/", "/")


METADATA_FILE = "metadata.yaml"
TOPICS = (
    (f"/{RECORD}", RECORD_TYPE, RECORDS_LATCHED),
    (f"/{TASK_STATE}", TASK_STATE_TYPE, TASKS_LATCHED),
    (f"/{RULE_STATE}", RULE_STATE_TYPE, RULES_LATCHED),
)
"""Name, type, and the number of messages for a late subscriber when the bag is played."""
SECOND = 1_000_000_000


class _Channel(Struct):
    """A topic in the file."""

    id: int
    codec: MessageCodec
    facts: TopicFacts


def write_mcap(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write the one session of `sessions` to the new folder `path`. Raises ExportError, OSError."""
    try:
        from mcap.writer import Writer  # an extra
    except ImportError:
        raise ExportError('the format mcap needs mcap and rosbags: pip install "rise-tui[bag]"') from None
    catalog = _catalog()
    for data in sessions:
        path.mkdir(0o700)
        name = f"{data.facts.session}.mcap"
        with (path / name).open("xb") as file:
            text = _write_session(Writer(file, enable_crcs=True, enable_data_crcs=True), catalog, data, name)
        (path / METADATA_FILE).write_text(text, "utf-8")


def _catalog() -> InterfaceCatalog:
    """The types of this program, whatever workspace is sourced. Raises ExportError."""
    catalog = InterfaceCatalog(environment={})
    try:
        import rosbags as rosbags  # an extra with the standard types
    except ImportError:
        raise ExportError('the format mcap needs rosbags, for the types of ROS: pip install "rise-tui[bag]"') from None
    return catalog


def _write_session(writer: Writer, catalog: InterfaceCatalog, data: SessionData, file: str) -> str:
    """Write the whole session. Returns the text of the bag's metadata.yaml."""
    writer.start(profile="ros2", library="rise-tui")
    channels = {topic: _register(writer, catalog, topic, type, depth) for topic, type, depth in TOPICS}
    counts: Counter[str] = Counter()
    first = last = _start(data)
    for at, record in _timed(data):
        header = make_header(at)
        for topic, message in _messages(record, data.facts.session, header):
            channel = channels[topic]
            counts[topic] += 1
            writer.add_message(
                channel.id, log_time=at, data=channel.codec.pack(message), publish_time=at, sequence=counts[topic]
            )
        last = max(last, at)
    facts = [msgspec.structs.replace(channel.facts, messages=counts[topic]) for topic, channel in channels.items()]
    text = bag_metadata(file, facts, first, last - first, _custom_data(data))
    writer.add_metadata("rosbag2", {"serialized_metadata": text})  # for a file without its folder
    writer.finish()  # type: ignore[no-untyped-call]
    return text


def _register(writer: Writer, catalog: InterfaceCatalog, topic: str, type: str, depth: int) -> _Channel:
    profile = qos_profile(depth)
    schema = writer.register_schema(type, "ros2msg", message_schema(catalog, type).encode())
    hash = catalog.type_hash(type)
    id = writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": profile, "topic_type_hash": hash})
    return _Channel(id, catalog.codec(type), TopicFacts(topic, type, hash, depth))


def _messages(record: AnyRecord, session: str, header: Message) -> Iterator[tuple[str, dict[str, Any]]]:
    if isinstance(record, TaskRecord):
        yield f"/{TASK_STATE}", task_state_message(record, header)
    elif isinstance(record, RuleRecord):
        yield f"/{RULE_STATE}", rule_state_message(record.name, record.status, record, header)
    yield f"/{RECORD}", record_message(record, session, header)


def _timed(data: SessionData) -> Iterator[tuple[int, AnyRecord]]:
    """The records with their times in the file, in nanoseconds since 1970."""
    begin = _start(data)
    for seconds, record in records_by_wall_clock(data):
        yield begin + round(seconds * SECOND), record


def _start(data: SessionData) -> int:
    """The session's start, in nanoseconds since 1970; 0: not given."""
    try:
        return round(datetime.fromisoformat(data.facts.started).timestamp() * 1e6) * 1000
    except ValueError:
        return 0


def _custom_data(data: SessionData) -> dict[str, str]:
    facts = data.facts
    return {**describe_session(facts), "level": data.level, "seed": str(facts.seed), "speed": f"{facts.speed:g}"}


FORMAT = ExportFormat(
    name="mcap",
    about="a bag of ROS 2 for each session, with check sums",
    shape="file-per-session",
    suffix="",
    write=write_mcap,
    extra="bag",
)
