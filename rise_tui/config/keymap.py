"""What a user's key file gave to actions of the registry, as a console takes it (`keyfile` reads it)."""

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
    """What a user's key file says."""

    path: Path | None = None
    """None: there is no such file."""
    keys: dict[str, tuple[str, ...]] = {}
    """The keys of each action that has others than usual, in Textual's spelling."""
    problems: tuple[Diagnostic, ...] = ()
    """All that is wrong with it. With any, no console starts."""
    locations: dict[tuple[str, str], SourceLocation] = {}
    """Where a key of an action is given."""

    def clashes(self, keys: Mapping[str, KeyBinding]) -> list[Diagnostic]:
        """Keys that the scenario has too; what such a key does would depend on luck."""
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
    """As `App.set_keymap` takes them."""
    return {action: textual_keys(action, own) for action, own in keys.keys.items()}


def how_to_fix(path: Path | None) -> str:
    """What to do when a console does not start because of a key file."""
    return f"no console was started: fix {path}, or start with the usual keys: rise-tui --keys {USUAL_KEYS} ..."
