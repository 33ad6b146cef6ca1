"""Law 6: one registry, from which everything else is made."""

from __future__ import annotations

from pathlib import Path

from rise_engine.scenario.keys import CONSOLE_KEYS
from rise_tui.actions import ACTIONS, BY_ID, KEY_LABELS, PLACES, SWALLOWED, at, bindings

DOCUMENT = Path(__file__).parents[2] / "docs" / "how-to" / "wizard.md"


def test_ids_are_unique_and_every_place_has_a_title() -> None:
    assert len(BY_ID) == len(ACTIONS)
    assert {action.place for action in ACTIONS} <= {place for place, _ in PLACES}


def test_no_key_means_two_things_at_one_time() -> None:
    common = [key for place in ("everywhere", "console") for action in at(place) for key in action.keys]
    assert len(common) == len(set(common))
    for place, _ in PLACES:
        if place not in ("everywhere", "console"):
            keys = [key for action in at(place) for key in action.keys]
            assert len(keys) == len(set(keys))
            assert not set(keys) & set(common)


def test_no_key_is_one_that_terminals_swallow_or_confuse() -> None:
    keys = {key for action in ACTIONS for key in action.keys}
    assert not keys & SWALLOWED
    assert not {key for key in keys if key.startswith(("alt+", "ctrl+shift+", "super+"))}


def test_every_function_key_has_a_twin() -> None:
    for action in ACTIONS:
        functions = [key for key in action.keys if key[0] == "f" and key[1:].isdigit()]
        assert not functions or len(action.keys) > len(functions), action.id


def test_the_console_keys_are_those_that_a_scenario_cannot_bind() -> None:
    taken = set(CONSOLE_KEYS) | {"shift+up", "shift+down"}  # a scenario cannot bind shift with an arrow either
    assert {key for action in ACTIONS for key in action.keys} <= taken


def test_the_stop_keys_work_before_anything_else() -> None:
    stop = next(binding for binding in bindings("everywhere") if getattr(binding, "id", "") == "stop")
    assert stop.priority is True and stop.key == "f9,ctrl+g"


def test_every_action_explains_itself() -> None:
    for action in ACTIONS:
        assert action.title and action.help.endswith((".", "too."))
        assert action.keys or action.id in ("theme", "settings")


def test_the_document_lists_every_key() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    written = {**KEY_LABELS, "shift+up": "shift+↑", "shift+down": "shift+↓"}
    for action in ACTIONS:
        assert action.title in text, action.title
        for key in action.keys:
            label = written.get(key, key.upper() if key[0] == "f" and key[1:].isdigit() else key)
            assert f"`{label}`" in text, f"{action.id}: {label}"
