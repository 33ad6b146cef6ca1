"""The port behind which a recorder stands: a camera, a microphone, a bag, a program that records streams.

A driver is found by an entry point, as robots are. It is never called from the engine's process, and whoever
calls it gives each call `CALL_SECONDS`, so that nothing that it does can hold up a session.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal, Protocol, TypeAlias

from msgspec import Struct

from rise_engine.base.errors import AdapterError
from rise_engine.scenario.model import Json

MediaKind: TypeAlias = Literal["video", "audio", "bag", "streams", "other"]
"""What a recording is."""
CALL_SECONDS = 5.0
"""How long each call may take."""


class RecorderError(AdapterError):
    """It cannot record, or not any more; a sentence for the wizard, with what to do."""

    def __init__(self, *lines: str, ended: bool = False) -> None:
        """`ended`: what recorded has ended by itself, and can be started anew."""
        super().__init__(*lines)
        self.ended = ended


class RecordingPlan(Struct, frozen=True):
    """What is to be recorded."""

    session: str
    """Name of the session's folder; a file's name begins with it."""
    folder: Path
    """Where a file goes that the driver itself names; it exists."""
    participant: str = ""
    task: str = ""
    """The study's id."""
    run: int = 0


class RecorderStatus(Struct, frozen=True):
    """How a recorder stands."""

    recording: bool
    bytes: int | None = None
    """How large its file is; None: nobody can know."""
    seconds: float | None = None
    """How long the recording is; None: nobody can know."""
    drops: int | None = None
    """Frames, samples or messages that it has lost."""
    path: str = ""


class Recorder(Protocol):
    """One recorder for one session. All methods run on one loop and never block it; each may raise RecorderError."""

    kind: MediaKind
    stalled_after: float
    """Seconds without growth after which something is wrong; more than 3 for what writes in large pieces."""

    async def prepare(self, plan: RecordingPlan) -> str:
        """Reach it and set it up, without recording. Returns what was found, for a check: `OBS 30.2, scene Lab`."""

    async def start(self) -> str:
        """Record. Returns the path of the file, empty when it is not known yet."""

    async def status(self) -> RecorderStatus:
        """How it stands now. Called about once a second."""

    async def stop(self) -> str:
        """End the recording. Returns the path of the file, empty when nobody knows it."""

    async def close(self) -> None:
        """Let go of it. Called once, whatever happened before."""


RecorderOpener: TypeAlias = Callable[[str, Mapping[str, Json]], Recorder]
"""What an entry point names: (the recorder's name, its options in study.toml) -> Recorder. It only checks the options
and raises RecorderError with every finding, a line each."""
