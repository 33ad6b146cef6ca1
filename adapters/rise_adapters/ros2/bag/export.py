"""The format `mcap`: a folder of each session with `metadata.yaml` and one MCAP file, as `ros2 bag` makes and opens it.

The messages are those that the session's node publishes while it runs (`rise_adapters.ros2.record_messages`), on the
same topics, so that a bag can be played to whatever listens to a session. Every part of the file has a check sum: by
them readers find a byte that has changed (https://mcap.dev/spec).

Times in the file are those of the wall clock at the session's start, and from there on session time, with what lay
between the parts of a recovered session added. At the levels that tell no times of day they begin in 1970.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import Struct

from rise_adapters.ros2.bag.metadata import TopicFacts, bag_metadata, qos_profile
from rise_adapters.ros2.bag.schemas import message_schema
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
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog, MessageCodec
from rise_adapters.ros2.transport.port import Message
from rise_engine.kernel.records import AnyRecord, RuleRecord, TaskRecord
from rise_engine.results.analysis.markers import describe_session
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.outages import records_by_wall_clock
from rise_engine.results.export.format import ExportContext, ExportError, ExportFormat

if TYPE_CHECKING:
    from mcap.writer import Writer

METADATA_FILE = "metadata.yaml"
TOPICS = (
    (f"/{RECORD}", RECORD_TYPE, RECORDS_LATCHED),
    (f"/{TASK_STATE}", TASK_STATE_TYPE, TASKS_LATCHED),
    (f"/{RULE_STATE}", RULE_STATE_TYPE, RULES_LATCHED),
)
"""Name, type, and how many of the latest messages a late subscriber of it gets when it is played."""
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
    """The types that this program has, whatever workspace is sourced. Raises ExportError."""
    catalog = InterfaceCatalog(environment={})
    try:
        import rosbags as rosbags  # has the standard types; an extra
    except ImportError:
        raise ExportError('the format mcap needs rosbags, for the types of ROS: pip install "rise-tui[bag]"') from None
    return catalog


def _write_session(writer: Writer, catalog: InterfaceCatalog, data: SessionData, file: str) -> str:
    """Write it all; returns the text of the bag's metadata.yaml."""
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
    writer.add_metadata("rosbag2", {"serialized_metadata": text})  # which is read where the file lies alone
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
    """When the session began, in nanoseconds since 1970; 0 where that is not told."""
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
