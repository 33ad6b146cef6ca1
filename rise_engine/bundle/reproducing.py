"""What is done with a bundle: its check sums are compared, and every session of it is replayed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from msgspec import Struct

from rise_engine.bundle.crate import METADATA
from rise_engine.bundle.errors import BundleError
from rise_engine.bundle.manifest import ManifestCheck, check_manifest
from rise_engine.session.errors import SessionError
from rise_engine.session.folder import JOURNAL
from rise_engine.session.replay import ReplayComparison, compare_replay
from rise_engine.study.traces import MANIFEST_FILE

SESSIONS = "sessions"


class ReproducedSession(Struct, frozen=True):
    """A session of a bundle, and what came of its replay."""

    name: str
    comparison: ReplayComparison | None
    """None: it cannot be replayed."""
    problem: str = ""
    """Why not."""

    @property
    def identical(self) -> bool:
        return self.comparison is not None and self.comparison.identical


def check_bundle(root: Path) -> ManifestCheck:
    """Compare a bundle with its check sums.

    :param root: its folder.
    :raises BundleError: it is no bundle, or cannot be read.
    """
    missing = [name for name in (METADATA, MANIFEST_FILE) if not (root / name).is_file()]
    if missing:
        raise BundleError(f"it is no bundle: it has no {' and no '.join(missing)}")
    try:
        return check_manifest(root)
    except OSError as error:
        raise BundleError(f"it cannot be read: {error.strerror or error}") from None


def session_folders(root: Path) -> list[Path]:
    """The sessions of a bundle, by their names."""
    return sorted(path.parent for path in (root / SESSIONS).glob(f"*/{JOURNAL}"))


def reproduce_sessions(root: Path) -> Iterator[ReproducedSession]:
    """Replay every session of a bundle, one after the other."""
    for folder in session_folders(root):
        try:
            yield ReproducedSession(folder.name, compare_replay(folder))
        except SessionError as error:
            yield ReproducedSession(folder.name, None, str(error))
