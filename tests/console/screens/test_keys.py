"""No accidents (console.md 2.1 to 2.4): which keys start something, and where."""

from __future__ import annotations

import asyncio

import pytest
from textual import events

from rise_engine.protocol.client import ClientInput, Reply
from rise_tui.model.control import ControlLost
from rise_tui.rendering.terminal_reader import mark_together
from tests.console.conftest import console

TAKEN = ControlLost("wizard:ben", 83.0)
GREET = ("startCommunicationRobotAct", "Greet")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "function", "behavior"),
    [
        ("g", "startCommunicationRobotAct", "Greet"),
        ("full_stop", "startCommunicationRobotAct", "Filler"),
        ("m", "startInteractionRule", "Main"),
        ("n", "raiseEventTopic", "/next"),
        ("u", "assignValue", "understood = true"),
    ],
)
async def test_a_scenario_key_submits_its_task_as_the_wizard(key: str, function: str, behavior: str) -> None:
    async with console() as it:
        await it.press(key)
        await it.sent(function, behavior)
        assert [message.source for message in it.client.sent] == ["wizard:anna"]


@pytest.mark.slow
@pytest.mark.parametrize("pane", ["acts", "rules", "memory", "act", "rule", "scheduler", "log"])
async def test_scenario_keys_work_whatever_list_has_the_focus(pane: str) -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane(pane)
        await it.press("g")
        await it.sent(*GREET)


@pytest.mark.parametrize("opening", [("slash",), ("f3", "f3", "f3", "enter"), ("f3", "f3", "f3", "insert")])
async def test_no_key_starts_anything_while_typing(opening: tuple[str, ...]) -> None:
    async with console() as it:
        await it.press(*opening)
        await it.press("g", "m", "n", "p")
        assert it.client.sent == []


@pytest.mark.parametrize("opening", ["question_mark", "colon", "f8", "ctrl+c"])
async def test_no_key_starts_anything_while_a_dialog_is_open(opening: str) -> None:
    async with console() as it:
        await it.press(opening)
        await it.until(lambda: it.app.screen is not it.screen)
        await it.press("g", "m", "n", "p")
        assert it.client.sent == []


async def test_that_a_command_is_on_its_way_is_to_be_seen_before_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    async with console() as it:
        answer: asyncio.Event = asyncio.Event()
        send = it.client.send

        async def sends(message: ClientInput) -> Reply:
            await answer.wait()
            return await send(message)

        monkeypatch.setattr(it.client, "send", sends)
        await it.press("g")
        await it.until(lambda: "sent" in it.row("acts", "Greet"))
        answer.set()
        await it.sent(*GREET)


async def test_a_key_takes_the_notice_away() -> None:
    async with console() as it:
        it.screen.show_notice("read me")
        await it.until(lambda: "read me" in it.notice)
        it.screen.refresh_scheduler._notice_at -= 2  # it has been there long enough to be read
        await it.press("down")
        await it.until(lambda: not it.notice)


async def test_a_key_takes_no_notice_away_that_has_not_been_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    async with console() as it:
        painting, store = it.screen.refresh_scheduler, it.screen.session.store
        it.screen.show_notice("read me")
        await it.until(lambda: "read me" in it.notice)
        painting._notice_at -= 2
        monkeypatch.setattr(painting, "_paint", lambda: None)  # two keys in the time of one frame
        painting.dismiss_read_notices()
        assert store.notice is None
        it.screen.show_notice("it was refused")
        painting.dismiss_read_notices()
        assert store.notice is not None and store.notice.text == "it was refused"


async def test_a_key_takes_no_word_of_control_away_that_has_not_been_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    async with console() as it:
        painting, store = it.screen.refresh_scheduler, it.screen.session.store
        store.control_lost = TAKEN
        painting.schedule({"status"})
        await it.until(lambda: painting._control_lost_at)
        painting._control_lost_at -= 2  # it has been there long enough to be read
        monkeypatch.setattr(painting, "_paint", lambda: None)  # two keys in the time of one frame
        painting.dismiss_read_notices()
        assert store.control_lost is None
        store.control_lost = TAKEN
        painting.dismiss_read_notices()
        assert store.control_lost is TAKEN


async def test_stopped_keys_start_nothing_and_say_why() -> None:
    async with console() as it:
        it.client.stop("latched", ("speech",))
        await it.until(lambda: it.screen.session.store.key_state == "STOPPED")
        await it.press("g", "enter")
        assert it.client.sent == []
        assert "STOPPED" in it.notice and "ctrl+r" in it.notice


@pytest.mark.slow
@pytest.mark.parametrize("key", ["f9", "ctrl+g"])
@pytest.mark.parametrize(
    "opening", [(), ("slash",), ("f3", "f3", "f3", "enter"), ("question_mark",), ("colon",), ("f8",), ("ctrl+c",)]
)
async def test_stop_works_on_every_screen_in_every_dialog_and_while_typing(key: str, opening: tuple[str, ...]) -> None:
    async with console() as it:
        await it.press(*opening)
        await it.press(key)
        await it.sent("stopAll", "")


async def test_stop_is_never_refused_even_when_stopped_already() -> None:
    async with console() as it:
        await it.press("f9", "f9")
        await it.until(lambda: it.client.asked() == [("stopAll", ""), ("stopAll", "")])


async def test_a_paste_triggers_nothing() -> None:
    async with console() as it:
        it.app.post_message(events.Paste("gmnp\ng"))
        await it.pilot.pause(0.1)
        assert it.client.sent == []


async def test_a_paste_without_brackets_triggers_nothing_and_is_told() -> None:
    async with console() as it:
        pasted = [events.Key(key, key if len(key) == 1 else "\r") for key in ("g", "m", "enter", "p", "g")]
        mark_together(pasted, True)  # all in one read of the terminal
        for key in pasted:
            it.app.post_message(key)
        await it.pilot.pause(0.2)
        assert it.client.sent == []
        assert "several keys at once" in it.notice
        await it.pilot.pause(0.3)
        await it.press("g")
        await it.sent(*GREET)


async def test_a_second_press_within_the_debounce_time_counts_once() -> None:
    async with console() as it:
        await it.press("p")
        await it.pilot.pause(0.2)
        await it.press("p")
        assert it.client.asked() == [("startCommunicationRobotAct", "Praise")]
        assert "taken once" in it.notice


async def test_a_hold_act_needs_a_second_key() -> None:
    async with console() as it:
        await it.press("b")
        assert it.client.sent == []
        await it.until(lambda: "again?" in it.row("acts", "Goodbye"))
        assert "Goodbye" in it.notice
        await it.press("enter")
        await it.sent("startCommunicationRobotAct", "Goodbye")
        assert len(it.client.sent) == 1  # and not the act under the cursor as well


async def test_a_hold_act_takes_its_own_key_as_the_second_one() -> None:
    async with console() as it:
        await it.press("b")
        await it.pilot.pause(0.3)
        await it.press("b")
        await it.sent("startCommunicationRobotAct", "Goodbye")


async def test_esc_forgets_the_first_press_of_a_hold_act() -> None:
    async with console() as it:
        await it.press("b", "escape", "escape")
        await it.until(lambda: "again?" not in it.text("acts"))
        assert it.client.sent == []
