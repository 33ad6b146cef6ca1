"""What becomes of an act that has failed: the study goes on, the wizard is asked, or the act is repeated (semantics.md
12.2)."""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct, field

from rise_engine.kernel.core import Core, Task, parse_task_id
from rise_engine.kernel.records import FailureRecord
from rise_engine.kernel.speech import SAY

REPEATING = "repeats task {}"
"""The reason of a task that is a repetition."""


class FailuresState(Struct):
    """What has to be known across inputs."""

    asked: dict[int, Task] = field(default_factory=dict)
    """Failed acts whose events are held until somebody answers, by task, the oldest first."""


class FailedActs:
    """Decides what a failure brings about, and takes the answers."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.state = FailuresState()
        self.add: Callable[[Task, str], None] = lambda task, reason: None
        """Schedules a task before all that wait; the reason stands in its record."""
        self.finish: Callable[[Task], None] = lambda task: None
        """Raises the events of an act's end."""
        self.note_repeated: Callable[[Task, Task], None] = lambda before, now: None
        """Called when a second task takes the place of a first."""

    def holds(self, task: Task, reason: str, *, by_itself: bool) -> bool:
        """An act has failed for this reason. Whether its events are not to be raised now, because it is repeated or
        somebody is asked. `by_itself`: whether it may be repeated without anybody asking."""
        if task.function == SAY:
            return False
        policy = self._core.scenario.failure_policy(task.behavior)
        if policy.kind == "go_on":
            return False
        if policy.kind == "repeat" and task.attempt > policy.times:
            self._record(task, "gone-on", "engine", reason=f"failed {task.attempt} times")
            return False
        if policy.kind == "repeat" and by_itself:
            self._repeat(task, "engine")
        else:
            self.state.asked[task.id] = task
            self._record(task, "asked", "engine", reason=reason)
        return True

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
        task = self._take(behavior)
        self._repeat(task, source)

    def go_on(self, behavior: str, source: str) -> None:
        """Raise the events of the failure, as if nobody had been asked."""
        task = self._take(behavior)
        self._record(task, "gone-on", source)
        self.finish(task)

    def drop(self, source: str, reason: str, started_after: int = 0) -> None:
        """Forget the questions about what `source` has started by tasks after this id; nothing is raised."""
        if self.state.asked:
            asked = [
                task
                for task in self.state.asked.values()
                if source in ("", task.source) and first_task(task) > started_after
            ]
            for task in asked:
                del self.state.asked[task.id]
                self._record(task, "dropped", "engine", reason=reason)

    def _take(self, behavior: str) -> Task:
        task = self.find(behavior)
        assert task is not None, "asked for after why_not_answer"
        return self.state.asked.pop(task.id)

    def _repeat(self, task: Task, source: str) -> None:
        core = self._core
        again = Task(core.next_task, task.function, task.behavior, task.calling_type, task.source)
        core.next_task += 1
        again.attempt, again.first = task.attempt + 1, first_task(task)
        self._record(task, "repeated", source, again.id)
        self.note_repeated(task, again)
        self.add(again, REPEATING.format(task.id))

    def _record(self, task: Task, status: str, source: str, by: int | None = None, reason: str = "") -> None:
        self._core.emit(FailureRecord, task.id, task.behavior, status, source, by, reason)  # type: ignore[arg-type]


def first_task(task: Task) -> int:
    """The id of the task that a task repeats, if need be over others; its own if it repeats none."""
    return task.first or task.id
