"""One registry, from which everything else is made (console.md 6.1)."""

from __future__ import annotations

from pathlib import Path

import pytest
from textual.binding import Binding

from rise_engine.scenario.keys import CONSOLE_KEYS
from rise_tui.actions import ACTIONS, BY_ID, KEY_SCOPES, STUDY_SCREEN_ACTIONS, actions_in, bindings_in
from rise_tui.key_labels import (
    first_key_label,
    key_label,
    key_name,
    key_text,
    keys_of,
    use_own_keys,
    why_unavailable,
)
from rise_tui.model.control import BlockedReason, blocked_text, control_question
from tests.tui.conftest import console

DOCUMENT = Path(__file__).parents[3] / "docs" / "how-to" / "remap-keys.md"


def test_ids_are_unique_and_every_place_has_a_title() -> None:
    assert len(BY_ID) == len(ACTIONS)
    assert {action.scope for action in ACTIONS} <= {place for place, _ in KEY_SCOPES}


def test_no_key_means_two_things_at_one_time() -> None:
    common = [key for place in ("everywhere", "console") for action in actions_in(place) for key in action.keys]
    assert len(common) == len(set(common))
    for place, _ in KEY_SCOPES:
        if place not in ("everywhere", "console"):
            keys = [key for action in actions_in(place) for key in action.keys]
            assert len(keys) == len(set(keys))
            shared = [key for action in ACTIONS if action.id in STUDY_SCREEN_ACTIONS for key in action.keys]
            always = [key for action in actions_in("everywhere") for key in action.keys]
            assert not set(keys) & set([*always, *shared] if place in ("study", "edit") else common)


SWALLOWED = frozenset(
    {"ctrl+h", "ctrl+i", "ctrl+m", "ctrl+left_square_bracket", "ctrl+space", "ctrl+at"}
    | {f"ctrl+{digit}" for digit in range(10)}
    | {f"alt+{digit}" for digit in range(10)}
    | {"ctrl+enter", "shift+enter", "alt+enter", "ctrl+a", "ctrl+b", "ctrl+s", "ctrl+z", "ctrl+q", "f1", "f10", "f11"}
)
"""Keys that terminals, multiplexers or editors take or confuse; nothing here may be bound to one."""


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
    assert {key for action in ACTIONS if action.scope not in ("study", "edit") for key in action.keys} <= taken


def test_the_stop_keys_work_before_anything_else() -> None:
    stop = next(binding for binding in bindings_in("everywhere") if getattr(binding, "id", "") == "stop")
    assert isinstance(stop, Binding) and stop.priority is True and stop.key == "f9,ctrl+g"


def test_every_action_explains_itself() -> None:
    palette_only = {action.id for action in ACTIONS if not action.keys}
    assert palette_only == {
        "theme",
        "settings",
        "edit-study",
        "tour",
        "redraw",
        "stop-rule",
        "take-over",
        "pause",
        "memory.save",
    } | {*("log.time", "log.copy", "log.copy-all", "log.save")}
    for action in ACTIONS:
        assert action.title and action.help[0].isupper() and action.help.endswith((".", "too.")), action.id
        assert action.title[0].isupper() and len(action.title) <= 28, action.id
        assert len(action.hint) <= 12, action.id


async def test_every_action_of_the_console_is_carried_out_by_something() -> None:
    async with console() as it:
        common = {action.id for place in ("everywhere", "console") for action in actions_in(place)}
        assert set(it.screen.action_calls()) == common


def test_every_action_of_a_pane_is_known_to_it() -> None:
    panes = Path(__file__).parents[3] / "rise_tui" / "panes"
    study_screen = panes.parent / "console" / "study_screen.py"
    editor = panes.parent / "editor"
    sources = (*panes.glob("*.py"), study_screen, *editor.rglob("*.py"))
    source = "".join(path.read_text(encoding="utf-8") for path in sources)
    for place, _ in KEY_SCOPES:
        if place not in ("everywhere", "console"):
            unnamed = [action.id for action in actions_in(place) if f'"{action.id}"' not in source]
            assert len(unnamed) <= 1, unnamed  # one may be what is done when it is none of the others


async def test_an_action_that_cannot_be_done_says_why_and_does_nothing() -> None:
    async with console() as it:
        for id, reason in (("release", "nothing is stopped"), ("mistake", "nothing has been started yet")):
            it.screen.action_do(id)
            await it.until(lambda id=id, reason=reason: f"{BY_ID[id].title}: not now, {reason}" in it.notice)  # type: ignore[misc]
        assert it.client.sent == [] and it.app.screen is it.screen


@pytest.mark.parametrize("id", [action.id for action in ACTIONS])
def test_no_action_can_be_used_after_the_engine_has_gone_but_those_that_only_look(id: str) -> None:
    from rise_tui.model.store import Store
    from tests.tui.fake import FakeClient, demo

    client = FakeClient(demo())
    store = Store(client.attach_reply(), "anna", client.now)
    store.gone_reason = "killed"
    looks = {"quit", "palette", "help", "lists", "next-pane", "previous-pane", "jump", "zoom", "filter", "theme"}
    looks |= {"redraw", "memory.unfold", "memory.fold", "scheduler.details", "log.follow"}
    why = why_unavailable(BY_ID[id], store)
    assert (why == "") is (id in looks) or id.startswith("log."), f"{id}: {why!r}"


# --- keys as they are shown -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "label"),
    [("f9", "F9"), ("ctrl+g", "^G"), ("question_mark", "?"), ("shift+tab", "⇧tab"), ("f", "f")],
)
def test_a_key_as_it_is_printed(key: str, label: str) -> None:
    assert key_label(key) == label


def test_whatever_shows_a_key_shows_the_users_own() -> None:
    stop = BY_ID["stop"]
    assert (key_text("stop"), keys_of(stop)) == ("F9", ("f9", "ctrl+g"))
    assert key_text("theme") == ": Choose a theme"
    use_own_keys({"stop": ("f12",), "theme": ("f6",), "control": ("f5",)})
    try:
        assert (key_text("stop"), first_key_label(stop), keys_of(stop)) == ("F12", "F12", ("f12",))
        assert key_text("theme") == "F6"
        assert blocked_text(BlockedReason("control", holder="ben"), key_name) == "ben has control (F5)"
        assert "stop everything (F12)" in control_question("wizard:ben", None, "wizard:anna", key_name)[0][0]
    finally:
        use_own_keys({})
    assert key_text("stop") == "F9"


def test_the_guide_names_every_action_that_is_not_of_one_pane() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    assert [each.id for each in ACTIONS if each.scope in ("everywhere", "console") and f"`{each.id}`" not in text] == []
