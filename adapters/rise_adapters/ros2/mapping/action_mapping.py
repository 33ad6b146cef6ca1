"""One carrier: what a robot profile says about how an action travels, ready for use (docs/reference/robots.md,
"Carriers"). `rise_adapters.ros2.mapping` reads them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from msgspec import Struct

from rise_adapters.ros2.mapping.field_sources import FillContext, MessageSource
from rise_adapters.ros2.transport.port import FEEDBACK, RELIABLE, STATUS, STATUS_TOPIC, Message, QoS
from rise_engine.errors import RiseError

USUAL_QOS: Mapping[str, QoS] = {}
"""Nothing but what is usual."""


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


class RosOptions(Struct, frozen=True):
    """`[options]` of a profile whose driver is `ros2`."""

    frame: str = "base_link"
    """The coordinate frame that `{@frame}` stands for."""
    deadlines: GoalDeadlines = GoalDeadlines()
    error: dict[str, Any] = {}
    """`carrier.error` of every action that has none of its own."""
    wrapper: str = ""
    """The name under which a wrapper offers the actions of the profile `rise`; empty: there is none."""
    share: tuple[str, ...] = ()
    """Folders with the definitions of further interface packages, for the transport without ROS."""


class MappingError(RiseError):
    """What is wrong with a profile's options and carriers: all of it, each a sentence for a person."""

    def __init__(self, robot: str, mistakes: list[str]) -> None:
        self.findings = [f"robot {robot}: {mistake}" for mistake in mistakes]
        super().__init__("\n".join(self.findings))


class ActionMapping:
    """How one action reaches the robot."""

    def __init__(
        self,
        kind: Literal["action", "topic"],
        name: str,
        type: str,
        deadlines: GoalDeadlines,
        message: MessageSource,
        reset: MessageSource | None = None,
        verdict: ResultRule | None = None,
        left_out: tuple[str, ...] = (),
        qos: Mapping[str, QoS] = USUAL_QOS,
    ) -> None:
        self.kind = kind
        self.name = name
        """Of the ROS action or the topic, as written: not resolved yet."""
        self.type = type
        """`rise_interfaces/action/Speech`; of a topic, a message type."""
        self.deadlines = deadlines
        self.unused_parameters = left_out
        """Parameters of the action that do not reach this robot: it has no field for them."""
        self.topic_qos = qos.get("topic", RELIABLE)
        """Of a topic, how it is published."""
        self.feedback_qos = qos.get(FEEDBACK, RELIABLE)
        """Of an action, how its feedback is listened to ..."""
        self.status_qos = qos.get(STATUS_TOPIC, STATUS)
        """... and how its status is."""
        self._message = message
        self._reset = reset
        self._verdict = verdict or ResultRule()

    def make_message(self, parameters: Mapping[str, Any], *, node: str, goal: str, frame: str) -> Message:
        """The goal (of a topic: the message) for these parameters.

        `node` is the full name of the node that sends it, `goal` the kernel's name of the goal, `frame` the robot's
        frame. Raises ValueError with a sentence when a value does not fit its field.
        """
        made: Message = self._message.fill(FillContext(parameters, {"node": node, "goal": goal, "frame": frame}))
        return made

    def make_reset(self, *, node: str = "", goal: str = "", frame: str = "") -> Message | None:
        """What is published when the action's time is over, or it is canceled; None: nothing."""
        if self._reset is None:
            return None
        made: Message = self._reset.fill(FillContext({}, {"node": node, "goal": goal, "frame": frame}))
        return made

    def failure(self, result: Message) -> str:
        """Why this result is a failure, whatever the goal's status says; empty when it is none."""
        return self._verdict.failure(result)

    def why_not_succeeded(self, result: Message) -> str:
        """What the robot has to say about how a goal ended that did not succeed; empty when it says nothing."""
        return self._verdict.failure(result) or self._verdict.robot_text(result)


class ResultRule(Struct, frozen=True):
    """Where a result says that it is none (`carrier.error`)."""

    code: tuple[str, ...] = ()
    ok: int | bool = 0
    text: tuple[str, ...] = ()
    codes: dict[str, str] = {}

    def failure(self, result: Message) -> str:
        said = self.robot_text(result)
        if not self.code:
            return said
        code = _field_at(result, self.code)
        if code is None or code == self.ok:
            return ""
        if isinstance(code, bool):
            return said or "the robot says that it did not succeed"
        means = said or self.codes.get(str(code), "")
        return f"{means} (error code {code})" if means else f"error code {code}"

    def robot_text(self, result: Message) -> str:
        text = _field_at(result, self.text) if self.text else None
        return " ".join(text.split()) if isinstance(text, str) else ""


def _field_at(message: Any, path: tuple[str, ...]) -> Any:
    for name in path:
        message = message.get(name) if isinstance(message, dict) else None
    return message
