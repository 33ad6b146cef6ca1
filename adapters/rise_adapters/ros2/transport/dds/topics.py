"""Publishers and subscriptions on DDS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cyclonedds.sub import DataReader

from rise_adapters.ros2.transport.dds.entities import DdsWriter
from rise_adapters.ros2.transport.dds.node import DdsNode
from rise_adapters.ros2.transport.interfaces import MessageCodec
from rise_adapters.ros2.transport.port import Message


class DdsPublisher:
    """Implements `port.Publisher`."""

    def __init__(self, node: DdsNode, writer: DdsWriter, codec: MessageCodec) -> None:
        self._node = node
        self._writer = writer
        self._codec = codec
        self._open = True

    def publish(self, message: Message) -> None:
        self._writer.write(self._codec.pack(message))

    def count_subscribers(self) -> int:
        return len(self._writer.matched_readers())

    def close(self) -> None:
        if self._open:
            self._open = False
            self._node.release(self, self._writer, None)


class DdsSubscription:
    """Implements `port.Subscription`."""

    def __init__(
        self, node: DdsNode, reader: DataReader[Any], codec: MessageCodec, on_message: Callable[[Message], None]
    ) -> None:
        self._node = node
        self._reader = reader
        self._codec = codec
        self._on_message = on_message
        self._stop_reading: Callable[[], None] | None = node.reader_thread.add(reader, self._on_sample)

    def publishers(self) -> int:
        return len(self._reader.get_matched_publications()) if self._stop_reading is not None else 0

    def close(self) -> None:
        if self._stop_reading is not None:
            self._stop_reading()
            self._stop_reading = None
            self._node.release(self, None, self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if info.valid_data:
            self._on_message(self._codec.unpack(data))
