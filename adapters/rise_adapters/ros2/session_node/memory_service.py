"""The service `rise/get_memory`: what the working memory holds under one key."""

from __future__ import annotations

import logging

from rise_adapters.ros2.transport.port import Message, PortError, SendReply, Transport
from rise_engine.base.json_codec import encode
from rise_engine.expression import lookup
from rise_engine.privacy.private_values import PrivateValues
from rise_engine.run.server.hub import SessionHub

_LOG = logging.getLogger(__name__)

GET_MEMORY, GET_MEMORY_TYPE = "rise/get_memory", "rise_interfaces/srv/GetMemory"
_JSON_TYPES = {"{": "object", "[": "array", '"': "string", "t": "boolean", "f": "boolean", "n": "null"}
"""By the first character of a value in JSON; all others begin a number."""


class MemoryService:
    """Answers from the view of the session, so it never waits for the engine."""

    def __init__(self, transport: Transport, hub: SessionHub, private: PrivateValues) -> None:
        """`private`: of what is in it, `{key}` is all that anybody gets. Raises PortError when the transport does not
        have the type."""
        self._private = private
        self._hub = hub
        self._service = transport.serve(GET_MEMORY, GET_MEMORY_TYPE, self._take_request)

    def close(self) -> None:
        self._service.close()

    def _take_request(self, request: Message, reply: SendReply) -> None:
        memory = self._hub.engine.scenario.table_memory
        memory.update((key, entry.value) for key, entry in self._hub.view.memory.items())
        found, value = lookup(memory, request["request_by_key"])
        response: Message = {"found": found}
        if found:
            value = self._private.read(request["request_by_key"], value)
            text = encode(value).decode()
            response |= {"value": text, "type": _JSON_TYPES.get(text[0], "number")}
        try:
            reply(response)
        except PortError as error:
            _LOG.warning("a request for the memory could not be answered: %s", error)
