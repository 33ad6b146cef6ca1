"""What only a person at a console asks for: free speech, the participant's cue, the next filler, and mistakes as data.

Like everything else they are DomainTasks (semantics.md 4.1), so that one log shows them.
"""

from __future__ import annotations

from typing import get_args

from msgspec import Struct, field

from rise_engine.kernel.core import Core, Task, TimerTarget, parse_task_id
from rise_engine.kernel.records import CueRecord, Mark, MistakeRecord, TaskRecord
from rise_engine.kernel.speech import act_name
from rise_engine.scenario.fillers import next_filler

MARKS: tuple[Mark, ...] = get_args(Mark)
REMEMBERED = 1000
"""Acts, and other tasks of wizards, that can still be marked as a mistake; older ones only in the record itself."""
UNMARKABLE = frozenset({"markMistake", "goOn", "repeatAct", "stopRuleOfAct"})
"""What a wizard says about tasks; it is no deed that could have been a mistake."""
LONGEST_SPEECH = 2000
"""Characters of free speech. Nobody says more in one go; what is longer was pasted by mistake."""


class WizardMarksState(Struct):
    """What has to be known across inputs."""

    last_filler: str | None = None
    filler_timer: int | None = None
    """Runs from a cue on when the scenario wants fillers without the wizard."""
    act_tasks: dict[int, str] = field(default_factory=dict)
    """The latest tasks that asked for an act, with its name."""
    other_tasks: list[int] = field(default_factory=list)
    """The latest other tasks that wizards have asked for: rules, events, memory, whatever a key can do."""
    failed_acts: dict[int, str] = field(default_factory=dict)
    """Failed acts that nobody has answered yet, by task: what was to be done, which a later task can make good."""


class WizardMarks:
    """The cue, the fillers and the marks."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.state = WizardMarksState()

    # --- acts come and go ---

    def note_accepted(self, task: Task) -> None:
        """An act or free speech was taken on: note what it answers, and when it was asked for."""
        core, acts = self._core, self.state.act_tasks
        task.cue_at, task.key_at, task.accepted_at = core.open_cue_at, core.key_at, core.t
        acts[task.id] = act_name(task)
        if len(acts) > REMEMBERED:
            del acts[next(iter(acts))]
        if self._is_filler(task):
            self.state.last_filler = task.behavior

    def note_started(self, task: Task) -> None:
        """A filler bridges the time until the answer; anything else is the answer to the cue."""
        core = self._core
        task.started_at = core.t
        self.cancel_filler()
        if core.open_cue_at is None:
            return
        task.filler = filler = self._is_filler(task)
        if not filler and not self._answers(task):
            return
        since = round(core.t - core.open_cue_at, 6)
        core.emit(CueRecord, "filled" if filler else "answered", task.source, task=task.id, since=since)
        if not filler:
            core.open_cue_at = None

    def note_ended(self, task: Task) -> None:
        """A failure stays until somebody goes on without the act, or it succeeds after all."""
        failed, what = self.state.failed_acts, f"{task.function} {task.behavior}"
        if task.status in ("ABORTED", "SUCCEEDED"):
            for id in [id for id, other in failed.items() if other == what]:
                del failed[id]
        if task.status == "ABORTED":
            failed[task.id] = what
            if len(failed) > REMEMBERED:
                del failed[next(iter(failed))]

    def forget_failure(self, task: Task) -> None:
        """This failure is answered otherwise: it is repeated, or somebody is asked."""
        self.state.failed_acts.pop(task.id, None)

    def why_not_go_on(self, behavior: str) -> str:
        """Why nobody need go on without this act, or empty."""
        if parse_task_id(behavior) not in self.state.failed_acts:
            return f"no task {behavior} has failed and waits for an answer"
        return ""

    def go_on(self, behavior: str) -> None:
        """The wizard has seen that an act failed, and goes on without it."""
        del self.state.failed_acts[parse_task_id(behavior)]

    def _is_filler(self, task: Task) -> bool:
        return task.function == "startCommunicationRobotAct" and self._core.scenario.settings_of(task.behavior).filler

    def _answers(self, task: Task) -> bool:
        return task.function != "startCommunicationRobotAct" or self._core.scenario.settings_of(task.behavior).answers

    # --- the cue ---

    def mark_cue(self, source: str, text: str) -> None:
        core = self._core
        core.open_cue_at = core.t
        core.emit(CueRecord, "marked", source, text)
        self.cancel_filler()
        seconds = core.scenario.fillers.auto_after
        if seconds is not None and self.next_filler() is not None:
            self.state.filler_timer = core.set_timer(seconds, TimerTarget("filler"))

    def why_not_undo_cue(self) -> str:
        """Why no cue can be taken back, or empty."""
        return "no cue is open: none was marked, or an act has answered it" if self._core.open_cue_at is None else ""

    def undo_cue(self, source: str) -> None:
        """The participant has not finished after all."""
        core = self._core
        core.open_cue_at = None
        self.cancel_filler()
        core.emit(CueRecord, "undone", source)
        core.raise_event_if_named("cue_undone")

    # --- fillers ---

    def next_filler(self) -> str | None:
        return next_filler(self._core.scenario, self.state.last_filler)

    def cancel_filler(self) -> None:
        """None is wanted by itself any more."""
        if self.state.filler_timer is not None:
            self._core.cancel_timer(self.state.filler_timer)
            self.state.filler_timer = None

    # --- mistakes ---

    def note_task(self, task: TaskRecord) -> None:
        """A wizard has asked for something: if it was not refused, it may have been a mistake."""
        if task.id in self.state.act_tasks or task.status == "REJECTED" or task.function in UNMARKABLE:
            return
        self.state.other_tasks.append(task.id)
        if len(self.state.other_tasks) > REMEMBERED:
            del self.state.other_tasks[0]

    def why_not_mark(self, behavior: str) -> str:
        """Why a mark cannot be taken, or empty."""
        number, _, mark = behavior.partition(" ")
        if mark not in MARKS:
            return f"write the task's id and one of {', '.join(MARKS)}, as in `17 late`"
        if parse_task_id(number) not in self.state.act_tasks and parse_task_id(number) not in self.state.other_tasks:
            return f"no task {number} has started an act lately, and none of a wizard's has this number"
        return ""

    def mark_mistake(self, behavior: str, source: str) -> None:
        number, _, mark = behavior.partition(" ")
        task = parse_task_id(number)
        self._core.emit(MistakeRecord, task, self.state.act_tasks.get(task, ""), mark, source)  # type: ignore[arg-type]
