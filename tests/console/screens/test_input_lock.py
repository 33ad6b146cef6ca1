"""LIVE, SAFE, LOCKED: what keys of this console may do (console.md 2.1)."""

from __future__ import annotations

import pytest
from textual import events

from rise_tui.key_labels import key_name, why_task_blocked
from rise_tui.model.blocked import BlockedReason, blocked_text
from rise_tui.model.input_lock import InputMode, mode_notice, toggle_lock, toggle_safe
from rise_tui.model.store import Store
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.help import HelpScreen
from rise_tui.widgets.speech_input import SpeechField
from tests.console.conftest import Console, console
from tests.console.fake import FakeClient, demo


@pytest.mark.parametrize(
    ("mode", "safe", "lock"),
    [("LIVE", "SAFE", "LOCKED"), ("SAFE", "LIVE", "LOCKED"), ("LOCKED", "LOCKED", "SAFE")],
)
def test_what_each_of_the_two_keys_makes_of_it(mode: InputMode, safe: InputMode, lock: InputMode) -> None:
    assert toggle_safe(mode) == safe and toggle_lock(mode) == lock


def test_only_what_is_not_live_has_a_reason() -> None:
    assert blocked_text(None, key_name) == ""
    assert blocked_text(BlockedReason("safe"), key_name) == "SAFE: ctrl+x makes keys act"
    assert blocked_text(BlockedReason("locked"), key_name) == "LOCKED: ctrl+n unlocks"


@pytest.mark.parametrize(
    ("mode", "key"), [("LIVE", "LIVE: keys start"), ("SAFE", "ctrl+x makes them act"), ("LOCKED", "leave and ctrl+n")]
)
def test_a_chosen_mode_is_told_with_the_key_that_leaves_it(mode: InputMode, key: str) -> None:
    assert key in mode_notice(mode, key_name)


async def quiet(it: Console) -> None:
    await it.pilot.pause(0.1)


@pytest.mark.slow
@pytest.mark.parametrize("key", ["g", "m", "n", "u", "comma", "enter"])
async def test_safe_starts_nothing_and_says_why(key: str) -> None:
    async with console() as it:
        await it.press("ctrl+x")
        await it.until(lambda: " SAFE " in it.bars.status_line.text and "LIVE" not in it.bars.status_line.text)
        await it.press(key)
        await it.until(lambda: "SAFE: ctrl+x makes keys act" in it.notice)
        await quiet(it)
        assert it.client.asked() == []
        await it.press("ctrl+x", key)
        await it.until(lambda: it.client.asked())


async def test_in_safe_marks_notes_and_stopping_work() -> None:
    async with console() as it:
        it.client.act("Greet")
        await it.press("ctrl+x", "space")
        await it.sent("markCue", "")
        await it.press("exclamation_mark", "escape")
        await it.sent("markMistake", "2 wrong")  # the cue
        await it.press("delete")
        await it.sent("stopCommunicationRobotAct", "Greet")
        await it.press("f9")
        await it.sent("stopAll", "")


async def test_in_safe_speech_can_be_prepared_and_is_not_said() -> None:
    async with console() as it:
        await it.press("ctrl+x", "ctrl+t", *"hello")
        assert "SAFE: ctrl+x makes keys act" in it.bars.key_hints.text
        await it.press("enter")
        await it.until(lambda: "not said: SAFE" in it.notice)
        await quiet(it)
        assert it.client.asked() == [] and it.bars.speech_input.field.value == "hello"


async def test_the_keys_of_acts_that_cannot_be_started_are_dimmed_and_the_row_says_why() -> None:
    async with console() as it:
        await it.press("ctrl+x")
        pane = it.pane("acts")
        await it.until(lambda: pane.row_view.row_at(0).line[0][1] == "muted")
        await it.press("down")
        await it.until(lambda: "Praise cannot be started: SAFE" in it.notice)


async def test_a_rule_that_runs_says_that_it_cannot_be_started_again() -> None:
    async with console() as it:
        it.client.rule("Again", "started", "raise", trigger="start")
        await it.press("f2", "down")
        await it.until(lambda: "Again cannot be started: it runs already" in it.notice)


async def test_locked_swallows_every_key_and_click_but_three() -> None:
    async with console() as it:
        await it.press("ctrl+n")
        await it.until(lambda: " LOCKED " in it.bars.status_line.text)
        assert it.bars.key_hints.text.split() == ["F9/^G", "STOP", "^C", "leave", "^N", "unlock"]
        for key in ("g", "ctrl+x", "colon", "question_mark", "ctrl+t", "tab", "space", "ctrl+o", "f8"):
            await it.press(key)
            await it.until(lambda: "LOCKED: ctrl+n unlocks" in it.notice)
        await it.pilot.click(it.bars.speech_input)
        await quiet(it)
        assert it.app.screen is it.screen and it.client.asked() == [] and it.pane("acts").row_view.has_focus
        assert not it.bars.speech_input.is_open
        await it.press("f9")
        await it.sent("stopAll", "")
        it.client.stop("requested")
        await it.press("ctrl+n")
        # Both: SAFE still holds when the stop is released.
        await it.until(lambda: " STOPPED  SAFE " in it.bars.status_line.text)


async def test_nothing_can_be_pasted_while_locked() -> None:
    async with console() as it:
        await it.press("ctrl+t", "a", "ctrl+n")
        await it.until(lambda: " LOCKED " in it.bars.status_line.text)
        it.app.post_message(events.Paste("text"))
        await it.press("b")
        assert isinstance(it.screen.focused, SpeechField)
        await it.press("ctrl+n", "c")
        await it.until(lambda: it.bars.speech_input.field.value == "ac")


async def test_a_locked_console_can_be_left() -> None:
    async with console() as it:
        await it.press("ctrl+n", "ctrl+c")
        await it.until(lambda: isinstance(it.app.screen, Dialog))
        await it.press("escape")
        await it.until(lambda: it.app.screen is it.screen)
        await it.press("ctrl+c")
        await it.until(lambda: isinstance(it.app.screen, Dialog))
        await it.press("d")
        await it.until(lambda: it.client.closed == [False])


@pytest.mark.slow
async def test_locking_closes_what_is_open_unanswered() -> None:
    async with console() as it:
        await it.press("question_mark")
        await it.until(lambda: isinstance(it.app.screen, HelpScreen))
        await it.press("ctrl+n")
        await it.until(lambda: it.app.screen is it.screen and " LOCKED " in it.bars.status_line.text)
        await it.press("ctrl+n", "f9")
        it.client.stop("latched")
        await it.until(lambda: it.screen.session.store.view.stop.latched)
        await it.press("ctrl+r")
        await it.until(lambda: isinstance(it.app.screen, Dialog))
        await it.press("ctrl+n")
        await it.until(lambda: it.app.screen is it.screen)
        await it.press("r")
        await quiet(it)
        assert ("releaseStop", "") not in it.client.asked()


async def test_locking_forgets_the_first_press_of_a_hold_act() -> None:
    async with console() as it:
        await it.press("b")
        await it.until(lambda: "again?" in it.row("acts", "Goodbye"))
        await it.press("ctrl+x", "ctrl+x", "enter")
        await it.sent("startCommunicationRobotAct", "Greet")  # the selected row, and not the armed act
        assert ("startCommunicationRobotAct", "Goodbye") not in it.client.asked()


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
