"""Keys and reasons in words for this user, who may have changed an action's keys (console.md 6.3)."""

from __future__ import annotations

from collections.abc import Mapping

from rise_engine.scenario.keys import PUNCTUATION
from rise_tui.actions import BY_ID, ConsoleAction
from rise_tui.model.control import BlockedReason, Intent, blocked_text
from rise_tui.model.store import Store

KEY_LABELS = {
    **{name: character for character, name in PUNCTUATION.items()},
    "delete": "del",
    "insert": "ins",
    "escape": "esc",
    "backspace": "bksp",
    "shift+tab": "⇧tab",
    "shift+up": "⇧↑",
    "shift+down": "⇧↓",
    "left": "←",
    "right": "→",
    "space": "space",
}
"""Keys with a printed form that differs from Textual's spelling."""

_own_keys: dict[str, tuple[str, ...]] = {}
"""The keys that this user has given to an action, by the action's id."""


def use_own_keys(own: Mapping[str, tuple[str, ...]]) -> None:
    """Show the user's own keys for these actions from now on. The app binds them (`App.set_keymap`)."""
    _own_keys.clear()
    _own_keys.update(own)


def keys_of(action: ConsoleAction) -> tuple[str, ...]:
    """The keys of an action for this user, for everything that shows a key."""
    return _own_keys.get(action.id, action.keys)


def key_label(key: str) -> str:
    """A key as it is printed: `F9`, `^G`, `?`."""
    if key in KEY_LABELS:
        return KEY_LABELS[key]
    if key.startswith("ctrl+"):
        return f"^{KEY_LABELS.get(key[5:], key[5:]).upper()}"
    return key.upper() if key.startswith("f") and key[1:].isdigit() else key


def first_key_label(action: ConsoleAction) -> str:
    """The key to show if there is room for only one; empty: the action has none."""
    keys = keys_of(action)
    return key_label(keys[0]) if keys else ""


def key_text(id: str) -> str:
    """The printed key of an action, for sentences: `F9`; `:` and the action's title if it has none."""
    return first_key_label(BY_ID[id]) or f": {BY_ID[id].title}"


def key_name(id: str) -> str:
    """The same for an instruction to press it: `ctrl+x`, `F9`."""
    keys = keys_of(BY_ID[id])
    return keys[0] if keys and keys[0].startswith("ctrl+") else key_text(id)


# --- reasons ----------------------------------------------------------------------------------------------------------


def why_blocked(store: Store, intent: Intent) -> str:
    """What blocks this intent, as a sentence with the user's own keys; empty: nothing."""
    return blocked_text(store.blocked_reason(intent), key_name)


def why_task_blocked(store: Store, function: str) -> str:
    """The same for a task with this function."""
    return blocked_text(store.task_blocked(function), key_name)


def why_unavailable(action: ConsoleAction, store: Store) -> str:
    """The same for an action of the registry."""
    obstacle = action.obstacle(store)
    return blocked_text(obstacle, key_name) if isinstance(obstacle, BlockedReason) else obstacle or ""
