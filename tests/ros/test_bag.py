"""A session as a bag (`--format mcap`), read by mcap with its check sums, by mcap-ros2-support and by rosbags."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from datetime import datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import pytest
import yaml
from rise_adapters.ros2.bag import FORMAT, message_schema
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog

from rise_engine.kernel.records import AnyRecord, RuleRecord, TaskRecord
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.export.format import ExportContext, ExportError, load_format
from tests.results.analysis.samples import BEGAN, play_session, recovered_session

pytest.importorskip("mcap", reason="the extra bag is not installed")
MAGIC, CRC_BYTES = b"\x89MCAP0\r\n", 4
START = round(BEGAN.timestamp() * 1e9)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return play_session(tmp_path_factory.mktemp("bag") / "sessions")


@pytest.fixture(scope="module")
def data(folder: Path) -> SessionData:
    return read_session(folder)


@pytest.fixture(scope="module")
def bag(data: SessionData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(data, tmp_path_factory.mktemp("bags") / "bag")


def write(data: SessionData, path: Path) -> Path:
    FORMAT.write(path, [data], ExportContext(data.level))
    return path


def mcap_of(bag: Path) -> Path:
    (file,) = bag.glob("*.mcap")
    return file


def check_file(data: bytes) -> int:
    """Read a file from its first byte to its last with every check sum, and compare what it says of itself with what
    is in it; the number of messages. Raises whatever the reader raises, or AssertionError.

    The one sum at which mcap's own reader does not look is that of the summary (https://mcap.dev/spec, "Footer").
    """
    from mcap.reader import make_reader
    from mcap.records import Footer, Message, Statistics
    from mcap.stream_reader import StreamReader
    from mcap_ros2.decoder import DecoderFactory

    records = list(StreamReader(BytesIO(data), validate_crcs=True).records)
    (statistics,) = (record for record in records if isinstance(record, Statistics))
    messages = [record for record in records if isinstance(record, Message)]
    footer = records[-1]
    assert isinstance(footer, Footer) and footer.summary_crc
    assert zlib.crc32(data[footer.summary_start : -len(MAGIC) - CRC_BYTES]) == footer.summary_crc
    assert statistics.message_count == len(messages)
    times = [message.log_time for message in messages]
    assert times == sorted(times) and times[0] == statistics.message_start_time
    decoded = make_reader(BytesIO(data), validate_crcs=True, decoder_factories=[DecoderFactory()])
    assert len(list(decoded.iter_decoded_messages())) == len(messages)
    return len(messages)


def messages_of(bag: Path) -> Iterator[tuple[str, int, Any]]:
    from rosbags.highlevel import AnyReader

    with AnyReader([bag]) as reader:
        for connection, at, raw in reader.messages():
            yield connection.topic, at, reader.deserialize(raw, connection.msgtype)


def test_the_format_is_found_without_naming_the_adapter() -> None:
    assert load_format("mcap") is FORMAT


def test_every_record_is_a_message_that_says_the_same(bag: Path, data: SessionData) -> None:
    found = [(at, message) for topic, at, message in messages_of(bag) if topic == "/rise/record"]
    read: list[AnyRecord] = [msgspec.json.decode(message.json, type=AnyRecord) for _, message in found]
    assert read == list(data.records)
    for (at, message), record in zip(found, data.records, strict=True):
        assert (message.seq, message.t, message.session) == (record.seq, record.t, data.facts.session)
        assert message.kind == record.__struct_config__.tag
        assert at == START + round(record.t * 1e9)
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == at


def test_tasks_and_rules_have_their_topics(bag: Path, data: SessionData) -> None:
    tasks = [message for topic, _, message in messages_of(bag) if topic == "/rise/task_state"]
    expected = [record for record in data.records if isinstance(record, TaskRecord)]
    assert [(each.id, each.domain_task_behavior, each.status) for each in tasks] == [
        (each.id, each.behavior, each.status) for each in expected
    ]
    rules = [message for topic, _, message in messages_of(bag) if topic == "/rise/rule_state"]
    changes = [record for record in data.records if isinstance(record, RuleRecord)]
    assert [(each.rule, each.status, each.state) for each in rules] == [
        (each.name, each.status, each.state or "") for each in changes
    ]


def test_the_file_is_whole_and_compressed(bag: Path, data: SessionData) -> None:
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader

    file = mcap_of(bag).read_bytes()
    assert check_file(file) > len(list(data.records))
    chunks = [record for record in StreamReader(BytesIO(file), emit_chunks=True).records if isinstance(record, Chunk)]
    assert chunks and all(chunk.compression == "zstd" and chunk.uncompressed_crc for chunk in chunks)


def test_a_byte_that_has_changed_is_found_wherever_it_is(bag: Path) -> None:
    file = mcap_of(bag).read_bytes()
    assert check_file(file)
    missed = []
    places = [*range(0, len(file), len(file) // 60), *range(len(file) - 40, len(file))]
    for place in places:
        broken = bytearray(file)
        broken[place] ^= 0x10
        try:
            check_file(bytes(broken))
        except Exception:  # whichever part of the reader sees it
            continue
        missed.append(place)
    assert not missed


@pytest.mark.parametrize("kept", [0.2, 0.5, 0.9, 0.999])
def test_a_torn_file_is_refused(bag: Path, kept: float) -> None:
    from mcap.exceptions import McapError

    file = mcap_of(bag).read_bytes()
    with pytest.raises((McapError, struct.error, ValueError, AssertionError)):
        check_file(file[: int(len(file) * kept)])


def test_what_is_said_of_it_is_read_back(bag: Path, data: SessionData) -> None:
    from rosbags.rosbag2 import Reader

    with Reader(bag) as reader:
        assert reader.message_count == check_file(mcap_of(bag).read_bytes())
        assert (reader.start_time, reader.duration) == (START, round(data.facts.duration * 1e9) + 1)
        hashes = {connection.msgtype: connection.digest for connection in reader.connections}
    custom = yaml.safe_load((bag / "metadata.yaml").read_text("utf-8"))["rosbag2_bagfile_information"]["custom_data"]
    assert custom["participant"] == "P01" and custom["scenario_hash"] == data.facts.scenario_hash
    assert custom["session"] == data.facts.session and custom["level"] == "full"
    assert set(hashes) == {f"rise_interfaces/msg/{name}" for name in ("Record", "TaskState", "RuleState")}


def test_types_and_hashes_are_those_of_rosbags() -> None:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    catalog = InterfaceCatalog(environment={})
    for name in ("Record", "TaskState", "RuleState"):
        type = f"rise_interfaces/msg/{name}"
        store = get_typestore(Stores.ROS2_JAZZY)
        own = message_schema(catalog, type).partition("=" * 80)[0]
        store.register(get_types_from_msg(own, type))
        assert catalog.type_hash(type) == store.hash_rihs01(type)
        wanted, _ = store.generate_msgdef(type, ros_version=2)
        assert fields(message_schema(catalog, type)) == fields(wanted)


def fields(definition: str) -> dict[str, list[str]]:
    """The fields of each type in a definition with all that it needs."""
    first, *others = definition.split("=" * 80 + "\nMSG: ")
    parts = {"": first, **{each.partition("\n")[0].replace("/msg/", "/"): each.partition("\n")[2] for each in others}}
    return {
        name: [
            " ".join(line.partition("#")[0].replace("/msg/", "/").split()) for line in text.splitlines()
            if line.partition("#")[0].strip()
        ]
        for name, text in parts.items()
    }  # fmt: skip


def test_a_file_alone_carries_its_metadata(bag: Path) -> None:
    from mcap.reader import make_reader

    with mcap_of(bag).open("rb") as file:
        reader = make_reader(file)
        (entry,) = reader.iter_metadata()
        summary = reader.get_summary()
    assert summary is not None
    assert {each.metadata["topic_type_hash"][:7] for each in summary.channels.values()} == {"RIHS01_"}
    assert entry.name == "rosbag2"
    assert entry.metadata["serialized_metadata"] == (bag / "metadata.yaml").read_text("utf-8")


@pytest.mark.parametrize("level", ["shared", "public"])
def test_other_levels_tell_no_time_of_day_and_no_names(folder: Path, tmp_path: Path, level: ExportLevel) -> None:
    bag = write(read_session(folder, level=level), tmp_path / "bag")
    times = [at for _, at, _ in messages_of(bag)]
    assert times[0] == 0 and times[-1] < 10**12
    told = repr(list(messages_of(bag))) + (bag / "metadata.yaml").read_text("utf-8") + mcap_of(bag).name
    assert "Zelda" not in told and "anna" not in told and f"{BEGAN:%Y-%m-%d}" not in told


def test_what_lies_between_the_parts_of_a_recovered_session_is_added(tmp_path: Path) -> None:
    data = read_session(recovered_session(tmp_path / "sessions", at=26.0, away=95.0))
    assert data.facts.downtime > 60
    bag = write(data, tmp_path / "bag")
    at = {m.seq: time for topic, time, m in messages_of(bag) if topic == "/rise/record"}
    for record in data.records:
        wall = round(datetime.fromisoformat(record.wall).timestamp() * 1e9)
        assert abs(at[record.seq] - wall) < 0.01e9


def test_a_missing_extra_is_said(data: SessionData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mcap.writer", None)
    with pytest.raises(ExportError, match=r'pip install "rise-tui\[bag\]"'):
        write(data, tmp_path / "bag")
    assert not (tmp_path / "bag").exists()
