"""The proof: what a camera that runs fast has recorded, with the sound that cameras make, is laid against the session
to within a millisecond; and what cannot be known is told, never guessed."""

from __future__ import annotations

import importlib
import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.base.errors import SessionError
from rise_engine.run.recording import media_files
from rise_engine.run.recording.alignment import SessionMark, align_by_marks
from rise_engine.run.recording.media_files import SOUND_RATE, Sound, find_marks, probe_media
from tests.chance import examples
from tests.run.recording.sounds import make_video, record_marks, write_wav

PLAYED = [(1, 2.25), (2, 27.0)]
SECONDS = 30.0
FAST = 1.000_05
"""50 ppm."""
needs_ffmpeg = pytest.mark.skipif(
    not (shutil.which("ffmpeg") and shutil.which("ffprobe")), reason="ffmpeg is not installed: no film is made"
)


def session_marks(played: Sequence[tuple[int, float]], within: float = 0.05) -> list[SessionMark]:
    return [SessionMark(number, at, within) for number, at in played]


def errors(found: Any, offset: float, rate: float, first: float, last: float) -> list[float]:
    """Seconds by which the alignment is wrong at two times of the session, and in their middle."""
    assert found.offset is not None, found.problem
    times = (first, (first + last) / 2, last)
    return [abs(found.offset + found.rate * t - (offset + rate * t)) for t in times]


def video_start(path: Path) -> float:
    """When the first picture is shown: with AAC, Matroska begins 21 ms before it."""
    shown = subprocess.run(
        ["ffprobe", "-v", "error", "-select_streams", "v", "-show_entries", "stream=start_time", "-of", "json", path],
        check=True, capture_output=True,
    )  # fmt: skip
    return float(json.loads(shown.stdout)["streams"][0]["start_time"])


@needs_ffmpeg
@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "offset", "noise", "delay"),
    [(".mp4", 1.7, 0.01, 0.0), (".mkv", -1.7, 0.1, 0.0), (".mov", -1.7, 0.3, 0.0), (".mkv", 1.7, 0.01, 0.5)],
)
def test_a_film_of_a_fast_camera_is_laid_against_the_session(
    tmp_path: Path, suffix: str, offset: float, noise: float, delay: float
) -> None:
    sound = record_marks(PLAYED, offset=offset, rate=FAST, seconds=SECONDS, noise=noise)
    film = make_video(tmp_path / f"room{suffix}", write_wav(tmp_path / "a.wav", sound), SECONDS, delay=delay)
    facts = probe_media(film)
    assert (facts.kind, facts.fps, facts.has_sound) == ("video", 5.0, True)
    assert facts.duration == pytest.approx(SECONDS, abs=0.1)
    found = align_by_marks(session_marks(PLAYED), find_marks(Sound(film).blocks(), SOUND_RATE))
    worst = max(errors(found, offset + video_start(film) + delay, FAST, 0.0, SECONDS))
    assert worst < 0.001, f"{worst * 1e3:.2f} ms"
    assert found.rate == pytest.approx(FAST, abs=5e-6) and len(found.marks) == 2
    assert all(mark.strength > 3 for mark in found.marks) and not found.remarks


@pytest.mark.slow
@settings(max_examples=examples(12))
@given(
    offset=st.floats(-10, 25),
    ppm=st.floats(-300, 300),
    noise=st.floats(0, 0.3),
    loudness=st.floats(0.05, 0.9),
    seed=st.integers(0, 1_000),
    first=st.floats(12, 20),
    between=st.floats(3, 15),
)
def test_whatever_the_clock_the_noise_and_the_loudness_are(
    offset: float, ppm: float, noise: float, loudness: float, seed: int, first: float, between: float
) -> None:
    noise = min(noise, loudness)  # at 16 kHz and with a fading tone that is a mark of a sixth of the noise's power
    rate = 1 + ppm * 1e-6
    played = [(1, first), (2, first + between)]
    sound = record_marks(
        played, offset=offset, rate=rate, seconds=65, noise=noise, loudness=loudness, seed=seed, samples=16_000
    )
    found = align_by_marks(session_marks(played), find_marks([sound], 16_000))
    assert max(errors(found, offset, rate, first, first + between)) < 0.001


def test_blocks_of_any_length_give_the_same() -> None:
    sound = record_marks([(1, 5.0), (2, 30.0)], offset=0, seconds=40, noise=0.05, samples=16_000)
    whole = find_marks([sound], 16_000)
    pieces = find_marks((sound[at : at + 7_919] for at in range(0, len(sound), 7_919)), 16_000)
    assert whole == pieces and [(mark.sweep, round(mark.at, 3)) for mark in whole] == [("up", 5.0), ("down", 30.0)]


@pytest.mark.parametrize("begin", [0.0, 15.9, 16.384, 32.2, 39.5])
def test_a_mark_lies_anywhere_also_where_blocks_meet(begin: float) -> None:
    sound = record_marks([(1, begin)], offset=0, seconds=40, noise=0.02, samples=16_000)
    [mark] = find_marks([sound], 16_000)
    assert mark.at == pytest.approx(begin, abs=1e-4)


def test_a_quiet_mark_hides_no_loud_one_and_what_is_lost_in_noise_is_none() -> None:
    """A camera for a whole day has marks from near and far."""
    sound = record_marks([], offset=0, seconds=90, noise=0.05, samples=16_000)
    loudness = [0.9, 0.5, 0.2, 0.1, 0.06, 0.045, 0.004]
    for number, each in enumerate(loudness, 1):
        sound += record_marks([(number, 10.0 * number)], offset=0, seconds=90, loudness=each, samples=16_000)
    found = find_marks([sound], 16_000)
    assert [round(mark.at) for mark in found] == [10, 20, 30, 40, 50, 60]
    assert found[0].strength > found[3].strength > found[5].strength >= 3


@pytest.mark.parametrize("kind", ["noise", "silence", "tone", "clicks", "nothing"])
def test_what_is_no_mark_is_none(kind: str) -> None:
    chance = numpy.random.default_rng(3)
    seconds = numpy.arange(20 * 16_000) / 16_000
    sound = {
        "noise": chance.standard_normal(len(seconds)) * 0.3,
        "silence": numpy.zeros(len(seconds)),
        "tone": 0.5 * numpy.sin(2 * numpy.pi * 2_000 * seconds) * (seconds % 3 < 0.5),
        "clicks": (chance.random(len(seconds)) < 0.0005) * 0.9,
        "nothing": numpy.zeros(0),
    }[kind]
    assert find_marks([sound.astype("f4")], 16_000) == []


@pytest.mark.parametrize(
    ("width", "channels", "samples"), [(1, 1, 11_025), (2, 2, 44_100), (3, 1, 48_000), (4, 2, 16_000)]
)
def test_wav_files_need_no_ffmpeg(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, width: int, channels: int, samples: int
) -> None:
    monkeypatch.setattr(media_files.shutil, "which", lambda name: None)
    sound = record_marks([(2, 3.5)], offset=0, seconds=6, noise=0.02, samples=samples)
    path = write_wav(tmp_path / "a.wav", sound, samples, width=width, channels=channels)
    heard = Sound(path)
    assert heard.rate == samples and probe_media(path) == media_files.MediaFacts("audio", path.stat().st_size, 6.0)
    [mark] = find_marks(heard.blocks(), heard.rate)
    assert mark.sweep == "down" and mark.at == pytest.approx(3.5, abs=1e-3)


def test_what_cannot_be_heard_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SessionError, match="has 8000 samples a second, and marks need 9,000"):
        find_marks([], 8_000)
    text = tmp_path / "notes.wav"
    text.write_text("no sound")
    with pytest.raises(SessionError, match=r"no WAV file that can be read without ffmpeg .*: install ffmpeg"):
        Sound(text, program="")
    with pytest.raises(SessionError, match=r"gone.wav cannot be read: No such file"):
        Sound(tmp_path / "gone.wav", program="")

    def missing(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(media_files, "import_module", missing)
    with pytest.raises(SessionError, match=r'pip install "rise-tui\[sync\]"'):
        Sound(text)
    assert importlib.import_module("numpy") is numpy


@needs_ffmpeg
@pytest.mark.slow
def test_a_film_without_sound_says_what_to_do(tmp_path: Path) -> None:
    silent = tmp_path / "silent.mp4"
    subprocess.run(
        ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", "testsrc=s=64x48:r=5:d=1", "-c:v", "mpeg4", silent], check=True
    )
    facts = probe_media(silent)
    assert (facts.kind, facts.has_sound, facts.duration) == ("video", False, 1.0)
    with pytest.raises(SessionError, match=r"silent.mp4 has no sound: use --at FILE=markN"):
        [*Sound(silent).blocks()]
    text = tmp_path / "text.mp4"
    text.write_text("nothing")
    with pytest.raises(SessionError, match=r"text.mp4 has no sound that ffmpeg can read: .*"):
        [*Sound(text).blocks()]
    assert probe_media(text).kind == "video" and probe_media(text).duration is None
