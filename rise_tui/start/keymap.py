"""What a user's key file gave to actions of the registry, as a console takes it (`keyfile` reads it)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msgspec import Struct

from rise_engine.scenario.findings import Finding
from rise_engine.scenario.model import KeyBinding, Place
from rise_tui.actions import key_label, no_key
from rise_tui.start.paths import NO_KEYS


class KeyFile(Struct, frozen=True):
    """What a user's key file says."""

    path: Path | None = None
    """None: there is no such file."""
    own: dict[str, tuple[str, ...]] = {}
    """The keys of each action that has others than usual, in Textual's spelling."""
    findings: tuple[Finding, ...] = ()
    """All that is wrong with it. With any, no console starts."""
    places: dict[tuple[str, str], Place] = {}
    """Where a key of an action is given."""

    def clashes(self, keys: Mapping[str, KeyBinding]) -> list[Finding]:
        """Keys that the scenario has too; what such a key does would depend on luck."""
        return [
            Finding(
                "error",
                "key-twice",
                f"`{key_label(key)}` is given to `{action}` here, and {_does(keys[key])} in the scenario "
                f"({keys[key].place})",
                place,
            )
            for (action, key), place in self.places.items()
            if key in keys
        ]


def for_textual(keys: KeyFile) -> dict[str, str]:
    """As `App.set_keymap` takes them."""
    return {action: ",".join(own) or no_key(action) for action, own in keys.own.items()}


def refusal(path: Path | None) -> str:
    """What to do when a console does not start because of a key file."""
    return f"no console was started: mend {path}, or start with the usual keys: rise-tui --keys {NO_KEYS} ..."


def _does(binding: KeyBinding) -> str:
    return f"to {binding.function} {binding.behavior}"
