"""Publishers and subscriptions of rclpy."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, Literal

from rise_adapters.ros2.transport.port import Message, PortError, QoS, SendReply
from rise_adapters.ros2.transport.rclpy.conversion import MessageConverter
from rise_adapters.ros2.transport.rclpy.installation import first_line
from rise_adapters.ros2.transport.rclpy.node import SpinningNode

# --- entities ---------------------------------------------------------------------------------------------------------


class RclpyEntity:
    """A publisher, subscription, service or client, until it is closed."""

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
        """`of_rclpy`: rclpy's class of the type. Raises PortError, with one sentence for rclpy's many errors."""
        node.check_works()
        self._node = node
        self._kind = kind
        self._closed = False
        try:
            create = getattr(node.rclpy_node, f"create_{kind}")
            self._entity: Any = create(of_rclpy, name, qos_profile=node.make_profile(qos), **more)
        except Exception as error:  # rclpy and its C code raise many kinds
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
        """Call a function on the loop's thread, unless this is closed by then. May be called on any thread."""
        self._node.call_on_loop(self._call_unless_closed, callback, *arguments)

    def _call_unless_closed(self, callback: Callable[..., object], *arguments: Any) -> None:
        if not self._closed:
            callback(*arguments)


# rclpy's default callbacks for events only write log lines, and each slows down every turn of the executor.


# --- services ---------------------------------------------------------------------------------------------------------

_log = logging.getLogger(__name__)

_QOS = QoS(depth=1000)
"""Requests and replies that may wait in the middleware. A burst overruns ROS's own 10, and the rest would be lost."""


class RclpyServer(RclpyEntity):
    """Answers at any time. It takes the header of each request from rclpy. Otherwise rclpy would wait for the answer in
    a coroutine, and every waiting request would slow down each turn of the executor."""

    def __init__(
        self,
        node: SpinningNode,
        name: str,
        type: str,
        service: Any,
        request: MessageConverter,
        response: MessageConverter,
        on_request: Callable[[Message, SendReply], None],
    ) -> None:
        """`service`: rclpy's class of the type. Raises PortError."""
        node.check_works()
        self._request = request
        self._response = response
        self._on_request = on_request
        self._ready = threading.Lock()
        """Held until `send_response` is replaced: an earlier request waits in `_pass_on`."""
        with self._ready:
            if node.spins_on:
                node.call_on_thread(self._pass_on, None, None)  # holds the thread before it sees the service
            super().__init__(node, "service", name, type, service, _QOS, callback=self._pass_on)
            self._send: Callable[[Any, Any], None] = self._entity.send_response
            self._entity.send_response = self._take_request

    def _pass_on(self, request: Any, response: Any) -> Any:
        """Pass on a request, as rclpy's callback in the spinning thread. `_take_request` gets it, with the header."""
        with self._ready:
            return request

    def _take_request(self, request: Any, header: Any) -> None:
        """Take a request, in the spinning thread, in place of the executor's sending of an answer."""
        self.hand_over(self._handle_request, self._request.read(request), header)

    def _handle_request(self, request: Message, header: Any) -> None:
        answered = False

        def reply(message: Message) -> None:
            nonlocal answered
            if answered or not self.works:
                return
            written = self._response.write(message)
            answered = True
            try:
                self._send(written, header)
            except Exception as error:  # the client is gone or unreachable
                _log.info("an answer could not be sent: %s", first_line(error))

        self._on_request(request, reply)


class RclpyClient(RclpyEntity):
    """Implements `port.ServiceClient`."""

    def __init__(
        self,
        node: SpinningNode,
        name: str,
        type: str,
        service: Any,
        request: MessageConverter,
        response: MessageConverter,
    ) -> None:
        """Like `RclpyServer`."""
        super().__init__(node, "client", name, type, service, _QOS)
        self._request = request
        self._response = response

    def count_servers(self) -> int:
        if not self.works or not self._entity.service_is_ready():
            return 0  # not ready: the graph may know one already, but it could not answer yet
        return max(1, int(self._node.rclpy_node.count_services(self._entity.service_name)))

    def call(self, request: Message, on_response: Callable[[Message], None]) -> None:
        written = self._request.write(request)
        if not self.works:
            return
        try:
            future = self._entity.call_async(written)
        except Exception as error:  # as in `RclpyEntity`
            raise PortError(f"{self._entity.service_name}: not asked: {first_line(error)}") from error
        future.add_done_callback(lambda done: self._take_response(done, on_response))

    def _take_response(self, done: Any, on_response: Callable[[Message], None]) -> None:
        """Take a response, in the spinning thread, or on the loop's thread if the answer was faster than `call`."""
        response = done.result()
        if response is not None:
            self.hand_over(on_response, self._response.read(response))


# --- topics -----------------------------------------------------------------------------------------------------------


class RclpyPublisher(RclpyEntity):
    """Implements `port.Publisher`."""

    def __init__(self, node: SpinningNode, topic: str, type: Any, converter: MessageConverter, qos: QoS) -> None:
        """`type`: rclpy's class of the type. Raises PortError."""
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
        """Like `RclpyPublisher`; `pause` is that of `port.Transport`."""

        def take(message: Any) -> None:
            """Take a message, in the spinning thread."""
            self.hand_over(on_message, converter.read(message))

        events = node.rclpy.events.SubscriptionEventCallbacks(use_default_callbacks=False)
        more = {"callback": take, "raw": pause > 0}  # raw: the executor does not read it (`SpinningNode`)
        super().__init__(node, "subscription", topic, converter.type, type, qos, event_callbacks=events, **more)
        if pause:
            self._poll = partial(
                self._read_newest, pause, qos.depth, type, lambda each: on_message(converter.read(each))
            )
            node.loop.call_later(pause, self._poll)

    def _read_newest(self, pause: float, depth: int, type: Any, read: Callable[[Any], None]) -> None:
        """Read on the loop what the middleware has kept, and again after the pause.

        rclpy's executor would take each message, but messages dropped by the middleware cost nothing.
        """
        if not self.works:
            return
        self._node.loop.call_later(pause, self._poll)
        with self._entity.handle:
            for _ in range(max(depth, 1)):  # not until none is left: the loop has other work
                if (taken := self._entity.handle.take_message(type, False)) is None:
                    break
                read(taken[0])

    def count_publishers(self) -> int:
        return int(self._entity.get_publisher_count()) if self.works else 0
