"""Watches whether the node that offers an action is active, if it is a lifecycle node
(https://design.ros2.org/articles/node_lifecycle.html). An inactive node rejects goals, or accepts them and does
nothing."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from rise_adapters.ros2.transport.port import (
    STATUS_TOPIC,
    Closable,
    Message,
    PortError,
    QoS,
    ServiceClient,
    Transport,
    action_topic,
)

STATE_TYPE, EVENT_TYPE = "lifecycle_msgs/srv/GetState", "lifecycle_msgs/msg/TransitionEvent"
SEARCH_SECONDS = 2.0
"""Seconds within which a node must show its lifecycle. Otherwise it has none."""
ASK_SECONDS = 2.0
"""Seconds between two requests. A transition is reported immediately, if that message arrives."""

_REMEDIES = {
    "inactive": "activate it (ros2 lifecycle set {node} activate)",
    "unconfigured": "configure and activate it (ros2 lifecycle set {node} configure, then activate)",
    "finalized": "start its program again",
}


class LifecycleWatch:
    """Follows one node, whose name may change. It has no timer: `poll` sends a request when one is due."""

    def __init__(self, transport: Transport, now: Callable[[], float]) -> None:
        """:param now: returns seconds on any running clock."""
        self.node = ""
        """The node's full name; empty: none is followed."""
        self.state = ""
        """The node's state (`active`); empty: it has no lifecycle, or has not reported yet."""
        self._transport = transport
        self._now = now
        self._since = 0.0
        self._asked_at = -inf
        self._client: ServiceClient | None = None
        self._events: Closable | None = None

    def follow(self, node: str) -> None:
        """Follow this node from now on; empty: none."""
        if node == self.node:
            return
        self.close()
        self.node, self.state, self._since, self._asked_at = node, "", self._now(), -inf
        if node:
            try:
                self._client = self._transport.client(f"{node}/get_state", STATE_TYPE)
            except PortError:  # lifecycle_msgs is not installed
                return
            self.poll()

    def follow_server(self, action: str) -> None:
        """Follow the node that offers an action (its full name) once that node is known."""
        ends = self._transport.publisher_endpoints(action_topic(action, STATUS_TOPIC))
        if node := next((end.node for end in ends if end.node.startswith("/")), ""):
            self.follow(node)

    def poll(self) -> None:
        """Ask the node for its state, if that is due."""
        client, now = self._client, self._now()
        if client is None:
            return
        if not client.count_servers():
            if not self.state and now > self._since + SEARCH_SECONDS:
                self.close()
        elif now >= self._asked_at + ASK_SECONDS:
            self._asked_at = now
            try:
                if self._events is None:
                    topic = f"{self.node}/transition_event"
                    self._events = self._transport.subscribe(topic, EVENT_TYPE, self._take_event, QoS())
                client.call({}, self._take_state)
            except PortError:  # the connection has just gone
                return

    @property
    def sentence(self) -> str:
        """A sentence that the node is not active; empty if it is, or has no lifecycle."""
        return f"{self.node} is {self.state}" if self.state not in ("", "active") else ""

    @property
    def remedy(self) -> str:
        return _REMEDIES.get(self.state, "wait until it is active").format(node=self.node)

    @property
    def trouble(self) -> str:
        """The sentence with its remedy."""
        return f"{self.sentence}; {self.remedy}" if self.sentence else ""

    def close(self) -> None:
        for handle in (self._client, self._events):
            if handle is not None:
                handle.close()
        self._client = self._events = None

    def _take_state(self, response: Message) -> None:
        self.state = response["current_state"]["label"]

    def _take_event(self, event: Message) -> None:
        self.state = event["goal_state"]["label"]
