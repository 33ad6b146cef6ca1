"""What several tests of ROS 2 use."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ros.model_server import ModelServer


@pytest.fixture
def model_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModelServer]:
    """A language model on this machine."""
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    server = ModelServer()
    yield server
    server.close()
