"""Where the user's own console files are. Light: this is read before anything else is imported."""

from __future__ import annotations

import os
from pathlib import Path

KEY_FILE_NAME = "keys.toml"
PREFERENCES_NAME = "console.json"
"""The file in the state folder with the preferences of all of a user's consoles."""
USUAL_KEYS = "none"
"""In place of a key file's name: the usual keys."""


def config_folder() -> Path:
    """The folder for files that people write: $XDG_CONFIG_HOME/rise-tui, or ~/.config/rise-tui. Creates nothing."""
    return _xdg_folder("XDG_CONFIG_HOME", "~/.config")


def state_folder() -> Path:
    """The folder that consoles write to: $XDG_STATE_HOME/rise-tui, or ~/.local/state/rise-tui. Creates nothing."""
    return _xdg_folder("XDG_STATE_HOME", "~/.local/state")


def key_file_path(named: str | None) -> Path | None:
    """The key file to read: the named one, or the usual one if it exists; None for the usual keys."""
    if named == USUAL_KEYS:
        return None
    if named is not None:
        return expand_home(named)
    usual = config_folder() / KEY_FILE_NAME
    return usual if os.path.lexists(usual) else None


def abbreviate_home(folder: str) -> str:
    """A path with `~` for the home folder."""
    home = f"{Path.home()}/"
    return f"~/{folder.removeprefix(home)}" if folder.startswith(home) else folder


def expand_home(path: str) -> Path:
    """Replace `~` by the home folder. Unlike `Path.expanduser` it never raises, because people are still typing."""
    return Path(os.path.expanduser(path))  # noqa: PTH111


def _xdg_folder(variable: str, usual: str) -> Path:
    named = os.environ.get(variable, "")
    return (Path(named) if Path(named).is_absolute() else expand_home(usual)) / "rise-tui"
