"""No test leaves anything in the home folder, or meets a session of whoever runs the tests."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import suppress

import pytest
from hypothesis import HealthCheck, settings

from tests import chance, virtual_time

virtual_time.install()
os.fsync = os.fdatasync = lambda fd: None  # no test loses power; in other processes the disk is waited for as ever

# For every property test: whether it passes depends neither on chance nor on how quick the machine is. A new clone has
# none of hypothesis' cached tables yet, and its first examples take seconds.
settings.register_profile(
    "fixed",
    derandomize=True,
    database=None,
    max_examples=chance.examples(100),
    deadline=None,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("search", settings.get_profile("fixed"), derandomize=False)
settings.load_profile("search" if chance.SEARCH else "fixed")


ONE_PROCESS = ("explore", "test_site", "sources", "test_bundle", "test_crate")
"""A folder and files whose tests share what took long to make: explorations, a site, parsed modules, a study."""
OF_SOURCES = ("test_architecture", "test_docs", "test_errors")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the tests of ONE_PROCESS in one process each, so that they make what they share once.

    What takes longest comes first: at the end, one process would run it while the others have nothing left to do.
    """

    def group(item: pytest.Item) -> str:
        folder = item.path.parent.name
        if item.path.stem in OF_SOURCES:
            return "sources"
        return folder if folder in ("explore", "tutorials") else item.path.stem

    for item in items:
        if group(item) in ONE_PROCESS:
            item.add_marker(pytest.mark.xdist_group(group(item)))
    items.sort(key=lambda item: group(item) not in (*ONE_PROCESS, "tutorials"))


def pytest_collection_finish() -> None:
    """What has been imported stays: looking through it for garbage again and again was a tenth of the whole run."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 50, 50)


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
