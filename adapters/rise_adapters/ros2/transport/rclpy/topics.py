"""Publishers and subscriptions of rclpy."""

from __future__ import annotations

from collections.abc import Callable
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
    ) -> None:
        """As `RclpyPublisher`."""

        def take(message: Any) -> None:
            """In the spinning thread."""
            self.hand_over(on_message, converter.read(message))

        events = node.rclpy.events.SubscriptionEventCallbacks(use_default_callbacks=False)
        super().__init__(node, "subscription", topic, converter.type, type, qos, callback=take, event_callbacks=events)

    def count_publishers(self) -> int:
        return int(self._entity.get_publisher_count()) if self.works else 0
