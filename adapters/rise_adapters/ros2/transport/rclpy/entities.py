"""What a node of rclpy's has: publishers, subscriptions, services and clients."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from rise_adapters.ros2.transport.port import PortError, QoS
from rise_adapters.ros2.transport.rclpy.installation import first_line
from rise_adapters.ros2.transport.rclpy.node import SpinningNode


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
