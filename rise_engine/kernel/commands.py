"""The kernel's commands. The engine executes them in order, after the records of the same step."""

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
    """As authored, with memory filled in and typed; omitted parameters are absent."""
    expected: float
    """Seconds that it probably takes."""
    goal: str = ""
    """The goal's UUID, 32 hexadecimal digits. The engine sets it, because it knows the session; empty in the kernel."""
    accepted: bool = False
    """For a goal that an earlier engine has sent: the robot has accepted it."""


class CancelAction(Struct, frozen=True, tag_field="command", tag="cancel_action"):
    """Ask the robot to stop one goal. The goal stays running until it reports an ending."""

    action: str


class StopRobot(Struct, frozen=True, tag_field="command", tag="stop_robot"):
    """Ask all parts of the robot to stop everything, also goals of other clients. The answer is a `StopReport`."""


class EndStop(Struct, frozen=True, tag_field="command", tag="end_stop"):
    """Tell the robot that the stop is released. Goals that other clients begin are no longer stopped."""


class CancelOpenGoals(Struct, frozen=True, tag_field="command", tag="cancel_open_goals"):
    """Ask the robot again to stop its open goals."""

    part: str
    """Empty: all parts."""


class ReleaseOpenGoals(Struct, frozen=True, tag_field="command", tag="release_open_goals"):
    """Release a part that a person has checked, although it may still be executing a goal."""

    part: str
    """Empty: all parts."""


class SetTimer(Struct, frozen=True, tag_field="command", tag="set_timer"):
    """Send `TimerElapsed` at session time `at` (seconds)."""

    timer: int
    at: float


class CancelTimer(Struct, frozen=True, tag_field="command", tag="cancel_timer"):
    timer: int


Command: TypeAlias = (
    StartAction | CancelAction | StopRobot | EndStop | CancelOpenGoals | ReleaseOpenGoals | SetTimer | CancelTimer
)
