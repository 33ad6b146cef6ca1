"""What becomes of an act that has failed: the study goes on, the wizard is asked, or the act is repeated after a pause
(semantics.md 12.2)."""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct, field

from rise_engine.kernel.core import Core, Task, TimerTarget, parse_task_id
from rise_engine.kernel.records import FailureRecord, FailureStatus
from rise_engine.kernel.speech import SAY

REPEATING = "repeats task {}"
"""The reason of a task that is a repetition."""
FIRST_PAUSE, LONGEST_PAUSE = 2.0, 10.0
"""Seconds before an act is repeated by itself for the first time; each further pause is twice as long as the last, up
to the longest."""


class FailuresState(Struct):
    """What has to be known across inputs."""

    asked: dict[int, Task] = field(default_factory=dict)
    """Failed acts whose events are held, by task, the oldest first: until somebody answers, or they are repeated."""
    pauses: dict[int, int | None] = field(default_factory=dict)
    """Those of them that are repeated by themselves: by task, the timer of the pause; null: it begins when the robot is
    back."""


class FailedActs:
    """Decides what a failure brings about, and takes the answers."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.state = FailuresState()
        self.add: Callable[[Task, str], None] = lambda task, reason: None
        """Schedules a task before all that wait; the reason stands in its record."""
        self.finish: Callable[[Task], None] = lambda task: None
        """Raises the events of an act's end."""
        self.advance: Callable[[], None] = lambda: None
        """Called when others may start, because a pause has ended."""
        self.note_repeated: Callable[[Task, Task], None] = lambda before, now: None
        """Called when a second task takes the place of a first."""

    def holds(self, task: Task, reason: str, may_repeat: bool, robot_lost: bool) -> bool:
        """Whether the events of a failure are not to be raised now, because the act waits for its repetition, or for
        an answer.

        Arguments:
            task: its task, which was ABORTED for this reason.
            reason: why.
            may_repeat: whether it may be repeated without anybody asking for it. An act that the robot or somebody else
                has ended may not, nor one that an engine was doing that has gone.
            robot_lost: whether a repetition has to wait until the robot is back.
        """
        if task.function == SAY:
            return False
        policy = self._core.scenario.failure_policy(task.behavior)
        if policy.kind == "go_on":
            return False
        repeats = policy.kind == "repeat" and may_repeat
        if repeats and task.attempt > policy.times:
            self._record(task, "gone-on", "engine", reason=f"failed {task.attempt} times")
            return False
        self.state.asked[task.id] = task
        if not repeats:
            self._record(task, "asked", "engine", reason=reason)
        elif robot_lost:
            self._wait_for_robot(task, reason)
        else:
            self._pause(task, reason)
        return True

    # --- repeating by itself ---

    def pause_elapsed(self, id: int, robot_lost: str | None) -> None:
        """The pause of a failed act is over. `robot_lost`: why it has to wait nevertheless, or null."""
        task = self.state.asked[id]
        self.state.pauses[id] = None
        if robot_lost is None:
            self._repeat(self._take(task), "engine")
        else:
            self._wait_for_robot(task, robot_lost)
            self.advance()

    def robot_back(self) -> None:
        """What has waited for the robot is repeated after a pause, and counted anew."""
        for id in [id for id, timer in self.state.pauses.items() if timer is None]:
            task = self.state.asked[id]
            task.attempt = 1
            self._pause(task, "the robot is back")

    @property
    def waiting(self) -> list[Task]:
        """The failed acts that are repeated by themselves."""
        return [task for id, task in self.state.asked.items() if id in self.state.pauses]

    @property
    def pausing(self) -> list[Task]:
        """Those of them whose pause has begun: they keep others from starting as if they ran."""
        return [task for task in self.waiting if self.state.pauses[task.id] is not None]

    def stop(self, tasks: list[Task], source: str, reason: str = "") -> None:
        """These acts are not repeated by themselves, and their events are raised."""
        for task in tasks:
            self._record(self._take(task), "gone-on", source, reason=reason)
            self.finish(task)
        self.advance()

    def _pause(self, task: Task, reason: str) -> None:
        seconds = min(FIRST_PAUSE * 2 ** (task.attempt - 1), LONGEST_PAUSE)
        self.state.pauses[task.id] = self._core.set_timer(seconds, TimerTarget("repeat", str(task.id)))
        self._record(task, "waiting", "engine", reason=reason, seconds=seconds)

    def _wait_for_robot(self, task: Task, reason: str) -> None:
        self.state.pauses[task.id] = None
        self._record(task, "waiting", "engine", reason=reason)

    # --- answers ---

    def find(self, behavior: str) -> Task | None:
        """The failed act that an answer is about: its task's id, or its name, of several of one name the oldest."""
        asked = self.state.asked
        found = asked.get(parse_task_id(behavior))
        return found or next((task for task in asked.values() if task.behavior == behavior), None)

    def why_not_answer(self, behavior: str) -> str:
        """Why nobody can say what is to become of this act, or empty."""
        return "" if self.find(behavior) is not None else f"no failed act {behavior} waits for an answer"

    def repeat(self, behavior: str, source: str) -> None:
        """Start the act again; its end will be the end that is waited for."""
        self._repeat(self._take(self._found(behavior)), source)

    def go_on(self, behavior: str, source: str) -> None:
        """Raise the events of the failure, as if nobody had been asked."""
        self.stop([self._found(behavior)], source)

    def drop(self, source: str, reason: str, started_after: int = 0) -> bool:
        """Forget the questions about what `source` has started by tasks after this id; nothing is raised. Whether there
        were any."""
        asked = [
            task
            for task in self.state.asked.values()
            if source in ("", task.source) and first_task(task) > started_after
        ]
        for task in asked:
            self._record(self._take(task), "dropped", "engine", reason=reason)
        return bool(asked)

    def _found(self, behavior: str) -> Task:
        task = self.find(behavior)
        assert task is not None, "asked for after why_not_answer"
        return task

    def _take(self, task: Task) -> Task:
        """It no longer waits for anything."""
        del self.state.asked[task.id]
        if (timer := self.state.pauses.pop(task.id, None)) is not None:
            self._core.cancel_timer(timer)
        return task

    def _repeat(self, task: Task, source: str) -> None:
        core = self._core
        again = Task(core.next_task, task.function, task.behavior, task.calling_type, task.source)
        core.next_task += 1
        again.attempt, again.first, again.cause = task.attempt + 1, first_task(task), task.id
        self._record(task, "repeated", source, again.id)
        self.note_repeated(task, again)
        self.add(again, REPEATING.format(task.id))

    def _record(
        self,
        task: Task,
        status: FailureStatus,
        source: str,
        by: int | None = None,
        reason: str = "",
        seconds: float | None = None,
    ) -> None:
        self._core.emit(FailureRecord, task.id, task.behavior, status, source, by, reason, seconds)


def first_task(task: Task) -> int:
    """The id of the task that a task repeats, if need be over others; its own if it repeats none."""
    return task.first or task.id
