"""Whether the keys of this console start anything (console.md 2.1). Pure; STOPPED is the engine's, and comes first."""

from __future__ import annotations

from typing import Literal, TypeAlias

from rise_engine.scenario.model import CUE_TOPICS
from rise_tui.model.blocked import KeyNames

InputMode: TypeAlias = Literal["LIVE", "SAFE", "LOCKED"]
"""LIVE: keys start acts and rules. SAFE: everything can be looked at, nothing is started. LOCKED: keys do nothing."""

STARTING_FUNCTIONS = frozenset(
    {
        "startCommunicationRobotAct",
        "startInteractionRule",
        "raiseEventTopic",
        "assignValue",
        "say",
        "nextFiller",
        "repeatAct",
        "stepBack",
    }
)
"""What a key may ask for that makes something happen; stopping, and marks for the record, are not among it."""

CUE_EVENTS = dict(zip(("markCue", "undoCue"), CUE_TOPICS, strict=True))
"""The event of a cue: where a rule waits for it, marking one makes something happen, too."""

LOCKED_ACTIONS = ("stop", "quit", "lock")
"""Actions of the registry that work while everything is locked."""


def toggle_safe(mode: InputMode) -> InputMode:
    """The mode after the key that changes between LIVE and SAFE; a locked keyboard stays locked."""
    return "SAFE" if mode == "LIVE" else "LIVE" if mode == "SAFE" else mode


def toggle_lock(mode: InputMode) -> InputMode:
    """The mode after the key that locks. Unlocked is never LIVE at once: that takes the other key, on purpose."""
    return "SAFE" if mode == "LOCKED" else "LOCKED"


def mode_notice(mode: InputMode, key_name: KeyNames) -> str:
    """What to say when the mode has just been chosen."""
    match mode:
        case "LIVE":
            return "LIVE: keys start acts and rules"
        case "SAFE":
            return f"SAFE: keys start nothing; {key_name('safe')} turns them on"
        case "LOCKED":
            return f"LOCKED: every key is ignored except stop, leave and {key_name('lock')}"
