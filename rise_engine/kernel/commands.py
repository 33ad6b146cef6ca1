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


class CancelAction(Struct, frozen=True, tag_field="command", tag="cancel_action"):
    """Ask the robot to stop one goal. The goal stays running until it reports an ending."""

    action: str


class StopRobot(Struct, frozen=True, tag_field="command", tag="stop_robot"):
    """Ask everything that the robot has to stop everything, also goals of others; answer with `StopReport`."""


class SetTimer(Struct, frozen=True, tag_field="command", tag="set_timer"):
    """Send `TimerElapsed` at session time `at` (seconds)."""

    timer: int
    at: float


class CancelTimer(Struct, frozen=True, tag_field="command", tag="cancel_timer"):
    timer: int


Command: TypeAlias = StartAction | CancelAction | StopRobot | SetTimer | CancelTimer
