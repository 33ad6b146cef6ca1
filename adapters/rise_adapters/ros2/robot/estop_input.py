"""Listens to the laboratory's emergency stop: on somebody else's topic, or through a service that this side offers.

It hears every publisher, whatever its quality of service, because its subscription requests what is offered, like
`ros2 topic echo`. While its state is not known for certain, that is a fault of the robot, and nothing new begins.

A message does not say who has sent it. One publisher that is not pressed must not let go for another one that is, so
with several publishers, or when one of them has gone, the state is not known.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from rise_adapters.ros2.mapping.action_mapping import EstopMapping
from rise_adapters.ros2.transport.port import Closable, Message, QoS, SendReply, Subscription, Transport
from rise_engine.kernel.inputs import EstopReport

SERVICE_TYPE = "std_srvs/srv/SetBool"
UNHEARD_SECONDS = 2.0
"""Seconds for which an emergency stop may be silent after its discovery."""


class EstopInput:
    """One emergency stop. `poll` checks whether it is there. `report` receives its state when that is news."""

    label = "estop"

    def __init__(
        self,
        mapping: EstopMapping,
        transport: Transport,
        now: Callable[[], float],
        report: Callable[[EstopReport], object],
    ) -> None:
        """`now`: seconds on any running clock. Raises PortError."""
        self.name = transport.resolve(mapping.name)
        self.pressed: bool | None = None
        """None: it has not reported yet."""
        self.publishers: list[str] = []
        """The nodes that publish it, at the last check."""
        self._mapping = mapping
        self._transport = transport
        self._now = now
        self._report = report
        self._qos = QoS()
        self._subscription: Subscription | None = None
        self._service: Closable | None = None
        self._most = 0
        """The largest number of nodes that have published it at the same time."""
        self._since: float | None = None
        """When it was found, or last heard; None: it is not there."""
        if mapping.type:
            self._subscription = transport.subscribe(mapping.name, mapping.type, self._take_message, self._qos)
        else:
            self._service = transport.serve(mapping.name, SERVICE_TYPE, self._take_request)

    def poll(self) -> None:
        """See who publishes it, and request what they offer."""
        if self._subscription is None:
            return
        ends = [end for end in self._transport.publisher_endpoints(self.name) if end.type == self._mapping.type]
        self.publishers = [end.node for end in ends]
        self._most = max(self._most, len(set(self.publishers)))
        offered = [end.qos for end in ends if end.qos is not None]
        if offered:
            self._subscribe(QoS(10, all(qos.reliable for qos in offered), all(qos.latched for qos in offered)))
        if not self._subscription.count_publishers():
            self._since = None
        elif self._since is None:
            self._since = self._now()

    @property
    def fault(self) -> Literal["", "missing", "unheard", "silent", "several", "gone"]:
        """Why its state is not known; empty: it is known."""
        if self._subscription is None:
            return ""
        if self._since is None:
            return "missing"
        count = self._subscription.count_publishers()
        if count > 1:
            return "several"
        if min(count, len(set(self.publishers))) < self._most:
            return "gone"
        if self.pressed is None:
            return "unheard"
        limit = self._mapping.silent_after
        return "silent" if limit and self._now() > self._since + limit else ""

    @property
    def is_new(self) -> bool:
        """Whether it was found just now, so that its first message may still come."""
        return self.fault == "unheard" and self._since is not None and self._now() <= self._since + UNHEARD_SECONDS

    @property
    def trouble(self) -> str:
        """What is wrong with it, for a person; empty when it is heard."""
        what = f"the emergency stop at {self.name}"
        match self.fault:
            case "missing":
                why = f"cannot be heard: nothing publishes it as {self._mapping.type}"
            case "silent":
                why = f"has said nothing for {self._mapping.silent_after:g} s"
            case "unheard":
                why = "has said nothing yet, so whether it is pressed is not known"
            case "several":
                names = ", ".join(sorted(set(self.publishers)))
                remedy = "a message does not say who sent it; let one program publish for all"
                why = f"has several publishers ({names}): {remedy}"
            case "gone":
                why = f"had {self._most} publishers, and not all are there: the one that has gone may be pressed"
            case _:
                return ""
        return f"{what} {why}{'; it was pressed when it was heard last' if self.pressed else ''}"

    def close(self) -> None:
        for handle in (self._subscription, self._service):
            if handle is not None:
                handle.close()

    def _subscribe(self, qos: QoS) -> None:
        if qos != self._qos:
            assert self._subscription is not None
            self._subscription.close()
            self._qos = qos
            self._subscription = self._transport.subscribe(
                self._mapping.name, self._mapping.type, self._take_message, qos
            )

    def _take_message(self, message: Message) -> None:
        self._since = self._now()
        self._take(self._mapping.is_pressed(message))

    def _take_request(self, request: Message, reply: SendReply) -> None:
        pressed = bool(request["data"])
        self._take(pressed)
        stays = "is not pressed any more; a stop is released at the console"
        reply({"success": True, "message": f"the emergency stop {'is pressed' if pressed else stays}"})

    def _take(self, pressed: bool) -> None:
        if not pressed and self.fault in ("several", "gone"):
            return  # another one may be pressed
        if pressed != self.pressed:
            self.pressed = pressed
            self._report(EstopReport(source=f"estop:{self.name}", pressed=pressed))
