"""The tiers as tab-separated text, for a transcription that somebody has begun."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from hypothesis import given

from rise_engine.analysis.model import SessionData
from rise_engine.export.elan_tab import COLUMNS, write_elan_tab
from rise_engine.export.format import ExportContext
from rise_engine.export.media_clock import recording_clock
from rise_engine.export.spans import spans_of
from rise_engine.export.tiers import lay_out

from .made_sessions import act, point, session, sessions, video


def write(data: SessionData, folder: Path, context: ExportContext | None = None) -> list[list[str]]:
    out = folder / "session.txt"
    out.unlink(missing_ok=True)
    write_elan_tab(out, [data], context or ExportContext("full"))
    with out.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file, delimiter="\t", quoting=csv.QUOTE_NONE))


def test_times_are_those_of_the_video(tmp_path: Path) -> None:
    data = session(tmp_path, media=(video(offset=2.5, rate=1.01),), acts=(act(10, 20),), points=(point(30.0),))
    assert write(data, tmp_path, context := ExportContext("full")) == [
        list(COLUMNS),
        ["wizard acts", "12600", "22700", "R_Hello"],
        ["note", "32800", "32900", "hm"],
    ]
    assert [each for each in context.warnings if "room.mp4, in which the session begins at 2.500 s" in each]


@given(data=sessions())
def test_every_line_has_four_fields(data: SessionData, tmp_path_factory: pytest.TempPathFactory) -> None:
    rows = write(data, tmp_path_factory.getbasetemp())
    found = lay_out(spans_of(data), recording_clock(data, [], first="video"), data.facts.duration)
    assert rows[1:] == [
        [tier.name, str(each.start), str(each.end), each.text] for tier in found.tiers for each in tier.annotations
    ]
