"""Tasks that only a person at a console submits: free speech, the participant's cue, the next filler, mistakes as data.

They are DomainTasks like all others (semantics.md 4.1), so that one log shows them.
"""

from __future__ import annotations

from typing import get_args

from msgspec import Struct, field

from rise_engine.kernel.core import Core, Task, TimerTarget, parse_task_id
from rise_engine.kernel.records import CueRecord, Mark, MistakeRecord, TaskRecord
from rise_engine.kernel.speech import act_name
from rise_engine.scenario.model import Scenario

MARKS: tuple[Mark, ...] = get_args(Mark)
MAX_REMEMBERED = 1000
"""The number of acts, and of other tasks of wizards, that can still be marked as mistakes."""
UNMARKABLE = frozenset({"markMistake", "goOn", "repeatAct", "stopRuleOfAct"})
"""A wizard's statements about tasks, which cannot be mistakes themselves."""
LONGEST_SPEECH = 2000
"""The maximum number of characters of free speech. Longer texts are pasted by mistake."""


class WizardMarksState(Struct):
    """The state that is kept across inputs."""

    last_filler: str | None = None
    filler_timer: int | None = None
    """The timer of the automatic filler after a cue, if the scenario wants one."""
    act_tasks: dict[int, str] = field(default_factory=dict)
    """The latest tasks that requested an act, with its name."""
    other_tasks: list[int] = field(default_factory=list)
    """The latest other tasks of wizards: rules, events, memory, and everything else that a key can do."""
    failed_acts: dict[int, str] = field(default_factory=dict)
    """Failed acts without an answer, by task: the attempt, which a later task can make good."""


class WizardMarks:
    """The cue, the fillers and the marks."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.state = WizardMarksState()

    # --- the start and end of acts ---

    def note_accepted(self, task: Task) -> None:
        """Note the cue that an accepted act or free speech answers, and when it was requested."""
        core, acts = self._core, self.state.act_tasks
        task.cue_at, task.key_at, task.accepted_at = core.open_cue_at, core.key_at, core.t
        acts[task.id] = act_name(task)
        if len(acts) > MAX_REMEMBERED:
            del acts[next(iter(acts))]
        if self._is_filler(task):
            self.state.last_filler = task.behavior

    def note_started(self, task: Task) -> None:
        """Handle the start of an act: a filler bridges the time until the answer; any other act answers the cue."""
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
        """Handle the end of an act. A failure stays until a wizard goes on without the act, or it succeeds later."""
        failed, what = self.state.failed_acts, f"{task.function} {task.behavior}"
        if task.status in ("ABORTED", "SUCCEEDED"):
            for id in [id for id, other in failed.items() if other == what]:
                del failed[id]
        if task.status == "ABORTED":
            failed[task.id] = what
            if len(failed) > MAX_REMEMBERED:
                del failed[next(iter(failed))]

    def forget_failure(self, task: Task) -> None:
        """Remove a failure that is handled otherwise: by a repetition or a question."""
        self.state.failed_acts.pop(task.id, None)

    def why_not_go_on(self, behavior: str) -> str:
        """Why there is no failed act to go on without; empty: there is."""
        if parse_task_id(behavior) not in self.state.failed_acts:
            return f"no task {behavior} has failed and waits for an answer"
        return ""

    def go_on(self, behavior: str) -> None:
        """Note that the wizard goes on without a failed act."""
        del self.state.failed_acts[parse_task_id(behavior)]

    def _is_filler(self, task: Task) -> bool:
        return task.function == "startCommunicationRobotAct" and self._core.scenario.settings_of(task.behavior).filler

    def _answers(self, task: Task) -> bool:
        return task.function != "startCommunicationRobotAct" or self._core.scenario.settings_of(task.behavior).answers

    # --- the cue ---

    def mark_cue(self, source: str, text: str) -> None:
        core = self._core
        core.open_cue_at = core.t if core.key_at is None else core.key_at
        core.emit(CueRecord, "marked", source, text, key_at=core.key_at)
        self.cancel_filler()
        seconds = core.scenario.fillers.auto_after
        if seconds is not None and self.next_filler() is not None:
            self.state.filler_timer = core.set_timer(seconds, TimerTarget("filler"))

    def why_not_undo_cue(self) -> str:
        """Why no cue can be taken back; empty: one can."""
        return "no cue is open: none was marked, or an act has answered it" if self._core.open_cue_at is None else ""

    def undo_cue(self, source: str) -> None:
        """Take back the cue, because the participant has not finished after all."""
        core = self._core
        core.open_cue_at = None
        self.cancel_filler()
        core.emit(CueRecord, "undone", source)
        core.raise_event_if_named("cue_undone")

    # --- fillers ---

    def next_filler(self) -> str | None:
        return next_filler(self._core.scenario, self.state.last_filler)

    def cancel_filler(self) -> None:
        """Cancel the automatic filler."""
        if self.state.filler_timer is not None:
            self._core.cancel_timer(self.state.filler_timer)
            self.state.filler_timer = None

    # --- mistakes ---

    def note_task(self, task: TaskRecord) -> None:
        """Note a wizard's task, which may be a mistake unless it was rejected."""
        if task.id in self.state.act_tasks or task.status == "REJECTED" or task.function in UNMARKABLE:
            return
        self.state.other_tasks.append(task.id)
        if len(self.state.other_tasks) > MAX_REMEMBERED:
            del self.state.other_tasks[0]

    def why_not_mark(self, behavior: str) -> str:
        """Why a mark cannot be accepted; empty: it can."""
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


def filler_acts(scenario: Scenario) -> tuple[str, ...]:
    """The scenario's fillers, in the order of its acts."""
    return tuple(name for name in scenario.acts if scenario.settings_of(name).filler)


def next_filler(scenario: Scenario, last: str | None) -> str | None:
    """The filler after the last used one, in turn; None: the scenario has none."""
    found = filler_acts(scenario)
    if not found:
        return None
    return found[(found.index(last) + 1) % len(found)] if last in found else found[0]
