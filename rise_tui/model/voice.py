"""When the robot began to speak: what a participant waits for. Pure; knows no screen.

An act may begin with a look or a pause, and be heard seconds later. Its `timing` record says when (`voice_at`), but
only at its end; before that the records of its actions do, with the robot's profile, which knows what takes the voice.
"""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import SessionView
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.spoken import SPEECH_CHANNEL


class CueClock(NamedTuple):
    """The time since the participant's cue, and what ended it."""

    marked: float
    answered: float | None = None
    """When the answer came: the robot's voice, or of an act that says nothing its start. None: it is awaited."""
    said: bool = True
    """Whether that act has come to what it was to say; if not, `answered` is when it ended."""
    filled: float | None = None
    """When the latest filler started."""


def cue_clock(scenario: Scenario, view: SessionView) -> CueClock | None:
    """The participant's last cue as the participant hears it; None when there is none."""
    cue = view.cue
    if cue is None:
        return None
    task = view.tasks.get(cue.task) if cue.task is not None else None
    if cue.answered is None or task is None or not speaks(scenario, task):
        return CueClock(cue.t, cue.answered, True, cue.filled)
    voice = voice_at(scenario, task)
    if voice is None and task.ended is not None:
        return CueClock(cue.t, task.ended, False, cue.filled)
    return CueClock(cue.t, voice, True, cue.filled)


def voice_at(scenario: Scenario, task: TaskView) -> float | None:
    """When the robot first confirmed an action of a task that takes its voice; None: it has not."""
    if task.voice_at is not None:
        return task.voice_at
    confirmed = (
        action.confirmed
        for action in task.actions.values()
        if action.confirmed is not None and _takes_voice(scenario, action.sent_as or action.type)
    )
    return min(confirmed, default=None)


def speaks(scenario: Scenario, task: TaskView) -> bool:
    """Whether a task is to be heard: its act has an action for which this robot uses its voice."""
    if task.function == "say":
        return True
    act = scenario.acts.get(task.behavior)
    calls = [call for action in act.actions for call in action.calls] if act is not None else []
    specs = scenario.robot.actions
    return any(_takes_voice(scenario, specs[call.type].substitute or call.type) for call in calls)


def _takes_voice(scenario: Scenario, action: str) -> bool:
    spec = scenario.robot.actions.get(action)
    return spec is not None and SPEECH_CHANNEL in spec.channels
