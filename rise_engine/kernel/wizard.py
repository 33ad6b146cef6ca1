"""What only a person at a console asks for: free speech, the participant's cue, the next filler, and mistakes as data.

Like everything else they are DomainTasks (semantics, section 5), so that one log shows them.
"""

from __future__ import annotations

from typing import Literal, get_args

from msgspec import Struct, field

from rise_engine.kernel.core import Core, Task, TimerTarget
from rise_engine.kernel.records import CueRecord, Mark, MistakeRecord
from rise_engine.kernel.speech import act_name
from rise_engine.scenario.fillers import fillers, next_filler

MARKS: tuple[Mark, ...] = get_args(Mark)
REMEMBERED = 1000
"""Acts that can still be marked as a mistake; older ones only in the record itself."""
LONGEST_SPEECH = 2000
"""Characters of free speech. Nobody says more in one go; what is longer was pasted by mistake."""


class WizardState(Struct):
    """What has to be known across inputs."""

    last_filler: str | None = None
    filler_timer: int | None = None
    """Runs from a cue on when the scenario wants fillers without the wizard."""
    acts: dict[int, str] = field(default_factory=dict)
    """The latest tasks that asked for an act, with its name."""


class Wizard:
    """The cue, the fillers and the marks."""

    __slots__ = ("_core", "state")

    def __init__(self, core: Core) -> None:
        self._core = core
        self.state = WizardState()

    # --- acts come and go ---

    def act_accepted(self, task: Task) -> None:
        """An act or free speech was taken on: note what it answers, and when it was asked for."""
        core, acts = self._core, self.state.acts
        task.cue, task.pressed, task.accepted = core.cue, core.pressed, core.t
        acts[task.id] = act_name(task)
        if len(acts) > REMEMBERED:
            del acts[next(iter(acts))]
        if self._is_filler(task):
            self.state.last_filler = task.behavior

    def act_started(self, task: Task) -> None:
        """A filler bridges the time until the answer; anything else is the answer to the cue."""
        core = self._core
        task.started = core.t
        self.no_filler()
        if core.cue is None:
            return
        filler = self._is_filler(task)
        core.seq += 1
        status: Literal["filled", "answered"] = "filled" if filler else "answered"
        since = round(core.t - core.cue, 6)
        core.records.append(CueRecord(core.seq, core.t, "", status, task.source, "", task.id, since))
        if not filler:
            core.cue = None

    def _is_filler(self, task: Task) -> bool:
        return task.function == "startCommunicationRobotAct" and self._core.scenario.settings_of(task.behavior).filler

    # --- the cue ---

    def mark_cue(self, source: str, text: str) -> None:
        core = self._core
        core.cue = core.t
        core.seq += 1
        core.records.append(CueRecord(core.seq, core.t, "", "marked", source, text))
        self.no_filler()
        seconds = core.scenario.fillers.auto_after
        if seconds is not None and fillers(core.scenario):
            self.state.filler_timer = core.set_timer(seconds, TimerTarget("filler"))

    # --- fillers ---

    def next_filler(self) -> str | None:
        return next_filler(self._core.scenario, self.state.last_filler)

    def no_filler(self) -> None:
        """None is wanted by itself any more."""
        if self.state.filler_timer is not None:
            self._core.cancel_timer(self.state.filler_timer)
            self.state.filler_timer = None

    # --- mistakes ---

    def mark_problem(self, behavior: str) -> str:
        """Why a mark cannot be taken, or empty."""
        number, _, mark = behavior.partition(" ")
        if mark not in MARKS:
            return f"write the task's id and one of {', '.join(MARKS)}, as in `17 late`"
        if not self._act_of(number):
            return f"no task {number} has started an act lately"
        return ""

    def mark_mistake(self, behavior: str, source: str) -> None:
        number, _, mark = behavior.partition(" ")
        core = self._core
        core.seq += 1
        core.records.append(
            MistakeRecord(core.seq, core.t, "", int(number), self._act_of(number), mark, source)  # type: ignore[arg-type]
        )

    def _act_of(self, number: str) -> str:
        known = number.isascii() and number.isdigit() and len(number) < 19
        return self.state.acts.get(int(number), "") if known else ""
