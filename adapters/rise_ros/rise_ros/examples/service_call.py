"""A call of a service, as a simulated action does it: like a goal that cannot be canceled, and sends no feedback."""

from __future__ import annotations

from itertools import count

from rise_adapters.ros2.transport.port import Message, SendReply

_numbers = count(1)


class ServiceCall:
    """One request; the first answer counts."""

    def __init__(self, message: Message, reply: SendReply) -> None:
        self.message = message
        self.id = next(_numbers).to_bytes(16, "big")
        self.data: object = None
        self._reply = reply

    def accept(self) -> None:
        """Nothing is said of that."""

    def execute(self) -> None:
        """Nor of that."""

    def publish_feedback(self, message: Message) -> None:
        """Nor of that."""

    def succeed(self, result: Message) -> None:
        self._reply(result)

    abort = cancel = succeed
