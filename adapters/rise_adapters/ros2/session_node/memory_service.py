"""The service `rise/get_memory`: what the working memory holds under one key."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from typing import Any

from rise_adapters.ros2.session_node.record_topics import encode_json
from rise_adapters.ros2.transport.port import Message, PortError, SendReply, Transport
from rise_engine.expression import lookup
from rise_engine.kernel.view import MemoryView
from rise_engine.server.hub import SessionHub

_LOG = logging.getLogger(__name__)

GET_MEMORY, GET_MEMORY_TYPE = "rise/get_memory", "rise_interfaces/srv/GetMemory"


class MemoryService:
    """Answers from the view of the session, so it never waits for the engine."""

    def __init__(self, transport: Transport, hub: SessionHub) -> None:
        """Raises PortError when the transport does not have the type."""
        self._hub = hub
        self._service = transport.serve(GET_MEMORY, GET_MEMORY_TYPE, self._answer)

    def close(self) -> None:
        self._service.close()

    def _answer(self, request: Message, reply: SendReply) -> None:
        found, value = lookup(_MemoryValues(self._hub.view.memory), request["request_by_key"])
        answer: Message = {"found": False}
        if found:
            answer = {"found": True, "value": encode_json(value), "type": _json_type(value)}
        try:
            reply(answer)
        except PortError as error:
            _LOG.warning("a request for the memory could not be answered: %s", error)


class _MemoryValues(Mapping[str, Any]):
    """The memory as the expression language sees it: keys and plain values."""

    def __init__(self, memory: Mapping[str, MemoryView]) -> None:
        self._memory = memory

    def __getitem__(self, key: str) -> Any:
        return self._memory[key].value

    def __contains__(self, key: object) -> bool:
        return key in self._memory

    def __iter__(self) -> Iterator[str]:
        return iter(self._memory)

    def __len__(self) -> int:
        return len(self._memory)


def _json_type(value: object) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return "boolean"
        case int() | float():
            return "number"
        case str():
            return "string"
        case list() | tuple():
            return "array"
        case _:
            return "object"
