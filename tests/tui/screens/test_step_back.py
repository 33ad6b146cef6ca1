"""One step back, asked for in the rule pane."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rise_engine.kernel.records import MemoryRecord
from rise_tui.screens.dialog import StepBackDialog
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient

pytestmark = pytest.mark.slow  # many keys each


def text_of(it: Console, part: str) -> str:
    return str(it.app.screen.query_one(f"#{part}").render())


def went_on(client: FakeClient) -> None:
    """The rule has gone from `greeting` to `waiting`, and two keys of the memory have changed since it began."""
    client.rule("Main", "started", "greeting", trigger="start")
    client.rule("Main", "entered", "greeting", trigger="start")
    client.act("Greet", source="rule:Main")
    client.emit(MemoryRecord(0, 0.0, "", "task", 5, 4, "wizard:anna"))
    client.rule("Main", "entered", "waiting", previous="greeting", trigger="/x", transition=0)
    client.emit(MemoryRecord(0, 0.0, "", "new", "x", None, "wizard:anna", created=True))


async def asked(it: Console) -> None:
    await it.until(lambda: "in waiting" in it.text("rule"))
    it.screen.pane_layout.focus_pane("rule")
    await it.until(lambda: it.pane("rule").row_view.has_focus)
    await it.press("left")
    await it.until(lambda: isinstance(it.app.screen, StepBackDialog))
    await it.until(lambda: "›" in text_of(it, "choices"))


async def step_sent(it: Console) -> dict[str, Any]:
    await it.until(lambda: any(function == "stepBack" for function, _ in it.client.asked()))
    behavior = next(behavior for function, behavior in it.client.asked() if function == "stepBack")
    found: dict[str, Any] = json.loads(behavior)
    return found


async def test_each_key_is_taken_back_or_kept_and_escape_stays() -> None:
    async with console(size=(80, 24)) as it:
        await it.press("left")
        assert it.app.screen is it.screen
        went_on(it.client)
        for size in ((80, 24), (120, 40)):
            await it.pilot.resize_terminal(*size)
            for keys, step in (
                (("b",), {"take_back": ["task", "new"], "enter": True, "stop_acts": False}),
                (("w",), {"take_back": ["task", "new"], "enter": False, "stop_acts": False}),
                (("k", "b"), {"take_back": [], "enter": True, "stop_acts": False}),
                (("k", "t", "b"), {"take_back": ["task", "new"], "enter": True, "stop_acts": False}),
                (("down", "right", "down", "left", "b"), {"take_back": ["task"], "enter": True, "stop_acts": True}),
            ):
                await asked(it)
                assert "from waiting back to greeting" in text_of(it, "lines") and "says “" in text_of(it, "lines")
                shown = text_of(it, "choices").replace('"', "")
                assert "task: 5 → 4" in shown and "new: x → not set" in shown and "its acts: Greet" in shown
                assert it.app.screen.query_one("#answer-w").region.bottom <= size[1]
                await it.press(*keys)
                assert await step_sent(it) == {"rule": "Main", **step}
                await it.back()
                it.client.sent.clear()
                await it.pilot.pause(0.6)
        await asked(it)
        await it.press("escape")
        await it.back()
        assert it.client.asked() == []
        it.client.rule("Main", "stopped", "waiting")
        it.client.rule("Main", "started", "greeting", trigger="start")
        it.client.rule("Main", "entered", "greeting", trigger="start")
        await it.until(lambda: "in greeting" in it.text("rule"))
        await it.press("left")
        await it.until(lambda: "no earlier state to go back to" in it.notice, "a first state has none before it")
