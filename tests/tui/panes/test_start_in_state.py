"""Starting a rule in one of its states, from the rule pane."""

from __future__ import annotations

import pytest

from rise_tui.panes.rule import RulePane
from rise_tui.screens.dialog import Dialog
from tests.tui.conftest import Console, console

START = "startInteractionRule"


def dialog_text(it: Console) -> str:
    return str(it.app.screen.query_one("#lines").render())


async def ask_about(it: Console, state: str) -> None:
    it.screen.pane_layout.focus_pane("rule")
    await it.until(lambda: it.pane("rule").row_view.has_focus)
    pane = it.pane("rule")
    assert isinstance(pane, RulePane)
    for _ in range(20):
        if pane.graph.has_focus and pane.graph.current_id.endswith(f":{state}"):
            break
        await it.press("down")
    await it.press("enter")
    await it.until(lambda: isinstance(it.app.screen, Dialog))


@pytest.mark.slow
async def test_it_asks_says_what_the_robot_would_say_and_stops_a_rule_that_runs_first() -> None:
    async with console(size=(80, 24)) as it:
        for size, key, behavior in (
            ((80, 24), "s", '{"rule": "Main", "state": "greeting"}'),
            ((120, 40), "w", '{"rule": "Main", "state": "greeting", "enter": false}'),
        ):
            await it.pilot.resize_terminal(*size)
            await ask_about(it, "greeting")
            assert "says “" in dialog_text(it)
            await it.press(key)
            await it.sent(START, behavior)
            await it.back()
            await it.pilot.pause(0.6)
        it.client.sent.clear()
        it.client.rule("Main", "entered", "greeting", trigger="start")
        await it.until(lambda: "here" in it.text("rule"))
        await ask_about(it, "waiting")
        assert "does nothing but wait" in dialog_text(it) and "is stopped first" in dialog_text(it)
        await it.press("escape")
        await it.back()
        assert it.client.asked() == []
        await ask_about(it, "waiting")
        await it.press("s")
        await it.sent(START, '{"rule": "Main", "state": "waiting"}')
        assert it.client.asked()[0] == ("stopInteractionRule", "Main")
        await it.back()
        await ask_about(it, "over")
        await it.press("escape", "up", "up")
        assert not it.pane("rule").row_view.has_focus
        await it.press("up")  # from the first state back to the reasons
        await it.until(lambda: it.pane("rule").row_view.has_focus)
