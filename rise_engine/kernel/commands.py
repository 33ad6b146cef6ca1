"""What the kernel asks of the world. The engine carries commands out, in order, after the records of the same step."""

from __future__ import annotations

from typing import Any, TypeAlias

from msgspec import Struct


class StartAction(Struct, frozen=True, tag_field="command", tag="start_action"):
    """Give the robot a goal."""

    action: str
    """The goal id, unique in the session: `<task>/<actionID>`."""
    type: str
    """What the robot does: the authored action, or its substitute."""
    parameters: dict[str, Any]
    """As authored, memory filled in, typed; parameters left out are absent."""
    expected: float
    """Seconds that it will probably take."""
    goal: str = ""
    """The goal's UUID, 32 hexadecimal digits: the engine's, which knows the session. Empty within the kernel."""
    accepted: bool = False
    """Of a goal that an engine before this one has sent: the robot has taken it."""


class CancelAction(Struct, frozen=True, tag_field="command", tag="cancel_action"):
    """Ask the robot to stop one goal. The goal stays running until it reports an ending."""

    action: str


class StopRobot(Struct, frozen=True, tag_field="command", tag="stop_robot"):
    """Ask everything that the robot has to stop everything, also goals of others; answer with `StopReport`."""


class CancelOpenGoals(Struct, frozen=True, tag_field="command", tag="cancel_open_goals"):
    """Ask the robot once more to stop what it may still be doing of actions that have ended."""

    part: str
    """Empty: all parts."""


class ReleaseOpenGoals(Struct, frozen=True, tag_field="command", tag="release_open_goals"):
    """A person has looked: what a part may still be doing holds it no more."""

    part: str
    """Empty: all parts."""


class SetTimer(Struct, frozen=True, tag_field="command", tag="set_timer"):
    """Send `TimerElapsed` at session time `at` (seconds)."""

    timer: int
    at: float


class CancelTimer(Struct, frozen=True, tag_field="command", tag="cancel_timer"):
    timer: int


Command: TypeAlias = (
    StartAction | CancelAction | StopRobot | CancelOpenGoals | ReleaseOpenGoals | SetTimer | CancelTimer
)
