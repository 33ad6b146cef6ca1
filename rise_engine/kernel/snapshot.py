"""The kernel's whole state as a value: taken between inputs (`Kernel.snapshot`), sent or stored, and brought back to
life (`Kernel.restore`). Plain data through and through, so it can be encoded as JSON and decoded again."""

from __future__ import annotations

from typing import Any

import msgspec
from msgspec import Struct

from rise_engine.kernel.act_runner import ActRun
from rise_engine.kernel.core import Task, TimerTarget
from rise_engine.kernel.failures import FailuresState
from rise_engine.kernel.history import MemoryLog
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.kept_events import KeptEvent
from rise_engine.kernel.records import OpenGoal
from rise_engine.kernel.stop import StoodRule, StopStatus
from rise_engine.kernel.wizard_marks import WizardMarksState


class RuleSnapshot(Struct, frozen=True):
    """A running rule."""

    name: str
    state: str
    task: Task
    priority: float
    recency: int
    timers: dict[int, int]
    """Timer to index of the transition that it is for, in the state. An index says which one only within the very
    scenario that the snapshot was taken of, as everything else in it does; so `Snapshot.scenario` is compared first."""
    latched: list[int]
    own_acts: dict[str, int]
    history: list[tuple[str, int]]
    """As `RuleRun.steps`."""
    steps: int
    """Transitions that it has taken in the macrostep that timers of the same moment would still belong to."""


class RulesSnapshot(Struct, frozen=True):
    """Everything about the rules."""

    running: list[RuleSnapshot]
    """Bottom of the stack first."""
    step_counts: dict[str, int]
    """Steps of rules that have ended, as `RuleSnapshot.steps`."""
    recency: int
    """The highest that any rule has had."""
    kept: list[KeptEvent]
    """The oldest first."""


class Snapshot(Struct, frozen=True):
    """Everything that a kernel needs to go on."""

    scenario: str
    """The hash of the scenario's files: with others, nothing in here means what it says."""
    seed: int
    t: float
    seq: int
    rng: int
    next_task: int
    next_timer: int
    timers: dict[int, TimerTarget]
    reported_missing: list[str]
    memory: dict[str, Any]
    memory_log: MemoryLog
    rules: RulesSnapshot
    waiting: list[Task]
    acts: list[ActRun]
    last_pick: dict[str, int]
    robot_lost: str | None
    stop: StopStatus
    stop_timer: int | None
    stood: list[StoodRule]
    held_by: list[str]
    wizard_marks: WizardMarksState
    failures: FailuresState
    open_cue_at: float | None
    open_goals: tuple[OpenGoal, ...]
    begun: SessionStarted

    def copy(self) -> Snapshot:
        """By way of JSON, so that the copy shares nothing with a kernel and can surely be sent."""
        return msgspec.json.decode(msgspec.json.encode(self), type=Snapshot)
