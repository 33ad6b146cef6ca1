"""What several tests of ROS 2 use."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping
from inspect import signature

import pytest

from tests.ros.model_server import ModelServer
from tests.virtual_time import VirtualLoop

REAL_TIME = {"test_session_node", "test_session_node_release", "test_session_node_topics"}
"""Whose tests wait for the thread of a disk."""


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """DDS and a model's server have threads and clocks of their own; a robot in memory has none."""
    threads = item.get_closest_marker("dds") or "model_server" in signature(item.function).parameters  # type: ignore[attr-defined]
    real = threads or item.path.stem in REAL_TIME
    return {"machine": asyncio.new_event_loop} if real else {"virtual": VirtualLoop}


@pytest.fixture
def model_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModelServer]:
    """A language model on this machine."""
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    server = ModelServer()
    yield server
    server.close()
