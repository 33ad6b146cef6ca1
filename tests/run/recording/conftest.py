"""Time that passes at once for tests that have no other clock than the loop's; a runtime folder with a short path."""

from __future__ import annotations

import asyncio
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

from tests.virtual_time import VirtualLoop

VIRTUAL = frozenset({"test_one_recorder"})


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    return {"virtual": VirtualLoop} if item.path.stem in VIRTUAL else {"machine": asyncio.new_event_loop}


@pytest.fixture(autouse=True)
def scratch(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = Path(tempfile.mkdtemp(prefix="rise-", dir="/tmp"))
    monkeypatch.setenv("RISE_RUNTIME", str(folder / "run"))
    yield folder
    shutil.rmtree(folder)
