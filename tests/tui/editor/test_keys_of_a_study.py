"""A small study made from the blank one in the editor alone: four acts, nine texts, one rule, five keys.

Each key is counted. In November 2026 a new user needed 1,854.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.scenario.loader import load
from rise_engine.scenario.shipped_studies import write_blank_study
from tests.tui.editor.conftest import editor

MAX_KEYS = 450
"""392 today, of which 297 are letters."""
ACTS = (
    *("enter", "enter", "enter", "ctrl+u", "=Hello! I am Pepper. Shall we play?", "enter", "escape", "escape"),
    *("a", "=R_Ask", "enter", "a", "=Speech", "enter", "=What do you see in this picture?", "enter"),
    *("v", "=And what is this?", "enter", "v", "=What about this one?", "enter", "escape", "escape"),
    *("a", "=R_Praise", "enter", "a", "=Speech", "enter", "=Very good!", "enter"),
    *("v", "=Well done!", "enter", "v", "=Yes, exactly!", "enter", "escape", "escape"),
    *("a", "=R_Bye", "enter", "a", "=Speech", "enter", "=Thank you, that was all.", "enter"),
    *("v", "=That was fun. Thank you!", "enter", "escape", "escape"),
)
RULE = (
    *("slash", "=Main", "enter", "enter", "slash", "=Done", "enter", "r", "ctrl+u", "=Ask", "enter"),
    *("tab", "a", "=R_Ask", "enter", "tab"),
    *("a", "right", "tab", "=ok", "tab", "tab", "=Praise", "enter"),
    *("a", "right", "tab", "=end", "tab", "tab", "=Bye", "enter"),
    *("slash", "=Praise", "enter", "tab", "a", "=R_Praise", "enter", "tab"),
    *("a", "tab", "tab", "tab", "tab", "=Ask", "enter"),
    *("slash", "=Bye", "enter", "tab", "a", "=R_Bye", "enter", "escape"),
)
KEYS = (
    *("slash", "=Keys", "enter", "enter", "a", "=r", "enter", "=/ok", "enter", "a", "=e", "enter", "=/end", "enter"),
    *("a", "=p", "enter", "=R_Praise", "enter", "escape", "ctrl+o", "enter"),
)
"""`=TEXT` is typed; anything else is one key."""


@pytest.mark.slow
async def test_a_study_takes_at_most_this_many_keys(tmp_path: Path) -> None:
    write_blank_study(tmp_path, "Pictures", "pepper")
    pressed = 0
    async with editor(tmp_path, (80, 24)) as it:
        for key in (*ACTS, *RULE, *KEYS):
            pressed += len(key) - 1 if key.startswith("=") else 1
            await (it.type(key[1:]) if key.startswith("=") else it.press(key))
        await it.until(lambda: not it.screen.study.draft.changed_files)
    scenario = load(tmp_path).scenario
    assert scenario is not None
    texts = {name: [len(action.calls) for action in act.actions] for name, act in scenario.acts.items()}
    assert texts == {"R_Hello": [1], "R_Ask": [3], "R_Praise": [3], "R_Bye": [2]}
    states = scenario.rules["Main"].states
    ways = {state.id: [transition.target for transition in state.transitions] for state in states.values()}
    assert ways == {"Hello": ["Ask"], "Ask": ["Praise", "Bye"], "Praise": ["Ask"], "Bye": []}
    keys = {key.label: key.behavior for key in scenario.keys.values()}
    assert keys == {"b": "Main", "h": "R_Hello", "r": "/ok", "e": "/end", "p": "R_Praise"}
    assert pressed <= MAX_KEYS
