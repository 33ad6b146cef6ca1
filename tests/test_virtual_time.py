"""The clock that most tests of the console and of ROS trust."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

from textual import _time

from tests.virtual_time import VirtualLoop, monotonic, real_monotonic

T = TypeVar("T")


def run(work: Callable[[], Coroutine[Any, Any, T]]) -> T:
    loop = VirtualLoop()
    try:
        return loop.run_until_complete(work())
    finally:
        loop.close()


def test_a_day_passes_at_once_and_in_its_order() -> None:
    async def work() -> list[str]:
        began, happened = time.monotonic(), list[str]()
        loop = asyncio.get_running_loop()
        loop.call_later(3600, happened.append, "an hour")
        loop.call_later(1, happened.append, "a second")
        await asyncio.sleep(1800)
        happened.append("half an hour")
        await asyncio.sleep(86_400 - 1800)
        assert 86_399.999 <= time.monotonic() - began < 86_401  # a sum of large numbers
        return happened

    assert run(work) == ["a second", "half an hour", "an hour"]


def test_no_time_passes_while_something_is_done() -> None:
    async def work() -> float:
        began = time.monotonic()
        for _ in range(1000):
            await asyncio.sleep(0)
        return time.monotonic() - began

    assert run(work) == 0.0


def test_a_thread_gets_the_time_that_it_needs() -> None:
    async def work() -> None:
        async with asyncio.timeout(30):  # which would be over at once
            await asyncio.to_thread(time.sleep, 0.05)

    run(work)


def test_afterwards_the_clock_is_the_machines_again() -> None:
    async def work() -> None:
        await asyncio.sleep(86_400)

    run(work)
    assert abs(time.monotonic() - real_monotonic()) < 60


def test_textual_goes_by_it() -> None:
    """Its plugin for snapshots loads it before anything of ours."""
    assert _time.get_time is monotonic is time.monotonic
