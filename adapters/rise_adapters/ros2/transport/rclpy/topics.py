"""Publishers and subscriptions of rclpy."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Any

from rise_adapters.ros2.transport.port import Message, PortError, QoS
from rise_adapters.ros2.transport.rclpy.conversion import MessageConverter
from rise_adapters.ros2.transport.rclpy.entities import RclpyEntity
from rise_adapters.ros2.transport.rclpy.installation import first_line
from rise_adapters.ros2.transport.rclpy.node import SpinningNode

# rclpy's own callbacks for events would only write log lines, and each makes every turn of the executor longer.


class RclpyPublisher(RclpyEntity):
    """Implements `port.Publisher`."""

    def __init__(self, node: SpinningNode, topic: str, type: Any, converter: MessageConverter, qos: QoS) -> None:
        """`type`: rclpy's class of it. Raises PortError."""
        events = node.rclpy.events.PublisherEventCallbacks(use_default_callbacks=False)
        super().__init__(node, "publisher", topic, converter.type, type, qos, event_callbacks=events)
        self._converter = converter

    def publish(self, message: Message) -> None:
        written = self._converter.write(message)
        if not self.works:
            return
        try:
            self._entity.publish(written)
        except Exception as error:  # as in `RclpyEntity`
            if self.works:
                raise PortError(f"{self._entity.topic_name}: not published: {first_line(error)}") from error

    def count_subscribers(self) -> int:
        return int(self._entity.get_subscription_count()) if self.works else 0


class NewestMessages:
    """What a subscription that may pause has heard and not read yet, as bytes: reading it is what takes time."""

    def __init__(
        self,
        read: Callable[[bytes], None],
        depth: int,
        pause: float,
        call_later: Callable[..., object],
        hand_over: Callable[..., None],
    ) -> None:
        """`read` reads one, on the loop, where `call_later` belongs; `hand_over`, from any thread, has something called
        there."""
        self._read, self._pause, self._call_later, self._hand_over = read, pause, call_later, hand_over
        self._kept: deque[bytes] = deque(maxlen=max(depth, 1))
        self._lock = Lock()
        self._pausing = False
        """Whether somebody will look at what is kept."""

    def put(self, message: bytes) -> None:
        """In the spinning thread."""
        with self._lock:
            self._kept.append(message)
            if self._pausing:
                return
            self._pausing = True
        self._hand_over(self._deliver)

    def _deliver(self) -> None:
        with self._lock:
            messages = list(self._kept)
            self._kept.clear()
            self._pausing = bool(messages)
        if messages:
            self._call_later(self._pause, self._hand_over, self._deliver)
        for message in messages:
            self._hand_over(partial(self._read, message))


class RclpySubscription(RclpyEntity):
    """Implements `port.Subscription`."""

    def __init__(
        self,
        node: SpinningNode,
        topic: str,
        type: Any,
        converter: MessageConverter,
        on_message: Callable[[Message], None],
        qos: QoS,
        pause: float,
    ) -> None:
        """As `RclpyPublisher`; `pause` as of `port.Transport`."""

        def take(message: Any) -> None:
            """In the spinning thread."""
            self.hand_over(on_message, converter.read(message))

        def read(message: bytes) -> None:
            on_message(converter.read(node.rclpy.deserialize(message, type)))

        newest = NewestMessages(read, qos.depth, pause, node.loop.call_later, self.hand_over) if pause else None
        events = node.rclpy.events.SubscriptionEventCallbacks(use_default_callbacks=False)
        more = {"callback": take if newest is None else newest.put, "raw": newest is not None}
        super().__init__(node, "subscription", topic, converter.type, type, qos, event_callbacks=events, **more)

    def count_publishers(self) -> int:
        return int(self._entity.get_publisher_count()) if self.works else 0
