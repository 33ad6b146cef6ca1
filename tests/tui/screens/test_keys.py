"""No accidents (console.md 2.1 to 2.4): which keys start something, and where. The rules themselves: test_input.py."""

from __future__ import annotations

import pytest
from textual import events

from rise_tui.model.control import ControlLost
from rise_tui.rendering.terminal_driver import mark_together
from tests.tui.conftest import Console, console

TAKEN = ControlLost("wizard:ben", 83.0)
GREET = ("startCommunicationRobotAct", "Greet")
GOODBYE = ("startCommunicationRobotAct", "Goodbye")

pytestmark = pytest.mark.slow  # many keys each


async def test_a_scenario_key_submits_its_task_as_the_wizard_whatever_list_has_the_focus() -> None:
    async with console() as it:
        for key, function, behavior in (
            ("g", *GREET),
            ("full_stop", "startCommunicationRobotAct", "Filler"),
            ("m", "startInteractionRule", "Main"),
            ("n", "raiseEventTopic", "/next"),
            ("u", "assignValue", "understood = true"),
        ):
            await it.press(key)
            await it.sent(function, behavior)
        assert [message.source for message in it.client.sent] == ["wizard:anna"] * 5
        for pane in ("acts", "rules", "memory", "act", "rule", "scheduler", "log"):
            it.client.sent.clear()
            await it.pilot.pause(0.6)  # beyond the time in which a second press is the same one
            await it.focus(pane)
            await it.press("g")
            await it.until(lambda: it.client.asked() == [GREET], pane)


async def test_while_typing_and_in_dialogs_no_key_starts_anything_and_both_stop_keys_work() -> None:
    async with console() as it:
        for pane, *opening in (
            ("acts",),
            ("acts", "slash"),
            ("memory", "enter"),
            ("memory", "insert"),
            ("acts", "question_mark"),
            ("acts", "colon"),
            ("acts", "f8"),
            ("acts", "ctrl+c"),
        ):
            await it.focus(pane)
            await it.press(*opening)
            if opening:
                await it.press("g", "m", "n", "p")
                assert it.client.sent == [], opening
            await it.press("f9", "ctrl+g")  # also when everything is stopped already
            await it.until(lambda: it.client.asked() == [("stopAll", "")] * 2, str(opening))
            it.client.sent.clear()
            await it.press("escape", "escape")
            await it.back()


async def test_a_key_takes_away_what_has_been_read_and_nothing_that_has_not_been_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with console() as it:
        painting, store = it.screen.bars, it.screen.session.store

        async def shown(text: str) -> None:
            it.screen.show_notice(text)
            await it.until(lambda: text in it.notice)
            painting._notice_at -= 2  # it has been there long enough to be read

        await shown("read me")
        await it.press("down")
        await it.until(lambda: not it.notice)
        await shown("read me")
        store.control_lost = TAKEN
        painting.schedule({"status"})
        await it.until(lambda: painting._control_lost_at)
        painting._control_lost_at -= 2
        monkeypatch.setattr(painting, "_paint", lambda: None)  # two keys in the time of one frame
        painting.dismiss_read_notices()
        assert store.notice is None and store.control_lost is None
        it.screen.show_notice("it was refused")
        store.control_lost = TAKEN
        painting.dismiss_read_notices()
        assert store.notice is not None and store.notice.text == "it was refused" and store.control_lost is TAKEN


async def armed(it: Console) -> None:
    await it.press("b")
    await it.until(lambda: "! again: “Goodbye" in it.text("acts"))


async def test_what_is_pasted_pressed_twice_or_once_too_little_starts_nothing() -> None:
    async with console() as it:
        it.app.post_message(events.Paste("gmnp\ng"))
        await it.pilot.pause(0.1)
        assert it.client.sent == []
        pasted = [events.Key(key, key if len(key) == 1 else "\r") for key in ("g", "m", "enter", "p", "g")]
        mark_together(pasted, True)  # all in one read of the terminal, without brackets
        for key in pasted:
            it.app.post_message(key)
        await it.pilot.pause(0.2)
        assert it.client.sent == []
        assert "several keys at once" in it.notice
        await it.pilot.pause(0.3)
        await it.press("g")
        await it.sent(*GREET)
        await it.press("p")
        await it.pilot.pause(0.2)
        await it.press("p")
        assert it.client.asked() == [GREET, ("startCommunicationRobotAct", "Praise")]
        assert "counted once" in it.notice
        it.client.sent.clear()
        await armed(it)
        assert "Goodbye" in it.notice and it.client.sent == []
        await it.press("escape", "escape")
        await it.until(lambda: "or enter" not in it.text("acts"))
        assert it.client.sent == [], "esc forgets the first press"
        for second in ("enter", "b"):
            await it.pilot.pause(3)
            await armed(it)
            await it.pilot.pause(0.3)
            await it.press(second)
            await it.pilot.pause(1)
            assert it.client.asked() == [GOODBYE], "and not the act under the cursor as well"
            it.client.sent.clear()
