"""The paths of the user's own files, and the state that a console restores: layout, filters, theme, rows of the log.

    $XDG_STATE_HOME/rise-tui, or ~/.local/state/rise-tui     0700
        console.json                                         0600
        lablinking-3f09ac.json      one for each scenario's folder

Nothing here raises errors. An unreadable file is skipped with one sentence. A file that cannot be written loses only
these settings.
"""

from __future__ import annotations

import os
import shutil
import sys
import threading
from pathlib import Path
from typing import TypeVar

import msgspec
from msgspec import Struct

from rise_engine.base.files import write_whole

KEY_FILE_NAME = "keys.toml"
PREFERENCES_NAME = "console.json"
"""The file in the state folder with the preferences of all of a user's consoles."""
DEFAULT_KEYS = "none"
"""Instead of a key file's name: the usual keys."""


def config_folder() -> Path:
    """The folder for files that people write: $XDG_CONFIG_HOME/rise-tui, or ~/.config/rise-tui. Creates nothing."""
    return _xdg_folder("XDG_CONFIG_HOME", "~/.config")


def state_folder() -> Path:
    """The folder that consoles write to: $XDG_STATE_HOME/rise-tui, or ~/.local/state/rise-tui. Creates nothing."""
    return _xdg_folder("XDG_STATE_HOME", "~/.local/state")


def key_file_path(named: str | None) -> Path | None:
    """The key file to read: the named one, or the usual one if it exists; None for the usual keys."""
    if named == DEFAULT_KEYS:
        return None
    if named is not None:
        return expand_home(named)
    usual = config_folder() / KEY_FILE_NAME
    return usual if os.path.lexists(usual) else None


def abbreviate_home(folder: str) -> str:
    """A path with `~` for the home folder."""
    home = f"{Path.home()}/"
    return f"~/{folder.removeprefix(home)}" if folder.startswith(home) else folder


def typed_command(name: str = "rise-tui") -> str:
    """What to type in any terminal for one of our programs: its name, or its place if only this environment has it."""
    own = Path(sys.prefix, "bin", name)
    found = shutil.which(name)
    elsewhere = found is not None and Path(found).parent != own.parent
    return name if elsewhere or sys.prefix == sys.base_prefix or not own.exists() else abbreviate_home(str(own))


def expand_home(path: str) -> Path:
    """Replace `~` by the home folder. Unlike `Path.expanduser` it never raises, because the text may be incomplete."""
    return Path(os.path.expanduser(path))  # noqa: PTH111


def _xdg_folder(variable: str, usual: str) -> Path:
    named = os.environ.get(variable, "")
    return (Path(named) if Path(named).is_absolute() else expand_home(usual)) / "rise-tui"


MAX_BYTES = 100_000
MAX_FOLDERS = 12
"""Maximum number of folders that are kept for the launcher."""


class Preferences(Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="rise-tui console"):
    """The preferences of all consoles of this user."""

    theme: str = ""
    tour: bool = False
    """Whether the user has seen the tour of the first run."""
    rules_own: bool = False
    """Whether the log shows what rules did on their own."""
    wizard: str = ""
    """The last wizard's name."""
    folders: dict[str, str] = {}
    """The folders of the last used scenarios and studies, with the time of their last use (ISO 8601)."""


class SavedLayout(Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="rise-tui scenario"):
    """The last state of one scenario's console."""

    layout: dict[str, str] = {}
    """The result of `Layout.layout_state`."""
    filters: dict[str, str] = {}
    """By pane, without empty ones."""
    session: str = ""
    """The folder of its session. The same session restores everything. A new session restores only the lower pane, so
    that the next participant begins with the rule in front and without filters."""


Saved = TypeVar("Saved", Preferences, SavedLayout)


def load_saved(path: Path, kind: type[Saved]) -> tuple[Saved, str]:
    """Read a file. Returns its contents, and a sentence if it was not used. Never raises."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        return kind(), ""
    except OSError as error:
        return kind(), _unused_text(path, error.strerror or str(error))
    try:
        if os.fstat(descriptor).st_uid != os.getuid():
            return kind(), _unused_text(path, "it belongs to another user")
        return msgspec.json.decode(os.read(descriptor, MAX_BYTES), type=kind), ""
    except (OSError, ValueError) as error:  # msgspec's errors are ValueErrors
        return kind(), _unused_text(path, f"it is not what a console writes ({error})")
    finally:
        os.close(descriptor)


def write_saved(path: Path, kept: Preferences | SavedLayout) -> str:
    """Write the file completely or not at all. Returns the reason of a failure, or empty. May block."""
    try:
        path.parent.mkdir(0o700, parents=True, exist_ok=True)
        beside = path.with_name(f".{path.name}-{os.getpid()}-{threading.get_ident()}")
        write_whole(path, msgspec.json.format(msgspec.json.encode(kept)) + b"\n", beside=beside)
    except OSError as error:
        return f"the layout cannot be saved for the next time: {path}: {error.strerror or error}"
    return ""


def _unused_text(path: Path, why: str) -> str:
    return f"{path} was not used: {why}"
