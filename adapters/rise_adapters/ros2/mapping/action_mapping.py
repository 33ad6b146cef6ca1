"""One carrier, ready for use: how an action reaches the robot, by its profile (docs/reference/robots.md, "Carriers").
`rise_adapters.ros2.mapping` reads carriers."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_adapters.ros2.mapping.field_sources import FillContext, MessageSource
from rise_adapters.ros2.transport.port import RELIABLE, STATUS, Message, QoS
from rise_engine.kernel.act_runner import CANCEL_LIMIT

MAX_CANCEL_SECONDS = CANCEL_LIMIT - 0.25
"""Maximum seconds of a cancel. Our report must arrive before the kernel gives up, after CANCEL_LIMIT."""
MappingKind: TypeAlias = Literal["action", "topic", "service"]
"""The kind of carrier."""


class GoalDeadlines(Struct, frozen=True):
    """Maximum seconds of each phase of a goal, on the session's clock."""

    server: float = 5.0
    """Until a node offers the action or service, or listens to the topic."""
    acceptance: float = 2.0
    """Until the goal is accepted or refused."""
    feedback: float = 0.0
    """Until the next feedback; 0: none is expected."""
    result: float = 0.0
    """Seconds beyond the expected time; 0: the kernel's limit decides (`limit` of the action)."""
    cancel: float = 4.0
    """Until a cancelled goal has ended, at most MAX_CANCEL_SECONDS."""


class EstopMapping(Struct, frozen=True):
    """The input of a laboratory's emergency stop: a topic, or a service that this side offers."""

    name: str
    """As written, before it is resolved."""
    type: str = ""
    """The type of the topic's messages; empty: it is a service, `std_srvs/srv/SetBool`."""
    when: tuple[tuple[tuple[str, ...], tuple[Any, ...]], ...] = ()
    """It is pressed when each of these fields has one of its values."""
    silent_after: float = 0.0
    """Seconds without a message after which it counts as silent; 0: never."""

    def is_pressed(self, message: Mapping[str, Any]) -> bool:
        return all(field_at(message, path) in values for path, values in self.when)


class RosOptions(Struct, frozen=True):
    """`[options]` of a profile whose driver is `ros2`."""

    frame: str = "base_link"
    """The coordinate frame for `{@frame}`."""
    deadlines: GoalDeadlines = GoalDeadlines()
    error: dict[str, Any] = {}
    """`carrier.error` of every action without its own."""
    wrapper: str = ""
    """The name under which a wrapper offers the actions of the profile `rise`; empty: none."""
    leftovers: Literal["cancel", "keep"] = "cancel"
    """The treatment of a killed engine's goals, if no wizard can decide."""
    unattended: Literal["wait", "go on"] = "wait"
    """Whether a recovered session moves the robot before a wizard has taken control."""
    share: tuple[str, ...] = ()
    """Folders with definitions of further interface packages, for the transport without ROS."""
    estop: EstopMapping | None = None


class ResultRule(Struct, frozen=True):
    """The rule by which a result is a failure (`carrier.error`)."""

    code: tuple[str, ...] = ()
    ok: tuple[int | bool | str, ...] = (0,)
    """The values of `code` that mean success; empty: the limits decide."""
    minimum: float = -inf
    maximum: float = inf
    """The smallest and largest number that means success."""
    text: tuple[str, ...] = ()
    codes: dict[str, str] = {}

    def failure(self, result: Message) -> str:
        """Why this result is a failure, whatever the goal's status; empty: it is none."""
        text = self.robot_text(result)
        if not self.code:
            return text
        code = field_at(result, self.code)
        if code is None or (code in self.ok if self.ok else self.minimum <= code <= self.maximum):
            return ""
        if isinstance(code, bool):
            return text or "the robot says that it did not succeed"
        code_text = f"error code {code}" if self.ok and isinstance(code, int) else self._describe_miss(code)
        means = text or self.codes.get(str(code), "")
        return f"{means} ({code_text})" if means else code_text

    def _describe_miss(self, code: float | str) -> str:
        """`success_rate is 0.2, and a success is at least 0.5`"""
        name = self.code[-1]
        if isinstance(code, str):
            return f"{name} is `{code}`"
        limits = [f"at least {self.minimum:g}"] if self.minimum > -inf else []
        limits += [f"at most {self.maximum:g}"] if self.maximum < inf else []
        return f"{name} is {code:g}, and a success is {' and '.join(limits)}"

    def why_not_succeeded(self, result: Message) -> str:
        """The robot's explanation of a goal that did not succeed; empty: none."""
        return self.failure(result) or self.robot_text(result)

    def robot_text(self, result: Message) -> str:
        text = field_at(result, self.text) if self.text else None
        return " ".join(text.split()) if isinstance(text, str) else ""


class ActionMapping(Struct, frozen=True):
    """How one action reaches the robot."""

    kind: MappingKind
    name: str
    """The name of the ROS action, topic or service, as written, before it is resolved."""
    type: str
    """`rise_interfaces/action/Speech`; for a topic, a message type; for a service, `std_srvs/srv/Trigger`."""
    deadlines: GoalDeadlines
    message: MessageSource
    """The source of the goal, of the topic's message or of the service's request."""
    reset: MessageSource | None = None
    """The message at the end of the action's time or at its cancel; None: none."""
    harmless: bool = False
    """Whether it is safe although nothing can stop it (`unstoppable = true`)."""
    rate: float = 0.0
    """Messages a second on a topic during the action; 0: only one message."""
    result_rule: ResultRule = ResultRule()
    unused_parameters: tuple[str, ...] = ()
    """Parameters of the action for which this robot has no field."""
    topic_qos: QoS = RELIABLE
    """For a topic: the quality of service of its publisher."""
    feedback_qos: QoS = RELIABLE
    """For an action: the quality of service of its feedback."""
    status_qos: QoS = STATUS
    """For an action: the quality of service of its status."""

    @property
    def feedback_wanted(self) -> QoS | None:
        """The quality of service for feedback; None: not needed, so it would only cost processor time."""
        return self.feedback_qos if self.deadlines.feedback else None

    @property
    def stoppable(self) -> bool:
        """Whether a message can stop the robot. (Service calls and messages without `reset` cannot be taken back.)"""
        return self.kind == "action" or self.reset is not None

    @property
    def route(self) -> tuple[str, str, str]:
        """The server or topic, equal for all actions that share it."""
        return self.kind, self.name, self.type

    def make_message(self, parameters: Mapping[str, Any], *, node: str, goal: str, frame: str) -> Message:
        """Make the goal, topic message or service request for these parameters, with present values.

        `node` is the full name of the sending node, `goal` the kernel's name of the goal, `frame` the robot's frame.
        Raises ValueError with a sentence if a value does not fit its field.
        """
        return self.message.fill(_context(parameters, node, goal, frame))

    def make_reset(self, *, node: str = "", goal: str = "", frame: str = "") -> Message | None:
        """Make the `reset` message, with present values; None: there is none."""
        if self.reset is None:
            return None
        return self.reset.fill(_context({}, node, goal, frame))


def _context(parameters: Mapping[str, Any], node: str, goal: str, frame: str) -> FillContext:
    return FillContext(parameters, {"node": node, "goal": goal, "frame": frame}, time.time_ns())


def field_at(message: Any, path: Sequence[str]) -> Any:
    """The value of a field in a message, a nested message or a list; None: it does not exist."""
    for name in path:
        if isinstance(message, list):
            message = dict(enumerate(message)).get(int(name)) if name.isdecimal() else None
        else:
            message = message.get(name) if isinstance(message, dict) else None
    return message
