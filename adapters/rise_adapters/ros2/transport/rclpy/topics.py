"""Publishers and subscriptions of rclpy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Literal

from rise_adapters.ros2.transport.port import Message, PortError, QoS
from rise_adapters.ros2.transport.rclpy.conversion import MessageConverter
from rise_adapters.ros2.transport.rclpy.installation import first_line
from rise_adapters.ros2.transport.rclpy.node import SpinningNode

# --- entities ---------------------------------------------------------------------------------------------------------


class RclpyEntity:
    """One of these, until it is closed."""

    def __init__(
        self,
        node: SpinningNode,
        kind: Literal["publisher", "subscription", "service", "client"],
        name: str,
        type: str,
        of_rclpy: Any,
        qos: QoS,
        **more: Any,
    ) -> None:
        """`of_rclpy`: rclpy's class of the type. Raises PortError; rclpy's manifold complaints become one sentence."""
        node.check_works()
        self._node = node
        self._kind = kind
        self._closed = False
        try:
            create = getattr(node.rclpy_node, f"create_{kind}")
            self._entity: Any = create(of_rclpy, name, qos_profile=node.make_profile(qos), **more)
        except Exception as error:  # rclpy and its C code raise all kinds
            what = "topic" if kind in ("publisher", "subscription") else "service"
            raise PortError(f"The {what} {name} of the type {type} cannot be made: {first_line(error)}") from error

    @property
    def works(self) -> bool:
        return not self._closed and not self._node.failure()

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._node.destroy(getattr(self._node.rclpy_node, f"destroy_{self._kind}"), self._entity)

    def hand_over(self, callback: Callable[..., object], *arguments: Any) -> None:
        """From any thread: have it called on the loop's, unless this is closed by then."""
        self._node.call_on_loop(self._call_unless_closed, callback, *arguments)

    def _call_unless_closed(self, callback: Callable[..., object], *arguments: Any) -> None:
        if not self._closed:
            callback(*arguments)


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
        pause: float,
    ) -> None:
        """As `RclpyPublisher`; `pause` as of `port.Transport`."""

        def take(message: Any) -> None:
            """In the spinning thread."""
            self.hand_over(on_message, converter.read(message))

        events = node.rclpy.events.SubscriptionEventCallbacks(use_default_callbacks=False)
        more = {"callback": take, "raw": pause > 0}  # raw: the executor leaves it alone (`SpinningNode`)
        super().__init__(node, "subscription", topic, converter.type, type, qos, event_callbacks=events, **more)
        if pause:
            self._poll = partial(
                self._read_newest, pause, qos.depth, type, lambda each: on_message(converter.read(each))
            )
            node.loop.call_later(pause, self._poll)

    def _read_newest(self, pause: float, depth: int, type: Any, read: Callable[[Any], None]) -> None:
        """On the loop: read what the middleware has kept, and look again after the pause.

        rclpy's executor would take each message that comes; what the middleware drops costs nothing.
        """
        if not self.works:
            return
        self._node.loop.call_later(pause, self._poll)
        with self._entity.handle:
            for _ in range(max(depth, 1)):  # not as long as more come: the loop has other work
                if (taken := self._entity.handle.take_message(type, False)) is None:
                    break
                read(taken[0])

    def count_publishers(self) -> int:
        return int(self._entity.get_publisher_count()) if self.works else 0
