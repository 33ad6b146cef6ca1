"""A service call of a simulated action: like a goal that cannot be cancelled and sends no feedback."""

from __future__ import annotations

from itertools import count

from rise_adapters.ros2.transport.port import Message, SendReply

_numbers = count(1)


class ServiceCall:
    """One request. The first answer counts."""

    def __init__(self, message: Message, reply: SendReply) -> None:
        self.message = message
        self.id = next(_numbers).to_bytes(16, "big")
        self.data: object = None
        self._reply = reply

    def accept(self) -> None:
        """Do nothing: a service does not report this."""

    def execute(self) -> None:
        """Do nothing: a service does not report this."""

    def publish_feedback(self, message: Message) -> None:
        """Do nothing: a service sends no feedback."""

    def succeed(self, result: Message) -> None:
        self._reply(result)

    abort = cancel = succeed
