"""A transport that can be cut, for what is simulated to vanish: then it says and hears nothing any more, not even that
it ends, while the node itself lives on."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rise_adapters.ros2.port import (
    RELIABLE,
    Client,
    End,
    Handle,
    Message,
    Publisher,
    QoS,
    Reply,
    Subscription,
    Transport,
)


class CuttableTransport:
    """Implements `rise_adapters.ros2.port.Transport` over another one, which it does not close."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._open: set[Handle] = set()
        self.cut_off = False
        self.kind, self.about, self.node = transport.kind, transport.about, transport.node
        self.vendor = transport.vendor

    def cut(self) -> None:
        """Take back everything that was offered, without a word."""
        self.cut_off = True
        for handle in tuple(self._open):
            self.drop(handle)

    def drop(self, handle: Handle) -> None:
        if handle in self._open:
            self._open.remove(handle)
            handle.close()

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> Publisher:
        publisher = self._transport.publisher(topic, type, qos)
        self._open.add(publisher)
        return _Publisher(self, publisher)

    def subscribe(self, topic: str, type: str, taken: Callable[[Message], None], qos: QoS = RELIABLE) -> Subscription:
        subscription = self._transport.subscribe(topic, type, taken, qos)
        self._open.add(subscription)
        return _Subscription(self, subscription)

    def serve(self, name: str, type: str, asked: Callable[[Message, Reply], None]) -> Handle:
        def heard(request: Message, reply: Reply) -> None:
            if not self.cut_off:
                asked(request, lambda message: None if self.cut_off else reply(message))

        return self._handle(self._transport.serve(name, type, heard))

    def client(self, name: str, type: str) -> Client:
        client = self._transport.client(name, type)
        self._open.add(client)
        return client

    def _handle(self, handle: Handle) -> Handle:
        self._open.add(handle)
        return _Handle(self, handle)

    def resolve(self, name: str) -> str:
        return self._transport.resolve(name)

    def fields(self, type: str) -> Mapping[str, str]:
        return self._transport.fields(type)

    def type_hash(self, type: str) -> str:
        return self._transport.type_hash(type)

    def publisher_ends(self, topic: str) -> list[End]:
        return self._transport.publisher_ends(topic)

    def subscriber_ends(self, topic: str) -> list[End]:
        return self._transport.subscriber_ends(topic)

    def server_ends(self, service: str) -> list[End]:
        return self._transport.server_ends(service)

    def topics(self) -> list[str]:
        return self._transport.topics()

    def strangers(self) -> list[tuple[str, str]]:
        return self._transport.strangers()

    def nodes(self) -> list[str]:
        return self._transport.nodes()

    def clients_of(self, service: str) -> list[str]:
        return self._transport.clients_of(service)

    def lost(self) -> str:
        return self._transport.lost()

    def close(self) -> None:
        self.cut()


class _Handle:
    def __init__(self, home: CuttableTransport, handle: Handle) -> None:
        self._home, self._handle = home, handle

    def close(self) -> None:
        self._home.drop(self._handle)


class _Subscription(_Handle):
    def __init__(self, home: CuttableTransport, subscription: Subscription) -> None:
        super().__init__(home, subscription)
        self._subscription = subscription

    def publishers(self) -> int:
        return 0 if self._home.cut_off else self._subscription.publishers()


class _Publisher(_Handle):
    def __init__(self, home: CuttableTransport, publisher: Publisher) -> None:
        super().__init__(home, publisher)
        self._publisher = publisher

    def publish(self, message: Message) -> None:
        if not self._home.cut_off:
            self._publisher.publish(message)

    def subscribers(self) -> int:
        return 0 if self._home.cut_off else self._publisher.subscribers()
