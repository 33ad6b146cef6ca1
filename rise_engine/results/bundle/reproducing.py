"""What is done with a bundle: its check sums are compared."""

from __future__ import annotations

from pathlib import Path

from rise_engine.results.bundle.about import ABOUT_FILE
from rise_engine.results.bundle.crate import METADATA
from rise_engine.results.bundle.manifest import ManifestCheck, check_manifest
from rise_engine.results.export.format import ExportError
from rise_engine.study.traces import MANIFEST_FILE


def check_bundle(root: Path) -> ManifestCheck:
    """Compare a bundle with its check sums.

    :param root: its folder.
    :raises ExportError: it is no bundle, or cannot be read.
    """
    missing = [name for name in (METADATA, ABOUT_FILE, MANIFEST_FILE) if not (root / name).is_file()]
    if missing:
        raise ExportError(f"it is no bundle: it has no {' and no '.join(missing)}")
    try:
        return check_manifest(root)
    except OSError as error:
        raise ExportError(f"it cannot be read: {error.strerror or error}") from None
