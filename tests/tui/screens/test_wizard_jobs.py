"""Twenty things that a wizard does in a session, with the keys that each takes. Typed words do not count as keys."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest

from rise_engine.kernel.records import CueRecord, FailureRecord
from rise_tui.console.input import CHANGE_SECONDS
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient
from tests.tui.screens.test_step_back import went_on
from tests.tui.study_days import day

pytestmark = pytest.mark.slow  # many keys
ACT = "startCommunicationRobotAct"


class Job(NamedTuple):
    """What is to be done, and how."""

    name: str
    keys: tuple[str, ...]
    """Key by key; a text in blanks is typed and does not count."""
    before: Callable[[FakeClient], object]
    """What has happened."""
    asked: tuple[str, str] | Callable[[Console], object]
    """What the engine is asked for, or what holds then."""


def nothing(client: FakeClient) -> None:
    """The session has begun."""


def greets(client: FakeClient) -> None:
    client.rule("Main", "started", "greeting", trigger="start")
    client.act("Greet", source="rule:Main")


def waits(client: FakeClient) -> None:
    client.rule("Main", "started", "greeting", trigger="start")
    client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)


def queued(client: FakeClient) -> None:
    client.act("Greet")
    client.act("Praise", "PENDING")


def failed(client: FakeClient) -> None:
    task = client.act("Greet", "FAILED", reason="the robot has no voice")
    client.emit(FailureRecord(0, 0.0, "", task, "Greet", "asked", "engine", reason="the robot has no voice"))


def stopped(client: FakeClient) -> None:
    client.stop("requested")
    client.stop("latched", ("pepper/speech",))


def cue_marked(client: FakeClient) -> None:
    client.emit(CueRecord(0, 0.0, "", "marked", "wizard:anna"))


def taken(client: FakeClient) -> None:
    client.control_record("taken", "wizard:ben", "wizard:ben")


JOBS = (
    Job("stop everything", ("f9",), greets, ("stopAll", "")),
    Job("stop only what runs", ("backspace",), greets, ("cancelTask", "1")),
    Job("say the next act", ("p",), nothing, (ACT, "Praise")),
    Job("let the rule go on", ("n",), waits, ("raiseEventTopic", "/next")),
    Job("find an act by its words", ("colon", " fork ", "enter", "enter"), nothing, (ACT, "Greet")),
    Job("say something else", ("ctrl+t", " Hi ", "enter"), nothing, ("say", "Hi")),
    Job("mark the participant's cue", ("space",), nothing, lambda it: asked_for(it, "markCue")),
    Job("take back the cue", ("underscore",), cue_marked, lambda it: asked_for(it, "undoCue")),
    Job("say a filler", ("comma",), nothing, lambda it: asked_for(it, "nextFiller")),
    Job("mark the last act as late", ("exclamation_mark", "l"), lambda it: it.act("Praise", "SUCCEEDED"),
        ("markMistake", "1 late")),
    Job("write a note", ("ctrl+o", " coughs ", "enter"), nothing,
        lambda it: [each.text for each in it.client.notes] == ["coughs"]),
    Job("correct a value", ("ctrl+d", "m", "home", "enter", " 3 ", "enter"), nothing,
        lambda it: asked_for(it, "assignValue")),
    Job("go back one step in the rule", ("ctrl+d", "u", "left", "b"), went_on, lambda it: asked_for(it, "stepBack")),
    Job("take a waiting act out", ("ctrl+d", "s", "home", "down", "delete"), queued, ("cancelTask", "2")),
    Job("repeat a failed act", ("ctrl+e",), failed, lambda it: asked_for(it, "repeatAct")),
    Job("go on without it", ("ctrl+k",), failed, lambda it: asked_for(it, "goOn")),
    Job("release the stop", ("ctrl+r", "r"), stopped, lambda it: asked_for(it, "releaseStop")),
    Job("take control", ("f8", "t"), taken, lambda it: it.client.verbs == ["take"]),
    Job("leave, and the session goes on", ("ctrl+c", "d"), greets, lambda it: it.client.closed == [False]),
)  # fmt: skip


def asked_for(it: Console, function: str) -> bool:
    return any(each == function for each, _ in it.client.asked())


LIMITS = {"stop only what runs": 1, "find an act by its words": 4}
"""Of issue 31. Every other job takes at most six keys."""


@pytest.mark.parametrize("job", JOBS, ids=lambda job: job.name)
async def test_a_job_takes_few_keys(job: Job) -> None:
    async with console(size=(80, 24)) as it:
        job.before(it.client)
        it.client.time += 60
        await it.pilot.pause(2 * CHANGE_SECONDS)
        for key in job.keys:
            if key.startswith(" "):
                await it.pilot.press(*key.strip())
            else:
                await it.press(key)
            await it.pilot.pause(0.4)
        if callable(job.asked):
            await it.until(lambda: job.asked(it), job.name)  # type: ignore[operator]
        else:
            await it.sent(*job.asked)
    assert sum(not key.startswith(" ") for key in job.keys) <= LIMITS.get(job.name, 6)


async def test_the_next_participant_takes_six_keys() -> None:
    """The twentieth job: from the report of a session to the next one, with two checks by a person."""
    keys = ["enter", "enter", "y", "y", "enter"]
    async with day() as at:
        for key in keys:
            await at.press(key)
        await at.until(lambda: at.app.console_screen is not None)
        await at.over()
    assert 1 + len(keys) <= 8, "escape leaves the report before"
