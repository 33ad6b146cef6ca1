"""Time that passes at once, for the tests that have no other clock than the loop's."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

import pytest

from tests.virtual_time import VirtualLoop


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    return (
        {"virtual": VirtualLoop}
        if item.path.stem in ("test_robot", "test_recorder")
        else {"machine": asyncio.new_event_loop}
    )
