"""What a bundle says of how it was made: `bundle.json`. Whoever has the bundle makes the same again from it."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec import Struct

from rise_engine import __version__
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.export.format import ExportError

ABOUT_FILE = "bundle.json"


class BundleOptions(Struct, frozen=True):
    """What somebody decides about a bundle."""

    level: ExportLevel = "shared"
    private: tuple[str, ...] = ()
    """Further private memory keys."""
    license: str = ""
    """Instead of what `[report]` in study.toml says."""


class AboutBundle(Struct, frozen=True):
    """`bundle.json`."""

    options: BundleOptions
    program: str = __version__
    """The version of rise-tui that made it."""
    rehearsals: dict[str, int] = {}
    """How many sessions that do not count are left out, by their purpose."""
    absent: dict[str, str] = {}
    """Why a session that study.jsonl names is not in it, in a sentence's part, by the session's name."""


def write_about(root: Path, about: AboutBundle) -> None:
    """Write `bundle.json` into the bundle in `root`. Raises OSError."""
    text = msgspec.json.format(msgspec.json.encode(about), indent=2)
    (root / ABOUT_FILE).write_bytes(text + b"\n")


def read_about(root: Path) -> AboutBundle:
    """`bundle.json` of the bundle in `root`. Raises ExportError when it is missing or is none."""
    try:
        return msgspec.json.decode((root / ABOUT_FILE).read_bytes(), type=AboutBundle)
    except FileNotFoundError:
        raise ExportError(f"it is no bundle that can be made again: it has no {ABOUT_FILE}") from None
    except (OSError, msgspec.DecodeError) as error:
        raise ExportError(f"{ABOUT_FILE} cannot be read: {error}") from None
