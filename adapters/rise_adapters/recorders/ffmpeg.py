"""Cameras and microphones of this computer, through the program ffmpeg (https://ffmpeg.org/ffmpeg.html).

It records Matroska, which, unlike MP4, stays readable up to its last second if the program is killed. SIGINT makes the
program complete the file and end.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path

from rise_adapters.recorders.options import OptionReader
from rise_adapters.recorders.program import RecordingProgram, new_path, recording_stem, size_of
from rise_engine.ports.recorder import (
    MediaKind,
    RecorderError,
    RecorderStatus,
    RecordingPlan,
)
from rise_engine.scenario.model import Json

BEGIN_SECONDS = 4.0
"""Seconds that `start` waits for the first sign of a recording. After that, `status` watches the file's growth."""
_INPUT_FORM = 'input = ["-f", "v4l2", "-i", "/dev/video0"]'
_MATROSKA = ("-flush_packets", "1", "-cluster_time_limit", "1000", "-f", "matroska")
"""Write every second. With the default of 5 s, a stall could not be detected sooner."""
_OWN = ("-y", "-n", "-progress", "-nostdin", "-stdin")


class FfmpegRecorder:
    """One camera, microphone or screen."""

    stalled_after = 3.0

    def __init__(self, name: str, options: Mapping[str, Json]) -> None:
        """
        :param name: the recorder's name, a part of the file's name.
        :param options: `input` (arguments with `-i`), `output` (arguments for the codecs), `kind` (video, audio),
            `program`.
        :raises RecorderError: with all errors.
        """
        self.name = name
        read = OptionReader(options, ("input", "output", "kind", "program"))
        self.input = read.texts("input", _INPUT_FORM, needed=True)
        if self.input and "-i" not in self.input:
            read.refuse(f"`input` says with -i what is recorded: {_INPUT_FORM}")
        self.output = read.texts("output", 'output = ["-c:v", "libx264", "-preset", "veryfast"]')
        for key, values in (("input", self.input), ("output", self.output)):
            if own := next((each for each in values if each in _OWN), None):
                read.refuse(f"`{key}` has {own}, which is already set")
        self.kind: MediaKind = "audio" if read.choice("kind", ("video", "audio")) == "audio" else "video"
        self.program = read.text("program", "ffmpeg")
        read.finish()
        self._run: RecordingProgram | None = None
        self._path: Path | None = None
        self._progress: dict[str, str] = {}
        self._began = asyncio.Event()

    async def prepare(self, plan: RecordingPlan) -> str:
        """Check that the program exists; returns its version."""
        self.plan = plan
        version = RecordingProgram(self.program)
        lines: list[str] = []
        await version.start([self.program, "-hide_banner", "-version"], lines.append)
        try:
            await version.gone.wait()
        finally:
            version.close()
        if not lines:
            raise RecorderError(version.ending())
        return " ".join(lines[0].split()[:3])

    async def start(self) -> str:
        """Record into a new file."""
        path = new_path(
            self.plan.folder, recording_stem(self.plan, self.name), ".mka" if self.kind == "audio" else ".mkv"
        )
        run = self._run = RecordingProgram("ffmpeg")
        self._path = path
        arguments = [self.program, "-hide_banner", "-loglevel", "warning", "-nostdin", "-n", "-progress", "pipe:1"]
        arguments += [*self.input, *self.output, *_MATROSKA, f"file:{path}"]
        await run.start(arguments, self._take_progress)
        waiting = [asyncio.create_task(each.wait()) for each in (run.gone, self._began)]
        try:
            await asyncio.wait(waiting, timeout=BEGIN_SECONDS, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waiting:
                task.cancel()
        if run.gone.is_set():
            if size_of(path) == 0:
                path.unlink(missing_ok=True)
            raise RecorderError(run.ending(), ended=True)
        return str(path)

    async def status(self) -> RecorderStatus:
        """The size of its file, and the progress that the program reports."""
        run, path = self._run, self._path
        assert run is not None and path is not None
        if not run.runs:
            raise RecorderError(run.ending(), ended=True)
        return RecorderStatus(
            recording=True,
            bytes=size_of(path) or 0,
            seconds=_number(self._progress.get("out_time_us"), 1e-6),
            drops=int(_number(self._progress.get("drop_frames"), 1) or 0),
            path=str(path),
        )

    async def stop(self) -> str:
        """End the program, which completes its file."""
        if self._run is None:
            return ""
        ended_well = await self._run.end()
        path = self._path
        if path is None or not size_of(path):
            raise RecorderError("nothing was recorded")
        if not ended_well:
            raise RecorderError("ffmpeg did not end when it was asked to, and was killed; its file is not complete")
        return str(path)

    async def close(self) -> None:
        """Kill the program if it still runs."""
        if self._run is not None:
            self._run.close()

    def _take_progress(self, line: str) -> None:
        key, _, value = line.partition("=")
        self._progress[key] = value.strip()
        if key == "out_time_us" and (_number(value, 1) or 0) > 0:
            self._began.set()


def _number(text: str | None, factor: float) -> float | None:
    try:
        return float(text or "") * factor
    except ValueError:  # N/A
        return None
