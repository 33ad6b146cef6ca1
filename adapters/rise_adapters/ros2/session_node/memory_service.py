"""The service `rise/get_memory`: what the working memory holds under one key."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from typing import Any

from rise_adapters.ros2.face.record_topics import as_json
from rise_adapters.ros2.port import Message, PortError, Reply, Transport
from rise_engine.expression import lookup
from rise_engine.link.room import Room
from rise_engine.view import MemoryView

_LOG = logging.getLogger(__name__)

GET_MEMORY, GET_MEMORY_TYPE = "rise/get_memory", "rise_interfaces/srv/GetMemory"


class MemoryService:
    """Answers from the view of the session, so it never waits for the engine."""

    def __init__(self, transport: Transport, room: Room) -> None:
        """Raises PortError when the transport does not have the type."""
        self._room = room
        self._service = transport.serve(GET_MEMORY, GET_MEMORY_TYPE, self._answer)

    def close(self) -> None:
        self._service.close()

    def _answer(self, request: Message, reply: Reply) -> None:
        found, value = lookup(_MemoryValues(self._room.view.memory), request["request_by_key"])
        answer: Message = {"found": False}
        if found:
            answer = {"found": True, "value": as_json(value), "type": _json_type(value)}
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
