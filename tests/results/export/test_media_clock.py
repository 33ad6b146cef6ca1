"""Recordings beside a session: whose time annotations have, and what is not certain about it."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import pytest
from hypothesis import given
from msgspec import structs

from rise_engine.kernel.records import SessionRecord
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.export.media_clock import MediaClock, recording_clock, session_clock
from rise_engine.session.media import FoundMark, MediaFile
from tests.results.analysis.samples import recovered_session

from .made_sessions import MARKS, session, sessions, video


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    for name in ("room.mp4", "face.mp4", "voice.wav"):
        (tmp_path / name).write_bytes(b"")
    return tmp_path


def made(lab: Path, *media: MediaFile, duration: float = 60.0) -> SessionData:
    return session(lab, media=media, facts={"duration": duration})


def origins(clock: MediaClock) -> dict[str, float]:
    return {each.file.path: round(each.origin, 6) for each in clock.linked}


def test_a_recording_that_began_before_the_session_leaves_session_time_as_it_is(lab: Path) -> None:
    warnings: list[str] = []
    clock = session_clock(made(lab, video(offset=4.2)), warnings)
    assert (clock.rate, clock.shift, origins(clock), warnings) == (1.0, 0.0, {"room.mp4": 4.2}, [])
    assert clock.linked[0].path == lab / "room.mp4"


def test_recordings_that_began_later_shift_everything_to_the_last_of_them(lab: Path) -> None:
    clock = session_clock(made(lab, video(offset=-1.5), video("face.mp4", offset=-3.25)), [])
    assert (clock.shift, origins(clock)) == (-3.25, {"room.mp4": 1.75, "face.mp4": 0.0})
    assert clock.to_ms(10.0) == 6750  # 6.75 s in face.mp4, 8.5 s in room.mp4: 10 - 1.5


def test_a_camera_that_was_started_again_later_is_not_linked_to_the_first(lab: Path) -> None:
    warnings: list[str] = []
    clock = session_clock(made(lab, video("face.mp4", offset=-400.0), video(offset=-2.0), duration=600.0), warnings)
    assert (clock.shift, origins(clock)) == (-2.0, {"room.mp4": 0.0})
    assert [each for each in warnings if "face.mp4 begins 400.0 s after the session" in each]


def test_drift_is_corrected_by_scaling(lab: Path) -> None:
    fast = video(offset=1.7, rate=1.00005, marks=MARKS, aligned_by="marks")
    clock = session_clock(made(lab, fast, duration=3000.0), warnings := [])
    assert (clock.to_ms(1800.0), origins(clock), warnings) == (1_800_090, {"room.mp4": 1.7}, [])
    assert recording_clock(made(lab, fast), [], first="video").to_ms(1800.0) == 1_801_790  # its own time


def test_the_file_whose_drift_is_known_leads_and_the_other_says_how_far_it_is_off(lab: Path) -> None:
    measured = video("face.mp4", rate=1.0001, marks=MARKS, aligned_by="marks")
    clock = session_clock(made(lab, video(), measured, duration=1000.0), warnings := [])
    assert (list(origins(clock)), clock.rate) == (["face.mp4", "room.mp4"], 1.0001)
    assert [each for each in warnings if "against it room.mp4 is 0.10 s off" in each]


@pytest.mark.parametrize(
    ("file", "duration", "said"),
    [
        (video(offset=None), 60.0, "the place of room.mp4 on the session's clock is not known"),
        (video(aligned_by="start"), 60.0, "aligned by when its recorder was started"),
        (video(duration=1300.0), 60.0, "was not measured, and it is longer than 20 minutes"),
        (video(), 1201.0, "was not measured, and it is longer than 20 minutes"),
        (video("gone.mp4"), 60.0, "gone.mp4 is not there now"),
    ],
    ids=["unknown", "start", "long file", "long session", "gone"],
)
def test_what_is_not_certain_is_said(lab: Path, file: MediaFile, duration: float, said: str) -> None:
    warnings: list[str] = []
    session_clock(made(lab, file, duration=duration), warnings)
    assert len(warnings) == 1 and said in warnings[0], warnings


def test_what_is_certain_and_what_is_no_video_is_not_spoken_of(lab: Path) -> None:
    bag = MediaFile(path="bag", kind="bag")
    known = video(marks=MARKS, duration=3000.0, aligned_by="marks")
    assert session_clock(made(lab, known, bag, duration=3000.0), warnings := []).linked[0].file is known
    assert warnings == []


def test_praat_gets_the_time_of_the_sound_and_elan_that_of_the_video(lab: Path) -> None:
    data = made(lab, video(offset=4.0), video("voice.wav", kind="audio", offset=9.0))
    assert recording_clock(data, [], first="audio", alone=True).to_ms(1.0) == 10_000
    assert recording_clock(data, [], first="video", alone=True).to_ms(1.0) == 5_000
    assert recording_clock(made(lab), [], first="video") == MediaClock()


@given(sessions())
def test_no_time_origin_is_negative_and_media_time_is_right_for_every_file(data: SessionData) -> None:
    clock = session_clock(data, [])
    for linked in clock.linked:
        assert linked.origin >= 0 and linked.file.offset is not None
        annotation = clock.shift + clock.rate * 100.0
        drift = abs(linked.file.rate - clock.rate) * 100.0
        assert abs(annotation + linked.origin - (linked.file.offset + linked.file.rate * 100.0)) <= drift + 1e-6


def test_a_camera_goes_on_while_the_session_has_no_engine(tmp_path: Path) -> None:
    folder = recovered_session(tmp_path, at=26.0, away=95.0)
    (folder / "room.mp4").write_bytes(b"")
    data = read_session(folder)
    (gap,) = data.outages
    recovered = next(each for each in data.records if isinstance(each, SessionRecord) and each.status == "recovered")
    assert gap.at == recovered.t and data.facts.downtime == gap.seconds == pytest.approx(95.0, abs=1.5)
    before = structs.replace(data, media=(video(offset=2.0, marks=MARKS[:1]),))
    clock = recording_clock(before, warnings := [], first="video")
    assert (clock.to_ms(10.0), clock.to_ms(60.0)) == (12_000, round((62.0 + gap.seconds) * 1000))
    assert [each for each in warnings if f"{gap.seconds:.1f} s at {gap.at:.1f} s" in each]
    later = next(each for each in data.records if each.t > 60.0)
    passed = datetime.fromisoformat(later.wall) - datetime.fromisoformat(next(iter(data.records)).wall)
    assert clock.to_ms(later.t) == pytest.approx((2.0 + passed.total_seconds()) * 1000, abs=2)  # as a camera has it


def test_a_file_is_laid_against_the_part_of_the_session_in_which_its_marks_are(tmp_path: Path) -> None:
    data = read_session(recovered_session(tmp_path, at=26.0, away=95.0))
    after = FoundMark(number=2, session_at=60.0, media_at=5.0, strength=9.0)
    later = structs.replace(data, media=(video(offset=-55.0, marks=(after,)),))
    assert recording_clock(later, [], first="video").to_ms(60.0) == 5_000
    both = video(offset=2.0, marks=(MARKS[0], after))
    assert recording_clock(structs.replace(data, media=(both,)), warnings := [], first="video").linked
    assert [each for each in warnings if "marks before and after that" in each]
    elan = session_clock(structs.replace(data, media=(video(offset=2.0, marks=MARKS[:1]), *later.media)), [])
    assert [each.file.offset for each in elan.linked] == [2.0]  # the second part began 80 s and more later


def test_a_session_without_recordings_has_its_own_time_and_the_gap(tmp_path: Path) -> None:
    data = read_session(recovered_session(tmp_path))
    clock = session_clock(data, warnings := [])
    assert clock == MediaClock(gaps=data.outages) and data.outages and warnings == []
    gap = data.outages[0]
    assert clock.to_ms(gap.at) - clock.to_ms(gap.at - 0.001) == round(gap.seconds * 1000) + 1
