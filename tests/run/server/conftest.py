"""A runtime folder with a short path for each test: a Unix socket's path may not be long."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def scratch(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = Path(tempfile.mkdtemp(prefix="rise-", dir="/tmp"))
    monkeypatch.setenv("RISE_RUNTIME", str(folder / "run"))
    yield folder
    shutil.rmtree(folder)
