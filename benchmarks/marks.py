"""Finding the marks in an hour of a room's sound: `rise-engine media add --find-marks` as a whole process. The floor is
ffmpeg, which only decodes that sound. The memory must not grow with the file."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy
from measure import Report

sys.path.insert(0, str(Path(__file__).parent.parent))

from rise_engine.kernel.records import SyncRecord
from rise_engine.session.journal_format import encode_header, encode_record, with_checksum
from tests.run.recording.sounds import record_marks

RATE = 48_000
MINUTE = 60.0
LENGTHS = {"six minutes": 6 * MINUTE, "an hour": 60 * MINUTE}


def main() -> bool:
    report = Report("Finding two marks in the sound of a film (AAC, 64 kb/s)", "wall time and the most memory")
    if shutil.which("ffmpeg") is None:
        print("ffmpeg is not installed: nothing was measured")
        return True
    memory: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, seconds in LENGTHS.items():
            film = Path(folder, f"{seconds:.0f}.m4a")
            _make_film(film, seconds)
            session = _make_session(Path(folder, name.replace(" ", "-")), seconds)
            alone, _ = _measure(
                ["ffmpeg", "-nostdin", "-v", "error", "-i", str(film), "-ar", "16000", "-f", "null", "-"]
            )
            program = str(Path(sys.executable).parent / "rise-engine")
            took, memory[name] = _measure([program, "media", "add", str(session), str(film), "--find-marks"])
            report.row(f"media add, {name}", f"{took:.1f} s, {memory[name]:.0f} MB")
            report.row(f"ffmpeg alone, {name}", f"{alone:.1f} s")
    report.target("seconds for an hour", took, 30.0, at_least=False)
    report.target("memory of an hour over that of six minutes", memory["an hour"] / memory["six minutes"], 1.5,
                  at_least=False)  # fmt: skip
    return report.met


def _make_film(path: Path, seconds: float) -> None:
    """Noise with a mark at each end, encoded a minute at a time."""
    command = ["ffmpeg", "-nostdin", "-v", "error", "-f", "f32le", "-ar", str(RATE), "-ac", "1", "-i", "pipe:0"]
    process = subprocess.Popen([*command, "-c:a", "aac", "-b:a", "64k", str(path)], stdin=subprocess.PIPE)
    assert process.stdin is not None
    for number in range(int(seconds // MINUTE)):
        begin = number * MINUTE
        marks = [(each, at - begin) for each, at in ((1, 5.0), (2, seconds - 5.0)) if 0 <= at - begin < MINUTE]
        sound = record_marks(marks, offset=0.0, seconds=MINUTE, noise=0.05, seed=number, samples=RATE)
        process.stdin.write(sound.astype(numpy.float32).tobytes())
    process.stdin.close()
    if process.wait():
        sys.exit("ffmpeg could not make the film")


def _make_session(folder: Path, seconds: float) -> Path:
    folder.mkdir()
    marks = [SyncRecord(number, at, "", number, "sound", "", "node:b", at, 0.05) for number, at in
             ((1, 5.0), (2, seconds - 5.0))]  # fmt: skip
    lines = b"".join(with_checksum(encode_record(mark)) for mark in marks)
    (folder / "journal.jsonl").write_bytes(encode_header("benchmark") + lines)
    return folder


def _measure(command: list[str]) -> tuple[float, float]:
    """Seconds of a program, and its maximum memory in MB."""
    begun = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{command[0]} failed")
    return time.perf_counter() - begun, used.ru_maxrss / (1024 if sys.platform != "darwin" else 1024**2)


if __name__ == "__main__":
    sys.exit(not main())
