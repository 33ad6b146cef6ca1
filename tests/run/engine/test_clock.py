"""The clocks."""

from __future__ import annotations

import asyncio
import time
from datetime import datetime, timedelta

import pytest

from rise_engine.run.engine.clock import RealClock, VirtualClock
from tests.patience import PATIENCE


def test_virtual_time_runs_timers_in_order_and_ties_in_the_order_of_their_setting() -> None:
    clock = VirtualClock()
    seen: list[tuple[str, float]] = []
    for name, when in (("c", 2.0), ("a", 1.0), ("b", 1.0), ("d", 1.0000001)):
        clock.call_at(when, lambda name=name: seen.append((name, clock.now())))  # type: ignore[misc]
    while clock.advance():
        pass
    assert seen == [("a", 1.0), ("b", 1.0), ("d", 1.0), ("c", 2.0)]


def test_a_timer_in_the_past_runs_now_but_not_inside_the_call() -> None:
    clock = VirtualClock()
    clock.call_at(5, lambda: None)
    clock.advance()
    seen: list[float] = []
    clock.call_at(1, lambda: seen.append(clock.now()))
    assert seen == []
    clock.advance()
    assert seen == [5.0]


def test_cancelled_timers_do_not_run() -> None:
    clock = VirtualClock()
    clock.call_at(0.5, lambda: pytest.fail("it was cancelled")).cancel()
    clock.call_at(100, lambda: pytest.fail("it was cancelled")).cancel()
    timer = clock.call_at(1, lambda: None)
    clock.advance()
    timer.cancel()  # after it has run: nothing happens
    timer.cancel()
    assert clock.next_at is None
    assert not clock.advance()


def test_virtual_wall_time_begins_in_1970() -> None:
    assert VirtualClock().wall_label(0) == "1970-01-01T00:00:00.000+00:00"
    assert VirtualClock().wall_label(3661.5) == "1970-01-01T01:01:01.500+00:00"


def test_a_label_is_given_for_every_time_however_far_away() -> None:
    for far in (1e12, 1e300, float("inf")):
        assert VirtualClock().wall_label(far) == "9999-12-31T23:59:59.000+00:00"
    for early in (-1.0, float("-inf"), float("nan")):
        assert VirtualClock().wall_label(early) == "1970-01-01T00:00:00.000+00:00"


async def test_real_time_can_be_faster() -> None:
    clock = RealClock(asyncio.get_running_loop(), 100)
    done = asyncio.Event()
    clock.call_at(1.0, done.set)
    await asyncio.wait_for(done.wait(), PATIENCE)
    assert clock.now() > 0.999


@pytest.mark.parametrize("zone", ["UTC", "Europe/Berlin", "Asia/Kathmandu", "America/St_Johns"])
async def test_the_label_is_the_local_time_with_its_offset(zone: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        clock = RealClock(asyncio.get_running_loop())
        for nanoseconds in (
            1_732_190_399_000_000_000,
            1_732_190_399_999_999_999,
            1_732_190_400_000_000_000,
            1_729_990_799_500_000_000,  # the last second of summer time in Europe
            1_729_990_800_001_000_000,
        ):
            monkeypatch.setattr("rise_engine.run.engine.clock.time_ns", lambda now=nanoseconds: now)
            whole, milliseconds = divmod(nanoseconds // 1_000_000, 1000)
            exact = datetime.fromtimestamp(whole).astimezone() + timedelta(milliseconds=milliseconds)
            assert clock.wall_label(clock.now()) == exact.isoformat(timespec="milliseconds")
            earlier = datetime.fromisoformat(clock.wall_label(clock.now() - 60.0))
            assert exact - earlier == pytest.approx(timedelta(seconds=60), abs=timedelta(milliseconds=20))
    finally:
        monkeypatch.undo()
        time.tzset()


async def test_a_speed_must_be_above_zero() -> None:
    loop = asyncio.get_running_loop()
    for speed in (0, -1, float("inf"), float("nan")):
        with pytest.raises(ValueError, match="above 0"):
            RealClock(loop, speed)


async def test_the_origin_says_what_the_loop_s_clock_shows_at_a_session_time() -> None:
    """Also of a session that goes on at 100 s, and of one that runs ten times as fast."""
    loop = asyncio.get_running_loop()
    for speed, start in ((1.0, 0.0), (1.0, 100.0), (10.0, 0.0), (10.0, 100.0)):
        before = loop.time()
        clock = RealClock(loop, speed, start)
        after = loop.time()
        assert before - 1e-6 <= clock.origin + start / speed <= after + 1e-6
        t = clock.now()
        assert after - 1e-6 <= clock.origin + t / speed <= loop.time() + 1e-6
