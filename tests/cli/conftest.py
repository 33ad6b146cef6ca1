"""What several tests of `rise-engine run` use."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.processes import folder


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A scenario folder with a few acts and rules."""
    return folder(tmp_path / "study")
