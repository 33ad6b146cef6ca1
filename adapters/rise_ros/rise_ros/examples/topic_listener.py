"""Listens to another node's topic, whatever its publishers guarantee, and reports if nothing can arrive.

ROS itself reports nothing: a subscription that requests more than a publisher guarantees stays silent.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from msgspec.structs import replace
from rise_adapters.ros2.graph_checks import describe_other_versions
from rise_adapters.ros2.transport.port import RELIABLE, SENSOR, Message, QoS, Subscription, Transport

POLL_SECONDS = 0.5
"""Seconds between two checks of the publishers."""
PATIENCE_SECONDS = 5.0
"""Seconds until it is reported that nothing can arrive."""


class TopicListener:
    """Calls `on_message` with every message on a topic, until it is closed.

    It subscribes reliably, so that guaranteed messages are not lost. If there is a publisher without this guarantee (a
    sensor's), it subscribes without it. While a publisher has another version of the type, it takes nothing, because
    some messages would be garbage. `report` receives a sentence about each obstacle: no publisher, or one with another
    type or version.
    """

    def __init__(
        self,
        transport: Transport,
        topic: str,
        type: str,
        on_message: Callable[[Message], None],
        *,
        report: Callable[[str], object] = print,
        interval: float = POLL_SECONDS,
        patience: float = PATIENCE_SECONDS,
        pause: float = 0.0,
    ) -> None:
        """`pause`: seconds between two messages, each the newest; 0: every message is taken. Raises PortError."""
        self._transport, self._name, self._type, self._report = transport, topic, type, report
        self._topic = transport.resolve(topic)
        self._interval, self._patience, self._pause = interval, patience, pause
        self._on_message = on_message
        self._has_arrived = False
        self._other_versions: list[str] = []
        """The publishers of another version of the type."""
        self._reported = ""
        self._unmatched = False
        """Whether the last check found a publisher that it does not hear. (It may only just be appearing.)"""
        self._loop = asyncio.get_running_loop()
        self._begun = self._loop.time()
        self._best_effort = False
        self._subscription = self._subscribe(RELIABLE)
        self._timer = self._loop.call_later(interval, self._poll)

    def close(self) -> None:
        self._timer.cancel()
        self._subscription.close()

    def _subscribe(self, qos: QoS) -> Subscription:
        wanted = replace(qos, depth=1) if self._pause else qos
        return self._transport.subscribe(self._name, self._type, self._take_message, wanted, self._pause)

    def _take_message(self, message: Message) -> None:
        if not self._has_arrived:
            self._has_arrived = True
            self._compare_types()
        if not self._other_versions:
            self._on_message(message)

    def _compare_types(self) -> None:
        self._other_versions = describe_other_versions(self._transport, self._topic, self._type)
        for sentence in self._other_versions:
            self._report_once(sentence)

    def _poll(self) -> None:
        self._timer = self._loop.call_later(self._interval, self._poll)
        if self._transport.failure():
            return
        published = [end.type for end in self._transport.publisher_endpoints(self._topic)]
        mine = published.count(self._type)
        unmatched = mine > self._subscription.count_publishers()
        if unmatched and self._unmatched and not self._best_effort:
            self._best_effort = True
            self._subscription.close()
            self._subscription = self._subscribe(SENSOR)
        self._unmatched = unmatched
        self._compare_types()
        if not self._has_arrived and self._loop.time() - self._begun >= self._patience:
            self._report_once(describe_silence(self._topic, self._type, published))

    def _report_once(self, trouble: str) -> None:
        if trouble != self._reported:
            self._reported = trouble
            if trouble:
                self._report(trouble)


def describe_silence(topic: str, type: str, published: Sequence[str]) -> str:
    """Why nothing can arrive on a topic; empty: something can. `published`: the types of its publishers."""
    if not published:
        return f"nobody publishes on {topic} (yet); is its node running, and is the topic called so?"
    others = sorted(set(published))
    if type in others:
        return ""
    return f"{', '.join(others)} is published on {topic}, and this node hears {type}: nothing of it arrives"
