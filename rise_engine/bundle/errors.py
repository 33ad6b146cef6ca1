"""What goes wrong with bundles."""

from __future__ import annotations

from rise_engine.errors import RiseError


class BundleError(RiseError):
    """A bundle cannot be made or read; the text says why, in a sentence or several lines."""
