"""Work in portions: in turn, bounded in time, and whatever a piece does."""

from __future__ import annotations

import asyncio
import time
from collections import deque

import pytest
from rise_adapters.ros2.face.portions import HASTY, TURN_SECONDS, Portions


class Work:
    def __init__(self, seconds: float = 0.0) -> None:
        self.left = 0
        self.seconds = seconds
        self.done: deque[float] = deque()

    def piece(self) -> bool:
        if not self.left:
            return False
        self.left -= 1
        until = time.perf_counter() + self.seconds
        while time.perf_counter() < until:
            pass
        self.done.append(time.perf_counter())
        return True


async def test_the_loop_goes_on_between_portions() -> None:
    first, second = Work(0.0002), Work(0.0002)
    portions = Portions(asyncio.get_running_loop(), first.piece, second.piece)
    first.left = second.left = 100
    portions.wake()
    portions.wake()
    turns = 0
    while first.left or second.left:
        turns += 1
        await asyncio.sleep(0)
    assert turns >= 200 * 0.0002 / (TURN_SECONDS + 0.001), "in many turns"
    order = sorted([(at, 1) for at in first.done] + [(at, 2) for at in second.done])
    assert [kind for _, kind in order] == [1, 2] * 100, "one of each in turn"


async def test_a_piece_that_fails_keeps_no_other_from_being_done(caplog: pytest.LogCaptureFixture) -> None:
    work, fails = Work(), [3]

    def bad() -> bool:
        if not fails[0]:
            return False
        fails[0] -= 1
        raise ValueError("a mistake")

    portions = Portions(asyncio.get_running_loop(), bad, work.piece)
    work.left = 5
    portions.finish(1)
    assert not work.left and not fails[0] and "a mistake" in caplog.text


async def test_some_is_done_at_once_while_nothing_waits() -> None:
    work = Work()
    portions = Portions(asyncio.get_running_loop(), work.piece)
    assert [portions.at_leisure() for _ in range(HASTY + 2)] == [True] * HASTY + [False] * 2
    await asyncio.sleep(0)
    assert portions.at_leisure(), "the next turn of the loop"
    portions.wake()
    assert not portions.at_leisure(), "it would overtake what waits"
    await asyncio.sleep(0)
    assert portions.at_leisure()
