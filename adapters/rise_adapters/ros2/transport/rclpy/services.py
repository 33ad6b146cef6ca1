"""Servers and clients of rclpy's services."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

from rise_adapters.ros2.transport.port import Message, PortError, QoS, SendReply
from rise_adapters.ros2.transport.rclpy.conversion import MessageConverter
from rise_adapters.ros2.transport.rclpy.installation import first_line
from rise_adapters.ros2.transport.rclpy.node import SpinningNode
from rise_adapters.ros2.transport.rclpy.topics import RclpyEntity

_log = logging.getLogger(__name__)

_QOS = QoS(depth=1000)
"""Requests and replies that may wait in the middleware. ROS's own 10 are overrun by a burst, and then they are lost."""


class RclpyServer(RclpyEntity):
    """Answers at any time: it takes the header of each request from rclpy, instead of having rclpy wait for the answer
    in a coroutine, which would cost each turn of the executor something for every request that waits."""

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
        """Held until `send_response` is replaced: a request that comes before waits in `_pass_on`."""
        with self._ready:
            if node.spins_on:
                node.call_on_thread(self._pass_on, None, None)  # holds the thread before it sees the service
            super().__init__(node, "service", name, type, service, _QOS, callback=self._pass_on)
            self._send: Callable[[Any, Any], None] = self._entity.send_response
            self._entity.send_response = self._take_request

    def _pass_on(self, request: Any, response: Any) -> Any:
        """rclpy's callback, in the spinning thread. What it returns goes to `send_response`, together with the header
        of the request: to `_take_request`."""
        with self._ready:
            return request

    def _take_request(self, request: Any, header: Any) -> None:
        """In the spinning thread, where the executor believes to send an answer."""
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
            except Exception as error:  # the client is gone, or cannot be reached: nobody to tell
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
        """As `RclpyServer`."""
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
        """In the spinning thread; on the loop's when the answer was quicker than `call`."""
        response = done.result()
        if response is not None:
            self.hand_over(on_response, self._response.read(response))
