"""What follows a failed act: the study goes on, the wizard is asked, or the act is repeated (semantics.md 12.2)."""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct, field

from rise_engine.kernel.core import Core, Task, TimerTarget, parse_task_id
from rise_engine.kernel.records import FailureRecord, FailureStatus
from rise_engine.kernel.speech import SAY

REPEATING = "repeats task {}"
"""The reason of a task that is a repetition."""
FIRST_PAUSE, LONGEST_PAUSE = 2.0, 10.0
"""Seconds of the pause before the first automatic repetition, and of the longest pause. Each pause doubles the last."""


class FailuresState(Struct):
    """The state that is kept across inputs."""

    asked: dict[int, Task] = field(default_factory=dict)
    """Failed acts whose events are held until an answer or a repetition, by task, oldest first."""
    pauses: dict[int, int | None] = field(default_factory=dict)
    """The acts in `asked` that are repeated automatically: the pause's timer; null: it begins when the robot is
    back."""


class FailedActs:
    """Decides what happens after a failure, and handles the answers."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.state = FailuresState()
        self.add: Callable[[Task, str], None] = lambda task, reason: None
        """Schedules a task before all waiting ones. Its record contains the reason."""
        self.finish: Callable[[Task], None] = lambda task: None
        """Raises the events of an act's end."""
        self.advance: Callable[[], None] = lambda: None
        """Called when other acts may start, because a pause has ended."""
        self.note_repeated: Callable[[Task, Task], None] = lambda before, now: None
        """Called when a second task replaces a first."""

    def holds(self, task: Task, reason: str, may_repeat: bool, robot_lost: bool) -> bool:
        """Whether to hold the events of a failure, because the act waits for its repetition or an answer.

        Arguments:
            task: its task, which was ABORTED.
            reason: why it was.
            may_repeat: whether it may be repeated automatically. Not if the robot or another program ended the act, or
                an earlier engine started it.
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

    # --- automatic repetition ---

    def pause_elapsed(self, id: int, robot_lost: str | None) -> None:
        """Handle the end of a failed act's pause. `robot_lost`: why it must still wait, or None."""
        task = self.state.asked[id]
        self.state.pauses[id] = None
        if robot_lost is None:
            self._repeat(self._take(task), "engine")
        else:
            self._wait_for_robot(task, robot_lost)
            self.advance()

    def robot_back(self) -> None:
        """Repeat the acts that waited for the robot, after a pause and with a new count of attempts."""
        for id in [id for id, timer in self.state.pauses.items() if timer is None]:
            task = self.state.asked[id]
            task.attempt = 1
            self._pause(task, "the robot is back")

    @property
    def waiting(self) -> list[Task]:
        """The failed acts that are repeated automatically."""
        return [task for id, task in self.state.asked.items() if id in self.state.pauses]

    @property
    def pausing(self) -> list[Task]:
        """The acts in `waiting` whose pause has begun. They prevent other starts as if they were running."""
        return [task for task in self.waiting if self.state.pauses[task.id] is not None]

    def stop(self, tasks: list[Task], source: str, reason: str = "") -> None:
        """Raise the events of these acts instead of repeating them automatically."""
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
        """The failed act that an answer names: by its task's id, or by its name (the oldest of several)."""
        asked = self.state.asked
        found = asked.get(parse_task_id(behavior))
        return found or next((task for task in asked.values() if task.behavior == behavior), None)

    def why_not_answer(self, behavior: str) -> str:
        """Why no decision about this act is possible; empty: it is."""
        return "" if self.find(behavior) is not None else f"no failed act {behavior} waits for an answer"

    def repeat(self, behavior: str, source: str) -> None:
        """Start the act again. The repetition's end replaces the held end."""
        self._repeat(self._take(self._found(behavior)), source)

    def go_on(self, behavior: str, source: str) -> None:
        """Raise the events of the failure, as if there had been no question."""
        self.stop([self._found(behavior)], source)

    def drop(self, source: str, reason: str, started_after: int = 0) -> bool:
        """Drop the questions about acts of `source` (empty: all) whose first task is after this id. Returns whether any
        was."""
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
        """Remove an act that no longer waits."""
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
    """The id of the first task that a task repeats; its own id if it repeats none."""
    return task.first or task.id
