"""The keys that a user's key file gives to actions, as a console takes them (`key_file` reads it)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msgspec import Struct

from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.model import KeyBinding, SourceLocation
from rise_tui.actions import BY_ID, textual_keys
from rise_tui.config.paths import USUAL_KEYS
from rise_tui.key_labels import key_label


class KeyFile(Struct, frozen=True):
    """The contents of a user's key file."""

    path: Path | None = None
    """None: there is no such file."""
    keys: dict[str, tuple[str, ...]] = {}
    """The keys of each action that differ from the usual ones, in Textual's spelling."""
    problems: tuple[Diagnostic, ...] = ()
    """Everything that is wrong with the file. With any problem, no console starts."""
    locations: dict[tuple[str, str], SourceLocation] = {}
    """The place in the file of each action's key."""

    def clashes(self, keys: Mapping[str, KeyBinding]) -> list[Diagnostic]:
        """Keys that the scenario also binds. It would be a matter of luck what such a key does."""
        return [
            Diagnostic(
                "error",
                "key-twice",
                f"`{key_label(key)}` is given to `{action}` here, and to {keys[key].function} {keys[key].behavior} "
                f"in the scenario ({keys[key].location})",
                location,
            )
            for (action, key), location in self.locations.items()
            if key in keys and BY_ID[action].scope not in ("study", "edit")
        ]


def textual_keymap(keys: KeyFile) -> dict[str, str]:
    """The keys in the form that `App.set_keymap` takes."""
    return {action: textual_keys(action, own) for action, own in keys.keys.items()}


def how_to_fix(path: Path | None) -> str:
    """What to do when a key file prevents the console from starting."""
    return f"no console was started: fix {path}, or start with the usual keys: rise-tui --keys {USUAL_KEYS} ..."
