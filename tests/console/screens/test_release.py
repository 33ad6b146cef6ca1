"""Releasing a stop asks once what becomes of the rules that it has ended."""

from __future__ import annotations

import json

import pytest

from rise_engine.kernel.records import OpenGoal, RobotRecord, RuleRecord
from rise_tui.screens.release import ReleaseDialog
from tests.console.conftest import Console, console

pytestmark = pytest.mark.slow  # many keys each


def stop(it: Console, **stood: str) -> None:
    """Everything is stopped; `stood`: the rules that ran, the top of the stack first."""
    it.client.stop("requested")
    for name, state in stood.items():
        it.client.emit(RuleRecord(0, 0.0, "", name, "stopped", state, reason="stop-all by wizard:anna"))
    it.client.stop("latched", ("pepper/speech",))


async def asked(it: Console) -> ReleaseDialog:
    await it.until(lambda: "STOPPED" in it.bars.status_line.text)
    await it.press("ctrl+r")
    await it.until(lambda: isinstance(it.app.screen, ReleaseDialog))
    dialog = it.app.screen
    assert isinstance(dialog, ReleaseDialog)
    await it.until(lambda: "›" in text_of(dialog))
    return dialog


def text_of(dialog: ReleaseDialog) -> str:
    return str(dialog.query_one("#choices").render())


async def release_sent(it: Console) -> dict[str, str]:
    await it.until(lambda: any(function == "releaseStop" for function, _ in it.client.asked()))
    behavior = next(behavior for function, behavior in it.client.asked() if function == "releaseStop")
    found: dict[str, str] = json.loads(behavior or "{}")
    return found


@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
@pytest.mark.parametrize(
    ("keys", "released"),
    [
        (("r",), {}),
        (("e", "r"), {"Main": "enter", "Again": "enter"}),
        (("w", "r"), {"Main": "wait", "Again": "wait"}),
        (("e", "l", "r"), {}),
        (("right", "down", "left", "r"), {"Main": "enter", "Again": "wait"}),
        (("down", "right", "r"), {"Again": "enter"}),
    ],
)
async def test_a_choice_for_each_rule_and_one_for_all(
    size: tuple[int, int], keys: tuple[str, ...], released: dict[str, str]
) -> None:
    async with console(size=size) as it:
        stop(it, Main="greeting", Again="raise")
        dialog = await asked(it)
        text = text_of(dialog)
        assert "Main: greeting" in text and "leave stopped" in text and "says “" in text
        box = dialog.query_one("#box").region
        assert box.bottom <= size[1] and dialog.query_one("#answer-r").region.bottom <= box.bottom
        await it.press(*keys)
        assert await release_sent(it) == released


async def test_it_says_what_would_come_of_each_choice() -> None:
    async with console(size=(80, 24)) as it:
        stop(it, Main="waiting")
        dialog = await asked(it)
        assert "nothing; entered again: does nothing by itself" in text_of(dialog)
        await it.press("w")
        await it.until(lambda: "waits for event next or event repeat" in text_of(dialog))
        await it.press("escape")
        await it.until(lambda: it.app.screen is it.screen)
        assert it.client.asked() == []


async def test_a_new_stop_closes_the_question() -> None:
    async with console() as it:
        stop(it, Main="greeting")
        await asked(it)
        await it.press("f9")
        await it.until(lambda: it.app.screen is it.screen)
        assert ("releaseStop", "") not in it.client.asked() and "was closed" in it.notice


async def test_a_console_that_comes_later_asks_the_same() -> None:
    async with console() as first:
        stop(first, Main="greeting")
        client = first.client
        await asked(first)
        await first.press("escape")
    async with console(client=client) as later:
        dialog = await asked(later)
        assert "Main: greeting" in text_of(dialog)


async def test_of_many_rules_those_around_the_selected_one_are_shown() -> None:
    from msgspec.structs import replace

    from tests.console.fake import FakeClient, demo

    scenario = demo()
    rules = {f"Rule {n}": replace(scenario.rules["Main"], name=f"Rule {n}") for n in range(20)}
    async with console(size=(80, 24), client=FakeClient(replace(scenario, rules={**scenario.rules, **rules}))) as it:
        stop(it, **dict.fromkeys(rules, "greeting"))
        dialog = await asked(it)
        await it.press(*["down"] * 12, "right")
        assert "▸ Rule 12: greeting" in text_of(dialog) and "Rule 1:" not in text_of(dialog)
        await it.press("r")
        assert await release_sent(it) == {"Rule 12": "enter"}


OPEN = OpenGoal("pepper/speech", "3/1", "Speech", "it refused to stop")


def hold(it: Console) -> None:
    it.client.emit(RobotRecord(0, 0.0, "", "degraded", "pepper/speech may still be doing Speech", (OPEN,)))


async def test_what_still_runs_is_asked_to_stop_by_one_key() -> None:
    async with console(size=(80, 24)) as it:
        hold(it)
        await it.until(lambda: "STILL RUNNING?" in it.bars.alarm_bar.text)
        await it.press("ctrl+w")
        await it.until(lambda: ("cancelOpenGoals", "") in it.client.asked())


async def test_a_part_that_is_held_is_released_after_a_question() -> None:
    async with console(size=(80, 24)) as it:
        hold(it)
        await it.until(lambda: "STILL RUNNING?" in it.bars.alarm_bar.text)
        await it.press("ctrl+r")
        await it.until(lambda: type(it.app.screen).__name__ == "Dialog")
        await it.press("escape", "ctrl+r")
        assert not it.client.asked()
        await it.until(lambda: type(it.app.screen).__name__ == "Dialog")
        await it.press("r")
        await it.until(lambda: ("releaseOpenGoals", "") in it.client.asked())
