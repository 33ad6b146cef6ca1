"""Recordings that are made for tests: what a microphone hears of a session's marks, on a clock of its own."""

from __future__ import annotations

import subprocess
import wave
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy

from rise_engine.run.recording.chirp import CHIRP_SECONDS, HIGH_HZ, LOW_HZ, sweep_of


def record_marks(
    marks: Sequence[tuple[int, float]],
    *,
    offset: float,
    rate: float = 1.0,
    seconds: float,
    noise: float = 0.0,
    loudness: float = 0.3,
    seed: int = 1,
    samples: int = 48_000,
) -> Any:
    """Sound, as floats.

    :param marks: each a number and a session time.
    :param offset: media time at session time 0.
    :param rate: media seconds in a session second.
    :param seconds: of the file.
    :param noise: white, as loud as this (root mean square).
    :param loudness: of the marks at their loudest.
    """
    chance = numpy.random.default_rng(seed)
    sound = chance.standard_normal(round(seconds * samples), dtype=numpy.float32) * numpy.float32(noise)
    for number, at in marks:
        begin = offset + rate * at
        first = max(0, int(begin * samples))
        last = min(len(sound), int((begin + rate * CHIRP_SECONDS) * samples) + 2)
        t = (numpy.arange(first, last) / samples - begin) / rate
        low, high = (LOW_HZ, HIGH_HZ) if sweep_of(number) == "up" else (HIGH_HZ, LOW_HZ)
        window = numpy.where(
            (t >= 0) & (t <= CHIRP_SECONDS), 0.5 - 0.5 * numpy.cos(2 * numpy.pi * t / CHIRP_SECONDS), 0
        )
        phase = 2 * numpy.pi * (low * t + (high - low) / CHIRP_SECONDS * t * t / 2)
        sound[first:last] += (loudness * window * numpy.sin(phase)).astype(numpy.float32)
    return sound


def write_wav(path: Path, sound: Any, samples: int = 48_000, *, width: int = 2, channels: int = 1) -> Path:
    """A WAV file, with the sound on every channel."""
    data = numpy.clip(numpy.repeat(sound, channels), -1, 1)
    with wave.open(str(path), "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(width)
        file.setframerate(samples)
        if width == 1:
            file.writeframes((data * 127 + 128).astype("u1").tobytes())
        elif width == 3:
            wide = (data.astype("f8") * (2**31 - 1)).astype("<i4").view("u1").reshape(-1, 4)
            file.writeframes(wide[:, 1:].tobytes())
        else:
            file.writeframes((data.astype("f8") * (2 ** (8 * width - 1) - 1)).astype(f"<i{width}").tobytes())
    return path


def make_video(path: Path, sound: Path, seconds: float, *, fps: int = 5, delay: float = 0.0) -> Path:
    """A film with that sound as AAC of 64 kb/s. `delay`: seconds by which its sound track begins late."""
    subprocess.run(
        ["ffmpeg", "-nostdin", "-v", "error", "-f", "lavfi", "-i", f"testsrc=s=64x48:r={fps}:d={seconds}",
         "-itsoffset", str(delay), "-i", str(sound), "-map", "0:v", "-map", "1:a", "-c:v", "mpeg4", "-c:a", "aac",
         "-b:a", "64k", "-t", str(seconds), str(path)],
        check=True, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    return path
