"""The kernel's state as plain data, taken between inputs (`Kernel.snapshot`) and restored (`Kernel.restore`)."""

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
from rise_engine.kernel.stop import StoppedRule, StopStatus
from rise_engine.kernel.wizard_marks import WizardMarksState


class RuleSnapshot(Struct, frozen=True):
    """A running rule."""

    name: str
    state: str
    task: Task
    priority: float
    recency: int
    timers: dict[int, int]
    """The index of the transition in the state, by timer. Like everything else here, an index is valid only for the
    scenario of the snapshot, so `Snapshot.scenario` is compared first."""
    latched: list[int]
    own_acts: dict[str, int]
    history: list[tuple[str, int]]
    """As `RuleRun.steps`."""
    steps: int
    """Its transitions in the macrostep to which further timers of the same moment would belong."""


class RulesSnapshot(Struct, frozen=True):
    """The state of all rules."""

    running: list[RuleSnapshot]
    """Bottom of the stack first."""
    step_counts: dict[str, int]
    """Steps of ended rules, as `RuleSnapshot.steps`."""
    recency: int
    """The highest recency of any rule so far."""
    kept: list[KeptEvent]
    """Oldest first."""


class Snapshot(Struct, frozen=True):
    """Everything that a kernel needs to continue."""

    scenario: str
    """The hash of the scenario's files. With other files, the snapshot has no meaning."""
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
    stopped_rules: list[StoppedRule]
    held_by: list[str]
    stops: int
    """The number of requested stops."""
    wizard_marks: WizardMarksState
    failures: FailuresState
    open_cue_at: float | None
    open_goals: tuple[OpenGoal, ...]
    waits_for_wizard: bool
    begun: SessionStarted

    def copy(self) -> Snapshot:
        """Copy through JSON, so that the copy shares nothing with a kernel and can certainly be sent."""
        return msgspec.json.decode(msgspec.json.encode(self), type=Snapshot)
