"""The task scheduler: which act runs, which waits (semantics, section 5).

Blocking acts run one at a time, in the order of the queue. A None act runs beside them unless it needs a channel of the
running Blocking act; when a Blocking act needs the channel of a running None act, that one is interrupted first.
"""

from __future__ import annotations

from rise_engine.kernel.acts import ActRun, ActRunner
from rise_engine.kernel.core import Core, Task


class Scheduler:
    __slots__ = ("_again", "_core", "_runner", "_working", "waiting")

    def __init__(self, core: Core) -> None:
        self._core = core
        self._runner = ActRunner(core, self._act_ended)
        self._working = False
        self._again = False
        self.waiting: list[Task] = []
        """Accepted acts that have not started, next first."""

    @property
    def runner(self) -> ActRunner:
        return self._runner

    def has(self, act: str) -> bool:
        """Whether any task of an act is running or waiting."""
        tasks = [*self.waiting, *(run.task for run in self._runner.runs.values())]
        return any(task.behavior == act for task in tasks)

    def add(self, task: Task) -> None:
        self.waiting.append(task)
        self._core.task_record(task, position=len(self.waiting) - 1)
        self.advance()

    def move(self, task: Task, position: int) -> None:
        """Give a waiting task another place; the order of the others stays."""
        self.waiting.remove(task)
        position = max(0, min(position, len(self.waiting)))
        self.waiting.insert(position, task)
        self._core.task_record(task, "moved", position)
        self.advance()

    def remove(self, task: Task, reason: str) -> None:
        """Take a waiting task out. Its act has ended for everyone who waits for that, without ever having started."""
        self.waiting.remove(task)
        self._end(task, "CANCELED", reason)
        self.advance()

    def stop(self, act: str, reason: str) -> int:
        """Stop every task of an act, running or waiting; how many there were."""
        waiting = [task for task in self.waiting if task.behavior == act]
        running = [run for run in self._runner.runs.values() if run.task.behavior == act]
        for task in waiting:
            self.waiting.remove(task)
            self._end(task, "CANCELED", reason)
        for run in running:
            self._runner.cancel(run, reason)
        self.advance()
        return len(waiting) + len(running)

    def stop_all(self, reason: str) -> None:
        for task in list(self.waiting):
            self.waiting.remove(task)
            self._end(task, "CANCELED", reason)
        for run in list(self._runner.runs.values()):
            self._runner.cancel(run, reason)

    def advance(self) -> None:
        """Start what may start. Called whenever something was added, moved or ended."""
        if self._working:
            self._again = True  # an act that ends while it is being started; the loop below goes round again
            return
        self._working = True
        try:
            self._again = True
            while self._again:
                self._again = False
                self._pass()
        finally:
            self._working = False

    def _pass(self) -> None:
        blocking = next((run for run in self._runner.runs.values() if run.task.calling_type == "Blocking"), None)
        holder = blocking.task if blocking is not None else None
        if holder is None:
            holder = next((task for task in self.waiting if task.calling_type == "Blocking"), None)
            if holder is not None and self._channels_are_free_for(holder):
                self._start(holder)
        for task in [task for task in self.waiting if task.calling_type == "None"]:
            if holder is None or not self._channels(task) & self._channels(holder):
                self._start(task)

    def _channels_are_free_for(self, task: Task) -> bool:
        """Interrupt the None acts that occupy a channel it needs; true when there is none."""
        channels = self._channels(task)
        in_the_way = [run for run in self._runner.runs.values() if self._channels(run.task) & channels]
        for run in in_the_way:
            self._runner.cancel(run, f"interrupted by {task.behavior}")
        # An act that only waits ends within cancel(); one on the robot ends when the robot has confirmed.
        return not any(self._channels(run.task) & channels for run in self._runner.runs.values())

    def _start(self, task: Task) -> None:
        self.waiting.remove(task)
        task.status = "ACTIVE"
        self._core.task_record(task)
        self._again = True
        self._runner.start(task)

    def _act_ended(self, run: ActRun, status: str, reason: str) -> None:
        self._end(run.task, status, reason)
        self.advance()

    def _end(self, task: Task, status: str, reason: str) -> None:
        core = self._core
        task.status = status  # type: ignore[assignment]
        core.task_record(task, reason)
        core.raise_if_named(task.behavior + _OUTCOMES[status])
        core.raise_if_named(task.behavior + "_end")

    def _channels(self, task: Task) -> frozenset[str]:
        return self._core.scenario.acts[task.behavior].channels


_OUTCOMES = {"SUCCEEDED": "_succeeded", "ABORTED": "_failed", "CANCELED": "_stopped"}
