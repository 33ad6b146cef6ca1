"""What a recording is, and its sound: by ffmpeg and ffprobe where they are installed, else as far as Python knows."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import wave
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.base.files import file_hash
from rise_engine.base.text import clean
from rise_engine.ports.recorder import MediaKind
from rise_engine.run.recording.finding import load_numpy

if TYPE_CHECKING:
    from rise_engine.run.recording.finding import Samples

SOUND_RATE = 16_000
"""Samples in a second of what ffmpeg gives."""
PROBE_SECONDS = 30.0
_PIECE = 1 << 20
"""Bytes that are read at once."""
_SUFFIXES: dict[str, MediaKind] = {
    **dict.fromkeys(
        (".mkv", ".mp4", ".mov", ".avi", ".webm", ".m4v", ".mts", ".m2ts", ".mpg", ".wmv", ".flv"), "video"
    ),
    **dict.fromkeys((".wav", ".flac", ".mp3", ".m4a", ".ogg", ".opus", ".aac", ".wma", ".aif", ".aiff"), "audio"),
    **dict.fromkeys((".mcap", ".db3", ".bag"), "bag"),
    ".xdf": "streams",
}
_LOCAL = ("-protocol_whitelist", "file,pipe")
"""Nothing that a file names is fetched from a network."""


class MediaFacts(Struct, frozen=True):
    """What is known of a file, or a bag's folder."""

    kind: MediaKind
    bytes: int
    duration: float | None = None
    """Seconds; None: not known."""
    fps: float | None = None
    has_sound: bool | None = None
    """None: not known."""


class _Stream(Struct, frozen=True):
    codec_type: str = ""
    avg_frame_rate: str = ""
    disposition: dict[str, int] = {}


class _Format(Struct, frozen=True):
    duration: str = ""


class _Probe(Struct, frozen=True):
    streams: list[_Stream] = []
    format: _Format = _Format()


def look_at_media(path: Path) -> MediaFacts:
    """What a file is. Raises OSError."""
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
    """SHA-256 of a file, as hexadecimal digits; empty for a folder. Raises OSError."""
    return "" if path.is_dir() else file_hash(path)


class Sound:
    """The sound of a file, in pieces, as one channel; time 0 of it is time 0 of the file, as players count.

    Without ffmpeg only WAV files (PCM) can be read.
    """

    def __init__(self, path: Path, *, program: str | None = None) -> None:
        """
        :param path: the file.
        :param program: ffmpeg; None: the one that is installed.
        :raises SessionError: it cannot be read, or numpy is missing.
        """
        self._path, self._numpy = path, load_numpy()
        self._program = program if program is not None else shutil.which("ffmpeg") or ""
        self.rate = SOUND_RATE
        if not self._program:
            self.rate = self._wav(lambda file: int(file.getframerate()))

    def blocks(self) -> Iterator[Samples]:
        """The samples. Raises SessionError when it has no sound, or when it ends in the middle of reading."""
        return self._from_ffmpeg() if self._program else self._from_wav()

    def _from_ffmpeg(self) -> Iterator[Samples]:
        # first_pts and async: a track that begins late or has holes keeps its times.
        times = f"aresample={SOUND_RATE}:async=1:min_hard_comp=0.02:first_pts=0"
        command = [self._program, "-nostdin", "-v", "error", *_LOCAL, "-i", f"file:{self._path.absolute()}"]
        command += ["-map", "0:a:0", "-af", times, "-ac", "1", "-f", "f32le", "pipe:1"]
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said)
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
                said.seek(0)
                raise SessionError(_why_no_sound(self._path, said.read().decode("utf-8", "replace").strip()))

    def _from_wav(self) -> Iterator[Samples]:
        with wave.open(str(self._path)) as file:
            width, channels = file.getsampwidth(), file.getnchannels()
            while data := file.readframes(_PIECE):
                yield self._samples(data, width).reshape(-1, channels).mean(axis=1, dtype="f4")

    def _samples(self, data: bytes, width: int) -> Any:
        """Between -1 and 1."""
        numpy = self._numpy
        if width == 1:  # the only one without a sign
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


def _why_no_sound(path: Path, said: str) -> str:
    if "matches no streams" in said:
        return f"{path} has no sound: say --at FILE=markN for a flash or a clap that can be seen"
    return f"{path} has no sound that ffmpeg can read: {clean(said.rpartition(chr(10))[2])}"
