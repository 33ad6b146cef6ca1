"""Whether the keys of this console start anything (law 2). Pure; STOPPED is the engine's, and comes before all this."""

from __future__ import annotations

from typing import Literal, TypeAlias

Guard: TypeAlias = Literal["LIVE", "SAFE", "LOCKED"]
"""LIVE: keys start acts and rules. SAFE: everything can be looked at, nothing is started. LOCKED: keys do nothing."""

STARTS = frozenset(
    {"startCommunicationRobotAct", "startInteractionRule", "raiseEventTopic", "assignValue", "say", "nextFiller"}
)
"""What a key may ask for that makes something happen; stopping, and marks for the record, are not among it."""

LOCKED_ACTIONS = ("stop", "quit", "lock")
"""Actions of the registry that work while everything is locked."""


def after_safe(guard: Guard) -> Guard:
    """The key that changes between LIVE and SAFE; a locked keyboard stays locked."""
    return {"LIVE": "SAFE", "SAFE": "LIVE", "LOCKED": "LOCKED"}[guard]  # type: ignore[return-value]


def after_lock(guard: Guard) -> Guard:
    """The key that locks. Unlocked is never LIVE at once: that takes the other key, on purpose."""
    return "SAFE" if guard == "LOCKED" else "LOCKED"


def why_not(guard: Guard, safe_key: str, lock_key: str) -> str:
    """Why a key starts nothing, and what to do about it; empty while it does."""
    if guard == "SAFE":
        return f"SAFE: {safe_key} makes keys act"
    return f"LOCKED: {lock_key} unlocks" if guard == "LOCKED" else ""


def told(guard: Guard, safe_key: str, lock_key: str) -> str:
    """What to say when it has just become so."""
    if guard == "SAFE":
        return f"SAFE: keys start nothing; {safe_key} makes them act"
    if guard == "LOCKED":
        return f"LOCKED: every key is ignored but stop, leave and {lock_key}"
    return "LIVE: keys start acts and rules"
