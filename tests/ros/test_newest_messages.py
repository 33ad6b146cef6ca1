"""What a subscription of rclpy that may pause does with what it hears."""

from __future__ import annotations

from typing import Any

from rise_adapters.ros2.transport.rclpy.topics import NewestMessages

from rise_engine.engine.clock import VirtualClock
from tests.ros.memory import ClockLoop


def test_what_comes_during_a_pause_is_left_and_the_newest_is_read_then() -> None:
    loop = ClockLoop(VirtualClock())
    read: list[tuple[float, bytes]] = []
    newest = NewestMessages(
        lambda message: read.append((loop.clock.now(), message)),
        2,
        0.5,
        loop.call_later,
        lambda call, *more: call(*more),
    )

    def hear(*messages: Any) -> None:
        for at, message in messages:
            loop.call_later(at, newest.put, message)

    hear((1.0, b"a"), (1.1, b"b"), (1.2, b"c"), (1.3, b"d"), (1.6, b"e"), (5.0, b"f"))
    loop.run_until(10.0)
    assert read == [(1.0, b"a"), (1.5, b"c"), (1.5, b"d"), (2.0, b"e"), (5.0, b"f")]
