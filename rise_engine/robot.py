"""The port behind which every robot stands, simulated or real (architecture, "The engine").

An adapter implements `Robot`; the engine finds its class by the entry-point group `rise.drivers` and calls it from its
own loop only. An adapter with threads of its own hands its reports over through the loop. Nothing here may block: each
call starts something and returns, and what came of it arrives through `report`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, Note, RobotChanged, StopReport
from rise_engine.scenario.model import RobotProfile

RobotReport: TypeAlias = ActionReport | RobotChanged | StopReport | Note
"""What a robot says. A note is for the record only: what came too late to count, or twice."""
Report: TypeAlias = Callable[[RobotReport], None]


class Timer(Protocol):
    def cancel(self) -> None: ...


class Clock(Protocol):
    """The session's clock: real (optionally faster) or virtual. Seconds since the session began; never goes back."""

    def now(self) -> float: ...

    def call_at(self, when: float, callback: Callable[[], None]) -> Timer:
        """Run `callback` on the engine's loop at session time `when` (at once, but not inside this call, if past)."""
        ...


class Robot(Protocol):
    """What a robot adapter must be able to do.

    It raises nothing: what goes wrong is a report (an `ActionReport` with the status `failed` and a reason, or
    `RobotChanged` with `lost`). An error that it raises all the same fails that action, and is in the engine's log.
    """

    def connect(self, report: Report) -> None:
        """Begin. Answers with `RobotChanged("connected")` when goals can be sent, and again whenever that changes.

        :param report: takes what the robot says, on the engine's loop, at any time until `close`.
        """
        ...

    def start(self, goal: StartAction) -> None:
        """Begin an action. Reports `accepted`, then exactly one ending; `failed` with a reason when it is refused.

        :param goal: the action's id, type, parameters and deadline.
        """
        ...

    def cancel(self, action: str) -> None:
        """Stop one action, also one that has only just been started. It then reports its ending (`canceled`)."""
        ...

    def stop_all(self) -> None:
        """Stop everything, also what others asked for, and answer with `StopReport`."""
        ...

    def seen(self) -> float | None:
        """Session time of its last sign of life, for people who watch the link; None when that is not known."""
        ...

    def close(self) -> None:
        """Let go of everything. No reports after this."""
        ...


class Driver(Protocol):
    """The callable that an entry point of the group `rise.drivers` names."""

    def __call__(self, profile: RobotProfile, clock: Clock, seed: int, faults: tuple[str, ...] = ()) -> Robot:
        """Make a robot.

        :param profile: the robot's own file: its actions, and `options` for this driver.
        :param clock: the session's; deadlines and reports are in its seconds.
        :param seed: for what a simulated robot picks at random.
        :param faults: what it does wrong on request, as the driver documents it; only simulated ones take any.
        :raises ValueError: with a sentence for a person, when the profile's options or a fault cannot be understood.
        """
        ...
