"""LIVE, SAFE, LOCKED: what keys of this console may do (console.md 2.1)."""

from __future__ import annotations

import pytest
from textual import events

from rise_tui.key_labels import key_name, why_task_blocked
from rise_tui.model.control import BlockedReason, InputMode, blocked_text, mode_notice, toggle_lock, toggle_safe
from rise_tui.model.store import Store
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.help import HelpScreen
from rise_tui.widgets.speech_input import SpeechField
from tests.tui.conftest import console
from tests.tui.fake import FakeClient, demo


@pytest.mark.parametrize(
    ("mode", "safe", "lock"),
    [("LIVE", "SAFE", "LOCKED"), ("SAFE", "LIVE", "LOCKED"), ("LOCKED", "LOCKED", "SAFE")],
)
def test_what_each_of_the_two_keys_makes_of_it(mode: InputMode, safe: InputMode, lock: InputMode) -> None:
    assert toggle_safe(mode) == safe and toggle_lock(mode) == lock


def test_only_what_is_not_live_has_a_reason() -> None:
    assert blocked_text(None, key_name) == ""
    assert blocked_text(BlockedReason("safe"), key_name) == "SAFE: ctrl+x turns keys on"
    assert blocked_text(BlockedReason("locked"), key_name) == "LOCKED: F7 unlocks"


@pytest.mark.parametrize(
    ("mode", "key"), [("LIVE", "LIVE: keys start"), ("SAFE", "ctrl+x turns them on"), ("LOCKED", "leave and F7")]
)
def test_a_chosen_mode_is_told_with_the_key_that_leaves_it(mode: InputMode, key: str) -> None:
    assert key in mode_notice(mode, key_name)


@pytest.mark.slow
async def test_safe_starts_nothing_says_why_and_leaves_marks_notes_and_stopping() -> None:
    async with console() as it:
        for key in ("g", "m", "n", "u", "comma", "enter"):
            await it.press("ctrl+x")
            await it.until(lambda: " SAFE " in it.bars.status_line.text and "LIVE" not in it.bars.status_line.text)
            await it.pilot.pause(0.6)
            await it.press(key)
            await it.until(lambda: "SAFE: ctrl+x turns keys on" in it.notice, key)
            await it.pilot.pause(0.1)
            assert it.client.asked() == []
            await it.press("ctrl+x", *[key] * (1 + (key == "enter")))
            await it.until(lambda: it.client.asked(), key)
            it.client.sent.clear()
        await it.press("ctrl+x", "ctrl+t", *"hello")
        assert "SAFE: ctrl+x turns keys on" in it.bars.key_hints.text
        await it.press("enter")  # speech can be prepared, and is not said
        await it.until(lambda: "not said: SAFE" in it.notice)
        await it.pilot.pause(0.1)
        assert it.client.asked() == [] and it.bars.speech_input.field.value == "hello"
        await it.press("escape")
        assert it.pane("acts").row_view.row_at(0).line[0][1] == "muted", "keys of acts that cannot start are dimmed"
        await it.press("down")
        await it.until(lambda: "Praise cannot be started: SAFE" in it.notice)
        await it.press("up")
        it.client.act("Greet")
        await it.press("space")
        await it.sent("markCue", "")
        cue = it.client._tasks
        await it.press("exclamation_mark", "escape")
        await it.sent("markMistake", f"{cue} wrong")
        await it.press("delete")
        await it.sent("stopCommunicationRobotAct", "Greet")
        await it.press("f9")
        await it.sent("stopAll", "")


@pytest.mark.slow
async def test_locked_swallows_every_key_and_click_but_three() -> None:
    async with console() as it:
        await it.press("f7")
        await it.until(lambda: " LOCKED " in it.bars.status_line.text)
        assert it.bars.key_hints.text.split() == ["F9/^G", "STOP", "^C", "leave", "F7", "unlock"]
        for key in ("g", "ctrl+x", "colon", "question_mark", "ctrl+t", "tab", "space", "ctrl+o", "f8"):
            await it.press(key)
            await it.until(lambda: "LOCKED: F7 unlocks" in it.notice)
        await it.pilot.click(it.bars.speech_input)
        await it.pilot.pause(0.1)
        assert it.app.screen is it.screen and it.client.asked() == [] and it.pane("acts").row_view.has_focus
        assert not it.bars.speech_input.is_open
        await it.press("f9")
        await it.sent("stopAll", "")
        it.client.stop("requested")
        await it.press("f7")
        # Both: SAFE still holds when the stop is released.
        await it.until(lambda: " STOPPED  SAFE " in it.bars.status_line.text)
        await it.press("f7", "ctrl+c")
        await it.shows(Dialog)
        await it.press("escape")
        await it.back()
        await it.press("ctrl+c")
        await it.shows(Dialog)
        await it.press("d")  # a locked console can be left
        await it.until(lambda: it.client.closed == [False])


@pytest.mark.slow
async def test_locking_closes_what_is_open_unanswered_and_forgets_what_was_begun() -> None:
    async with console() as it:
        it.client.rule("Again", "started", "raise", trigger="start")
        await it.press("f2", "down")
        await it.until(lambda: "Again cannot be started: it is already running" in it.notice)
        await it.press("f2", "b")
        await it.until(lambda: "! again: “Goodbye" in it.text("acts"))
        await it.press("ctrl+x", "ctrl+x", "enter", "enter")
        await it.sent("startCommunicationRobotAct", "Greet")  # the selected row, and not the armed act
        assert ("startCommunicationRobotAct", "Goodbye") not in it.client.asked()
        await it.press("ctrl+t", "a", "f7")
        await it.until(lambda: " LOCKED " in it.bars.status_line.text)
        it.app.post_message(events.Paste("text"))
        await it.press("b")
        assert isinstance(it.screen.focused, SpeechField)
        await it.press("f7", "c")
        await it.until(lambda: it.bars.speech_input.field.value == "ac", "nothing can be typed or pasted while locked")
        await it.press("escape", "question_mark")
        await it.shows(HelpScreen)
        await it.press("f7")
        await it.back()
        await it.until(lambda: " LOCKED " in it.bars.status_line.text)
        await it.press("f7", "f9")
        it.client.stop("latched")
        await it.until(lambda: it.screen.session.store.view.stop.latched)
        await it.press("ctrl+r")
        await it.shows(Dialog)
        await it.press("f7")
        await it.back()
        await it.press("r")
        await it.pilot.pause(0.1)
        assert ("releaseStop", "") not in it.client.asked()


async def test_a_console_that_watches_is_not_called_live() -> None:
    client = FakeClient(demo(), you="wizard:ben", holder="wizard:anna")
    async with console(client=client) as it:
        await it.press("ctrl+x")
        await it.until(lambda: " SAFE " in it.bars.status_line.text and "WATCHING" in it.bars.status_line.text)


@pytest.mark.parametrize("guard", ["SAFE", "LOCKED"])
@pytest.mark.parametrize(
    "function", ["startCommunicationRobotAct", "raiseEventTopic", "assignValue", "say", "nextFiller"]
)
def test_what_makes_something_happen_does_not_while_keys_are_safe(guard: InputMode, function: str) -> None:
    client = FakeClient(demo())
    store = Store(client.attach_reply(), "anna", client.now)
    assert why_task_blocked(store, function) == ""
    store.input_mode = guard
    assert why_task_blocked(store, function).startswith(guard)
    assert why_task_blocked(store, "markCue") == why_task_blocked(store, "stopCommunicationRobotAct") == ""
