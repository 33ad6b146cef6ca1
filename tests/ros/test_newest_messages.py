"""A subscription of rclpy that pauses, without rclpy: what it reads of what the middleware keeps."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any, cast

from rise_adapters.ros2.transport.port import QoS
from rise_adapters.ros2.transport.rclpy.entities import RclpySubscription
from rise_adapters.ros2.transport.rclpy.node import SpinningNode, _node_class


class Handle(nullcontext[None]):
    """As the middleware: it keeps the newest messages, as many as the depth, and more come while somebody reads."""

    def __init__(self, depth: int) -> None:
        super().__init__()
        self.kept: deque[int] = deque(maxlen=depth)
        self.coming: list[int] = []

    def take_message(self, type: object, raw: bool) -> tuple[int, None] | None:
        assert not raw
        if self.coming:
            self.kept.append(self.coming.pop(0))
        return (self.kept.popleft(), None) if self.kept else None


class Node:
    """What a subscription needs of a `SpinningNode`."""

    def __init__(self, handle: Handle) -> None:
        self.later: list[Callable[[], None]] = []
        self.loop = SimpleNamespace(call_later=lambda seconds, callback: self.later.append(callback))
        self.made: dict[str, Any] = {}
        self.rclpy_node = SimpleNamespace(
            create_subscription=lambda type, name, **more: self.made.update(more) or SimpleNamespace(handle=handle),
            destroy_subscription=lambda entity: None,
        )
        self.rclpy = SimpleNamespace(events=SimpleNamespace(SubscriptionEventCallbacks=lambda **more: None))

    def check_works(self) -> None: ...

    def make_profile(self, qos: QoS) -> None: ...

    def failure(self) -> str:
        return ""

    def destroy(self, destroy: Callable[[Any], Any], thing: Any) -> None: ...

    def pass_time(self) -> None:
        callbacks, self.later = self.later, []
        for callback in callbacks:
            callback()


def subscription(depth: int) -> tuple[Handle, Node, list[int], RclpySubscription]:
    handle, heard = Handle(depth), list[int]()
    node = Node(handle)
    converter = SimpleNamespace(type="std_msgs/msg/Int32", read=lambda message: message)
    made = RclpySubscription(
        cast(SpinningNode, node), "points", None, cast(Any, converter), cast(Any, heard.append), QoS(depth=depth), 0.1
    )
    return handle, node, heard, made


def test_after_each_pause_the_newest_are_read_as_many_as_the_depth() -> None:
    handle, node, heard, made = subscription(2)
    assert node.made["raw"] and heard == []
    handle.kept.extend(range(50))
    node.pass_time()
    assert heard == [48, 49]
    handle.coming = list(range(100, 200))
    node.pass_time()
    assert heard == [48, 49, 100, 101], "more that comes meanwhile waits for the next time"
    made.close()
    node.pass_time()
    assert len(heard) == 4 and not node.later


def test_the_executor_sees_no_subscription_that_pauses() -> None:
    often, paused = SimpleNamespace(raw=False), SimpleNamespace(raw=True)

    class OfRclpy:
        subscriptions = property(lambda node: iter((often, paused)))

    assert [*_node_class(cast(Any, SimpleNamespace(Node=OfRclpy)))().subscriptions] == [often]
