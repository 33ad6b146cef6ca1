"""Publishers and subscriptions of rclpy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rise_adapters.ros2.transport.port import Message, PortError, QoS
from rise_adapters.ros2.transport.rclpy.conversion import MessageConverter
from rise_adapters.ros2.transport.rclpy.installation import first_line
from rise_adapters.ros2.transport.rclpy.node import SpinningNode


class RclpyPublisher:
    """Implements `port.Publisher`."""

    def __init__(self, node: SpinningNode, topic: str, type: Any, converter: MessageConverter, qos: QoS) -> None:
        """`type`: rclpy's class of it. Raises PortError."""
        self._node = node
        self._converter = converter
        self._closed = False
        self._publisher = node.create(
            f"topic {topic} of the type {converter.type}",
            node.rclpy_node.create_publisher,
            type,
            topic,
            qos,
            event_callbacks=node.publisher_events(),
        )

    def publish(self, message: Message) -> None:
        written = self._converter.write(message)
        if self._closed or self._node.known_to_have_ended():
            return
        try:
            self._publisher.publish(written)
        except Exception as error:
            if not self._node.ended():
                raise PortError(f"{self._publisher.topic_name}: not published: {first_line(error)}") from error

    def count_subscribers(self) -> int:
        return 0 if self._closed or self._node.ended() else int(self._publisher.get_subscription_count())

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._node.destroy(self._node.rclpy_node.destroy_publisher, self._publisher)


class RclpySubscription:
    """Implements `port.Subscription`."""

    def __init__(
        self,
        node: SpinningNode,
        topic: str,
        type: Any,
        converter: MessageConverter,
        on_message: Callable[[Message], None],
        qos: QoS,
    ) -> None:
        """As `RclpyPublisher`."""
        self._node = node
        self._converter = converter
        self._on_message = on_message
        self._closed = False
        self._subscription = node.create(
            f"topic {topic} of the type {converter.type}",
            node.rclpy_node.create_subscription,
            type,
            topic,
            qos,
            callback=self._take,
            event_callbacks=node.subscription_events(),
        )

    def publishers(self) -> int:
        return 0 if self._closed or self._node.ended() else int(self._subscription.get_publisher_count())

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._node.destroy(self._node.rclpy_node.destroy_subscription, self._subscription)

    def _take(self, message: Any) -> None:
        """In the spinning thread."""
        self._node.call_on_loop(self._deliver, self._converter.read(message))

    def _deliver(self, message: Message) -> None:
        if not self._closed:
            self._on_message(message)
