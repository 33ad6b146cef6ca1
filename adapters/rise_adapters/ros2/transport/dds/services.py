"""Services on DDS, as rmw_cyclonedds has them: a topic of requests and one of replies, every message beginning with
whose request it is and which one; and ids in the user data by which one sees which writers and readers belong together.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable
from typing import Any

from rise_adapters.ros2.transport.dds import graph, names
from rise_adapters.ros2.transport.dds.node import DdsNode
from rise_adapters.ros2.transport.interfaces import MessageCodec
from rise_adapters.ros2.transport.port import Message, PortError, QoS, SendReply

_HEADER = struct.Struct("<Qq")
_BODY = 4 + _HEADER.size
_QOS = QoS(depth=1000)
"""Of requests and replies. ROS has a depth of 10; only this side's own memory is meant."""
_UNANSWERED = 10_000
"""Requests whose answers are waited for; with more, the oldest is forgotten."""
_ANSWER_KEPT_SECONDS = 1.0
"""Seconds that an answer is kept for a client whose reader is not seen yet."""
_RETRY_SECONDS = 0.005
_LOG = logging.getLogger(__name__)


class DdsClient:
    """Implements `port.Client`."""

    def __init__(self, node: DdsNode, name: str, request: MessageCodec, response: MessageCodec) -> None:
        """`name`: the full name. Raises PortError as `DdsNode.writer`."""
        self._node = node
        self._name = name
        id = {"clientid": node.new_service_id()}
        self._reader = node.reader(names.reply(name), response.type, _QOS, id, headed=True)
        self._writer = node.writer(names.request(name), request.type, _QOS, id, headed=True)
        self._request = request
        self._response = response
        self._waiting: dict[int, Callable[[Message], None]] = {}
        self._number = 0
        self._known_ends: dict[int, graph.DdsEndpoint] = {}
        self._matched_handles: tuple[list[int], list[int]] | None = None
        """The other ends when they were looked at last, and all of them were known."""
        self._count = 0
        self._stop_reading: Callable[[], None] | None = node.reader_thread.add(self._reader, self._on_sample)

    def count_servers(self) -> int:
        taking, answering = self._writer.matched_readers(), self._reader.get_matched_publications()
        if (taking, answering) == self._matched_handles:
            return self._count
        ends = {
            **{
                handle: self._known_ends.get(handle) or graph.matched_reader(self._writer.handle, handle)
                for handle in taking
            },
            **{
                handle: self._known_ends.get(handle) or graph.matched_writer(self._reader._ref, handle)
                for handle in answering
            },
        }
        # Types of one structure match each other whatever their names are; those are not meant.
        named = (self._request.type, self._response.type)
        self._known_ends = {handle: end for handle, end in ends.items() if end and end.is_cyclone and end.type in named}
        takers, answerers = (
            [end.user_data.get("serviceid", "") for handle in handles if (end := self._known_ends.get(handle))]
            for handles in (taking, answering)
        )
        paired = {id for id in takers if id} & {id for id in answerers if id}
        self._count = len(paired) + min(takers.count(""), answerers.count(""))
        # This is asked before each goal, and seldom changes; but what is not known yet is asked for again.
        self._matched_handles = (taking, answering) if all(ends.values()) else None
        return self._count

    def call(self, request: Message, answer: Callable[[Message], None]) -> None:
        if self._stop_reading is None:
            return
        self._number += 1
        data = self._request.pack(request, _HEADER.pack(self._writer.instance, self._number))
        if len(self._waiting) >= _UNANSWERED:
            del self._waiting[next(iter(self._waiting))]
        self._waiting[self._number] = answer
        self._writer.write(data)

    def close(self) -> None:
        if self._stop_reading is not None:
            self._stop_reading()
            self._stop_reading = None
            self._waiting.clear()
            self._node.release(self, self._writer, self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if not info.valid_data or len(data) < _BODY:
            return
        client, number = _HEADER.unpack_from(data, 4)
        if client != self._writer.instance:
            return
        answer = self._waiting.pop(number, None)
        if answer is None:
            return
        try:
            message = self._response.unpack(data, _BODY)
        except PortError as error:
            _LOG.warning("%s: %s", self._name, error)
            return
        answer(message)


class DdsServer:
    """Serves one service."""

    def __init__(
        self,
        node: DdsNode,
        name: str,
        request: MessageCodec,
        response: MessageCodec,
        on_request: Callable[[Message, SendReply], None],
    ) -> None:
        """`name`: the full name. Raises PortError as `DdsNode.writer`."""
        self._node = node
        self._name = name
        id = {"serviceid": node.new_service_id()}
        self._writer = node.writer(names.reply(name), response.type, _QOS, id, headed=True)
        self._reader = node.reader(names.request(name), request.type, _QOS, id, headed=True)
        self._request = request
        self._response = response
        self._on_request = on_request
        self._reachable: set[int] = set()
        """Writers of requests (by handle) whose readers of replies have been seen."""
        self._stop_reading: Callable[[], None] | None = node.reader_thread.add(self._reader, self._on_sample)

    def close(self) -> None:
        if self._stop_reading is not None:
            self._stop_reading()
            self._stop_reading = None
            self._node.release(self, self._writer, self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if not info.valid_data or len(data) < _BODY:
            return
        try:
            message = self._request.unpack(data, _BODY)
        except PortError as error:
            _LOG.warning("%s: %s", self._name, error)
            return
        head, client = data[4:_BODY], info.publication_handle
        answered = False

        def reply(response: Message) -> None:
            nonlocal answered
            if not answered and self._stop_reading is not None:
                answer = self._response.pack(response, head)
                answered = True
                self._send_answer(client, answer, self._node.loop.time() + _ANSWER_KEPT_SECONDS)

        self._on_request(message, reply)

    def _send_answer(self, client: int, data: bytes, until: float) -> None:
        """Send an answer once its client's reader is known; DDS would drop it before that."""
        if self._stop_reading is None:
            return
        if client not in self._reachable:
            there = self._client_listens(client)
            if there is None:
                return
            if not there and self._node.loop.time() < until:
                self._node.loop.call_later(_RETRY_SECONDS, self._send_answer, client, data, until)
                return
            if not there:
                _LOG.warning("%s: an answer could not be sent: the client is not seen to listen", self._name)
                return
            if len(self._reachable) > 1000:
                self._reachable.clear()
            self._reachable.add(client)
        self._writer.write(data)

    def _client_listens(self, client: int) -> bool | None:
        """Whether the reader of a client is there; None: nothing of the client is."""
        writer = graph.matched_writer(self._reader._ref, client)
        if writer is None:
            return None
        id = writer.user_data.get("clientid")
        if id is None:
            return True
        readers = (graph.matched_reader(self._writer.handle, handle) for handle in self._writer.matched_readers())
        return any(end is not None and end.user_data.get("clientid") == id for end in readers)
