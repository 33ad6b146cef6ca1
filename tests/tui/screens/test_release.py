"""Releasing a stop asks once what becomes of the rules that it has ended."""

from __future__ import annotations

import json
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.kernel.records import OpenGoal, RobotRecord, RuleRecord
from rise_tui.screens.dialog import Dialog, ReleaseDialog
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

pytestmark = pytest.mark.slow  # many keys each


def stop(at: Console | FakeClient, **stood: str) -> None:
    """Everything is stopped; `stood`: the rules that ran, the top of the stack first."""
    client = at if isinstance(at, FakeClient) else at.client
    client.stop("requested")
    for name, state in stood.items():
        client.emit(RuleRecord(0, 0.0, "", name, "stopped", state, reason="stop-all by wizard:anna"))
    client.stop("latched", ("pepper/speech",))


async def asked(it: Console) -> ReleaseDialog:
    await it.until(lambda: it.screen.session.store.view.stop.latched)
    await it.pilot.pause(0.2)
    await it.press("ctrl+r")
    dialog = await it.shows(ReleaseDialog)
    await it.until(lambda: "›" in text_of(dialog))
    return dialog


def text_of(dialog: ReleaseDialog) -> str:
    return str(dialog.query_one("#choices").render())


async def release_sent(it: Console) -> dict[str, str]:
    await it.until(lambda: any(function == "releaseStop" for function, _ in it.client.asked()))
    behavior = next(behavior for function, behavior in it.client.asked() if function == "releaseStop")
    found: dict[str, Any] = json.loads(behavior)
    assert found.pop("stop") == it.screen.session.store.view.stop.count, "the stop that the wizard has seen"
    return found


async def test_a_choice_for_each_rule_and_one_for_all_says_what_would_come_of_it() -> None:
    async with console(size=(80, 24)) as it:
        for size in ((80, 24), (120, 40)):
            await it.pilot.resize_terminal(*size)
            for keys, released in (
                (("r",), {}),
                (("e", "r"), {"Main": "enter", "Again": "enter"}),
                (("w", "r"), {"Main": "wait", "Again": "wait"}),
                (("e", "l", "r"), {}),
                (("right", "down", "left", "r"), {"Main": "enter", "Again": "wait"}),
                (("down", "right", "r"), {"Again": "enter"}),
            ):
                stop(it, Main="greeting", Again="raise")
                dialog = await asked(it)
                text = text_of(dialog)
                assert "Main: greeting" in text and "leave stopped" in text and "says “" in text
                box = dialog.query_one("#box").region
                assert box.bottom <= size[1] and dialog.query_one("#answer-r").region.bottom <= box.bottom
                await it.press(*keys)
                assert await release_sent(it) == released
                it.client.stop("released")
                it.client.sent.clear()
        stop(it, Main="waiting")
        dialog = await asked(it)
        assert "stays stopped; if re-entered: does nothing but wait" in text_of(dialog)
        await it.press("w")
        await it.until(lambda: "waits for event next or event repeat" in text_of(dialog))
        await it.press("escape")
        await it.back()
        assert it.client.asked() == []
        await asked(it)
        await it.press("f9")
        await it.back()
        assert it.client.asked() == [("stopAll", "")] and "was closed" in it.notice, "a new stop closes it"


async def test_a_console_that_comes_later_asks_the_same_and_of_many_rules_shows_those_around_the_selected_one() -> None:
    scenario = demo()
    rules = {f"Rule {n}": replace(scenario.rules["Main"], name=f"Rule {n}") for n in range(20)}
    client = FakeClient(replace(scenario, rules={**scenario.rules, **rules}))
    stop(client, **dict.fromkeys(rules, "greeting"))
    async with console(size=(80, 24), client=client) as it:
        dialog = await asked(it)
        await it.press(*["down"] * 12, "right")
        assert "▸ Rule 12: greeting" in text_of(dialog) and "Rule 1:" not in text_of(dialog)
        await it.press("r")
        assert await release_sent(it) == {"Rule 12": "enter"}


async def test_the_key_that_asks_about_rules_also_answers_when_it_is_pressed_again() -> None:
    async with console(size=(80, 24)) as it:
        stop(it, Main="greeting")
        await asked(it)
        await it.press("w")
        await it.press("ctrl+r")
        assert await release_sent(it) == {"Main": "wait"}


async def test_a_stop_of_somebody_else_closes_the_question() -> None:
    """A release must not let the robot go on that somebody has just stopped."""
    async with console(size=(80, 24)) as it:
        stop(it, Main="greeting")
        await asked(it)
        it.client.stop("requested", source="wizard:olga")
        await it.back()
        assert "was closed" in it.notice
        await it.press("r")
        assert it.client.asked() == []


OPEN = OpenGoal("pepper/speech", "3/1", "Speech", "it refused to stop")


async def test_what_still_runs_is_asked_to_stop_by_one_key_and_released_after_a_question() -> None:
    async with console(size=(80, 24)) as it:
        it.client.emit(RobotRecord(0, 0.0, "", "degraded", "pepper/speech may still be doing Speech", (OPEN,)))
        await it.until(lambda: "STILL RUNNING?" in it.bars.alarm_bar.text)
        await it.press("ctrl+r")
        await it.shows(Dialog)
        await it.press("escape", "ctrl+r")
        assert not it.client.asked()
        await it.shows(Dialog)
        await it.press("r")
        await it.until(lambda: it.client.asked() == [("releaseOpenGoals", "pepper/speech")])
        await it.press("ctrl+w")
        await it.sent("cancelOpenGoals", "")


async def test_what_becomes_held_while_the_question_is_shown_is_not_released_unseen() -> None:
    async with console(size=(80, 24)) as it:
        it.client.emit(RobotRecord(0, 0.0, "", "degraded", "speech", (OPEN,)))
        await it.until(lambda: "STILL RUNNING?" in it.bars.alarm_bar.text)
        await it.press("ctrl+r")
        await it.shows(Dialog)
        gaze = OpenGoal("pepper/look_at", "4/1", "LookAt", "it refused to stop")
        it.client.emit(RobotRecord(0, 0.0, "", "degraded", "both", (OPEN, gaze)))
        await it.back()
        assert "was closed" in it.notice
        await it.press("r")
        assert it.client.asked() == []


@pytest.mark.parametrize(
    "answer",
    [
        ("latched", (), ("pepper/speech (something was begun there after the stop)",)),
        ("released",),
    ],
)
async def test_the_question_goes_when_the_stop_is_not_any_more_what_it_says(answer: tuple[Any, ...]) -> None:
    async with console(size=(80, 24)) as it:
        stop(it)
        await it.until(lambda: it.screen.session.store.view.stop.latched)
        await it.pilot.pause(0.2)
        await it.press("ctrl+r")
        await it.shows(Dialog)
        it.client.stop(*answer)
        await it.back()
        assert "was closed" in it.notice
        await it.press("r")
        assert it.client.asked() == []
