"""No finger does what it did not mean: Enter, the stop of what runs, keys that move."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_tui.console.input import CHANGE_SECONDS
from rise_tui.model.resumption import act_summary, act_texts
from rise_tui.screens.help import HelpScreen
from rise_tui.screens.palette import Palette
from tests.tui.conftest import console
from tests.tui.fake import FakeClient

ACT = "startCommunicationRobotAct"


def lablinking() -> Scenario:
    scenario = load(Path(__file__).parents[3] / "scenarios" / "lablinking").scenario
    assert scenario is not None
    return scenario


@pytest.mark.parametrize(
    ("act", "summary"),
    [
        ("R_Praise", "“Very good!” +3"),
        ("R_Apology", "“I am sorry, that was not very clear.” +1"),
        ("R_Nod", "Animation"),
    ],
)
def test_an_act_in_short(act: str, summary: str) -> None:
    scenario = lablinking()
    assert "".join(act_summary(scenario, act, act_texts(scenario, act, scenario.memory))) == summary


async def test_enter_after_an_overlay_that_closed_just_now_starts_nothing() -> None:
    async with console() as it:
        await it.press("question_mark")
        await it.shows(HelpScreen)
        await it.pilot.press("escape", *["enter"] * 6)
        await it.back()
        assert it.client.asked() == [] and it.screen.store.armed is None
        assert "press enter again" in it.notice
        await it.pilot.pause(CHANGE_SECONDS)
        await it.pilot.press("enter")
        assert it.screen.store.armed is not None and it.client.asked() == []


async def test_the_palette_chooses_nothing_that_acts() -> None:
    async with console() as it:
        task = it.client.act("Greet")
        await it.until(lambda: "running" in it.row("acts", "Greet"))
        await it.press("colon")
        palette = await it.shows(Palette)
        assert palette.current is None and palette.list.text.splitlines()[0].startswith(" Stop Greet")
        await it.pilot.press("enter")
        assert palette.current is None, "it has opened just now"
        await it.press("enter")
        assert palette.current is not None and it.client.asked() == []
        it.client.act("Praise")  # began while the palette was open
        await it.until(lambda: "running" in it.row("acts", "Praise"))
        await it.press("enter")
        await it.sent("cancelTask", str(task))
        await it.press("colon", *"note")
        palette = await it.shows(Palette)
        assert palette.current is not None and palette.current.title == "Add a note", "it only opens a line"


async def test_an_act_is_found_by_its_words() -> None:
    async with console() as it:
        await it.press("colon", *"bye")
        palette = await it.shows(Palette)
        await it.press("enter", "enter")
        await it.until(lambda: it.screen.store.armed is not None, "Goodbye needs two presses")
        assert palette.search.value == "bye"


@pytest.mark.parametrize("pane", ["acts", "rules", "memory", "scheduler", "log", "rule", "act"])
async def test_one_key_stops_what_runs_now_in_every_pane(pane: str) -> None:
    async with console() as it:
        it.client.act("Greet")
        praise = it.client.act("Praise")
        await it.until(lambda: "stops Praise" in it.bars.key_hints.text)
        await it.focus(pane)
        await it.press("backspace")
        await it.sent("cancelTask", str(praise))
        assert it.notice.strip() == "· stopping Praise; Greet goes on"
        assert it.client.asked() == [("cancelTask", str(praise))]


async def test_an_act_that_has_just_begun_is_not_stopped_in_place_of_the_one_before() -> None:
    async with console() as it:
        it.client.act("Greet")
        task = it.client.act("Praise", source="rule:Main")
        await it.until(lambda: "stops Praise" in it.bars.key_hints.text)
        await it.press("backspace")
        assert "Praise has just begun; press again to stop it" in it.notice and it.client.asked() == []
        it.client.time += CHANGE_SECONDS
        await it.press("backspace")
        await it.sent("cancelTask", str(task))


async def test_one_key_stops_what_is_being_said_and_says_when_nothing_is() -> None:
    async with console() as it:
        await it.press("backspace")
        assert "Stop what runs now: not now, no act is running" in it.notice
        task = it.client.task("say", "Once upon a time")
        await it.until(lambda: "stops “Once upon a" in it.bars.key_hints.text)
        await it.press("backspace")
        await it.sent("cancelTask", str(task))


async def test_ctrl_n_and_ctrl_p_move_in_lists_and_in_the_palette() -> None:
    async with console() as it:
        rows = it.pane("acts").row_view
        await it.press("ctrl+n", "ctrl+n", "ctrl+p")
        assert rows.cursor == 1
        await it.press("colon")
        palette = await it.shows(Palette)
        await it.press("ctrl+n", "ctrl+n")
        assert palette.list.cursor == 1
        await it.press("ctrl+p")
        assert palette.list.cursor == 0 and it.client.asked() == []


async def test_a_row_that_is_out_of_view_is_shown_and_not_started() -> None:
    async with console((80, 24), FakeClient(lablinking()), ready="praise") as it:
        rows = it.pane("acts").row_view
        await it.press("home")
        rows.scroll_to(y=20, animate=False)
        await it.pilot.pause()
        assert rows.scroll_offset.y == 20
        await it.press("enter")
        assert rows.scroll_offset.y == 0 and "out of view" in it.notice and it.screen.store.armed is None
        await it.press("enter", "enter")
        await it.sent(ACT, "R_Praise")


async def test_moving_on_drops_what_enter_has_chosen() -> None:
    async with console() as it:
        await it.press("enter")
        await it.until(lambda: "enter again" in it.text("acts"))
        await it.press("down")
        await it.until(lambda: "enter again" not in it.text("acts"))
        await it.press("enter")
        await it.until(lambda: "enter again" in it.text("acts"))
        assert it.client.asked() == []


async def test_a_rule_says_what_it_would_do_first() -> None:
    async with console() as it:
        await it.press("f2", "enter")
        await it.until(lambda: "enter again: Main " in it.text("rules"))
        assert it.client.asked() == []
        await it.press("enter")
        await it.sent("startInteractionRule", "Main")


async def test_the_letters_of_a_question_that_has_gone_start_nothing() -> None:
    async with console() as it:
        await it.press("f8")
        await it.until(lambda: it.app.screen is not it.screen)
        it.client.control_record("taken", "wizard:carol", "wizard:carol")
        await it.back()
        it.client.control_record("taken", "wizard:anna", "wizard:anna")
        await it.pilot.press("g")
        await it.pilot.pause(CHANGE_SECONDS)
        assert it.client.asked() == []
        await it.press("g")
        await it.sent(ACT, "Greet")


@pytest.mark.parametrize(
    ("typed", "act", "title"), [("sorry", "R_Apology", "apology"), ("great", "R_Praise", "praise")]
)
async def test_an_act_is_found_by_what_it_may_say(typed: str, act: str, title: str) -> None:
    """Also by a wording that is not the first: “That looks great.” is the third of the praise."""
    async with console((80, 24), FakeClient(lablinking()), ready="praise") as it:
        await it.press("/", *typed)
        await it.until(lambda: [title in row for row in it.text("acts").splitlines()] == [True])
        await it.press("escape", ":", *typed)
        palette = await it.shows(Palette)
        await it.until(lambda: palette.list.text.split()[:1] == [act])
