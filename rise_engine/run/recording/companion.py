"""What a companion process is asked to do: the one line that it reads first.

A companion is a child of the engine's process that belongs to one running session: it works the recorders, or it is an
outlet. Its standard input is a leash: the first line is a `CompanionRequest` as JSON, and its end means that it is to
finish what it does and to go. On standard output it writes an empty line every `SIGN_SECONDS`, as a sign of life. Its
exit status is 0; anything else has the reason as the last line on standard error.
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
SIGN_SECONDS = 2.0
"""Between two signs of life."""
OUTLET_NAME = "lsl"
"""What the outlet is called in `recording` records, and its entry point in the group `rise.outlets`."""
MARKS_NAME = "marks"
"""What the companion that only gives marks is called there."""


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
        """The names of the `recording` records that it is about."""
        if self.kind == "outlet":
            return (OUTLET_NAME,)
        return tuple(each.name for each in self.settings.recorders) or (MARKS_NAME,)

    @property
    def arguments(self) -> list[str]:
        """How its process is started; what it is to do is nothing that a list of processes shows."""
        return [sys.executable, "-m", "rise_engine.run.recording.companion_main"]


def companions_for(request: CompanionRequest) -> list[CompanionRequest]:
    """The companions that its settings need, of a request of whatever kind."""
    settings = request.settings
    found = []
    if settings.recorders or settings.sync is not None:
        found.append(msgspec.structs.replace(request, kind="recorders"))
    if settings.markers is not None:
        found.append(msgspec.structs.replace(request, kind="outlet"))
    return found


def encode_request(request: CompanionRequest) -> bytes:
    """The line that a companion reads first."""
    return encode(request) + b"\n"


def decode_request(line: bytes) -> CompanionRequest:
    """The request in that line. Raises msgspec.DecodeError and ValidationError."""
    return msgspec.convert(restore_all_surrogates(msgspec.json.decode(line)), CompanionRequest)
