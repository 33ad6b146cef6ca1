"""A moment of the session as a person types it: `14:32`, `-30s`, `now`. Pure."""

from __future__ import annotations

import re

from rise_tui.model.filtering import InvalidFilter

_CLOCK = re.compile(r"(?:(\d{1,3}):)?(\d{1,3}):(\d{1,2}(?:\.\d+)?)")
_PARTS = re.compile(r"(?:(\d+(?:\.\d+)?)h)?(?:(\d+(?:\.\d+)?)m(?:in)?)?(?:(\d+(?:\.\d+)?)s?)?")
EXAMPLES = "14:32, 1:14:32, 90s, -30s, -2m, now"


def parse_moment(text: str, now: float) -> float | None:
    """Session time in seconds; None for `now`, which moves on. Raises InvalidFilter.

    `14:32` is 14 minutes 32 seconds after the session's beginning, as its clock shows it; with `-` in front it is that
    long ago.
    """
    bare = text.strip().casefold().replace(" ", "")
    if bare in ("now", "end"):
        return None
    ago = bare.startswith(("-", "−"))
    seconds = _parse_seconds(bare[1:] if ago or bare.startswith("+") else bare)
    return max(0.0, now - seconds) if ago else seconds


def _parse_seconds(text: str) -> float:
    if (found := _CLOCK.fullmatch(text)) is not None:
        hours, minutes, seconds = found[1], float(found[2]), float(found[3])
        if seconds >= 60 or (hours is not None and minutes >= 60):
            raise InvalidFilter(f"{text}: minutes and seconds go up to 59")
        return int(hours or 0) * 3600 + minutes * 60 + seconds
    if text and (found := _PARTS.fullmatch(text)) is not None:
        hours, minutes, rest = (float(part or 0) for part in found.groups())
        return hours * 3600 + minutes * 60 + rest
    raise InvalidFilter(f"type a time of the session: {EXAMPLES}")
