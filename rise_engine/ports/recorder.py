"""The port for a recorder: a camera, a microphone, a bag, a program that records streams.

Entry points name the drivers, as for robots. Calls are made outside the engine's process and limited to `CALL_SECONDS`,
so that a driver can never block a session.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal, Protocol, TypeAlias

from msgspec import Struct

from rise_engine.base.errors import AdapterError
from rise_engine.scenario.model import Json

MediaKind: TypeAlias = Literal["video", "audio", "bag", "streams", "other"]
"""The kind of a recording."""
CALL_SECONDS = 5.0
"""The time limit of each call."""


class RecorderError(AdapterError):
    """The recorder cannot record, or not any more. The text is a sentence for the wizard, with the remedy."""

    def __init__(self, *lines: str, ended: bool = False) -> None:
        """`ended`: the recording ended by itself, and can be restarted."""
        super().__init__(*lines)
        self.ended = ended


class RecordingPlan(Struct, frozen=True):
    """What to record, and where."""

    session: str
    """The name of the session's folder, and the beginning of the file's name."""
    folder: Path
    """The folder for a file that the driver names itself; it exists."""
    participant: str = ""
    task: str = ""
    """The study's id."""
    run: int = 0


class RecorderStatus(Struct, frozen=True):
    """The state of a recorder."""

    recording: bool
    bytes: int | None = None
    """The size of its file; None: unknown."""
    seconds: float | None = None
    """The length of the recording; None: unknown."""
    drops: int | None = None
    """The number of lost frames, samples or messages."""
    path: str = ""


class Recorder(Protocol):
    """One recorder for one session. All methods run on one loop and never block it; each may raise RecorderError."""

    kind: MediaKind
    stalled_after: float
    """Seconds without growth that indicate a fault; more than 3 for recorders that write in large pieces."""

    async def prepare(self, plan: RecordingPlan) -> str:
        """Connect and set it up, without recording. Returns its description for a check: `OBS 30.2, scene Lab`."""

    async def start(self) -> str:
        """Start to record. Returns the path of the file; empty: unknown yet."""

    async def status(self) -> RecorderStatus:
        """Return its present state. Called about once a second."""

    async def stop(self) -> str:
        """End the recording. Returns the path of the file; empty: unknown."""

    async def close(self) -> None:
        """Release it. Called once, whatever happened before."""


RecorderOpener: TypeAlias = Callable[[str, Mapping[str, Json]], Recorder]
"""The callable of an entry point: (the recorder's name, its options in study.toml) -> Recorder. It only checks the
options, and raises RecorderError with every error, one per line."""
