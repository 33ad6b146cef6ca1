"""What a press of a key, a click or Enter on a row asks for. Pure."""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.drawing.study_keys import ACT
from rise_engine.scenario.model import KeyBinding, Scenario

HELD_KEY_SECONDS = 0.15
"""Same keys nearer than this come from a key held down: a second press is none."""


class KeyAction(Struct, frozen=True):
    """A task to give to the engine, and what care a press of its key takes."""

    function: str
    behavior: str
    debounce: float = 0.5
    """Seconds in which a second press is taken for the same."""
    hold: bool = False
    """It needs a second press, or Enter (console.md 2.4)."""
    calling_type: str = ""


MARK_CUE = KeyAction("markCue", "")
UNDO_CUE = KeyAction("undoCue", "")
NEXT_FILLER = KeyAction("nextFiller", "")


def start_action(scenario: Scenario, function: str, behavior: str, calling_type: str = "") -> KeyAction:
    """With the care that the scenario asks for; only an act can need two presses."""
    settings = scenario.settings_of(behavior)
    return KeyAction(function, behavior, settings.debounce, function == ACT and settings.hold, calling_type)


def action_of_key(scenario: Scenario, key: KeyBinding) -> KeyAction:
    """What a key of the scenario asks for."""
    action = start_action(scenario, key.function, key.behavior)
    return replace(action, behavior=key.task_behavior)
