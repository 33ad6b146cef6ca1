"""`media.json` in a session's folder: the recordings that belong to it, and where they lie against its clock.

media time = offset + rate * session time          (both in seconds)
"""

from __future__ import annotations

from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.ports.recorder import MediaKind

MEDIA_FILE = "media.json"
AlignedBy: TypeAlias = Literal["", "marks", "given", "start"]
"""How a file was laid against the session's clock. marks: by marks that were found in it; given: somebody said it;
start: by when its recorder was started, which is no time of the first frame; empty: not at all."""


class FoundMark(Struct, frozen=True):
    """A mark of the session (`SyncRecord`) that was found in a file."""

    number: int
    session_at: float
    media_at: float
    strength: float
    """How far it stands above all else in the file, as a ratio; below 3 it is not believed."""


class MediaFile(Struct, frozen=True, kw_only=True):
    """One file, or one folder of a bag."""

    path: str
    """Absolute, or relative to the session's folder when it lies in there."""
    kind: MediaKind
    name: str = ""
    """Of the recorder that made it; empty: somebody added it."""
    bytes: int | None = None
    sha256: str = ""
    duration: float | None = None
    """Seconds."""
    offset: float | None = None
    """Media time at session time 0: negative when it began after the session. None: not known."""
    rate: float = 1.0
    """Seconds of the file for one second of the session."""
    aligned_by: AlignedBy = ""
    marks: tuple[FoundMark, ...] = ()
    added: str = ""
    """ISO 8601 with offset."""
    fps: float | None = None
    """Frames per second; None: not known, or no video."""

    @property
    def drift_ppm(self) -> float:
        """How much faster its clock runs, in millionths."""
        return (self.rate - 1.0) * 1e6
