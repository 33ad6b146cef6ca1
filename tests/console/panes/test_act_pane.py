"""The act pane: what runs, what it waits for, what was sent, and what would be."""

from __future__ import annotations

import pytest
from msgspec.structs import replace
from rich.cells import cell_len

from rise_engine.kernel.records import ActionRecord, MemoryRecord, TaskRecord
from rise_engine.scenario.model import Act, Action, ActionCall, ActionSpec, Scenario
from rise_engine.scenario.template import parse_template
from rise_tui.panes.act import ActPane
from tests.console.conftest import Console, console
from tests.console.fake import FakeClient, demo


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


async def test_before_it_starts_values_are_as_they_would_be_now() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("act")
        it.client.act("Greet")
        await it.until(lambda: "Greet" in it.text("act"))
        await it.press("end")
        details = pane(it).details
        await it.until(lambda: "not sent; as it would be now" in details.text)
        it.client.emit(MemoryRecord(0, 0.0, "", "side", "left", None, "wizard:anna"))
        await it.until(lambda: "fork to the left." in details.text and "written:" in details.text)
        it.client.emit(MemoryRecord(0, 0.0, "", "side", None, "left", "wizard:anna", deleted=True))
        await it.until(lambda: "(side is not set)" in details.text)


async def test_after_it_started_they_are_as_they_were_sent() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("act")
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
        it.client.emit(MemoryRecord(0, 0.0, "", "person", "Bob", "Ada", "wizard:anna"))
        await it.until(lambda: "Hello Ada!" in pane(it).details.text)
        assert "sent 00:01:23.0" in pane(it).details.text and "Bob" not in it.text("act")


async def test_elapsed_and_expected_time() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("act")
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "2", "Animation", "accepted", value="head_nod", duration=400)
        it.client.time += 0.3
        await it.until(lambda: "0.3/0.4" in line(it, "2"))
        assert "~0.3" in line(it, "3"), "300 ms, before it began"
        it.client.action(task, "Greet", "2", "Animation", "succeeded")
        await it.until(lambda: "0.3" in line(it, "2") and "done" in line(it, "2"))
        assert "1/4" in it.text("act").splitlines()[0].split()


async def test_a_failure_says_why_in_words() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("act")
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "1", "Speech", "started", message="Hello")
        it.client.emit(
            ActionRecord(0, 0.0, "", task, "Greet", "1", "Speech", {}, "failed", reason="the voice is switched off")
        )
        it.client.end_task(task, "Greet", "ABORTED", "action 1 failed: the voice is switched off")
        await it.until(lambda: "✗ failed" in it.row("act", "Greet"))
        lines = it.text("act").splitlines()
        assert "action 1 failed: the voice is switched off" in lines[1]
        assert "the voice is switched o" in lines[2] and "✗ failed" in lines[2]
        await it.until(lambda: "reason" in pane(it).details.text)


async def test_without_the_focus_the_details_follow_what_runs() -> None:
    async with console(size=(200, 50)) as it:
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "1", "Speech", "accepted", message="Hello Ada!")
        it.client.action(task, "Greet", "2", "Animation", "accepted", value="head_nod")
        details = pane(it).details
        await it.until(lambda: "head_nod" in details.text)
        it.client.action(task, "Greet", "2", "Animation", "succeeded")
        await it.until(lambda: "Hello Ada!" in details.text)
        it.screen.pane_layout.focus_pane("act")
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


async def test_free_speech_is_shown_like_an_act_while_it_is_the_newest() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("act")
        await say(it, "Wait, please.", "PENDING", 90)
        it.client.act("Greet")
        await it.until(lambda: "Greet" in it.text("act"), "what waits is not shown")
        await say(it, "Wait, please.", "ACTIVE", 90)
        it.client.emit(ActionRecord(0, 0.0, "", 90, "say", "say", "Speech", {"message": "Wait, please."}, "accepted"))
        await it.until(lambda: line(it, "say")[:2] == ["say", "►"], "the head")
        await it.until(lambda: "Wait, please." in it.text("act"))
        await say(it, "Wait, please.", "ABORTED", 90, "the robot is lost")
        await it.until(lambda: "the robot is lost" in it.text("act"))
        it.client.act("Praise")
        await it.until(lambda: "Well done." in it.text("act") and "Wait, please." not in it.text("act"))


async def test_free_speech_that_waits_is_not_shown_and_one_named_like_an_act_is_no_act() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("act")
        await say(it, "Praise", "PENDING", 90)
        await it.until(lambda: it.screen.session.store.newest_speech == 90)
        await it.pilot.pause(0.2)
        assert "select an act" in it.text("act")
        await say(it, "Praise", "ACTIVE", 90)
        await it.until(lambda: line(it, "say")[:2] == ["say", "►"])


async def test_an_act_that_the_wizard_selects_replaces_free_speech() -> None:
    async with console() as it:
        await say(it, "Hello.", "ACTIVE")
        it.screen.pane_layout.focus_pane("act")
        await it.until(lambda: "say" in it.text("act"))
        it.screen.pane_layout.focus_pane("acts")
        await it.press("down")
        await it.until(lambda: it.screen.session.store.shown_act != "")
        await it.until(lambda: it.row("act", it.screen.session.store.shown_act) and "Hello." not in it.text("act"))


@pytest.mark.slow
@pytest.mark.parametrize("width", [40, 60, 80, 120])
@pytest.mark.parametrize("height", [8, 24])
async def test_it_fits_at_every_size(width: int, height: int) -> None:
    actions = [
        speech(str(n), "A rather long sentence, so that it must be cut.", wait_for=(str(n - 1),) if n > 1 else ())
        for n in range(1, 13)
    ]
    async with console(client=FakeClient(scene(*actions)), size=(124, 40)) as it:
        it.screen.pane_layout.focus_pane("act")
        await it.press("f4")
        pane(it).styles.width, pane(it).styles.height = width, height
        await it.until(lambda: pane(it).size == (width, height))
        task = it.client.act("Made")
        it.client.action(task, "Made", "1", "Speech", "accepted", message="A rather long sentence.")
        await it.until(lambda: "running" in it.text("act") and "waits" in it.text("act"))
        everything = [*it.text("act").splitlines(), *pane(it).details.text.splitlines()]
        assert not [row for row in everything if cell_len(row) > width]
        assert pane(it).row_list.size.height >= 3
        assert pane(it).details.region.bottom <= pane(it).region.bottom
