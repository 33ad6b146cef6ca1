"""One carrier: what a robot profile says about how an action travels, ready for use (docs/reference/robots.md,
"Carriers"). `rise_adapters.ros2.mapping` reads them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from msgspec import Struct

from rise_adapters.ros2.mapping.field_sources import FillContext, MessageSource
from rise_adapters.ros2.transport.port import RELIABLE, STATUS, Message, QoS
from rise_engine.errors import RiseError


class GoalDeadlines(Struct, frozen=True):
    """Seconds that each phase of a goal may take, on the session's clock."""

    server: float = 5.0
    """Until something offers the action, or takes the topic."""
    acceptance: float = 2.0
    """Until the goal is accepted or refused."""
    feedback: float = 0.0
    """Until feedback comes (again); 0: none is expected."""
    result: float = 0.0
    """How much longer than expected the goal may take; 0: the kernel's limit decides (`limit` of the action)."""
    cancel: float = 4.0
    """Until a goal that is canceled has ended."""


class EstopMapping(Struct, frozen=True):
    """Where the emergency stop of a laboratory is heard: on a topic, or by a service that this side offers."""

    name: str
    """As written: not resolved yet."""
    type: str = ""
    """Of the topic's messages; empty: it is a service, `std_srvs/srv/SetBool`."""
    when: tuple[tuple[tuple[str, ...], tuple[Any, ...]], ...] = ()
    """It is pressed when each of these fields has one of its values."""
    silent_after: float = 0.0
    """Seconds without a message after which it counts as silent; 0: it may say nothing for ever."""

    def is_pressed(self, message: Mapping[str, Any]) -> bool:
        return all(field_at(message, path) in values for path, values in self.when)


class RosOptions(Struct, frozen=True):
    """`[options]` of a profile whose driver is `ros2`."""

    frame: str = "base_link"
    """The coordinate frame that `{@frame}` stands for."""
    deadlines: GoalDeadlines = GoalDeadlines()
    error: dict[str, Any] = {}
    """`carrier.error` of every action that has none of its own."""
    wrapper: str = ""
    """The name under which a wrapper offers the actions of the profile `rise`; empty: there is none."""
    leftovers: Literal["cancel", "keep"] = "cancel"
    """What becomes of goals that a killed engine left behind, when no wizard is there to decide."""
    share: tuple[str, ...] = ()
    """Folders with the definitions of further interface packages, for the transport without ROS."""
    estop: EstopMapping | None = None


class MappingError(RiseError):
    """What is wrong with a profile's options and carriers: all of it, each a sentence for a person."""

    def __init__(self, robot: str, mistakes: list[str]) -> None:
        self.findings = [f"robot {robot}: {mistake}" for mistake in mistakes]
        super().__init__("\n".join(self.findings))


class ResultRule(Struct, frozen=True):
    """Where a result says that it is none (`carrier.error`)."""

    code: tuple[str, ...] = ()
    ok: int | bool = 0
    text: tuple[str, ...] = ()
    codes: dict[str, str] = {}

    def failure(self, result: Message) -> str:
        """Why this result is a failure, whatever the goal's status says; empty when it is none."""
        text = self.robot_text(result)
        if not self.code:
            return text
        code = field_at(result, self.code)
        if code is None or code == self.ok:
            return ""
        if isinstance(code, bool):
            return text or "the robot says that it did not succeed"
        means = text or self.codes.get(str(code), "")
        return f"{means} (error code {code})" if means else f"error code {code}"

    def why_not_succeeded(self, result: Message) -> str:
        """What the robot has to say about how a goal ended that did not succeed; empty when it says nothing."""
        return self.failure(result) or self.robot_text(result)

    def robot_text(self, result: Message) -> str:
        text = field_at(result, self.text) if self.text else None
        return " ".join(text.split()) if isinstance(text, str) else ""


class ActionMapping(Struct, frozen=True):
    """How one action reaches the robot."""

    kind: Literal["action", "topic"]
    name: str
    """Of the ROS action or the topic, as written: not resolved yet."""
    type: str
    """`rise_interfaces/action/Speech`; of a topic, a message type."""
    deadlines: GoalDeadlines
    message: MessageSource
    """What fills the goal; of a topic, the message."""
    reset: MessageSource | None = None
    """What is published when the action's time is over, or it is canceled; None: nothing."""
    result_rule: ResultRule = ResultRule()
    unused_parameters: tuple[str, ...] = ()
    """Parameters of the action that do not reach this robot: it has no field for them."""
    topic_qos: QoS = RELIABLE
    """Of a topic, how it is published."""
    feedback_qos: QoS = RELIABLE
    """Of an action, how its feedback is listened to ..."""
    status_qos: QoS = STATUS
    """... and how its status is."""

    @property
    def route(self) -> tuple[str, str, str]:
        """Several actions may go the same way, to one server or topic: what they then have in common."""
        return self.kind, self.name, self.type

    def make_message(self, parameters: Mapping[str, Any], *, node: str, goal: str, frame: str) -> Message:
        """The goal (of a topic: the message) for these parameters.

        `node` is the full name of the node that sends it, `goal` the kernel's name of the goal, `frame` the robot's
        frame. Raises ValueError with a sentence when a value does not fit its field.
        """
        return self.message.fill(FillContext(parameters, {"node": node, "goal": goal, "frame": frame}))

    def make_reset(self, *, node: str = "", goal: str = "", frame: str = "") -> Message | None:
        """What `reset` is now; None: nothing is published."""
        if self.reset is None:
            return None
        return self.reset.fill(FillContext({}, {"node": node, "goal": goal, "frame": frame}))


def field_at(message: Any, path: Sequence[str]) -> Any:
    """The value of a field in a message, or in one of those nested in it; None when there is no such field."""
    for name in path:
        message = message.get(name) if isinstance(message, dict) else None
    return message
