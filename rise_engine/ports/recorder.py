"""The port for a recorder: a camera, a microphone, a bag, a program that records streams.

A driver is found by an entry point, as for robots. It is never called from the engine's process, and each call gets
`CALL_SECONDS`, so that it can never block a session.
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
    """It cannot record, or not any more; a sentence for the wizard, with what to do."""

    def __init__(self, *lines: str, ended: bool = False) -> None:
        """`ended`: the recording has ended by itself, and can be started again."""
        super().__init__(*lines)
        self.ended = ended


class RecordingPlan(Struct, frozen=True):
    """What to record, and where."""

    session: str
    """The name of the session's folder, with which a file's name begins."""
    folder: Path
    """The folder for a file that the driver itself names; it exists."""
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
    """Seconds without growth after which something is wrong; more than 3 for recorders that write in large pieces."""

    async def prepare(self, plan: RecordingPlan) -> str:
        """Connect and set it up, without recording. Returns what was found, for a check: `OBS 30.2, scene Lab`."""

    async def start(self) -> str:
        """Start to record. Returns the path of the file, empty if it is not known yet."""

    async def status(self) -> RecorderStatus:
        """Return its present state. Called about once a second."""

    async def stop(self) -> str:
        """End the recording. Returns the path of the file, empty if it is unknown."""

    async def close(self) -> None:
        """Release it. Called once, whatever happened before."""


RecorderOpener: TypeAlias = Callable[[str, Mapping[str, Json]], Recorder]
"""The callable of an entry point: (the recorder's name, its options in study.toml) -> Recorder. It only checks the
options, and raises RecorderError with every mistake, one per line."""
