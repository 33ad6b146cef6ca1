"""What a console finds again the next time: layout and filters of a session, the theme, and what the log shows.

    $XDG_STATE_HOME/rise-tui, or ~/.local/state/rise-tui     0700
        console.json                                         0600
        lablinking-3f09ac.json      one for each scenario's folder

Nothing here is worth an error: a file that cannot be read is left out with one sentence, and one that cannot be written
costs no more than what it would have kept.
"""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import TypeVar

import msgspec
from msgspec import Struct

from rise_engine.base.files import write_whole

MOST_BYTES = 100_000


class Preferences(Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="rise-tui console"):
    """What all consoles of this user have in common."""

    theme: str = ""
    tour: bool = False
    """Whether the tour of the first run has been seen."""
    rules_own: bool = False
    """Whether the log shows what rules did for themselves."""
    wizard: str = ""
    """Who sat here last, as they called themselves."""


class SavedLayout(Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind", tag="rise-tui scenario"):
    """How the console of one scenario was left."""

    layout: dict[str, str] = {}
    """What `Layout.layout_state` gave."""
    filters: dict[str, str] = {}
    """By pane; empty ones are left out."""
    session: str = ""
    """The folder of the session that it showed: the same session finds all of it again, a new one only the pane below,
    so that the next participant begins with the rule in front and without filters."""


Saved = TypeVar("Saved", Preferences, SavedLayout)


def load_saved(path: Path, kind: type[Saved]) -> tuple[Saved, str]:
    """What a file keeps, and a sentence when it was not used; never raises."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        return kind(), ""
    except OSError as error:
        return kind(), _unused_text(path, error.strerror or str(error))
    try:
        if os.fstat(descriptor).st_uid != os.getuid():
            return kind(), _unused_text(path, "it belongs to another user")
        return msgspec.json.decode(os.read(descriptor, MOST_BYTES), type=kind), ""
    except (OSError, ValueError) as error:  # msgspec's errors are ValueErrors
        return kind(), _unused_text(path, f"it is not what a console writes ({error})")
    finally:
        os.close(descriptor)


def write_saved(path: Path, kept: Preferences | SavedLayout) -> str:
    """Write it as a whole or not at all; says why it could not. May block."""
    try:
        path.parent.mkdir(0o700, parents=True, exist_ok=True)
        beside = path.with_name(f".{path.name}-{os.getpid()}-{threading.get_ident()}")
        write_whole(path, msgspec.json.format(msgspec.json.encode(kept)) + b"\n", beside=beside)
    except OSError as error:
        return f"what is on the screen is not kept for the next time: {path}: {error.strerror or error}"
    return ""


def _unused_text(path: Path, why: str) -> str:
    return f"{path} was not used: {why}"
