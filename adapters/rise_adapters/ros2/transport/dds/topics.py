"""Publishers and subscriptions on DDS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rise_adapters.ros2.transport.dds.names import dds_topic
from rise_adapters.ros2.transport.dds.node import DdsNode
from rise_adapters.ros2.transport.port import Message, QoS


class DdsPublisher:
    """Implements `port.Publisher`."""

    def __init__(self, node: DdsNode, topic: str, type: str, qos: QoS) -> None:
        """`topic`: the full name. Raises PortError as `DdsNode.open_writer`."""
        self._node = node
        self._codec = node.types.codec(type)
        self._writer = node.open_writer(dds_topic(topic), type, qos)

    def publish(self, message: Message) -> None:
        self._writer.write(self._codec.pack(message))

    def count_subscribers(self) -> int:
        return len(self._writer.matched_readers())

    def close(self) -> None:
        self._node.release(self._writer)


class DdsSubscription:
    """Implements `port.Subscription`."""

    def __init__(
        self, node: DdsNode, topic: str, type: str, on_message: Callable[[Message], None], qos: QoS, pause: float
    ) -> None:
        """As `DdsPublisher`."""
        self._node = node
        self._codec = node.types.codec(type)
        self._on_message = on_message
        self._reader = node.open_reader(dds_topic(topic), type, qos, self._on_sample, pause=pause)

    def count_publishers(self) -> int:
        return len(self._reader.matched_writers())

    def close(self) -> None:
        self._node.release(self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if info.valid_data:
            self._on_message(self._codec.unpack(data))
