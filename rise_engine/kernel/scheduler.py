"""The task scheduler: which act runs, and which waits (semantics.md 3).

Blocking acts run one at a time, in the order of the queue. A None act runs beside them unless it needs a channel of the
running Blocking act. When a Blocking act needs the channel of a running None act, the None act is interrupted first. An
Interrupt act is a Blocking act that does not wait: the running Blocking act is stopped for it.
"""

from __future__ import annotations

from collections.abc import Callable

from rise_engine.kernel.act_runner import ActRun, ActRunner
from rise_engine.kernel.core import Core, Task
from rise_engine.kernel.failures import FailedActs
from rise_engine.kernel.records import TaskStatus, TimingRecord
from rise_engine.kernel.speech import SAY, act_name, find_act
from rise_engine.kernel.wizard_marks import WizardMarks
from rise_engine.scenario.model import ActOutcome

MAX_ACTS = 1_000
"""The number of acts that wait, run or have failed without an answer, before others are refused (semantics.md 3)."""
FULL = f"{MAX_ACTS:,} acts are waiting, running or failed without an answer; probably a rule starts acts without end"


class Scheduler:
    def __init__(
        self, core: Core, wizard: WizardMarks, failures: FailedActs, act_runner: type[ActRunner] = ActRunner
    ) -> None:
        self._core = core
        self._wizard = wizard
        self._failures = failures
        failures.add, failures.finish, failures.advance = self._add_again, self._raise_end, self.advance
        self.on_ended: Callable[[Task, ActOutcome], None] = lambda task, outcome: None
        """Called with each ended task before its events are raised."""
        self.runner = act_runner(core, self._finish_act)
        self._advancing = False
        self._advance_again = False
        self.waiting: list[Task] = []
        """Accepted acts that have not started, next first."""

    def has_task_of(self, act: str) -> bool:
        """Whether any task of an act is running or waiting."""
        tasks = [*self.waiting, *(run.task for run in self.runner.runs.values())]
        return any(_starts_act(task, act) for task in tasks)

    @property
    def is_full(self) -> bool:
        """Whether no other act is accepted. Each start goes through all these acts."""
        return len(self.waiting) + len(self.runner.runs) + len(self._failures.state.asked) >= MAX_ACTS

    def add(self, task: Task) -> None:
        self._wizard.note_accepted(task)
        position = len(self.waiting)
        if task.calling_type == "Interrupt":
            position = next(
                (at for at, other in enumerate(self.waiting) if other.calling_type != "Interrupt"), position
            )
        self.waiting.insert(position, task)
        self._core.record_task(task, position=position)
        if task.calling_type == "Interrupt":
            reason = f"interrupted by {act_name(task)}"
            for run in [run for run in self.runner.runs.values() if _is_exclusive(run.task)]:
                self.runner.cancel(run, reason)
            self._end_pauses([failed for failed in self._failures.pausing if _is_exclusive(failed)], reason)
        self.advance()

    def _add_again(self, task: Task, reason: str) -> None:
        """Add a repetition before all waiting tasks except other repetitions."""
        self._wizard.note_accepted(task)
        position = next((at for at, other in enumerate(self.waiting) if not other.first), len(self.waiting))
        self.waiting.insert(position, task)
        self._core.record_task(task, reason, position=position)
        self.advance()

    def move(self, task: Task, position: int) -> None:
        """Move a waiting task to another position. The others keep their order."""
        self.waiting.remove(task)
        position = min(position, len(self.waiting))
        self.waiting.insert(position, task)
        self._core.record_task(task, "moved", position)
        self.advance()

    def remove(self, task: Task, reason: str) -> None:
        """Remove a waiting task. Its act ends without having started."""
        self.waiting.remove(task)
        self._record_end(task, "CANCELED", reason)
        self.advance()

    def stop(self, reason: str, act: str | None = None) -> None:
        """Stop every task, running or waiting, or every task of one act."""
        self._stop_matching(lambda task: act is None or _starts_act(task, act), reason)

    def stop_started_by(self, source: str, reason: str) -> None:
        """Stop every task, running or waiting, of one source."""
        self._stop_matching(lambda task: task.source == source, reason)

    def _stop_matching(self, is_meant: Callable[[Task], bool], reason: str) -> None:
        waiting = [task for task in self.waiting if is_meant(task)]
        running = [run for run in self.runner.runs.values() if is_meant(run.task)]
        for task in waiting:
            self.waiting.remove(task)
            self._record_end(task, "CANCELED", reason)
        for run in running:
            self.runner.cancel(run, reason)
        self.advance()

    def advance(self) -> None:
        """Start every task that may start. Called after each addition, move or end."""
        self._advance_again = True
        if self._advancing:
            return  # an act ended during its start; the loop below runs again
        self._advancing = True
        while self._advance_again:
            self._advance_again = False
            self._start_possible()
        self._advancing = False

    def resume_waiting(self) -> None:
        """Start what waited for a wizard: first the next actions of running acts, then the waiting tasks."""
        if self._core.waits_for_wizard:
            self._core.waits_for_wizard = False
            self._advancing = True
            self.runner.go_on()
            self._advancing = False
            self.advance()

    def _start_possible(self) -> None:
        if self._core.waits_for_wizard:
            return
        under_way = (*(run.task for run in self.runner.runs.values()), *self._failures.pausing)
        holder = next((task for task in under_way if _is_exclusive(task)), None)
        if holder is None:
            holder = next((task for task in self.waiting if _is_exclusive(task)), None)
            if holder is not None and self._clear_channels(holder):
                self._start(holder)
        for task in [task for task in self.waiting if task.calling_type == "None"]:
            if holder is None or not self._channels(task) & self._channels(holder):
                self._start(task)

    def _clear_channels(self, task: Task) -> bool:
        """Interrupt the None acts on channels that a task needs. Returns whether these channels are free."""
        reason = f"interrupted by {act_name(task)}"
        for run in self._runs_on_channels_of(task):
            self.runner.cancel(run, reason)
        channels = self._channels(task)
        self._end_pauses([failed for failed in self._failures.pausing if self._channels(failed) & channels], reason)
        # An act that only waits ends within cancel(). One on the robot ends when the robot confirms.
        return not self._runs_on_channels_of(task)

    def _end_pauses(self, failed: list[Task], reason: str) -> None:
        """Do not repeat these acts: if they were running, they would be cancelled now."""
        if failed:
            self._failures.stop(failed, "engine", reason)

    def _runs_on_channels_of(self, task: Task) -> list[ActRun]:
        channels = self._channels(task)
        return [run for run in self.runner.runs.values() if self._channels(run.task) & channels]

    def _start(self, task: Task) -> None:
        self.waiting.remove(task)
        task.status = "ACTIVE"
        self._core.record_task(task)
        self._wizard.note_started(task)
        self._advance_again = True
        self.runner.start(task)

    def _finish_act(self, run: ActRun, status: TaskStatus, reason: str) -> None:
        self._record_end(run.task, status, reason, interfered=run.interfered)
        self.advance()

    def _record_end(self, task: Task, status: TaskStatus, reason: str, *, interfered: bool = False) -> None:
        core = self._core
        task.status = status
        core.record_task(task, reason)
        self._wizard.note_ended(task)
        name = act_name(task)
        core.emit(
            TimingRecord,
            task.id,
            name,
            task.status,
            cue_at=task.cue_at,
            key_at=task.key_at,
            accepted_at=task.accepted_at,
            started_at=task.started_at,
            robot_at=task.robot_at,
            ended_at=core.t,
            source=task.source,
            filler=task.filler,
            voice_at=task.voice_at,
        )
        may_repeat = not (interfered or self.runner.earlier_goals)
        if status == "ABORTED" and self._failures.holds(task, reason, may_repeat, self.runner.robot_lost is not None):
            self._wizard.forget_failure(task)
        else:
            self._raise_end(task)

    def _raise_end(self, task: Task) -> None:
        """Raise the events of an act's end."""
        core, name = self._core, act_name(task)
        outcome = _OUTCOMES[task.status]
        before = core.cause
        if core.origin is None:  # after a lost robot, this act is the cause of the rules' steps
            core.cause = (task.id, before)
        self.on_ended(task, outcome)
        core.raise_event_if_named(f"{name}_{outcome}")
        core.raise_event_if_named(name + "_end")
        core.cause = before

    def _channels(self, task: Task) -> frozenset[str]:
        return find_act(self._core.scenario, task).channels


def _is_exclusive(task: Task) -> bool:
    """Whether a task runs alone among its kind: Blocking or Interrupt."""
    return task.calling_type != "None"


def _starts_act(task: Task, act: str) -> bool:
    return task.behavior == act and task.function != SAY


_OUTCOMES: dict[str, ActOutcome] = {"SUCCEEDED": "succeeded", "ABORTED": "failed", "CANCELED": "stopped"}
