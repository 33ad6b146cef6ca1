"""No test leaves anything in the home folder, or meets a session of whoever runs the tests."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import suppress

import pytest
from hypothesis import HealthCheck, settings

from tests import virtual_time

virtual_time.install()

# For every property test: whether it passes never depends on how quick the machine is. A new clone has none of
# hypothesis' cached tables yet, and its first examples take seconds.
settings.register_profile("rise", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("rise")


@pytest.fixture(scope="session", autouse=True)
def _own_places() -> Iterator[None]:
    """Sessions and sockets of this test run; short, because the path of a socket may not be long."""
    folder = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    before = {name: os.environ.get(name) for name in ("RISE_SESSIONS", "RISE_RUNTIME")}
    os.environ["RISE_SESSIONS"] = f"{folder}/sessions"
    os.environ["RISE_RUNTIME"] = f"{folder}/run"
    yield
    for name, value in before.items():
        if value is None:
            os.environ.pop(name)
        else:
            os.environ[name] = value
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session", autouse=True)
def _interrupts_arrive() -> None:
    """Whoever is started in the background of a script ignores interrupts, and so do the programs that it starts."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        with suppress(ValueError):  # not the main thread
            signal.signal(signal.SIGINT, signal.default_int_handler)
