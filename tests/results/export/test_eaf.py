"""ELAN's files, read by pympi, and by the format's own schema where RISE_EAF_XSD names it.

The schema (EAFv3.0.xsd) comes with ELAN and is not ours to ship: https://archive.mpi.nl/tla/elan
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from lxml import etree
from pympi.Elan import Eaf

from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.export.eaf import EAF, write_eaf
from rise_engine.results.export.format import ExportContext
from rise_engine.results.export.media_clock import lay_out, session_clock
from rise_engine.results.export.spans import spans_of
from rise_engine.results.export.writing import export_context, export_sessions
from rise_engine.session.media import FoundMark
from tests.results.analysis.samples import play_session

from .made_sessions import HARD_TEXTS, act, phase, point, session, sessions, video

XSD = os.environ.get("RISE_EAF_XSD", "")


def write(data: SessionData, folder: Path, context: ExportContext | None = None) -> Path:
    out = folder / "session.eaf"
    out.unlink(missing_ok=True)
    write_eaf(out, [data], context or ExportContext("full"))
    return out


def schema_errors(file: Path) -> list[str]:
    if not XSD:
        pytest.skip("RISE_EAF_XSD does not name ELAN's schema EAFv3.0.xsd")
    schema = etree.XMLSchema(etree.parse(XSD))
    schema.validate(etree.parse(str(file)))
    return [error.message for error in schema.error_log]


def rule_errors(file: Path) -> list[str]:
    """What ELAN demands, by an own reading of the format, for machines without the schema."""
    try:
        root = etree.parse(str(file)).getroot()
    except etree.XMLSyntaxError as error:
        return [str(error)]
    found = []
    order = [child.tag for child in root]
    parts = ["HEADER", "TIME_ORDER", "TIER", "LINGUISTIC_TYPE", "CONSTRAINT"]
    if order != sorted(order, key=lambda tag: parts.index(tag) if tag in parts else 99) or order[:2] != parts[:2]:
        found.append(f"order {order}")
    slots = {slot.get("TIME_SLOT_ID"): slot.get("TIME_VALUE") or "" for slot in root.iter("TIME_SLOT")}
    found += [f"time {value}" for value in slots.values() if not re.fullmatch(r"\d+", value)]
    if not found and (times := [int(value) for value in slots.values()]) != sorted(times):
        found.append("time slots in disorder")
    types = {each.get("LINGUISTIC_TYPE_ID") for each in root.iter("LINGUISTIC_TYPE")}
    names = [tier.get("TIER_ID") for tier in root.iter("TIER")]
    found += [f"tier twice: {name}" for name in names if names.count(name) > 1]
    found += [
        f"type {tier.get('LINGUISTIC_TYPE_REF')}"
        for tier in root.iter("TIER")
        if tier.get("LINGUISTIC_TYPE_REF") not in types
    ]
    ids = [each.get("ANNOTATION_ID") for each in root.iter("ALIGNABLE_ANNOTATION")]
    found += ["annotation twice"] if len(set(ids)) != len(ids) else []
    for tier in root.iter("TIER"):
        at = 0
        for each in tier.iter("ALIGNABLE_ANNOTATION"):
            references = (each.get("TIME_SLOT_REF1"), each.get("TIME_SLOT_REF2"))
            if not set(references) <= slots.keys():
                found.append(f"no slot {references}")
            elif not found:
                start, end = (int(slots[name]) for name in references)
                found += [f"{start} to {end} after {at}"] if not at <= start < end else []
                at = end
    origins = [each.get("TIME_ORIGIN", "0") for each in root.iter("MEDIA_DESCRIPTOR")]
    return found + [f"origin {each}" for each in origins if not each.isdigit()]


def told_by(file: Path) -> dict[str, list[tuple[int, int, str]]]:
    found = Eaf(str(file))
    return {name: sorted(found.get_annotation_data_for_tier(name)) for name in found.get_tier_names()}


def expected(data: SessionData) -> dict[str, list[tuple[int, int, str]]]:
    found = lay_out(spans_of(data), session_clock(data, []), data.facts.duration)
    return {tier.name: [(each.start, each.end, each.text) for each in tier.annotations] for tier in found.tiers}


def test_pympi_reads_every_annotation_of_a_real_session(real: SessionData, tmp_path: Path) -> None:
    file = write(real, tmp_path)
    assert told_by(file) == expected(real)
    assert sum(map(len, told_by(file).values())) > 50
    assert rule_errors(file) == []


def test_the_schema_accepts_a_real_session(real: SessionData, tmp_path: Path) -> None:
    assert schema_errors(write(real, tmp_path)) == []


@given(data=sessions())
def test_any_session_is_read_back_as_it_was_written(
    data: SessionData, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = write(data, tmp_path_factory.getbasetemp())
    assert rule_errors(file) == []
    assert told_by(file) == expected(data)
    if XSD:
        assert schema_errors(file) == []


def test_several_media_with_their_origins(tmp_path: Path) -> None:
    lab = tmp_path / "lab 1 – Büro"
    media = (
        video(offset=-1.5),
        video("/data/face & <b>.MOV", offset=2.25),
        video("voice.wav", kind="audio", offset=0.0),
        video("old.avi", offset=0.0),
    )
    (tmp_path / "out").mkdir()
    file = write(
        session(lab, media=media, points=(point(1.0), point(3.0))), tmp_path / "out", context := ExportContext("full")
    )
    found = [dict(each.attrib) for each in etree.parse(str(file)).iter("MEDIA_DESCRIPTOR")]
    assert found[0] == {
        "MEDIA_URL": f"file://{lab}/room.mp4",  # blanks and all, as ELAN reads it
        "RELATIVE_MEDIA_URL": "../lab 1 – Büro/room.mp4",
        "MIME_TYPE": "video/mp4",
    }
    assert [(each["MIME_TYPE"], each.get("TIME_ORIGIN")) for each in found[1:]] == [
        ("video/quicktime", "3750"),
        ("video/*", "1500"),
        ("audio/x-wav", "1500"),
    ]
    assert found[1]["MEDIA_URL"] == "file:///data/face & <b>.MOV"
    assert told_by(file)["note"] == [(1500, 1600, "hm")]
    assert [each for each in context.warnings if "1 annotation of what happened before is left out" in each]
    if XSD:
        assert schema_errors(file) == []


def test_paths_are_relative_to_where_the_file_will_lie(tmp_path: Path) -> None:
    context = ExportContext("full", folder=tmp_path)
    (work := tmp_path / "unfinished").mkdir()
    file = write(session(tmp_path / "s", media=(video(),)), work, context)
    assert Eaf(str(file)).media_descriptors[0]["RELATIVE_MEDIA_URL"] == "./s/room.mp4"


@pytest.mark.parametrize(
    ("started", "date"),
    [
        ("2024-11-23T09:30:00.123+01:00", "2024-11-23T09:30:00.123+01:00"),
        ("2026-06-01T09:30:00+05:30", "2026-06-01T09:30:00.000+05:30"),  # half an hour: pympi's own dates fail here
        ("2026-06-01T09:30:00-09:30", "2026-06-01T09:30:00.000-09:30"),
        ("2026-06-01T09:30:00+14:00", "2026-06-01T09:30:00.000+14:00"),
        ("2026-06-01T09:30:00+00:53:28", "2026-06-01T08:36:32.000+00:00"),
        ("2026-06-01T09:30:00-15:30", "2026-06-02T01:00:00.000+00:00"),
        ("0001-01-01T00:00:00+15:00", "1970-01-01T00:00:00+00:00"),
        ("2026-06-01T09:30:00", "1970-01-01T00:00:00+00:00"),
        ("yesterday", "1970-01-01T00:00:00+00:00"),
        ("", "1970-01-01T00:00:00+00:00"),
    ],
)
def test_the_date_is_one_in_every_time_zone(started: str, date: str, tmp_path: Path) -> None:
    file = write(session(facts={"started": started}), tmp_path)
    assert etree.parse(str(file)).getroot().get("DATE") == date
    if XSD:
        assert schema_errors(file) == []


def test_names_and_texts_of_any_characters(tmp_path: Path) -> None:
    runs = tuple(phase(place, place + 1, text, text) for place, text in enumerate(HARD_TEXTS))
    file = write(
        session(phases=runs, acts=tuple(act(place, place + 1, text) for place, text in enumerate(HARD_TEXTS))), tmp_path
    )
    assert rule_errors(file) == []
    names = list(told_by(file))
    assert 'rule she said "yes" & <no>' in names and "rule 😀 ü ß → 中文 שלום" in names and "rule ]]>" in names
    assert "rule half a � character" in names


@pytest.mark.parametrize("level", ["shared", "public"])
def test_other_levels_name_no_date_no_file_and_nothing_private(level: ExportLevel, tmp_path: Path) -> None:
    data = read_session(play_session(tmp_path / "lab"), level=level)
    text = write(data, tmp_path).read_text("utf-8")
    assert "MEDIA_DESCRIPTOR" not in text and "2024-11-23" not in text and 'DATE="1970' in text
    assert "Zelda" not in text and "anna" not in text and str(tmp_path) not in text


def test_the_same_session_gives_the_same_file(real: SessionData, tmp_path: Path) -> None:
    assert write(real, tmp_path).read_bytes() == write(real, tmp_path).read_bytes()


BROKEN: dict[str, Callable[[str], str]] = {
    "time slots after tiers": lambda text: re.sub(r"(?s)(<TIME_ORDER>.*</TIME_ORDER>)(.*</TIER>)", r"\2\1", text),
    "negative time": lambda text: re.sub(r'TIME_VALUE="(\d+)"', r'TIME_VALUE="-\1"', text, count=1),
}


@pytest.mark.parametrize("what", BROKEN)
def test_broken_copies_are_refused(what: str, real: SessionData, tmp_path: Path) -> None:
    file = write(real, tmp_path)
    text = file.read_text("utf-8")
    file.write_text(broken := BROKEN[what](text), "utf-8")
    assert broken != text
    assert rule_errors(file) != []
    if XSD:
        assert schema_errors(file) != []


def test_marks_lie_in_every_file_where_they_were_found(tmp_path: Path) -> None:
    """A camera that is 50 ppm fast and began late, and a sound file: annotation + origin = its time."""
    rate = 1.00005
    offsets = {"room.mp4": -1.7, "voice.wav": 0.4}
    media = tuple(
        video(
            path,
            kind="video" if path.endswith("mp4") else "audio",
            offset=offset,
            rate=rate,
            aligned_by="marks",
            marks=tuple(
                FoundMark(number=number, session_at=at, media_at=offset + rate * at, strength=9.0)
                for number, at in ((1, 2.0), (2, 3599.0))
            ),
        )
        for path, offset in offsets.items()
    )
    syncs = tuple(point(at, "sync", name, "sound") for name, at in (("1", 2.0), ("2", 3599.0)))
    data = session(tmp_path, media=media, points=syncs, facts={"duration": 3600.0})
    found = Eaf(str(write(data, tmp_path)))
    begun = [start for start, _, _ in sorted(found.get_annotation_data_for_tier("sync"))]
    for file, linked in zip(media, found.media_descriptors, strict=True):
        origin = int(linked.get("TIME_ORIGIN", 0))
        assert linked["RELATIVE_MEDIA_URL"] == f"./{file.path}"
        for start, mark in zip(begun, file.marks, strict=True):
            assert abs(start + origin - mark.media_at * 1000) <= 1


@pytest.mark.parametrize("several", [False, True])
def test_the_command_names_films_relative_to_where_the_file_ends_up(several: bool, tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions")
    (tmp_path / "films").mkdir()
    film = tmp_path / "films" / "room.mp4"
    film.write_bytes(b"")
    (folder / "media.json").write_bytes(msgspec.json.encode([video(str(film), offset=2.0)]))
    out = tmp_path / "out"
    export_sessions(EAF, out, [folder], export_context([folder], "full"), several=several)
    file = next(out.iterdir()) if several else out
    (linked,) = etree.parse(str(file)).iter("MEDIA_DESCRIPTOR")
    assert (file.parent / linked.get("RELATIVE_MEDIA_URL", "")).resolve() == film
    assert linked.get("MEDIA_URL") == f"file://{film}"
