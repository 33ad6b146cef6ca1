"""A process with one transport, that does what its standard input says: `python -m tests.ros.contract.peer rclpy NODE`.

Each line is a request, `{"id": 1, "do": "publish", ...}`, answered by `{"id": 1, "is": ...}` or
`{"id": 1, "error": ...}`; what happens meanwhile is said as `{"event": "taken", ...}`. It ends, and closes its
transport, when its input ends or when it is terminated.
"""

from __future__ import annotations

import asyncio
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
from rise_adapters.ros2 import compatibility
from rise_adapters.ros2.actions.client import ALL_GOALS, ActionClient
from rise_adapters.ros2.actions.server import ActionServer, Decide
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.mapping import ActionMapping, GoalDeadlines
from rise_adapters.ros2.mapping.field_sources import MessageSource
from rise_adapters.ros2.parameters import ParameterServices, ReadableParameter
from rise_adapters.ros2.transport.port import Message, PortError, QoS, SendReply, Transport
from rise_adapters.ros2.transport.selection import open_transport
from rise_ros.examples.topic_listener import TopicListener

from rise_engine.run.engine.clock import RealClock

from .lines import decode, encode


class Peer:
    """Its methods are what can be asked for."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._clock = RealClock(asyncio.get_running_loop())
        self._things: dict[str, Any] = {}
        self._replies: dict[int, SendReply] = {}
        self._goals: dict[bytes, ServerGoal] = {}
        self._decides: dict[bytes, Decide] = {}

    # --- the node -------------------------------------------------------------------------------------------------

    def about(self) -> dict[str, Any]:
        transport = self._transport
        return {"kind": transport.kind, "about": transport.about, "node": transport.node, "lost": transport.failure()}

    def resolve(self, name: str) -> str:
        return self._transport.resolve(name)

    def fields(self, type: str) -> dict[str, str]:
        return dict(self._transport.fields(type))

    def type_hash(self, type: str) -> str:
        return self._transport.type_hash(type)

    def ends(self, what: str, name: str) -> list[dict[str, Any]]:
        wire = self._transport
        listed = {
            "publisher": wire.publisher_endpoints,
            "subscriber": wire.subscriber_endpoints,
            "server": wire.server_endpoints,
        }
        return [msgspec.to_builtins(end) for end in listed[what](name)]

    def look(self, name: str, type: str, **qos: dict[str, Any]) -> dict[str, Any]:
        """What `compatibility` says about an action."""
        made: dict[str, Any] = {f"{part}_qos": QoS(**each) for part, each in qos.items()}
        carrier = ActionMapping("action", name, type, GoalDeadlines(feedback=1.0), MessageSource({}), **made)
        found = compatibility.compare(self._transport, carrier)
        return {**msgspec.to_builtins(found), "sentences": [each.sentence for each in found.mismatches]}

    def topics(self) -> list[str]:
        return self._transport.topics()

    def strangers(self) -> list[tuple[str, str]]:
        return self._transport.programs_of_other_vendors()

    def nodes(self) -> list[str]:
        return self._transport.nodes()

    def clients_of(self, service: str) -> list[str]:
        return self._transport.client_nodes(service)

    def close(self, key: str) -> None:
        self._things.pop(key).close()

    def freeze(self, seconds: float) -> None:
        """Keep the loop from doing anything, as a bad callback would."""
        import time

        time.sleep(seconds)

    # --- topics ---------------------------------------------------------------------------------------------------

    def publisher(self, key: str, topic: str, type: str, **qos: Any) -> None:
        self._things[key] = self._transport.publisher(topic, type, QoS(**qos))

    def publish(self, key: str, messages: list[Message]) -> None:
        for message in messages:
            self._things[key].publish(message)

    def subscribers(self, key: str) -> int:
        return int(self._things[key].count_subscribers())

    def subscribe(self, key: str, topic: str, type: str, pause: float = 0.0, **qos: Any) -> None:
        self._things[key] = self._transport.subscribe(
            topic, type, lambda message: say("taken", key=key, message=message), QoS(**qos), pause
        )

    def publishers(self, key: str) -> int:
        return int(self._things[key].count_publishers())

    def hear(self, key: str, topic: str, type: str) -> None:
        """As feature nodes do."""
        self._things[key] = TopicListener(
            self._transport,
            topic,
            type,
            lambda message: say("taken", key=key, message=message),
            report=lambda text: say("says", key=key, text=text),
            patience=1.0,
        )

    def parameters(self, **settings: Any) -> None:
        ParameterServices(self._transport, lambda: {name: ReadableParameter(value) for name, value in settings.items()})

    # --- services -------------------------------------------------------------------------------------------------

    def serve(self, key: str, name: str, type: str, answer: Message | None = None) -> None:
        """Answer at once with `answer`; without one, when told to."""

        def asked(request: Message, reply: SendReply) -> None:
            number = len(self._replies)
            self._replies[number] = reply
            say("asked", key=key, number=number, message=request)
            if answer is not None:
                reply(answer)

        self._things[key] = self._transport.serve(name, type, asked)

    def reply(self, number: int, message: Message) -> None:
        self._replies[number](message)

    def client(self, key: str, name: str, type: str) -> None:
        self._things[key] = self._transport.client(name, type)

    def servers(self, key: str) -> int:
        return int(self._things[key].count_servers())

    def call(self, key: str, number: int, message: Message) -> None:
        self._things[key].call(message, lambda answer: say("answer", key=key, number=number, message=answer))

    # --- actions --------------------------------------------------------------------------------------------------

    def action_server(self, key: str, name: str, type: str) -> None:
        def wanted(goal: ServerGoal) -> None:
            self._goals[goal.id] = goal
            say("wanted", key=key, goal=goal.id, message=goal.message)

        def cancel(goal: ServerGoal, decide: Decide) -> None:
            self._decides[goal.id] = decide
            say("cancel", key=key, goal=goal.id)

        self._things[key] = ActionServer(self._transport, name, type, wanted, cancel, clock=self._clock)

    def goal(self, goal: bytes, does: str, message: Message | None = None) -> bool:
        method: Callable[..., bool] = getattr(self._goals[goal], does)
        return method() if message is None else method(message)

    def decide(self, goal: bytes, yes: bool) -> None:
        self._decides[goal](yes)

    def action_client(self, key: str, name: str, type: str) -> None:
        client = self._things[key] = ActionClient(self._transport, name, type)
        client.on_feedback = lambda goal, message: say("feedback", key=key, goal=goal, message=message)

    def send(self, key: str, goal: bytes, message: Message) -> None:
        self._things[key].send(goal, message, lambda accepted: say("decided", key=key, goal=goal, accepted=accepted))

    def get_result(self, key: str, goal: bytes) -> None:
        self._things[key].get_result(
            goal, lambda status, message: say("result", key=key, goal=goal, status=status, message=message)
        )

    def cancel(self, key: str, goal: bytes) -> None:
        self._things[key].cancel(
            goal, lambda answer: say("canceling", key=key, goal=goal, code=answer.code, goals=list(answer.goals))
        )

    def cancel_all(self, key: str) -> None:
        self._things[key].cancel(
            ALL_GOALS, lambda answer: say("canceling", key=key, code=answer.code, goals=[*answer.goals])
        )

    def status(self, key: str, goal: bytes) -> int | None:
        statuses: dict[bytes, int] = self._things[key].statuses
        return statuses.get(goal)


def say(event: str, **fields: Any) -> None:
    print(encode({"event": event, **fields}), flush=True)


async def main(kind: str, node: str, arguments: list[str]) -> None:
    share = [Path(each.removeprefix("share=")) for each in arguments if each.startswith("share=")]
    arguments = arguments[len(share) :]
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()
    transport = await open_transport(kind, arguments, node=node, share=share)
    peer = Peer(transport)

    def heard(line: str) -> None:
        request = decode(line)
        number, do = request.pop("id"), request.pop("do")
        try:
            print(encode({"id": number, "is": getattr(peer, do)(**request)}), flush=True)
        except PortError as error:
            print(encode({"id": number, "error": str(error)}), flush=True)

    async def listen() -> None:
        reader = asyncio.StreamReader(limit=2**26)
        await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
        while line := await reader.readline():
            heard(line.decode())
        ended.set()

    loop.add_signal_handler(signal.SIGTERM, ended.set)
    say("ready")
    listening = asyncio.create_task(listen())
    listening.add_done_callback(lambda done: ended.set())
    await ended.wait()
    transport.close()
    assert transport.failure()
    if listening.done():
        listening.result()
    listening.cancel()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], sys.argv[2], sys.argv[3:]))
