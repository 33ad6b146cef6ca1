"""Listens to the laboratory's emergency stop: on another program's topic, or through a service of this side.

Its subscription requests the quality of service that is offered, like `ros2 topic echo`, so it hears every publisher.
While the state of the emergency stop is uncertain, the robot has a fault and nothing new begins. Nothing is heard while
the computer sleeps: of the state before, only *pressed* stays valid.

A message does not name its sender. So with several publishers, or after one has gone, the state is unknown: a button
that is not pressed must not release another one. When a new program appears, only *pressed* stays valid. A program of
the same node replaces one that has gone. A hidden node is a tool, such as `ros2 topic pub`: it can press, and need not
return.

A pressed emergency stop stays pressed over a new connection, and for an engine that continues the session. That engine
does not know which button was pressed. It must hear *pressed* before a release counts. (With a service, the last
request counts.)
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Literal

from rise_adapters.ros2.mapping.action_mapping import EstopMapping
from rise_adapters.ros2.robot.listeners import LEASE_SECONDS
from rise_adapters.ros2.transport.port import Closable, Message, QoS, RemoteEndpoint, SendReply, Subscription, Transport
from rise_engine.base.suspend import suspended_seconds
from rise_engine.kernel.inputs import EstopReport

SERVICE_TYPE = "std_srvs/srv/SetBool"
UNHEARD_SECONDS = 2.0
"""Seconds that an emergency stop may be silent after its discovery."""
SLEEP_LIMIT_SECONDS = 1.0
"""Seconds of the computer's sleep after which the state is unknown."""


class EstopInput:
    """One emergency stop. `poll` checks its presence. `report` receives each change of its state."""

    label = "estop"

    def __init__(
        self,
        mapping: EstopMapping,
        transport: Transport,
        now: Callable[[], float],
        report: Callable[[EstopReport], object],
        before: EstopInput | None = None,
    ) -> None:
        """`now`: seconds on any running clock; `before`: the same one over an earlier connection. Raises PortError."""
        self.name = transport.resolve(mapping.name)
        self.source = f"estop:{self.name}"
        self.pressed: bool | None = (before.pressed or None) if before is not None else None
        """None: its publisher has not reported yet."""
        self._is_inherited: bool = before is not None and before._is_inherited
        """Whether it was pressed for an earlier engine, and this one has not heard *pressed* yet."""
        self._mapping = mapping
        self._transport = transport
        self._now = now
        self._report = report
        self._qos = QoS()
        self._subscription: Subscription | None = None
        self._service: Closable | None = None
        self._programs: dict[bytes, float] = {}
        """The programs that published it at the last look, and when each was found."""
        self._ends: Counter[tuple[bytes, str]] = Counter()
        """Their publishers, by program and node."""
        self._known: Counter[str] = Counter(before._known if before is not None else ())
        """How many programs must be present, by node."""
        self._nameless: set[bytes] = set(before._nameless if before is not None else ())
        """The programs whose node was never known. (A node may become known a moment after its publisher.)"""
        self._ask_again = False
        """Whether to subscribe again, so that a publisher that sends only changes repeats its latched state."""
        self._suspended = suspended_seconds()
        """`suspended_seconds` at the last look."""
        self._since: float | None = None
        """When it was found or last heard; None: it is absent."""
        if mapping.type:
            self._subscription = transport.subscribe(mapping.name, mapping.type, self._take_message, self._qos)
        else:
            self._service = transport.serve(mapping.name, SERVICE_TYPE, self._take_request)

    def inherit(self) -> None:
        """Note that it was pressed for an earlier engine of the session."""
        self.pressed = True
        self._is_inherited = self._subscription is not None

    def poll(self) -> None:
        """Find its publishers, and request the quality of service that they offer."""
        if self._subscription is None:
            return
        offered = [end.qos for end in self._find_publishers() if end.qos is not None]
        if offered:
            latched = all(qos.latched for qos in offered)
            # Of latched messages, only the last one counts: an earlier one would press or release it again.
            qos = QoS(1 if latched else 10, all(qos.reliable for qos in offered), latched)
            if qos != self._qos or (self._ask_again and latched and self.pressed is not False):
                self._subscribe(qos)
            self._ask_again = False
        if not self._subscription.count_publishers():
            self._since = None
        elif self._since is None:
            self._since = self._now()

    def _find_publishers(self) -> list[RemoteEndpoint]:
        """Find the programs that publish it. The state of a new one is unknown."""
        ends = [end for end in self._transport.publisher_endpoints(self.name) if end.type == self._mapping.type]
        now, ends_before, before = self._now(), self._ends, self._programs
        self._ends = Counter((end.program or end.node.encode(), end.node) for end in ends)
        self._programs = {program: before.get(program, now) for program, _ in self._ends}
        slept = suspended_seconds() - self._suspended
        self._suspended += slept
        self._ask_again |= self._ends != ends_before or slept >= SLEEP_LIMIT_SECONDS
        if self._programs.keys() - before.keys() or slept >= SLEEP_LIMIT_SECONDS:  # an earlier report may be outdated
            self._since = now
            self.pressed = self.pressed or None
        # A killed program stays visible for a while. Two programs that stay longer than that are two buttons.
        buttons = [each for each in self._ends if not each[1].rpartition("/")[2].startswith("_")]
        stay = Counter(node for program, node in buttons if now > self._programs[program] + LEASE_SECONDS)
        self._known |= stay | Counter({node for _, node in buttons if node or self.pressed})
        self._nameless |= {program for program, node in self._ends if program and not node}
        self._nameless -= {program for program, node in self._ends if node}
        self._known[""] = min(self._known[""], len(self._nameless))
        return ends

    @property
    def _nodes(self) -> Counter[str]:
        """The number of programs, by node."""
        return Counter(node for _, node in self._ends)

    @property
    def fault(self) -> Literal["", "missing", "unheard", "silent", "several", "gone", "inherited"]:
        """Why its state is unknown; empty: it is known."""
        if self._subscription is None:
            return ""
        if self._since is None:
            return "missing"
        if max(self._subscription.count_publishers(), len(self._programs)) > 1:
            return "several"
        if self._known - self._nodes:
            return "gone"
        if self._is_inherited:
            return "inherited"
        if self.pressed is None or suspended_seconds() >= self._suspended + SLEEP_LIMIT_SECONDS:
            return "unheard"
        limit = self._mapping.silent_after
        return "silent" if limit and self._now() > self._since + limit else ""

    @property
    def is_new(self) -> bool:
        """Whether it was found just now, so that its first message may still come."""
        return self.fault == "unheard" and self._since is not None and self._now() <= self._since + UNHEARD_SECONDS

    @property
    def trouble(self) -> str:
        """The fault, for a person; empty: none."""
        what = f"the emergency stop at {self.name}"
        match self.fault:
            case "missing":
                why = f"cannot be heard: nothing publishes it as {self._mapping.type}"
            case "silent":
                why = f"has said nothing for {self._mapping.silent_after:g} s"
            case "unheard":
                why = "has said nothing yet, so whether it is pressed is not known"
            case "several":
                remedy = "a message does not say who sent it; let one program publish for all"
                why = f"has several publishers ({_name_all(self._nodes)}): {remedy}"
            case "gone":
                remedy = "start it again, or begin a new session"
                who = _name_all(self._known - self._nodes)
                why = f"is not published by {who} any more, where it may be pressed: {remedy}"
            case "inherited":
                why = "was pressed when an engine ended, and it is unknown at which button: press it and let it go"
                return f"{what} {why}"
            case _:
                return ""
        return f"{what} {why}{'; it was pressed when it was heard last' if self.pressed else ''}"

    def close(self) -> None:
        for handle in (self._subscription, self._service):
            if handle is not None:
                handle.close()

    def _subscribe(self, qos: QoS) -> None:
        assert self._subscription is not None
        self._subscription.close()
        self._qos = qos
        self._subscription = self._transport.subscribe(self._mapping.name, self._mapping.type, self._take_message, qos)

    def _take_message(self, message: Message) -> None:
        before, pressed = self.pressed, self._mapping.is_pressed(message)
        if pressed:
            self._take(True)  # first, because the look may fail
        self._find_publishers()
        self._since = self._now()
        if not pressed and self.pressed == before:  # otherwise a program that has gone may have sent it
            self._take(False)

    def _take_request(self, request: Message, reply: SendReply) -> None:
        pressed = bool(request["data"])
        self._take(pressed)
        stays = "is not pressed any more; a stop is released at the console"
        reply({"success": True, "message": f"the emergency stop {'is pressed' if pressed else stays}"})

    def _take(self, pressed: bool) -> None:
        self._is_inherited = self._is_inherited and not pressed
        if not pressed and self.fault in ("several", "gone", "inherited"):
            return  # another button may be pressed
        if pressed != self.pressed:
            self.pressed = pressed
            self._report(EstopReport(source=self.source, pressed=pressed))


def _name_all(nodes: Counter[str]) -> str:
    return ", ".join(sorted(node or "a program without a node" for node in nodes.elements()))
