"""Facts about a recording and its sound, from ffmpeg and ffprobe, or without them as far as Python can read it.

It finds marks in a file's sound by cross-correlation with the sweeps. It works in blocks, so a file of two hours takes
no more memory than one of a minute. It needs numpy (extra `sync`).

The last half second of sound, from 0.8 to 4.2 kHz, is compared with a sweep. The result is a correlation coefficient
between 0 and 1, independent of the loudness. A mark as loud as the noise gets 0.7, one with a tenth of its power 0.3,
an hour of noise 0.1 at most.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import wave
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import msgspec
from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.base.files import file_hash
from rise_engine.base.text import clean
from rise_engine.ports.recorder import MediaKind
from rise_engine.run.recording.alignment import HeardMark
from rise_engine.run.recording.chirp import CHIRP_SECONDS, HIGH_HZ, LOW_HZ, Sweep, chirp

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Samples = NDArray[np.float32]

# --- finding marks in a file ------------------------------------------------------------------------------------------

MIN_RATIO = 3.0
"""Minimum ratio of a mark to the best match elsewhere in the file."""
_MIN_COEFFICIENT = 0.15
"""Minimum coefficient of a mark, however quiet the file is."""
MAX_MARKS = 200
"""Maximum number of marks in one file. A camera that runs for a whole day records those of all sessions."""
_FEW, _SHARE = 4, 0.1
"""Maximum number of marks in a short file, and maximum share of the time in a longer one."""
_BLOCK = 1 << 18
"""Number of samples compared together."""
_BIN_SECONDS = 0.25
"""Duration of the pieces of a file; the best match of each counts."""
_MIN_DISTANCE_SECONDS = 0.5
"""Minimum distance of two marks. A nearer one is an echo."""
_QUIET = 1e-5
"""Loudness (of 1) below which nothing is compared."""
_MARGIN_HZ = 200.0
"""Margin of the band around the sweep."""
SWEEPS: tuple[Sweep, ...] = get_args(Sweep)


def load_numpy() -> Any:
    """Load numpy. Raises SessionError if it is not installed."""
    try:
        return import_module("numpy")
    except ImportError:
        raise SessionError('marks are found with numpy: pip install "rise-tui[sync]"') from None


def find_marks(blocks: Iterable[Samples], rate: int) -> list[HeardMark]:
    """Find every sound that is a mark, in the order of the file.

    :param blocks: the sound, one channel, between -1 and 1, in pieces of any length.
    :param rate: samples in a second, at least 9,000: the sweeps reach 4 kHz.
    :return: those that are `MIN_RATIO` times as strong as everything else of that kind.
    :raises SessionError: numpy is missing, or the rate is too low.
    """
    numpy = load_numpy()
    if rate < 2 * HIGH_HZ + 1_000:
        raise SessionError(f"the sound has {rate} samples a second, and marks need 9,000 at least")
    matcher = _Matcher(numpy, rate)
    best: list[tuple[float, float, Sweep]] = []
    for start, block in _overlapping(numpy, blocks, matcher.length):
        best.extend(matcher.best_matches(start, block))
    return _select(best)


def _overlapping(numpy: Any, blocks: Iterable[Samples], length: int) -> Iterator[tuple[int, Samples]]:
    """Cut the sound into overlapping blocks of one size, each with the index of its first sample.

    The overlap keeps every mark whole. The file's end is filled with silence.
    """
    buffer = numpy.zeros(_BLOCK, dtype=numpy.float32)
    filled = start = 0
    step = _BLOCK - length + 1
    for samples in blocks:
        while len(samples):
            count = min(_BLOCK - filled, len(samples))
            buffer[filled : filled + count] = samples[:count]
            filled, samples = filled + count, samples[count:]
            if filled == _BLOCK:
                yield start, buffer
                kept = buffer[step:].copy()
                buffer[: len(kept)] = kept
                filled, start = len(kept), start + step
    if filled:
        buffer[filled:] = 0
        yield start, buffer


class _Matcher:
    """Comparison of blocks with both sweeps."""

    def __init__(self, numpy: Any, rate: int) -> None:
        self._numpy, self._rate = numpy, rate
        self.length = round(CHIRP_SECONDS * rate)
        frequencies = numpy.fft.rfftfreq(_BLOCK, 1 / rate)
        inside = (frequencies >= LOW_HZ - _MARGIN_HZ) & (frequencies <= HIGH_HZ + _MARGIN_HZ)
        self._band = inside.astype(numpy.float32)
        self._spectra = {sweep: self._spectrum(sweep) for sweep in SWEEPS}
        self._bin = round(_BIN_SECONDS * rate)

    def _spectrum(self, sweep: Sweep) -> Any:
        numpy = self._numpy
        tone = numpy.zeros(_BLOCK, dtype=numpy.float32)
        tone[: self.length] = numpy.array(chirp(sweep, self._rate), dtype=numpy.float32)
        tone /= numpy.sqrt(numpy.sum(tone.astype(numpy.float64) ** 2))
        return numpy.conj(numpy.fft.rfft(tone)) * self._band

    def best_matches(self, start: int, block: Samples) -> Iterator[tuple[float, float, Sweep]]:
        """Yield each sweep's best match in each piece of the block: its quality and its start in the file."""
        numpy = self._numpy
        spectrum = numpy.fft.rfft(block)
        heard = numpy.fft.irfft(spectrum * self._band, _BLOCK).astype(numpy.float64)
        energy = numpy.concatenate(([0.0], numpy.cumsum(heard * heard)))
        count = _BLOCK - self.length + 1
        loudness = numpy.sqrt(numpy.maximum(energy[self.length :] - energy[:count], _QUIET**2 * self.length))
        for sweep in SWEEPS:
            matches = numpy.abs(numpy.fft.irfft(spectrum * self._spectra[sweep], _BLOCK)[:count]) / loudness
            whole = count // self._bin * self._bin
            places = matches[:whole].reshape(-1, self._bin).argmax(axis=1) + numpy.arange(0, whole, self._bin)
            if whole < count:
                places = numpy.append(places, whole + matches[whole:].argmax())
            for place in places:
                yield float(matches[place]), (start + self._peak(matches, int(place))) / self._rate, sweep

    def _peak(self, matches: Any, place: int) -> float:
        """Interpolate the top of a peak by a parabola through its three highest samples."""
        if not 0 < place < len(matches) - 1:
            return place
        before, top, after = (float(each) for each in matches[place - 1 : place + 2])
        bend = before - 2 * top + after
        return place + (0.5 * (before - after) / bend if bend < 0 else 0.0)


def _select(best: list[tuple[float, float, Sweep]]) -> list[HeardMark]:
    """Select the matches that are stronger than all others. After the maximum number of marks, the others begin."""
    places = max((at for _, at, _ in best), default=0.0) / _MIN_DISTANCE_SECONDS
    most = min(MAX_MARKS, max(_FEW, int(places * _SHARE)))
    apart: list[tuple[float, float, Sweep]] = []
    for match in sorted(best, reverse=True):
        if len(apart) > most:
            break
        if all(abs(match[1] - each[1]) >= _MIN_DISTANCE_SECONDS for each in apart):
            apart.append(match)
    floor = max(apart[most][0] if len(apart) > most else 0.0, _MIN_COEFFICIENT / 100)
    least = max(_MIN_COEFFICIENT, MIN_RATIO * floor)
    heard = [HeardMark(sweep, at, round(quality / floor, 2)) for quality, at, sweep in apart[:most] if quality >= least]
    return sorted(heard, key=lambda mark: mark.at)


SOUND_RATE = 16_000
"""Samples in a second of ffmpeg's output."""
PROBE_SECONDS = 30.0
_PIECE = 1 << 20
"""Number of bytes read at once."""
_SUFFIXES: dict[str, MediaKind] = {
    **dict.fromkeys(
        (".mkv", ".mp4", ".mov", ".avi", ".webm", ".m4v", ".mts", ".m2ts", ".mpg", ".wmv", ".flv"), "video"
    ),
    **dict.fromkeys((".wav", ".flac", ".mp3", ".m4a", ".ogg", ".opus", ".aac", ".wma", ".aif", ".aiff"), "audio"),
    **dict.fromkeys((".mcap", ".db3", ".bag"), "bag"),
    ".xdf": "streams",
}
_LOCAL = ("-protocol_whitelist", "file,pipe")
"""Prevents network access that a file requests."""


class MediaFacts(Struct, frozen=True):
    """The facts about a file, or a bag's folder."""

    kind: MediaKind
    bytes: int
    duration: float | None = None
    """Seconds; None: unknown."""
    fps: float | None = None
    has_sound: bool | None = None
    """None: unknown."""


class _Stream(Struct, frozen=True):
    codec_type: str = ""
    avg_frame_rate: str = ""
    disposition: dict[str, int] = {}


class _Format(Struct, frozen=True):
    duration: str = ""


class _Probe(Struct, frozen=True):
    streams: list[_Stream] = []
    format: _Format = _Format()


def probe_media(path: Path) -> MediaFacts:
    """Find out what a file is. Raises OSError."""
    kind = _SUFFIXES.get(path.suffix.lower(), "other")
    if path.is_dir():
        files = [each for each in path.rglob("*") if each.is_file()]
        bag = any(each.name == "metadata.yaml" for each in files)
        return MediaFacts("bag" if bag else "other", sum(each.stat().st_size for each in files))
    size = path.stat().st_size
    if kind in ("bag", "streams"):
        return MediaFacts(kind, size)
    probe = _run_probe(path)
    if probe is None or not probe.streams:
        return MediaFacts(kind, size, _wav_seconds(path))
    moving = [each for each in probe.streams if each.codec_type == "video" and not each.disposition.get("attached_pic")]
    sound = any(each.codec_type == "audio" for each in probe.streams)
    found: MediaKind = "video" if moving else "audio" if sound else kind
    fps = _ratio(moving[0].avg_frame_rate) if moving else None
    duration = None
    with suppress(ValueError):
        duration = round(float(probe.format.duration), 3)
    return MediaFacts(found, size, duration, fps, sound)


def _run_probe(path: Path) -> _Probe | None:
    program = shutil.which("ffprobe")
    if program is None:
        return None
    asked = "format=duration:stream=codec_type,avg_frame_rate:stream_disposition=attached_pic"
    command = [program, "-v", "error", *_LOCAL, "-show_entries", asked, "-of", "json", f"file:{path.absolute()}"]
    try:
        done = subprocess.run(command, capture_output=True, timeout=PROBE_SECONDS, stdin=subprocess.DEVNULL)
        found: _Probe = msgspec.json.decode(done.stdout, type=_Probe)
    except (OSError, subprocess.TimeoutExpired, msgspec.DecodeError):
        return None
    return found


def _ratio(text: str) -> float | None:
    over, _, under = text.partition("/")
    try:
        return round(float(over) / float(under or 1), 6) or None
    except (ValueError, ZeroDivisionError):
        return None


def _wav_seconds(path: Path) -> float | None:
    try:
        with wave.open(str(path)) as file:
            seconds: float = file.getnframes() / file.getframerate()
            return round(seconds, 3)
    except (wave.Error, EOFError, OSError, ZeroDivisionError):
        return None


def hash_file(path: Path) -> str:
    """Compute the SHA-256 of a file, as hexadecimal digits; empty for a folder. Raises OSError."""
    return "" if path.is_dir() else file_hash(path)


class Sound:
    """The sound of a file, in pieces, as one channel. Its time 0 is that of the file, as players count.

    Without ffmpeg only WAV files (PCM) can be read.
    """

    def __init__(self, path: Path, *, program: str | None = None) -> None:
        """:param path: the file.
        :param program: ffmpeg; None: the installed one.
        :raises SessionError: it cannot be read, or numpy is missing.
        """
        self._path, self._numpy = path, load_numpy()
        self._program = program if program is not None else shutil.which("ffmpeg") or ""
        self.rate = SOUND_RATE
        if not self._program:
            self.rate = self._wav(lambda file: int(file.getframerate()))

    def blocks(self) -> Iterator[Samples]:
        """Yield the samples. Raises SessionError if there is no sound, or if it ends in the middle of reading."""
        return self._from_ffmpeg() if self._program else self._from_wav()

    def _from_ffmpeg(self) -> Iterator[Samples]:
        # first_pts and async keep the times of a track that begins late or has gaps.
        times = f"aresample={SOUND_RATE}:async=1:min_hard_comp=0.02:first_pts=0"
        command = [self._program, "-nostdin", "-v", "error", *_LOCAL, "-i", f"file:{self._path.absolute()}"]
        command += ["-map", "0:a:0", "-af", times, "-ac", "1", "-f", "f32le", "pipe:1"]
        with tempfile.TemporaryFile() as output:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=output)
            assert process.stdout is not None
            came = False
            try:
                while data := process.stdout.read(_PIECE):
                    came = True
                    yield self._numpy.frombuffer(data[: len(data) // 4 * 4], dtype="<f4")
                status = process.wait()
            finally:
                if process.returncode is None:
                    process.kill()
                    process.wait()
                process.stdout.close()
            if status and not came:
                output.seek(0)
                raise SessionError(_why_no_sound(self._path, output.read().decode("utf-8", "replace").strip()))

    def _from_wav(self) -> Iterator[Samples]:
        with wave.open(str(self._path)) as file:
            width, channels = file.getsampwidth(), file.getnchannels()
            while data := file.readframes(_PIECE):
                yield self._samples(data, width).reshape(-1, channels).mean(axis=1, dtype="f4")

    def _samples(self, data: bytes, width: int) -> Any:
        """Convert samples to values between -1 and 1."""
        numpy = self._numpy
        if width == 1:  # the only unsigned format
            return (numpy.frombuffer(data, dtype="u1").astype("f4") - 128) / 128
        if width == 3:
            bytes_of = numpy.frombuffer(data, dtype="u1").reshape(-1, 3)
            wide = numpy.zeros((len(bytes_of), 4), dtype="u1")
            wide[:, 1:] = bytes_of
            return wide.view("<i4").reshape(-1).astype("f4") / 2**31
        return numpy.frombuffer(data, dtype=f"<i{width}").astype("f4") / 2 ** (8 * width - 1)

    def _wav(self, read: Callable[[wave.Wave_read], int]) -> int:
        try:
            with wave.open(str(self._path)) as file:
                return read(file)
        except (wave.Error, EOFError) as error:
            raise SessionError(
                f"{self._path} is no WAV file that can be read without ffmpeg ({error}): install ffmpeg"
            ) from None
        except OSError as error:
            raise SessionError(f"{self._path} cannot be read: {error.strerror or error}") from None


def _why_no_sound(path: Path, output: str) -> str:
    if "matches no streams" in output:
        return f"{path} has no sound: use --at FILE=markN for a flash or a clap that can be seen"
    return f"{path} has no sound that ffmpeg can read: {clean(output.rpartition(chr(10))[2])}"
