"""Reads the user's key file: other keys for actions of the registry, checked as a whole before a console starts.

# ~/.config/rise-tui/keys.toml
[keys]
cue = "f5"
zoom = ["f4", "ctrl+f"]
theme = "f6"
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.files.toml_files import TomlFile, read_toml
from rise_engine.scenario.keys import KeyRefusedError, key_name
from rise_engine.scenario.model import KeyBinding, SourceLocation
from rise_tui.actions import ACTIONS, BY_ID, STUDY_SCREEN_ACTIONS, ConsoleAction, textual_keys
from rise_tui.config.preferences import DEFAULT_KEYS
from rise_tui.key_labels import key_label
from rise_tui.rendering.terminal_app import MOVES


class KeyFile(Struct, frozen=True):
    """The contents of a user's key file."""

    path: Path | None = None
    """None: no such file."""
    keys: dict[str, tuple[str, ...]] = {}
    """The keys of each action that differ from the usual ones, in Textual's spelling."""
    problems: tuple[Diagnostic, ...] = ()
    """All errors of the file. With any error, no console starts."""
    locations: dict[tuple[str, str], SourceLocation] = {}
    """The place in the file of each action's key."""

    def clashes(self, keys: Mapping[str, KeyBinding]) -> list[Diagnostic]:
        """Return the keys that the scenario also binds. The effect of such a key would be arbitrary."""
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
    """Return the remedy for a key file that prevents the console from starting."""
    return f"no console was started: fix {path}, or start with the usual keys: rise-tui --keys {DEFAULT_KEYS} ..."


FIXED = {
    "escape": "it leaves whatever is open",
    **dict.fromkeys(("up", "down", "left", "right", "pageup", "pagedown", "home", "end", *MOVES), "it moves in lists"),
}
"""Keys that no other action can have."""


def read_keys(path: Path) -> KeyFile:
    """Read and check a key file. Never raises; its diagnostics contain the errors."""
    diagnostics = Diagnostics()
    source = FileReader(path.parent, diagnostics).read(path)
    file = read_toml(source, diagnostics) if source is not None else None
    own, locations = _KeyFileReader(file, diagnostics).read() if file is not None else ({}, {})
    # With the file's whole path, because its name alone does not show the folder.
    problems = tuple(replace(each, location=replace(each.location, file=str(path))) for each in diagnostics.sorted())
    return KeyFile(path, own, problems, locations)


class _KeyFileReader:
    """Checks a file table by table, without stopping at the first error."""

    def __init__(self, file: TomlFile, diagnostics: Diagnostics) -> None:
        self.file, self.error = file, diagnostics.error
        self.own: dict[str, tuple[str, ...]] = {}
        self.locations: dict[tuple[str, str], SourceLocation] = {}

    def read(self) -> tuple[dict[str, tuple[str, ...]], dict[tuple[str, str], SourceLocation]]:
        """The keys of each action, and the place of each key."""
        for table in self.file.values:
            if table != "keys":
                known = did_you_mean(table, ("keys",))
                self.error("unknown-key", self.file.key_location(table), f"there is no `{table}` in a key file{known}")
        keys = self.file.values.get("keys", {})
        if not isinstance(keys, dict):
            self.error("wrong-type", self.file.key_location("keys"), "`keys` is a table: [keys]")
            keys = {}
        for action, value in _flatten(keys):
            self.read_action(action, value)
        self.report_conflicts()
        return self.own, self.locations

    def read_action(self, parts: tuple[str, ...], value: Any) -> None:
        name, location = ".".join(parts), self.file.key_location("keys", *parts)
        action = BY_ID.get(name)
        if action is None:
            known = did_you_mean(name, BY_ID) or "; `rise-tui keys` lists them"
            self.error("unknown-action", location, f"there is no action `{name}`{known}")
            return
        written = [value] if isinstance(value, str) else value
        at = self.file.value_location("keys", *parts)
        if not isinstance(written, list) or not all(isinstance(one, str) for one in written):
            self.error("wrong-type", at, f'a key is a text: {name} = "f5", or several: {name} = ["f5", "ctrl+f"]')
            return
        keys = [key for one in written if (key := self.read_key(action, one, at))]
        if not written and name == "stop":
            self.error("no-stop-key", at, "`stop` needs a key: someone will need it at once")
            return
        if len(keys) == len(written):
            self.own[name] = tuple(dict.fromkeys(keys))
            self.locations.update({(name, key): at for key in keys})

    def read_key(self, action: ConsoleAction, written: str, at: SourceLocation) -> str:
        """Textual's name of a key; empty after a diagnostic."""
        if written in action.keys:
            return written
        try:
            key = key_name(written)
        except KeyRefusedError as refused:
            self.error("key-refused", at, str(refused))
            return ""
        if key in action.keys:
            return key
        if key in FIXED:
            self.error("key-refused", at, f"`{written}` cannot be given to an action: {FIXED[key]}")
            return ""
        if action.scope == "everywhere" and not _works_while_typing(key):
            reason = "it works while you type too, so a function key or ctrl and a letter"
            self.error("key-refused", at, f"`{written}` cannot be given to `{action.id}`: {reason}")
            return ""
        return key

    def report_conflicts(self) -> None:
        """Report keys with two meanings at the same time, usual keys included."""
        for action in ACTIONS:
            if action.id not in self.own:
                continue
            for key in self.own[action.id]:
                others = [each.id for each in ACTIONS if each is not action and self.clashes(action, each, key)]
                if others:
                    names = " and ".join(f"`{other}`" for other in others)
                    which = f"`{key_label(key)}` is given to `{action.id}`, and {names} has it too"
                    self.error("key-twice", self.locations[action.id, key], f"{which}; give that another key, or []")

    def clashes(self, action: ConsoleAction, other: ConsoleAction, key: str) -> bool:
        if key not in self.own.get(other.id, other.keys) or not _overlaps(action, other):
            return False
        first = next(each.id for each in ACTIONS if each.id in (action.id, other.id))
        return other.id not in self.own or first == action.id  # two actions in the file get one diagnostic


def _flatten(keys: Mapping[str, Any], parts: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Join nested tables: `acts.start = "x"` is a table in TOML, and an action here."""
    for name, value in keys.items():
        if isinstance(value, dict):
            yield from _flatten(value, (*parts, name))
        else:
            yield (*parts, name), value


def _overlaps(one: ConsoleAction, other: ConsoleAction) -> bool:
    """Whether the keys of both actions work at the same time."""
    if {"study", "edit"} & {one.scope, other.scope}:  # few of the console's actions work on these screens
        return one.scope == other.scope or any(
            each.scope == "everywhere" or each.id in STUDY_SCREEN_ACTIONS for each in (one, other)
        )
    common = ("everywhere", "console")
    return one.scope in common or other.scope in common or one.scope == other.scope


def _works_while_typing(key: str) -> bool:
    return key.startswith("ctrl+") or (key[0] == "f" and key[1:].isdigit())
