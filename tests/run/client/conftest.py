"""A runtime folder with a short path for each test, as the tests of the server have it."""

from tests.run.server.conftest import scratch

__all__ = ["scratch"]
