"""What several tests of ROS 2 use."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping

import pytest

from tests.ros.model_server import ModelServer
from tests.virtual_time import VirtualLoop

REAL_TIME = {"test_nodes", "test_face"}
"""Whose tests wait for threads: that of a model's server, that of the disk."""


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """DDS has threads and clocks of its own; a robot in memory has none."""
    real = item.get_closest_marker("dds") is not None or item.path.stem in REAL_TIME
    return {"machine": asyncio.new_event_loop} if real else {"virtual": VirtualLoop}


@pytest.fixture
def model_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModelServer]:
    """A language model on this machine."""
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    server = ModelServer()
    yield server
    server.close()
