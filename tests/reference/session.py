"""What all parts of the interpreter share: the time, what is put out, and the times that run (semantics.md 0, 11)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from rise_engine.scenario.model import Scenario

from .chance import Chance

if TYPE_CHECKING:
    from .acts import Acts
    from .failures import Failures
    from .going_on import GoingOn
    from .kept import KeptEvents
    from .marks import Marks
    from .memory import Memory
    from .rules import Rules
    from .scheduler import Scheduler
    from .standing import Standing
    from .stop import Stop
    from .tasks import Tasks
    from .times import Times

Row = dict[str, Any]


@dataclass(eq=False)
class Clock:
    """A time that runs."""

    due: float
    what: Callable[[], None]
    task: int | None = None
    """The task that it belongs to, if it does to one."""


@dataclass
class Session:
    """One session, with a place for each part of it."""

    scenario: Scenario
    seed: int
    now: float = 0.0
    records: list[Row] = field(default_factory=list)
    orders: list[tuple[Any, ...]] = field(default_factory=list)
    clocks: list[Clock] = field(default_factory=list)
    pressed: float | None = None
    """When a key was pressed for what is going on now."""
    origin: int | None = None
    """The task that the input at hand belongs to, if it does to one."""

    def __post_init__(self) -> None:
        self.chance = Chance(self.seed)
        self.tasks: Tasks
        self.acts: Acts
        self.scheduler: Scheduler
        self.rules: Rules
        self.memory: Memory
        self.marks: Marks
        self.stop: Stop
        self.times: Times
        self.kept: KeptEvents
        self.standing: Standing
        self.failures: Failures
        self.going_on: GoingOn

    def put(self, kind: str, **fields: Any) -> Row:
        """A record."""
        row = {"kind": kind, "t": self.now, **fields}
        self.records.append(row)
        return row

    def order(self, *what: Any) -> None:
        """A command to the robot."""
        self.orders.append(what)

    def after(self, seconds: float, what: Callable[[], None], task: int | None = None) -> Clock:
        """`what` is to happen that long from now: times are counted in whole microseconds."""
        clock = Clock(round(self.now + seconds, 6), what, task)
        self.clocks.append(clock)
        return clock

    def forget(self, clock: Clock | None) -> None:
        """A time no longer runs."""
        if clock in self.clocks:
            self.clocks.remove(clock)
