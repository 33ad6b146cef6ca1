"""Sessions that tests of journals have in common."""

from __future__ import annotations

from pathlib import Path

import pytest

from .journals import Made


@pytest.fixture
def made(tmp_path: Path) -> Made:
    return Made(tmp_path)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """One for tests that write the journal anew each time."""
    return Made(tmp_path_factory.mktemp("shared"))


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return Made(tmp_path_factory.mktemp("ended"), ended=True)
