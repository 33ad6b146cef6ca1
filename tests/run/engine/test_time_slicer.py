"""Long work in slices: the loop goes on in between, and nothing is forgotten."""

from __future__ import annotations

import asyncio

import pytest

from rise_engine.base import time_slicer
from rise_engine.base.time_slicer import TimeSlicer


class Work:
    """Pieces that cost nothing, counted; `clock` stands in for the time that they take."""

    def __init__(self, pieces: int, seconds: float, monkeypatch: pytest.MonkeyPatch) -> None:
        self.left, self.now = pieces, 0.0
        self._seconds = seconds
        monkeypatch.setattr(time_slicer, "perf_counter", lambda: self.now)

    def step(self) -> int:
        if not self.left:
            return 0
        self.left -= 1
        self.now += self._seconds
        return 10


async def test_the_loop_goes_on_between_slices(monkeypatch: pytest.MonkeyPatch) -> None:
    work = Work(10, 1.0, monkeypatch)
    slicer = TimeSlicer(work.step, 2.5)
    slicer.wake()
    slicer.wake()
    left = []
    while slicer.busy:
        await asyncio.sleep(0)
        left.append(work.left)
    assert left == [7, 4, 1, 0]


async def test_a_slice_ends_as_well_when_enough_was_done(monkeypatch: pytest.MonkeyPatch) -> None:
    work = Work(7, 0.0, monkeypatch)
    slicer = TimeSlicer(work.step, 1.0, most=25)
    assert slicer.run_slice() and work.left == 4
    assert slicer.run_slice() and work.left == 1
    assert not slicer.run_slice() and work.left == 0


async def test_work_that_comes_up_meanwhile_is_done_too(monkeypatch: pytest.MonkeyPatch) -> None:
    work = Work(1, 0.0, monkeypatch)
    slicer = TimeSlicer(work.step, 1.0)
    slicer.wake()
    await asyncio.sleep(0)
    assert not slicer.busy
    work.left = 3
    slicer.wake()
    await asyncio.sleep(0)
    assert work.left == 0 and not slicer.busy


async def test_a_piece_that_fails_keeps_no_other_from_being_done(caplog: pytest.LogCaptureFixture) -> None:
    pieces = [lambda: 1, lambda: 1 // 0, lambda: 1]
    slicer = TimeSlicer(lambda: pieces.pop()() if pieces else 0, 1.0)
    slicer.wake()
    await asyncio.sleep(0)
    assert not pieces and not slicer.busy and "a piece of work failed" in caplog.text


async def test_what_was_cancelled_does_nothing_until_it_is_woken_again(monkeypatch: pytest.MonkeyPatch) -> None:
    work = Work(2, 0.0, monkeypatch)
    slicer = TimeSlicer(work.step, 1.0)
    slicer.wake()
    slicer.cancel()
    await asyncio.sleep(0)
    assert work.left == 2 and not slicer.busy
    slicer.wake()
    await asyncio.sleep(0)
    assert work.left == 0
