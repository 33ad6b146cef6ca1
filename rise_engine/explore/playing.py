"""A path played on the engine itself: when somebody must do what, and what must go wrong, so that it goes like this.

Times are thought out (`rise_engine.explore.path_times`), played in virtual time with the simulated robot
(`rise_engine.explore.attempt`), and what is seen then is reckoned with in the next attempt, until it goes as the path
has it, or no attempt is left.
"""

from __future__ import annotations

from collections.abc import Sequence

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.explore.attempt import Attempt
from rise_engine.explore.bounds import Bounds
from rise_engine.explore.cone import keys_that_matter
from rise_engine.explore.following import Followed, find_repeating, follow_path
from rise_engine.explore.path_times import PathTimes, PlannedTimes
from rise_engine.explore.paths import Path
from rise_engine.explore.telling import move_text
from rise_engine.explore.timetable import Contradiction
from rise_engine.protocol.task_file import TimedTask
from rise_engine.scenario.model import Scenario

ATTEMPTS = 25
"""How often times are thought out anew, at most, for one seed."""
SEEDS = 300
"""How many seeds are tried where chance decides."""
_PACE = (0.5, 3.0)
"""How many times what is expected acts take, where the bounds do not say."""
FILE = "path"
"""What stands for a file's name in tasks that are in none."""


class PlayedPath(Struct, frozen=True):
    """How a path is played."""

    tasks: tuple[TimedTask, ...]
    """What somebody does, and when; `line` is the number of the path's step."""
    faults: tuple[str, ...]
    """What goes wrong, as `--fault` has it."""
    seed: int
    """With which it plays."""
    condition: str
    """Of the session, as the scenario names it; empty: none."""
    seconds: float
    """Session time at which the path is at its end."""
    is_certain: bool
    """Whether it was played like this, with every situation as the path has it."""
    problem: str
    """Why it could not be, in words without a full stop; empty: it was."""


def find_times(scenario: Scenario, path: Path, bounds: Bounds | None = None) -> PlayedPath:
    """Play a path on the engine, and say how.

    Between two steps others may come and go, as long as everything is then as the path has it: a gaze that ends and
    begins again.

    Arguments:
        scenario: what was explored.
        path: a way through its situations.
        bounds: with which it was explored: what is tried, and how fast acts go.

    Raises rise_engine.explore.following.PathMismatch when the path is of another scenario.
    """
    bounds = bounds or Bounds()
    scenario = replace(scenario, mode="debug")
    return _Search(scenario, path, follow_path(scenario, path, bounds), bounds).find()


class _Search:
    """All attempts for one path."""

    def __init__(self, scenario: Scenario, path: Path, followed: Sequence[Followed], bounds: Bounds) -> None:
        self._scenario = scenario
        self._path = path
        self._followed = followed
        self._keys = _compared_keys(scenario, path)
        memory = {**scenario.memory, **path.begun.memory}
        again = find_repeating(scenario, followed, self._keys, path, bounds)
        self._times = PathTimes(scenario, followed, memory, bounds.pace or _PACE, again)
        self._chances = [step for step, each in enumerate(followed) if each.by_chance]
        self._best: tuple[int, PlannedTimes, int, float] | None = None
        """Of all attempts the one that came furthest: how many steps, its plan, its seed, and how long."""

    def find(self) -> PlayedPath:
        problem, in_vain = "", 0
        for seed in range(SEEDS if self._chances else 1):
            problem = self._try_seed(seed)
            if not problem:
                break
            reached = self._best[0] if self._best is not None else 0
            if not self._chances or reached + 1 < self._chances[0]:
                break  # another seed would not help
            in_vain += reached + 1 not in self._chances
            if in_vain > ATTEMPTS:
                break
        if self._best is None:
            return PlayedPath((), (), 0, self._path.begun.condition, 0.0, False, problem)
        _, plan, seed, seconds = self._best
        tasks = (
            TimedTask(round(plan.times[step], 3), replace(each.submitted, source="file"), FILE, step)
            for step, each in enumerate(self._followed)
            if each.submitted is not None
        )
        return PlayedPath(tuple(tasks), plan.faults, seed, self._path.begun.condition, seconds, not problem, problem)

    def _try_seed(self, seed: int) -> str:
        """Why the path could not be played with this seed; empty: it was, and that is the best attempt."""
        problem = ""
        tried: set[tuple[tuple[float, ...], tuple[str, ...]]] = set()
        for _ in range(ATTEMPTS):
            plan = self._times.plan()
            if isinstance(plan, Contradiction):
                return self._contradiction_text(plan)
            if (plan.times, plan.faults) in tried:
                break
            tried.add((plan.times, plan.faults))
            attempt = Attempt(self._scenario, self._path.begun, self._followed, self._keys, plan, seed)
            has_played = attempt.play()
            attempt.teach(self._times.known)
            if has_played or self._best is None or attempt.reached > self._best[0]:
                self._best = (attempt.reached, plan, seed, attempt.reached_at)
            if has_played:
                return ""
            problem = self._mismatch_text(attempt.reached)
            if attempt.reached + 1 in self._chances:
                break
        return problem

    def _mismatch_text(self, reached: int) -> str:
        before, step = self._followed[reached], self._followed[reached + 1]
        assert step.move is not None, "only the beginning is no move"
        text = move_text(self._scenario, step.move, before, step)
        return f"no times were found at which step {reached + 1}, “{text}”, comes as it is told here"

    def _contradiction_text(self, found: Contradiction) -> str:
        names = {task: name for each in self._followed for task, (name, _) in each.running.items()}
        counted = {number: each for step in self._followed for number, each in step.countdowns.items()}
        things: list[str] = []
        for tag in found.tags:
            match tag:
                case ("timer", int(number)):
                    things.append(f"the {counted[number].length / 1000:g} s of {counted[number].owner}")
                case ("act" | "fail" | "part" | "voice" | "cancel", int(task), *_):
                    things.append(names[task])
        what = " and ".join(sorted(set(things)))
        return f"the times of {what} do not go together" if what else "its steps leave no time for one another"


def _compared_keys(scenario: Scenario, path: Path) -> tuple[str, ...]:
    """The memory keys whose values stand in the path's situations; none, when that cannot be told."""
    memories = [{**scenario.memory, **condition.memory} for condition in scenario.conditions.values()]
    keys = tuple(keys_that_matter(scenario, memories or [scenario.memory]))
    return keys if len(keys) == len(path.beginning.memory) and not scenario.reads_session else ()
