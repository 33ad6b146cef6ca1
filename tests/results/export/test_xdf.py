"""A session as an XDF file: pyxdf reads all of it back, and notices copies that are broken."""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from rise_engine.kernel.records import AnyRecord, EventRecord, NoteRecord
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.markers import recorded_markers
from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.export.format import ExportContext, load_format
from rise_engine.results.export.xdf import SAMPLES, STREAM_FOOTER, write_session
from tests.chance import examples
from tests.results.analysis.samples import BEGAN, play_session

pyxdf: Any = pytest.importorskip("pyxdf")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return play_session(tmp_path_factory.mktemp("xdf") / "sessions")


@pytest.fixture(scope="module")
def data(folder: Path) -> SessionData:
    return read_session(folder)


def written(data: SessionData) -> bytes:
    out = BytesIO()
    write_session(out, data)
    return out.getvalue()


class Complaints(logging.Handler):
    """What pyxdf says about a file that it nevertheless reads as well as it can."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


def read(file: bytes) -> dict[str, Any]:
    """The streams by name, and `file`, the head. Raises ValueError when something in the file is wrong."""
    complaints = Complaints()
    log = logging.getLogger("pyxdf.pyxdf")
    log.addHandler(complaints)
    try:
        streams, head = pyxdf.load_xdf(BytesIO(file), dejitter_timestamps=False)
    except Exception as error:
        raise ValueError(f"{type(error).__name__}: {error}") from error
    finally:
        log.removeHandler(complaints)
    if complaints.said:
        raise ValueError("; ".join(complaints.said))
    for stream in streams:
        if "footer" not in stream:
            raise ValueError("a stream has no footer")
        counted = int(stream["footer"]["info"]["sample_count"][0])
        if counted != len(stream["time_series"]):
            raise ValueError(f"a footer counts {counted} samples, and there are {len(stream['time_series'])}")
    return {stream["info"]["name"][0]: stream for stream in streams} | {"file": head["info"]}


def samples(stream: dict[str, Any]) -> list[tuple[float, str]]:
    return [(float(at), text) for at, (text,) in zip(stream["time_stamps"], stream["time_series"], strict=True)]


def test_everything_is_read_back(data: SessionData) -> None:
    found = read(written(data))
    assert set(found) == {"rise", "rise-records", "file"}
    assert samples(found["rise"]) == recorded_markers(data)
    records = [msgspec.json.decode(text, type=AnyRecord) for _, text in samples(found["rise-records"])]
    assert records == list(data.records)
    assert [at for at, _ in samples(found["rise-records"])] == [record.t for record in data.records]


def test_what_the_streams_say_of_themselves(data: SessionData) -> None:
    found = read(written(data))
    info = found["rise"]["info"]
    assert (info["type"], info["channel_format"], info["nominal_srate"]) == (["Markers"], ["string"], ["0"])
    assert info["source_id"] == [f"rise/{data.facts.session}"]
    assert info["desc"][0]["participant"] == ["P01"] and info["desc"][0]["scenario"] == ["Tea"]
    assert found["rise-records"]["info"]["type"] == ["Records"]  # who imports all `Markers` gets each moment once
    assert found["file"]["version"] == ["1.0"] and found["file"]["datetime"] == [f"{BEGAN:%Y-%m-%dT%H:%M:%S.000%z}"]
    footer = found["rise-records"]["footer"]["info"]
    assert float(footer["last_timestamp"][0]) == data.facts.duration


def test_the_moments_of_an_act(data: SessionData) -> None:
    act = next(each for each in data.acts if each.act == "Answer" and each.status == "SUCCEEDED")
    assert act.voice_at is not None and act.robot_at is not None and act.robot_at < act.voice_at
    markers = recorded_markers(data)
    for at, moment in (
        (act.accepted_at, "accepted"),
        (act.started_at, "started"),
        (act.robot_at, "robot"),
        (act.voice_at, "voice"),
        (act.ended_at, "succeeded"),
    ):
        assert (at, f"act/Answer/{moment}") in markers


@pytest.mark.parametrize("level", ["shared", "public"])
def test_levels(folder: Path, level: ExportLevel) -> None:
    file = written(read_session(folder, level=level))
    assert "datetime" not in read(file)["file"]
    assert b"Zelda" not in file and b"anna" not in file and f"{BEGAN:%Y-%m-%d}".encode() not in file


def test_the_format_writes_a_new_file_of_one_session(data: SessionData, tmp_path: Path) -> None:
    load_format("xdf").write(tmp_path / "a.xdf", [data], ExportContext("full"))
    assert (tmp_path / "a.xdf").read_bytes() == written(data)


# --- broken copies ----------------------------------------------------------------------------------------------------


def chunks(file: bytes) -> list[tuple[int, int, int]]:
    """Where each chunk begins and ends, and its tag."""
    at, found = 4, []
    while at < len(file):
        size = file[at]
        (length,) = struct.unpack({1: "<B", 4: "<I", 8: "<Q"}[size], file[at + 1 : at + 1 + size])
        begin = at + 1 + size
        (tag,) = struct.unpack_from("<H", file, begin)
        found.append((at, begin + length, tag))
        at = begin + length
    return found


def first(file: bytes, tag: int, *, least: int = 0) -> tuple[int, int]:
    return next((begin, end) for begin, end, each in chunks(file) if each == tag and end - begin >= least)


def changed(file: bytes, at: int, value: int) -> bytes:
    return file[:at] + bytes([value]) + file[at + 1 :]


def torn(file: bytes) -> bytes:
    begin, end = first(file, SAMPLES, least=300)
    return file[: begin + (end - begin) // 2]


def without_a_footer(file: bytes) -> bytes:
    begin, end = first(file, STREAM_FOOTER)
    return file[:begin] + file[end:]


def one_sample_too_few(file: bytes) -> bytes:
    begin, _ = first(file, SAMPLES, least=300)  # whose length takes four bytes
    count = begin + 5 + 2 + 4 + 1  # behind its length, tag and stream, and how many bytes the count takes
    return changed(file, count, file[count] - 1)


@pytest.mark.parametrize("broken", [torn, without_a_footer, one_sample_too_few])
def test_a_broken_copy_is_noticed(data: SessionData, broken: Callable[[bytes], bytes]) -> None:
    file = written(data)
    read(file)
    with pytest.raises(ValueError):
        read(broken(file))


def test_a_reader_goes_on_behind_what_is_damaged(data: SessionData) -> None:
    """What boundaries are for: of a long session, only the chunk with the damage is lost."""
    record = EventRecord(0, 0.0, "", "/tick", "ros:/clock", None)
    long = replace(data, records=tuple(replace(record, seq=n, t=float(n)) for n in range(1, 601)), acts=())
    file = written(long)
    begin, _ = first(file, SAMPLES, least=100)
    broken = changed(file, begin + 2 + 2 + 4 + 1 if file[begin] == 1 else begin + 5 + 2 + 4 + 1, 255)
    streams, _ = pyxdf.load_xdf(BytesIO(broken), dejitter_timestamps=False)
    assert len(streams) == 2
    assert 550 < len(streams[1]["time_series"]) <= 600


@pytest.mark.slow
@settings(max_examples=examples(25))
@given(st.lists(st.tuples(st.floats(0, 1e6), st.text(max_size=300)), max_size=30))
def test_any_text_comes_back(notes: list[tuple[float, str]]) -> None:
    notes = sorted(notes, key=lambda note: note[0])
    records = tuple(NoteRecord(n, t, "", text, "wizard:w") for n, (t, text) in enumerate(notes, 1))
    facts = SessionFacts(session="s\x00 & <é>", condition="a\u0007b\ufffe", duration=notes[-1][0] if notes else 0.0)
    found = read(written(SessionData(facts=facts, level="full", folder=Path(), records=records)))
    said = [msgspec.json.decode(text)["text"] for _, text in samples(found["rise-records"])]
    assert said == [text for _, text in notes]
    assert [at for at, _ in samples(found["rise"])] == [t for t, _ in notes]
