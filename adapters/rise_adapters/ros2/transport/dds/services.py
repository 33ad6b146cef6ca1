"""Services on DDS, as in rmw_cyclonedds: a topic for requests and one for replies. Every message begins with its
client's id and a number. Ids in the user data show which writers and readers belong together."""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable
from typing import Any

from rise_adapters.ros2.transport.dds import graph, names
from rise_adapters.ros2.transport.dds.node import DdsNode
from rise_adapters.ros2.transport.port import Message, QoS, SendReply

_HEADER = struct.Struct("<Qq")
_BODY = 4 + _HEADER.size
_QOS = QoS(depth=1000)
"""For requests and replies. ROS has a depth of 10; this affects only this side's memory."""
_UNANSWERED = 10_000
"""The most requests that wait for answers; beyond this, the oldest is forgotten."""
_ANSWER_KEPT_SECONDS = 1.0
"""Seconds that an answer is kept for a client whose reader is not visible yet."""
_RETRY_SECONDS = 0.005
_LOG = logging.getLogger(__name__)


class DdsClient:
    """Implements `port.ServiceClient`."""

    def __init__(self, node: DdsNode, name: str, type: str) -> None:
        """`name`: the full name. Raises PortError like `DdsNode.open_writer`."""
        self._node = node
        self._request = node.types.codec(f"{type}_Request")
        self._response = node.types.codec(f"{type}_Response")
        self._waiting: dict[int, Callable[[Message], None]] = {}
        self._number = 0
        self._matched_handles: tuple[list[int], list[int]] | None = None
        """The other ends at the last check, if all of them were known."""
        self._count = 0
        ids = {"clientid": node.new_service_id()}
        self._reader = node.open_reader(names.reply_topic(name), self._response.type, _QOS, self._on_sample, ids)
        self._writer = node.open_writer(names.request_topic(name), self._request.type, _QOS, ids)

    def count_servers(self) -> int:
        handles = taking, answering = self._writer.matched_readers(), self._reader.matched_writers()
        if handles != self._matched_handles:
            takers = [graph.find_matched_reader(self._writer.handle, handle) for handle in taking]
            answerers = [graph.find_matched_writer(self._reader.handle, handle) for handle in answering]
            self._count = _count_pairs(
                _list_service_ids(takers, self._request.type), _list_service_ids(answerers, self._response.type)
            )
            # This is called before each goal, and rarely changes. Unknown ends are looked up again.
            self._matched_handles = handles if None not in (*takers, *answerers) else None
        return self._count

    def call(self, request: Message, on_response: Callable[[Message], None]) -> None:
        self._number += 1
        data = self._request.pack(request, _HEADER.pack(self._writer.instance, self._number))
        if len(self._waiting) >= _UNANSWERED:
            del self._waiting[next(iter(self._waiting))]
        self._waiting[self._number] = on_response
        self._writer.write(data)

    def close(self) -> None:
        self._waiting.clear()
        self._node.release(self._writer, self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if not info.valid_data or len(data) < _BODY:
            return
        client, number = _HEADER.unpack_from(data, 4)
        if client == self._writer.instance and (on_response := self._waiting.pop(number, None)):
            on_response(self._response.unpack(data, _BODY))


def _list_service_ids(ends: list[graph.DdsEndpoint | None], type: str) -> list[str]:
    """The service ids of the ends with this type. Types with one structure match each other, whatever their names."""
    return [end.user_data.get("serviceid", "") for end in ends if end and end.is_cyclone and end.type == type]


def _count_pairs(takers: list[str], answerers: list[str]) -> int:
    """The number of servers that these ends form, by their ids. Ends without an id count as pairs."""
    return len({*takers} & {*answerers} - {""}) + min(takers.count(""), answerers.count(""))


class DdsServer:
    """Serves one service."""

    def __init__(self, node: DdsNode, name: str, type: str, on_request: Callable[[Message, SendReply], None]) -> None:
        """Like `DdsClient`."""
        self._node = node
        self._name = name
        self._request = node.types.codec(f"{type}_Request")
        self._response = node.types.codec(f"{type}_Response")
        self._on_request = on_request
        self._reachable: set[int] = set()
        """Writers of requests (by handle) whose readers of replies have been seen."""
        ids = {"serviceid": node.new_service_id()}
        self._writer = node.open_writer(names.reply_topic(name), self._response.type, _QOS, ids)
        self._reader = node.open_reader(names.request_topic(name), self._request.type, _QOS, self._on_sample, ids)

    def close(self) -> None:
        self._node.release(self._writer, self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if not info.valid_data or len(data) < _BODY:
            return
        head, client = data[4:_BODY], info.publication_handle
        answered = False

        def reply(response: Message) -> None:
            nonlocal answered
            if not answered and self._reader.is_open:
                answer = self._response.pack(response, head)
                answered = True
                self._send_answer(client, answer, self._node.loop.time() + _ANSWER_KEPT_SECONDS)

        self._on_request(self._request.unpack(data, _BODY), reply)

    def _send_answer(self, client: int, data: bytes, until: float) -> None:
        """Send an answer once its client's reader is known; before that DDS would drop it."""
        if not self._reader.is_open:
            return
        if client not in self._reachable:
            listens = self._client_listens(client)
            if listens is None:
                return
            if not listens and self._node.loop.time() < until:
                self._node.loop.call_later(_RETRY_SECONDS, self._send_answer, client, data, until)
                return
            if not listens:
                _LOG.warning("%s: an answer could not be sent: the client is not seen to listen", self._name)
                return
            if len(self._reachable) > 1000:
                self._reachable.clear()
            self._reachable.add(client)
        self._writer.write(data)

    def _client_listens(self, client: int) -> bool | None:
        """Whether the reader of a client is there; None: no part of the client is."""
        writer = graph.find_matched_writer(self._reader.handle, client)
        if writer is None:
            return None
        id = writer.user_data.get("clientid")
        if id is None:
            return True
        readers = (graph.find_matched_reader(self._writer.handle, handle) for handle in self._writer.matched_readers())
        return any(end is not None and end.user_data.get("clientid") == id for end in readers)
