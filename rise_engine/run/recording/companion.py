"""The request for a companion process, which it reads first.

A companion is a child of the engine's process and belongs to one running session: it runs the recorders, or it is an
outlet. The first line of its standard input is a `CompanionRequest` as JSON. When the input ends, the companion
finishes its work and exits. On standard output it writes an empty line every `LIFE_SIGN_SECONDS` as a sign of life. Its
exit status is 0; for any other status, the last line on standard error is the reason.
"""

from __future__ import annotations

import sys
from typing import Literal, TypeAlias

import msgspec
from msgspec import Struct

from rise_engine.base.json_codec import encode
from rise_engine.base.text import restore_all_surrogates
from rise_engine.study.model import RecordingSettings

CompanionKind: TypeAlias = Literal["recorders", "outlet"]
LIFE_SIGN_SECONDS = 2.0
"""Interval between two signs of life."""
OUTLET_NAME = "lsl"
"""The outlet's name in `recording` records, and its entry point in the group `rise.outlets`."""
MARKS_NAME = "marks"
"""The name there of a companion that only gives marks."""


class CompanionRequest(Struct, frozen=True):
    """One companion of one session."""

    kind: CompanionKind
    socket: str
    """Path of the session's socket."""
    session: str
    """Name of the session's folder."""
    folder: str
    """The session's folder, absolute."""
    study: str
    """The study's folder, absolute."""
    task: str
    """The study's id."""
    participant: str
    run: int
    settings: RecordingSettings

    @property
    def recordings(self) -> tuple[str, ...]:
        """The names of its `recording` records."""
        if self.kind == "outlet":
            return (OUTLET_NAME,)
        return tuple(each.name for each in self.settings.recorders) or (MARKS_NAME,)

    @property
    def arguments(self) -> list[str]:
        """The command line of its process. It does not contain the request, so lists of processes do not show it."""
        return [sys.executable, "-m", "rise_engine.run.recording.companion_main"]


def companions_for(request: CompanionRequest) -> list[CompanionRequest]:
    """Make the requests for all companions that the settings of a request need."""
    settings = request.settings
    found = []
    if settings.recorders or settings.sync is not None:
        found.append(msgspec.structs.replace(request, kind="recorders"))
    if settings.markers is not None:
        found.append(msgspec.structs.replace(request, kind="outlet"))
    return found


def encode_request(request: CompanionRequest) -> bytes:
    """Encode the first line for a companion."""
    return encode(request) + b"\n"


def decode_request(line: bytes) -> CompanionRequest:
    """Decode that line. Raises msgspec.DecodeError and ValidationError."""
    return msgspec.convert(restore_all_surrogates(msgspec.json.decode(line)), CompanionRequest)
