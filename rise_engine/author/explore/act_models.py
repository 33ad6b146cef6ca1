"""Acts as single units: only what rules and the scheduler can see of them.

Rules learn only that an act has ended, and how. The scheduler uses only the channels of the whole act. So exploring
does not follow an act action by action: it runs until it succeeds, fails, or is cancelled. After a failure or
cancellation, the robot may have to confirm before the act ends. Where the next step depends on the moment within the
act, each possibility is a decision (`Decisions`), so that exploring tries them all.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias, cast

from rise_engine.author.explore.act_traits import ActTraits, begin
from rise_engine.kernel.act_runner import ActRun, ActRunner
from rise_engine.kernel.core import Core, Task, TimerTarget, parse_task_id
from rise_engine.kernel.records import ActionStatus, TaskStatus
from rise_engine.kernel.rng import Rng
from rise_engine.kernel.speech import find_act

# --- chance -----------------------------------------------------------------------------------------------------------

FRACTIONS = tuple(index / 12 for index in range(12))
"""Representatives of the numbers in [0, 1): twelve values, so that parts down to a twelfth all occur."""
MAX_SCRIPTS = 64
"""How many outcomes of one input are tried; random choices with more are not tried completely."""


class Decisions(Rng):
    """A source of chance that reads from a script and can provide the next script."""

    def __init__(self) -> None:
        super().__init__(0)
        self.made: list[tuple[int, int]] = []
        """Since `begin`: each decision, and its number of possibilities."""
        self._script: list[int] = []

    def begin(self, script: list[int]) -> None:
        """Decide from here on as the script says, and by 0 after its end."""
        self._script = script
        self.made.clear()

    def choose(self, count: int) -> int:
        """Choose one of `count` possibilities."""
        position = len(self.made)
        choice = self._script[position] if position < len(self._script) else 0
        self.made.append((choice, count))
        return choice

    def integer_below(self, count: int) -> int:
        return self.choose(count)

    def fraction(self) -> float:
        return FRACTIONS[self.choose(len(FRACTIONS))]

    def next_script(self) -> list[int] | None:
        """Return the next script: the last decision with a possibility left takes it; None: all were tried."""
        made = self.made
        while made:
            choice, count = made.pop()
            if choice + 1 < count:
                return [*(before for before, _ in made), choice + 1]
        return None


Phase: TypeAlias = Literal["running", "doomed", "failing", "canceling", "failing and canceling"]
"""doomed: one of its actions will fail in its turn, unless something gives the memory the value that it needs."""
FAILED = "an action failed"


class WholeActRun(ActRun):
    """An act that runs."""

    doomed: bool = False
    speaking: bool = False

    @property
    def phase(self) -> Phase:
        if self.cancel_reason is not None:
            return "canceling" if self.failure is None else "failing and canceling"
        if self.failure is not None:
            return "failing"
        return "doomed" if self.doomed else "running"


class WholeActs(ActRunner):
    """All running acts, each as a single unit.

    The robot's report on an act is an `ActionReport` for the action `ACT` of its task: `succeeded`; `failed`, also
    `aborted`, by the robot or somebody else; `canceled`, when a failing or cancelled act is over; `accepted`, when an
    act changes between speaking and silence.
    """

    def __init__(self, core: Core, on_ended: Callable[[ActRun, TaskStatus, str], None]) -> None:
        super().__init__(core, on_ended)
        self.traits: dict[str, ActTraits] = {}
        self.decisions = Decisions()
        """The source of decisions between the possibilities of a moment."""

    @property
    def is_speaking(self) -> bool:
        return any(cast(WholeActRun, run).speaking for run in self.runs.values())

    def start(self, task: Task) -> None:
        run = WholeActRun(task, {})
        self.runs[task.id] = run
        core = self._core
        act = find_act(core.scenario, task)
        traits = self.traits[act.name]
        lost = self.robot_lost is not None
        beginning, robot_began, run.doomed = begin(core.scenario, act, core.memory, lost, self.decisions.choose)
        if beginning == "fails":
            run.failure = FAILED
            if not (robot_began and self.decisions.choose(2)):
                self._finish(run)
        elif beginning == "ends":
            self._finish(run)
        else:
            run.speaking = traits.speaks

    def report(self, goal: str, status: ActionStatus, reason: str, *, aborted: bool = False) -> None:
        run = cast(WholeActRun, self.runs[parse_task_id(goal.partition("/")[0])])
        if status == "accepted":
            run.speaking = not run.speaking
        elif aborted and self.traits[run.task.behavior].can_go_on and self.decisions.choose(2):
            run.interfered = True
        elif status == "failed":
            run.failure, run.interfered = FAILED, aborted or run.interfered
            winds_down = self.robot_lost is None and self.traits[run.task.behavior].is_parallel
            if not (winds_down and self.decisions.choose(2)):
                self._finish(run)
        else:
            self._finish(run)

    def timer_elapsed(self, target: TimerTarget) -> None:
        raise AssertionError("acts that are one thing set no timers")

    def lose_running(self, reason: str) -> None:
        for each in list(self.runs.values()):
            run, traits = cast(WholeActRun, each), self.traits[each.task.behavior]
            if run.failure is not None or run.cancel_reason is not None:
                self._finish(run)
            elif traits.uses_robot and not (traits.waits and self.decisions.choose(2)):
                if traits.can_fail:
                    run.failure = reason
                self._finish(run)
            elif traits.can_fail:
                run.speaking = False

    def cancel(self, run: ActRun, reason: str) -> None:
        if run.cancel_reason is not None:
            return
        run.cancel_reason = reason
        traits = self.traits[run.task.behavior]
        if run.failure is None and (not traits.uses_robot or (traits.waits and self.decisions.choose(2))):
            self._finish(run)
