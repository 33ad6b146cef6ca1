"""Stop-all: requested immediately, answered by the robot or a time limit, and latched until it is released."""

from __future__ import annotations

from typing import Literal

from msgspec import Struct

from rise_engine.kernel.commands import EndStop, StopRobot
from rise_engine.kernel.core import Core, TimerTarget
from rise_engine.kernel.inputs import StopReport
from rise_engine.kernel.records import StopRecord, stopper_words

STOP_LIMIT = 3.0
"""Seconds for the robot to answer a stop-all. After that it counts as unconfirmed."""


class StoppedRule(Struct, frozen=True):
    """The state of a rule when everything was stopped."""

    name: str
    state: str
    priority: float
    latched: list[int]
    """As `RuleSnapshot.latched`."""
    steps: list[tuple[str, int]]
    """As `RuleRun.steps`."""


StopStatus = Literal["released", "requested", "latched"]


class StopLatch:
    """Decides whether anything may start."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.status: StopStatus = "released"
        """requested: the robot has not answered yet."""
        self.timer: int | None = None
        self.stopped_rules: list[StoppedRule] = []
        """The rules that the stop ended, the bottom of the stack first, until it is released."""
        self.held_by: list[str] = []
        """The sources of the pressed emergency stops, in order."""
        self.count = 0
        """The number of requested stops, which is the number of the last one."""

    @property
    def latched(self) -> bool:
        """True from the request until the release: nothing starts."""
        return self.status != "released"

    def request(self, source: str) -> None:
        """Request a stop. While it is latched, this asks the robot again."""
        self.status = "requested"
        self.count += 1
        self._core.emit(StopRecord, "requested", source=source, held_by=tuple(self.held_by))

    def note_released(self, source: str) -> None:
        """Note that an emergency stop is no longer pressed. The stop stays latched."""
        self.held_by.remove(source)
        self._core.emit(StopRecord, "let-go", source=source, held_by=tuple(self.held_by))

    def ask_robot(self) -> None:
        self._core.commands.append(StopRobot())
        self._cancel_timer()
        self.timer = self._core.set_timer(STOP_LIMIT, TimerTarget("stop"))

    def ask_again(self) -> None:
        """Ask the robot again. The earlier engine got the answers, and actions may have begun after them."""
        if self.status == "requested":
            self.ask_robot()
        elif self.status == "latched":
            self._core.commands.append(StopRobot())
            self._record_no_answer()

    def record_answer(self, answer: StopReport) -> None:
        """Record an answer of the robot, also after the time limit, but not after the release."""
        if self.latched:
            self._cancel_timer()
            self.status = "latched"
            parts = answer.confirmed, answer.unconfirmed
            held_by = tuple(self.held_by)
            self._core.emit(StopRecord, "latched", *parts, unstoppable=answer.unstoppable, held_by=held_by)

    def time_out(self) -> None:
        self.timer = None
        self.status = "latched"
        self._record_no_answer()

    def _record_no_answer(self) -> None:
        robot = self._core.scenario.robot.name
        self._core.emit(StopRecord, "latched", unconfirmed=(robot,), held_by=tuple(self.held_by))

    def why_not_release(self, seen: int | None) -> str:
        """Why it cannot be released now; empty: it can. `seen`: the number of the stop that a person means."""
        if self.status == "released":
            return "nothing is stopped"
        if self.held_by:
            return f"{stopper_words(self.held_by[0])} has not been let go"
        if seen not in (None, self.count):
            return "everything was stopped again since: look at the robot, and release this stop"
        return "the robot has not answered the stop yet" if self.status == "requested" else ""

    def release(self, source: str) -> None:
        self.status = "released"
        self.stopped_rules = []
        self._core.emit(StopRecord, "released", source=source)
        self._core.commands.append(EndStop())

    def _cancel_timer(self) -> None:
        if self.timer is not None:
            self._core.cancel_timer(self.timer)
            self.timer = None
