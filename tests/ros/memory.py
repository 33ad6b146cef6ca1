"""A wire in memory: services, topics with latching, several nodes, presence, and every fault on request.

    wire = MemoryWire()
    robot = MemoryTransport(wire, loop, node="/robot")
    engine = MemoryTransport(wire, loop, node="/engine")

Everything is delivered through `loop.call_soon`, never inside a call. `loop` is an asyncio loop, or a `ClockLoop`, on
which all that happens belongs to a virtual clock and nothing ever waits in earnest.

Faults are rules by name (`fnmatch` patterns of full names): `wire.drop("*/send_goal", what="reply", times=1)`,
`delay`, `duplicate`, `hold` (until `rule.release()`). A node that is `kill`ed says no goodbye: it sends and hears
nothing any more, but the others still see it until `wire.forget(node)`, as with a DDS lease. `wire.heal(node)` undoes
both. A transport that is made afterwards under the same name is another one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from fnmatch import fnmatchcase
from functools import partial
from itertools import count
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

from rise_adapters.ros2.transport.port import (
    RELIABLE,
    Message,
    PortError,
    QoS,
    RemoteEndpoint,
    SendReply,
)

from rise_engine.run.engine.clock import VirtualClock
from tests.ros.definitions import Definitions, copied

What: TypeAlias = Literal["request", "reply", "message", "any"]


class Loop(Protocol):
    """The part of an asyncio loop that the wire needs."""

    def call_soon(self, callback: Callable[..., object], *args: Any) -> object: ...

    def call_later(self, delay: float, callback: Callable[..., object], *args: Any) -> object: ...


class ClockLoop:
    """A loop that is nothing but a clock: what it is given runs when somebody advances a `VirtualClock`."""

    def __init__(self, clock: VirtualClock) -> None:
        self.clock = clock

    def run_until(self, when: float) -> None:
        """Let time pass until then, if it is not over, and run everything that is due."""
        when = round(max(when, self.clock.now()), 6)
        self.clock.call_at(when, lambda: None)  # or time would end with the last timer
        while (due := self.clock.next_at) is not None and due <= when:
            self.clock.advance()

    def stand_still(self, seconds: float) -> None:
        """Be blocked for so long, while everything else goes on, and run what is due then. Time is wrong afterwards."""
        now = self.clock.now
        self.clock.now = lambda: now() + seconds  # type: ignore[method-assign]
        for _ in range(60):
            self.clock.advance()

    def call_soon(self, callback: Callable[..., object], *args: Any) -> object:
        return self.call_later(0.0, callback, *args)

    def call_later(self, delay: float, callback: Callable[..., object], *args: Any) -> object:
        def run() -> None:
            callback(*args)

        return self.clock.call_at(self.clock.now() + delay, run)


class Sent(NamedTuple):
    """One message as it was given to the wire, whatever became of it."""

    what: str
    name: str
    node: str
    message: Message


class Rule:
    """A fault that meets messages by name."""

    def __init__(self, wire: MemoryWire, kind: str, name: str, what: What, times: int | None, **more: Any) -> None:
        self._wire = wire
        self.kind = kind
        self.name = name
        self.what = what
        self.left = times
        self.more = more
        self.met = 0
        """How many messages it has hit."""
        self.held: list[Callable[[], object]] = []

    def hits(self, what: str, name: str) -> bool:
        if self.left == 0 or self.what not in ("any", what) or not fnmatchcase(name, self.name):
            return False
        self.met += 1
        if self.left is not None:
            self.left -= 1
        return True

    def stop(self) -> None:
        """From now on it meets nothing. What it holds stays held."""
        self.left = 0

    def release(self) -> None:
        """Let go, in order, of what is held, and hold nothing more."""
        self.stop()
        held, self.held = self.held, []
        for deliver in held:
            deliver()


class MemoryWire:
    """What all nodes share."""

    def __init__(self, definitions: Mapping[str, Mapping[str, str]] | None = None) -> None:
        """`definitions`: further message types, by full name: field -> type."""
        self.types = Definitions(definitions or {})
        self.transports: list[MemoryTransport] = []
        self.programs = count(1)
        self.rules: list[Rule] = []
        self.sent: list[Sent] = []
        """Everything that was ever sent, in order."""
        self.killed: set[MemoryTransport] = set()
        self.forgotten: set[MemoryTransport] = set()
        self.first_answer_only = False
        """As the real transports: of several servers that answer one request, the first counts."""

    # --- faults ---

    def drop(self, name: str, *, what: What = "any", times: int | None = None) -> Rule:
        """Lose messages."""
        return self._rule("drop", name, what, times)

    def delay(self, name: str, seconds: float, *, what: What = "any", times: int | None = None) -> Rule:
        """Deliver them later; those behind overtake them."""
        return self._rule("delay", name, what, times, seconds=seconds)

    def duplicate(self, name: str, copies: int = 1, *, what: What = "any", times: int | None = None) -> Rule:
        """Deliver them `copies` times more often. (Of a reply: `answer` is called again.)"""
        return self._rule("duplicate", name, what, times, copies=copies)

    def hold(self, name: str, *, what: What = "any", times: int | None = None) -> Rule:
        """Keep them until `release()`."""
        return self._rule("hold", name, what, times)

    def _rule(self, kind: str, name: str, what: What, times: int | None, **more: Any) -> Rule:
        rule = Rule(self, kind, name, what, times, **more)
        self.rules.append(rule)
        return rule

    def kill(self, node: str | MemoryTransport) -> None:
        """Cut off this node, or all of this name, without a goodbye: SIGKILL, a cable. The others still see it, until
        `forget`."""
        self.killed |= set(self._named(node))

    def forget(self, node: str | MemoryTransport) -> None:
        """The others notice that the node is gone, and it sees nobody else."""
        self.kill(node)
        self.forgotten |= set(self._named(node))

    def heal(self, node: str | MemoryTransport) -> None:
        """The link is back. What was latched meanwhile arrives."""
        healed = set(self._named(node)) & self.killed
        self.killed -= healed
        self.forgotten -= healed
        for one in self.transports:
            for other in self.transports:
                if one is not other and healed & {one, other} and self.reaches(one, other):
                    for publisher in one.publishers:
                        for subscription in other.subscriptions:
                            publisher.greet(subscription)

    def _named(self, node: str | MemoryTransport) -> list[MemoryTransport]:
        return [transport for transport in self.transports if node in (transport, transport.node)]

    # --- what was sent ---

    def messages(self, name: str, what: What = "any") -> list[Message]:
        """What was sent under a name (pattern), in order."""
        return [s.message for s in self.sent if fnmatchcase(s.name, name) and what in ("any", s.what)]

    # --- for the transports ---

    def sees(self, one: MemoryTransport, other: MemoryTransport) -> bool:
        """Whether `one` believes that `other` is there."""
        if other.closed or other.why_lost:
            return False
        return one is other or not (one in self.forgotten or other in self.forgotten)

    def reaches(self, one: MemoryTransport, other: MemoryTransport) -> bool:
        """Whether a message would really arrive."""
        if one.closed or one.why_lost or other.closed or other.why_lost:
            return False
        return one is other or not (one in self.killed or other in self.killed)

    def carry(self, what: str, name: str, target: MemoryTransport, deliver: Callable[[], None]) -> None:
        """Bring one message to one receiver, or let it meet its fault."""
        soon = partial(target.loop.call_soon, deliver)
        for rule in self.rules:
            if not rule.hits(what, name):
                continue
            if rule.kind == "drop":
                return
            if rule.kind == "delay":
                target.loop.call_later(rule.more["seconds"], deliver)
                return
            if rule.kind == "hold":
                rule.held.append(soon)
                return
            for _ in range(rule.more["copies"]):
                soon()
        soon()


class _Subscription:
    def __init__(self, home: MemoryTransport, topic: str, type: str, on_message: Callable[[Message], None], qos: QoS):
        self.home, self.topic, self.type, self.on_message, self.qos = home, topic, type, on_message, qos
        self.open = True

    def take(self, source: MemoryTransport, message: Message) -> None:
        if self.open and self.home.wire.reaches(source, self.home):
            self.on_message(copied(message))

    def count_publishers(self) -> int:
        wire, home = self.home.wire, self.home
        return sum(p.matches(self) for t in wire.transports if wire.sees(home, t) for p in t.publishers)

    def close(self) -> None:
        self.open = False
        if self in self.home.subscriptions:
            self.home.subscriptions.remove(self)


class _Publisher:
    def __init__(self, home: MemoryTransport, topic: str, type: str, qos: QoS) -> None:
        self.home, self.topic, self.type, self.qos = home, topic, type, qos
        self.last: deque[Message] = deque(maxlen=max(1, qos.depth))
        self.open = True

    def publish(self, message: Message) -> None:
        home = self.home
        home._check()
        if not self.open:
            raise PortError(f"the publisher of {self.topic} is closed")
        whole = home.wire.types.complete(self.type, message)
        home.wire.sent.append(Sent("message", self.topic, home.node, whole))
        if self.qos.latched:
            self.last.append(whole)
        for subscription in self._takers():
            if home.wire.reaches(home, subscription.home):
                self._send(subscription, whole)

    def _send(self, subscription: _Subscription, message: Message) -> None:
        deliver = partial(subscription.take, self.home, message)
        self.home.wire.carry("message", self.topic, subscription.home, deliver)

    def _takers(self) -> list[_Subscription]:
        return [s for t in self.home.wire.transports for s in t.subscriptions if self.matches(s)]

    def matches(self, subscription: _Subscription) -> bool:
        """As DDS matches: same name, same type, and nothing asked for that is not offered."""
        mine, theirs = self.qos, subscription.qos
        return (
            (self.topic, self.type) == (subscription.topic, subscription.type)
            and (mine.reliable or not theirs.reliable)
            and (mine.latched or not theirs.latched)
        )

    def greet(self, subscription: _Subscription) -> None:
        """A late joiner gets what is latched."""
        if subscription.qos.latched and self.matches(subscription):
            for message in tuple(self.last)[-subscription.qos.depth :]:
                self._send(subscription, message)

    def count_subscribers(self) -> int:
        return sum(self.home.wire.sees(self.home, s.home) for s in self._takers())

    def close(self) -> None:
        self.open = False
        if self in self.home.publishers:
            self.home.publishers.remove(self)


class _Server:
    def __init__(
        self, home: MemoryTransport, name: str, type: str, on_request: Callable[[Message, SendReply], None]
    ) -> None:
        self.home, self.name, self.type, self.on_request = home, name, type, on_request
        self.open = True

    def take(self, client: _Client, call: _Call, request: Message) -> None:
        home = self.home
        if not self.open or not home.wire.reaches(client.home, home):
            return
        answered = False

        def reply(message: Message) -> None:
            nonlocal answered
            if answered or not self.open or home.closed:
                return
            answered = True
            home._check()
            whole = home.wire.types.complete(f"{self.type}_Response", message)
            home.wire.sent.append(Sent("reply", self.name, home.node, whole))
            if home.wire.reaches(home, client.home):
                home.wire.carry("reply", self.name, client.home, partial(client.take, home, call, whole))

        self.on_request(copied(request), reply)

    def close(self) -> None:
        self.open = False
        if self in self.home.servers:
            self.home.servers.remove(self)


class _Call:
    def __init__(self, on_response: Callable[[Message], None]) -> None:
        self.on_response = on_response
        self.answered = False


class _Client:
    def __init__(self, home: MemoryTransport, name: str, type: str) -> None:
        self.home, self.name, self.type = home, name, type
        self.open = True

    def _offers(self) -> list[_Server]:
        name, type = self.name, self.type
        return [s for t in self.home.wire.transports for s in t.servers if s.name == name and s.type == type]

    def count_servers(self) -> int:
        home = self.home
        if home.closed or home.why_lost:
            return 0
        return len([server for server in self._offers() if home.wire.sees(home, server.home)])

    def call(self, request: Message, on_response: Callable[[Message], None]) -> None:
        home = self.home
        home._check()
        if not self.open:
            raise PortError(f"the client of {self.name} is closed")
        whole = home.wire.types.complete(f"{self.type}_Request", request)
        home.wire.sent.append(Sent("request", self.name, home.node, whole))
        call = _Call(on_response)
        for server in self._offers():
            if home.wire.reaches(home, server.home):
                home.wire.carry("request", self.name, server.home, partial(server.take, self, call, whole))

    def take(self, server: MemoryTransport, call: _Call, message: Message) -> None:
        if self.open and self.home.wire.reaches(server, self.home):
            if call.answered and self.home.wire.first_answer_only:
                return
            call.answered = True
            call.on_response(copied(message))

    def close(self) -> None:
        self.open = False
        if self in self.home.clients:
            self.home.clients.remove(self)


class MemoryTransport:
    """One node on a `MemoryWire`; implements `rise_adapters.ros2.transport.port.Transport`."""

    kind: Literal["rclpy", "dds", "memory"] = "memory"

    def __init__(
        self, wire: MemoryWire, loop: Loop, node: str = "/rise/engine", remaps: Mapping[str, str] | None = None
    ) -> None:
        self.wire = wire
        self.loop = loop
        self.node = node if node.startswith("/") else f"/{node}"
        self.about = f"in memory, node {self.node}"
        self.vendor = "0110"
        self.hashes: dict[str, str] = {}
        """What it announces instead of the type's own hash, and takes for that: of another version of it."""
        self.why_lost = ""
        self.closed = False
        self.program = f"program {next(wire.programs):04}".encode()
        """As `RemoteEndpoint.program`."""
        self._remaps = {self._full(a): self._full(b) for a, b in (remaps or {}).items()}
        self.publishers: list[_Publisher] = []
        self.subscriptions: list[_Subscription] = []
        self.servers: list[_Server] = []
        self.clients: list[_Client] = []
        wire.transports.append(self)

    # --- the port ---

    def resolve(self, name: str) -> str:
        full = self._full(name)
        return self._remaps.get(full, full)

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> _Publisher:
        self._check()
        made = _Publisher(self, self.resolve(topic), type, qos)
        self.publishers.append(made)
        return made

    def subscribe(
        self,
        topic: str,
        type: str,
        on_message: Callable[[Message], None],
        qos: QoS = RELIABLE,
        pause: float = 0.0,
    ) -> _Subscription:
        self._check()
        made = _Subscription(self, self.resolve(topic), type, on_message, qos)
        self.subscriptions.append(made)
        for transport in self.wire.transports:
            for publisher in transport.publishers:
                if self.wire.reaches(transport, self):
                    publisher.greet(made)
        return made

    def serve(self, name: str, type: str, on_request: Callable[[Message, SendReply], None]) -> _Server:
        self._check()
        made = _Server(self, self.resolve(name), type, on_request)
        self.servers.append(made)
        return made

    def client(self, name: str, type: str) -> _Client:
        self._check()
        made = _Client(self, self.resolve(name), type)
        self.clients.append(made)
        return made

    def fields(self, type: str) -> Mapping[str, str]:
        return self.wire.types.fields(type)

    def type_hash(self, type: str) -> str:
        return self.hashes[type] if type in self.hashes else self.wire.types.hash(type)

    def graph_version(self) -> None:
        return None

    def publisher_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        full = self.resolve(topic)
        return [t.end(p.type, p.qos) for t in self._others() for p in t.publishers if p.topic == full]

    def subscriber_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        full = self.resolve(topic)
        return [t.end(s.type, s.qos) for t in self._others() for s in t.subscriptions if s.topic == full]

    def server_endpoints(self, service: str) -> list[RemoteEndpoint]:
        full = self.resolve(service)
        return [
            t.end(f"{server.type}_{end}", RELIABLE)
            for t in self._others()
            for server in t.servers
            if server.name == full
            for end in ("Request", "Response")
        ]

    def topics(self, ending: str = "") -> list[str]:
        found = {each.topic for t in self._others() for each in (*t.publishers, *t.subscriptions)}
        return sorted(topic for topic in found if topic.endswith(ending))

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        return [(t.node, t.vendor) for t in self._others() if t.vendor != self.vendor]

    def _others(self) -> list[MemoryTransport]:
        return [t for t in self.wire.transports if t is not self and self.wire.sees(self, t)]

    def end(self, type: str, qos: QoS) -> RemoteEndpoint:
        """One of this node's, as others see it."""
        return RemoteEndpoint(self.node, type, self.type_hash(type), self.vendor, qos, self.program)

    def nodes(self) -> list[str]:
        return sorted(t.node for t in self.wire.transports if self.wire.sees(self, t))

    def client_nodes(self, service: str) -> list[str]:
        full = self.resolve(service)
        others = [t for t in self.wire.transports if t is not self and self.wire.sees(self, t)]
        return sorted({t.node for t in others for client in t.clients if client.name == full})

    def failure(self) -> str:
        return self.why_lost

    def close(self) -> None:
        """With a goodbye: the others notice at once."""
        self.closed = True
        self.publishers.clear()
        self.subscriptions.clear()
        self.servers.clear()
        if self in self.wire.transports:
            self.wire.transports.remove(self)

    # --- for tests ---

    def break_down(self, why: str = "the middleware was shut down") -> None:
        """The middleware under this node is gone; the transport notices."""
        self.why_lost = why

    # --- small things ---

    def _check(self) -> None:
        if self.closed:
            raise PortError("the transport is closed")
        if self.why_lost:
            raise PortError(self.why_lost)

    def _full(self, name: str) -> str:
        if name.startswith("/"):
            return name
        if name.startswith("~/"):
            return f"{self.node}/{name[2:]}"
        return f"{self.node.rpartition('/')[0]}/{name}"
