"""Why something cannot be done now: a reason with a code, and its sentence once somebody names the keys. Pure.

The model knows no keys of the console (console.md 6.3): whoever shows a reason says how a key is called, as a function.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias

from msgspec import Struct

Deed: TypeAlias = Literal["reach", "remark", "change", "start"]
"""What somebody may want of the engine, each with all that the one before it needs.

reach: anything at all. remark: a note, a question about control. change: whatever changes the session. start: whatever
makes the robot or a rule do something.
"""

KeyNames: TypeAlias = Callable[[str], str]
"""From the id of an action of the console to its key, as a sentence names it: `ctrl+x`, `F9`."""


class BlockedReason(Struct, frozen=True):
    """One thing that stands in the way."""

    code: Literal["over", "gone", "cut", "replay", "control", "not-recording", "stopped", "safe", "locked", "paused"]
    detail: str = ""
    """What the session ended with, why the engine has gone, what is wrong with the disk."""
    holder: str = ""
    """`control`: who has it."""
    watches: bool = False
    """`control`: this console only watches, and could not take it."""


def blocked_text(reason: BlockedReason | None, key_name: KeyNames) -> str:
    """The reason as a sentence, and what to press where a key helps; empty when nothing stands in the way."""
    if reason is None:
        return ""
    match reason.code:
        case "over":
            return f"the session is over: {reason.detail}"
        case "gone":
            return f"the engine has gone: {reason.detail}"
        case "cut":
            return "the connection is cut; the console is reconnecting"
        case "replay":
            return "this is a replay"
        case "control":
            has = f"{reason.holder} has control"
            return f"{has} and this console only watches" if reason.watches else f"{has} ({key_name('control')})"
        case "not-recording":
            return f"NOT RECORDING, the session is paused: {reason.detail}"
        case "stopped":
            return f"STOPPED: {key_name('release')} releases the stop"
        case "safe":
            return f"SAFE: {key_name('safe')} turns keys on"
        case "locked":
            return f"LOCKED: {key_name('lock')} unlocks"
        case "paused":
            return f"paused: {key_name('control')} resumes it"
