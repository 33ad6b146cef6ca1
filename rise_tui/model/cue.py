"""The participant's cue: the time since it, and when a filler is due. Pure; knows no screen."""

from __future__ import annotations

from rise_tui.model.voice import CueClock
from rise_tui.rendering.text import StyledLine, format_seconds

LATE_SECONDS, VERY_LATE_SECONDS = 1.0, 2.0
"""Seconds after which a robot that has not answered seems slow, and seems broken."""
TENTHS_SECONDS = 10.0
"""For this long a cue is counted in tenths; then in seconds, with the clock."""
GIVEN_UP_SECONDS = 60.0
"""A cue that nobody answered for this long is not counted any more."""
ANSWERED_SECONDS = 5.0
"""How long it is shown how long the answer took."""


def seconds_since_cue(cue: CueClock | None, now: float) -> float | None:
    """Seconds since the cue, while it is counted; None when there is none, or it is answered or given up."""
    if cue is None or cue.answered is not None:
        return None
    since = max(0.0, now - cue.marked)
    return since if since < GIVEN_UP_SECONDS else None


def counts_tenths(cue: CueClock | None, now: float) -> bool:
    """Whether the time changes by the tenth."""
    since = seconds_since_cue(cue, now)
    return since is not None and since < TENTHS_SECONDS


def passed_text(since: float) -> str:
    """As exactly as it is counted."""
    return f"{int(since)}" if since >= TENTHS_SECONDS else format_seconds(since)


def cue_line(cue: CueClock | None, now: float, *, short: bool = False) -> StyledLine:
    """`◔ cue 0.4 s`, later `◑ cue 1.4 s`, `● cue 2.3 s !`, and `✓ answered 1.3 s` or `✗ not said`; else empty."""
    if cue is not None and cue.answered is not None and now - cue.answered < ANSWERED_SECONDS:
        if not cue.said:
            return (("✗ not said", "fault"),)
        took = f"{format_seconds(cue.answered - cue.marked)} s"
        return ((f"✓ {took}" if short else f"✓ answered {took}", "plain"),)
    since = seconds_since_cue(cue, now)
    if since is None:
        return ()
    passed = passed_text(since)
    if since < LATE_SECONDS:
        return (("◔ cue ", "plain"), (f"{passed} s", "plain"))
    if since < VERY_LATE_SECONDS:
        return (("◑ cue ", "wait"), (f"{passed} s", "wait"))
    if short:
        return (("cue ", "call"), (f"{passed} s", "call"), (" !", "call"))
    return ((" ● cue ", "call"), (f"{passed} s", "call"), (" ! ", "call"))


def filler_due(cue: CueClock | None, now: float, offer_after: float) -> float | None:
    """Seconds since the cue when it is time for a filler, the next one too; None while it is not."""
    since = seconds_since_cue(cue, now)
    if since is None or cue is None or offer_after <= 0:
        return None
    silent = now - (cue.marked if cue.filled is None else cue.filled)
    return since if silent >= offer_after else None
