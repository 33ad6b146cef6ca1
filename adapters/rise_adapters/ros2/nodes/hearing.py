"""Hearing a topic that somebody else publishes, and saying so when nothing can come: ROS itself says nothing then."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from rise_adapters.ros2.port import SENSOR, Handle, Message, Transport

PATIENCE = 5.0
"""Seconds until it is said that nobody publishes."""


def hear(
    transport: Transport,
    topic: str,
    type: str,
    taken: Callable[[Message], None],
    *,
    say: Callable[[str], object] = print,
    patience: float = PATIENCE,
) -> Heard:
    """Have `taken` called with every message on `topic`, whatever its publishers promise about delivery.

    After `patience` seconds without a message, `say` gets a sentence about what is in the way: nobody publishes, or
    somebody publishes another type; then again when that changes. Raises PortError.
    """
    return Heard(transport, topic, type, taken, say, patience)


class Heard:
    """A topic that is heard."""

    def __init__(
        self,
        transport: Transport,
        topic: str,
        type: str,
        taken: Callable[[Message], None],
        say: Callable[[str], object],
        patience: float,
    ) -> None:
        self._transport, self._topic, self._type = transport, transport.resolve(topic), type
        self._taken, self._say, self._patience = taken, say, patience
        self._said = ""
        self._came = False
        self._handle: Handle = transport.subscribe(topic, type, self._take, SENSOR)
        self._timer = asyncio.get_running_loop().call_later(patience, self._look)

    def close(self) -> None:
        self._timer.cancel()
        self._handle.close()

    def _take(self, message: Message) -> None:
        self._came = True
        self._taken(message)

    def _look(self) -> None:
        if self._came:
            return  # it works; one that falls silent later has nothing to say
        if self._transport.lost():
            return
        trouble = trouble_with(self._topic, self._type, self._transport.remote_types(self._topic))
        if trouble != self._said:
            self._said = trouble
            if trouble:
                self._say(trouble)
        self._timer = asyncio.get_running_loop().call_later(self._patience, self._look)


def trouble_with(topic: str, type: str, published: Sequence[tuple[str, str]]) -> str:
    """Why nothing can come on a topic; empty when something can. `published`: as `Transport.remote_types`."""
    others = sorted({each for each, _ in published} - {type})
    if not published:
        return f"nobody publishes on {topic} (yet); is its node running, and is the topic called so?"
    if any(each == type for each, _ in published):
        return ""
    return f"{', '.join(others)} is published on {topic}, and this node hears {type}: nothing of it arrives"
