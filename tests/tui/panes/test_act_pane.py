"""The act pane: what runs, what it waits for, what was sent, and what would be."""

from __future__ import annotations

from itertools import product

import pytest
from msgspec.structs import replace
from rich.cells import cell_len

from rise_engine.kernel.records import ActionRecord, MemoryRecord, TaskRecord
from rise_engine.scenario.model import Act, Action, ActionCall, ActionSpec, Scenario
from rise_engine.scenario.speech.template import parse_template
from rise_tui.panes.tasks import ActPane
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo


def pane(it: Console) -> ActPane:
    found = it.pane("act")
    assert isinstance(found, ActPane)
    return found


def line(it: Console, start: str) -> list[str]:
    """The words of the row of an action."""
    found = (row.split() for row in it.text("act").splitlines())
    return next((words for words in found if start in words[:3]), [])


def speech(id: str, *messages: str, wait_for: tuple[str, ...] = ()) -> Action:
    return Action(id, tuple(ActionCall("Speech", {"message": parse_template(text)}) for text in messages), wait_for)


def scene(*actions: Action, **specs: ActionSpec) -> Scenario:
    known = demo()
    robot = replace(known.robot, actions={**known.robot.actions, **specs})
    return replace(known, acts={**known.acts, "Made": Act("Made", actions)}, robot=robot)


async def say(it: Console, text: str, status: str, id: int = 0, reason: str = "") -> int:
    """A task of free speech."""
    it.client._tasks += not id
    number = id or it.client._tasks
    it.client.emit(TaskRecord(0, 0.0, "", number, "say", text, "Blocking", "wizard:anna", status, reason))  # type: ignore[arg-type]
    return number


@pytest.mark.slow
async def test_values_are_as_they_would_be_now_until_they_are_sent_and_a_failure_says_why() -> None:
    async with console() as it:
        details = pane(it).details
        await it.focus("act")
        first = it.client.act("Greet")
        await it.until(lambda: "Greet" in it.text("act"))
        await it.press("end")
        await it.until(lambda: "not sent; as it would be now" in details.text)
        it.client.emit(MemoryRecord(0, 0.0, "", "side", "left", None, "wizard:anna"))
        await it.until(lambda: "fork to the left." in details.text and "written:" in details.text)
        it.client.emit(MemoryRecord(0, 0.0, "", "side", None, "left", "wizard:anna", deleted=True))
        await it.until(lambda: "(side is not set)" in details.text)
        await it.press("home")
        it.client.end_task(first, "Greet")
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
        it.client.emit(MemoryRecord(0, 0.0, "", "person", "Bob", "Ada", "wizard:anna"))
        await it.until(lambda: "sent 00:01:23.0" in details.text and "Hello Ada!" in details.text)
        assert "Bob" not in it.text("act")
        it.client.action(task, "Greet", "2", "Animation", "accepted", value="head_nod", duration=400)
        it.client.time += 0.3
        await it.until(lambda: "0.3/0.4" in line(it, "2"))
        assert "~0.3" in line(it, "3"), "300 ms, before it began"
        it.client.action(task, "Greet", "2", "Animation", "succeeded")
        await it.until(lambda: "0.3" in line(it, "2") and "done" in line(it, "2"))
        assert "1/4" in it.text("act").splitlines()[0].split()
        off = "the voice is switched off"
        it.client.emit(ActionRecord(0, 0.0, "", task, "Greet", "1", "Speech", {}, "failed", reason=off))
        it.client.end_task(task, "Greet", "ABORTED", f"action 1 failed: {off}")
        await it.until(lambda: "✗ failed" in it.row("act", "Greet"))
        lines = it.text("act").splitlines()
        assert f"action 1 failed: {off}" in lines[1]
        assert "the voice is switched o" in lines[2] and "✗ failed" in lines[2]
        await it.until(lambda: "reason" in details.text)


async def test_without_the_focus_the_details_follow_what_runs() -> None:
    async with console(size=(200, 50)) as it:
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "1", "Speech", "accepted", message="Hello Ada!")
        it.client.action(task, "Greet", "2", "Animation", "accepted", value="head_nod")
        details = pane(it).details
        await it.until(lambda: "head_nod" in details.text)
        it.client.action(task, "Greet", "2", "Animation", "succeeded")
        await it.until(lambda: "Hello Ada!" in details.text)
        await it.focus("act")
        await it.press("home")
        it.client.action(task, "Greet", "3", "Wait", "accepted", duration=300)
        await it.until(lambda: "► running" in it.row("act", "Wait"))
        assert "Hello Ada!" in details.text, "the wizard's row has changed"


async def test_variants_and_what_the_robot_does_instead() -> None:
    spec = demo().robot.actions["Animation"]
    other = replace(spec, name="Wave", supported=False, substitute="Animation")
    made = scene(speech("1", "Hm.", "Let me see."), Action("2", (ActionCall("Wave", {}),)), Wave=other)
    async with console(client=FakeClient(made)) as it:
        it.screen.pane_layout.focus_pane("act")
        it.client.act("Made")
        await it.until(lambda: "Made" in it.text("act"))
        assert "1 of 2" in it.text("act") and "Wave→Animation" in it.text("act")
        assert "1. message" in pane(it).details.text and "2. message" in pane(it).details.text
        await it.press("end")
        await it.until(lambda: "the robot has no Wave: it does Animation instead" in pane(it).details.text)


@pytest.mark.slow
async def test_free_speech_is_shown_like_an_act_while_it_is_the_newest() -> None:
    async with console() as it:
        await it.focus("act")
        await say(it, "Praise", "PENDING", 89)
        await it.until(lambda: it.screen.session.store.newest_speech == 89)
        await it.pilot.pause(0.2)
        assert "select an act" in it.text("act"), "what waits is not shown, and named like an act it is none"
        await say(it, "Praise", "ACTIVE", 89)
        await it.until(lambda: line(it, "say")[:2] == ["say", "►"])
        await say(it, "Praise", "SUCCEEDED", 89)
        await say(it, "Wait, please.", "PENDING", 90)
        it.client.act("Greet")
        await it.until(lambda: "Greet" in it.text("act"))
        await say(it, "Wait, please.", "ACTIVE", 90)
        it.client.emit(ActionRecord(0, 0.0, "", 90, "say", "say", "Speech", {"message": "Wait, please."}, "accepted"))
        await it.until(lambda: line(it, "say")[:2] == ["say", "►"], "the head")
        await it.until(lambda: "Wait, please." in it.text("act"))
        await say(it, "Wait, please.", "ABORTED", 90, "the robot is lost")
        await it.until(lambda: "the robot is lost" in it.text("act"))
        it.client.act("Praise")
        await it.until(lambda: "Well done." in it.text("act") and "Wait, please." not in it.text("act"))
        await say(it, "Hello.", "ACTIVE", 91)
        await it.until(lambda: "Hello." in it.text("act"))
        await it.focus("acts")
        await it.press("down")  # what the wizard selects replaces it
        await it.until(lambda: it.screen.session.store.shown_act != "")
        await it.until(lambda: it.row("act", it.screen.session.store.shown_act) and "Hello." not in it.text("act"))


@pytest.mark.slow
async def test_it_fits_at_every_size() -> None:
    actions = [
        speech(str(n), "A rather long sentence, so that it must be cut.", wait_for=(str(n - 1),) if n > 1 else ())
        for n in range(1, 13)
    ]
    async with console(client=FakeClient(scene(*actions)), size=(124, 40)) as it:
        await it.focus("act")
        await it.press("f4")
        task = it.client.act("Made")
        it.client.action(task, "Made", "1", "Speech", "accepted", message="A rather long sentence.")
        await it.until(lambda: "running" in it.text("act") and "waits" in it.text("act"))
        for width, height in product((40, 60, 80, 120), (8, 24)):
            pane(it).styles.width, pane(it).styles.height = width, height
            await it.until(lambda size=(width, height): pane(it).size == size)  # type: ignore[misc]
            await it.pilot.pause(0.1)
            everything = [*it.text("act").splitlines(), *pane(it).details.text.splitlines()]
            assert not [row for row in everything if cell_len(row) > width]
            assert pane(it).row_list.size.height >= 3
            assert pane(it).details.region.bottom <= pane(it).region.bottom
