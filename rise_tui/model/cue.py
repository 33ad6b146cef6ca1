"""The participant's cue: the time since it, the robot's answering voice, and when a filler is due. Pure.

An act may begin with a look or a pause, and be heard seconds later. Its `timing` record has the time of the voice
(`voice_at`), but only at its end. Until then the time comes from the records of its actions, and from the robot's
profile, which names the actions that use the voice.
"""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import SessionView
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.parameters import SPEECH_CHANNEL
from rise_tui.rendering.text import StyledLine, format_seconds


class CueClock(NamedTuple):
    """The time since the participant's cue, and the answer."""

    marked: float
    answered: float | None = None
    """The time of the answer: the robot's voice, or the start of an act without speech; None: not yet."""
    has_spoken: bool = True
    """Whether that act has spoken. If not, `answered` is when it ended."""
    filled: float | None = None
    """When the latest filler started."""


def cue_clock(scenario: Scenario, view: SessionView) -> CueClock | None:
    """The participant's last cue, timed by what the participant hears; None without one."""
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
    """When the robot first confirmed an action of a task that uses its voice; None: not yet."""
    if task.voice_at is not None:
        return task.voice_at
    confirmed = (
        action.confirmed
        for action in task.actions.values()
        if action.confirmed is not None and _takes_voice(scenario, action.sent_as or action.type)
    )
    return min(confirmed, default=None)


def speaks(scenario: Scenario, task: TaskView) -> bool:
    """Whether a task is audible: its act has an action that uses this robot's voice."""
    if task.function == "say":
        return True
    act = scenario.acts.get(task.behavior)
    calls = [call for action in act.actions for call in action.calls] if act is not None else []
    specs = scenario.robot.actions
    return any(_takes_voice(scenario, specs[call.type].substitute or call.type) for call in calls)


def _takes_voice(scenario: Scenario, action: str) -> bool:
    spec = scenario.robot.actions.get(action)
    return spec is not None and SPEECH_CHANNEL in spec.channels


LATE_SECONDS, VERY_LATE_SECONDS = 1.0, 2.0
"""Seconds after which a robot without an answer seems slow, and seems broken."""
TENTHS_SECONDS = 10.0
"""Seconds for which a cue is counted in tenths. Then it is counted in seconds, with the clock."""
GIVEN_UP_SECONDS = 60.0
"""Seconds after which an unanswered cue is no longer counted."""
ANSWERED_SECONDS = 5.0
"""Seconds for which the answer time is shown."""


def seconds_since_cue(cue: CueClock | None, now: float) -> float | None:
    """Seconds since the cue while it is counted; None: no cue, or it is answered or given up."""
    if cue is None or cue.answered is not None:
        return None
    since = max(0.0, now - cue.marked)
    return since if since < GIVEN_UP_SECONDS else None


def counts_tenths(cue: CueClock | None, now: float) -> bool:
    """Whether the time changes by tenths."""
    since = seconds_since_cue(cue, now)
    return since is not None and since < TENTHS_SECONDS


def passed_text(since: float) -> str:
    """The time with the precision of the count."""
    return f"{int(since)}" if since >= TENTHS_SECONDS else format_seconds(since)


def cue_line(cue: CueClock | None, now: float, *, short: bool = False) -> StyledLine:
    """`◔ cue 0.4 s`, later `◑ cue 1.4 s`, `● cue 2.3 s !`, and `✓ answered 1.3 s` or `✗ not said`; else empty."""
    if cue is not None and cue.answered is not None and now - cue.answered < ANSWERED_SECONDS:
        if not cue.has_spoken:
            return (("✗ not said", "fault"),)
        took = f"{format_seconds(cue.answered - cue.marked)} s"
        return ((f"✓ {took}" if short else f"✓ answered {took}", "plain"),)
    since = seconds_since_cue(cue, now)
    if since is None:
        return ()
    passed = passed_text(since)
    if since < LATE_SECONDS:
        return (("◔ cue ", "plain"), (f"{passed} s", "plain"))
    if since < VERY_LATE_SECONDS:
        return (("◑ cue ", "wait"), (f"{passed} s", "wait"))
    if short:
        return (("cue ", "call"), (f"{passed} s", "call"), (" !", "call"))
    return ((" ● cue ", "call"), (f"{passed} s", "call"), (" ! ", "call"))


def filler_due(cue: CueClock | None, now: float, offer_after: float) -> float | None:
    """Seconds since the cue if a filler, the first or a further one, is due; otherwise None."""
    since = seconds_since_cue(cue, now)
    if since is None or cue is None or offer_after <= 0:
        return None
    silent = now - (cue.marked if cue.filled is None else cue.filled)
    return since if silent >= offer_after else None
