"""Several consoles: who has control, what a console without it may do, and what it is told."""

from __future__ import annotations

from typing import Any

import pytest
from textual.widgets import Button, Input

from rise_engine.kernel.records import NoteRecord, SessionRecord
from rise_tui.actions import ACTIONS
from rise_tui.console.input import CHANGE_SECONDS
from rise_tui.key_labels import why_unavailable
from rise_tui.model.store import Store
from rise_tui.screens.dialog import Dialog
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

pytestmark = pytest.mark.slow  # many keys each

ANNA, BEN = "wizard:anna", "wizard:ben"


def ben(**more: Any) -> FakeClient:
    """The console of ben; anna has control."""
    return FakeClient(demo(), you=BEN, **more)


async def opened(it: Console, key: str = "f8") -> str:
    """The question about control: what it says and offers."""
    await it.press(key)
    dialog = await it.shows(Dialog)
    await it.until(lambda: dialog.query("#buttons"))
    return "\n".join([*dialog._lines, *(str(button.label) for button in dialog.query(Button))])


async def test_every_screen_says_who_has_control() -> None:
    async with console(size=(80, 24)) as it:
        for size in ((80, 24), (120, 40), (200, 50)):
            await it.pilot.resize_terminal(*size)
            await it.until(lambda: "anna" in it.bars.status_line.text and "LIVE" in it.bars.status_line.text)
            assert "control" not in it.bars.status_line.text
            it.client.control_record("taken", BEN, BEN)
            await it.until(lambda: "WATCHING · ben has control" in it.bars.status_line.text)
            assert "LIVE" not in it.bars.status_line.text
            assert ("● ok" if size[0] < 100 else "● connected") in it.bars.status_line.text
            it.client.control_record("released", BEN, None)
            await it.until(lambda: "nobody has control" in it.bars.status_line.text)
            it.client.control_record("taken", ANNA, ANNA)


async def test_a_console_that_watches_starts_nothing_says_who_can_and_stops_everything() -> None:
    async with console(client=ben()) as it:
        await it.press("g")
        await it.until(lambda: it.notice.endswith("act Greet not started: anna has control (F8)"))
        await it.press("enter")
        assert "anna has control (F8)" in it.notice
        for action in ("acts.start", "memory.add", "rule.raise", "settings", "rules.start", "take-over"):
            it.screen.action_do(action)
            assert "anna has control (F8)" in it.notice, action
        assert it.client.sent == [] and it.client.take_overs == 0
        await it.press("f9")
        await it.sent("stopAll", "")
        assert it.client.sent[0].source == BEN
        it.client.stop("latched", ("speech",))
        await it.until(lambda: "STOPPED" in it.bars.alarm_bar.text)
        assert "ctrl+r" not in it.bars.alarm_bar.text
        await it.press("ctrl+r")
        assert it.app.screen is it.screen and "anna has control" in it.notice
        it.client.stop("released")
        await it.until(lambda: it.notice.strip().endswith("the stop is released"), "who watches is not live")


async def test_one_takes_control_or_asks_for_it_and_esc_leaves_it_where_it_is() -> None:
    async with console(client=ben()) as it:
        await opened(it)
        await it.press("escape")
        await it.back()
        assert it.client.verbs == []
        it.client.reject = "the session has not begun yet"
        await opened(it)
        await it.press("t")
        await it.until(lambda: "control has not changed: the session has not begun yet" in it.notice)
        it.client.reject = ""
        it.client.verbs.clear()
        await opened(it)
        it.client.control_record("taken", "wizard:carol", "wizard:carol")
        await it.back()  # the question is closed when control changes
        await it.pilot.pause(CHANGE_SECONDS)
        assert it.client.verbs == []
        await it.until(lambda: "carol has control" in it.bars.status_line.text)
        it.client.control_record("taken", ANNA, ANNA)
        await it.until(lambda: "anna has control" in it.bars.status_line.text)
        said = await opened(it, "ctrl+y")
        assert "anna has control" in said and "They are told" in said
        await it.press("a")
        await it.until(lambda: it.client.verbs == ["ask"])
        await it.until(lambda: "anna knows that you ask for control" in it.notice)
        assert "WATCHING · anna has control" in it.bars.status_line.text
        said = await opened(it)
        assert "Stop asking (r)" in said and "Take it (t)" in said
        await it.press("r")
        await it.until(lambda: it.client.verbs == ["ask", "release"])
        it.client.control_record("taken", ANNA, ANNA)
        await it.until(lambda: "anna has control" in it.bars.status_line.text)
        await opened(it)
        await it.press("t")
        await it.until(lambda: it.client.verbs == ["ask", "release", "take"])
        await it.until(lambda: "LIVE" in it.bars.status_line.text and "ben" in it.bars.status_line.text)
        await it.until(lambda: "you have control" in it.notice)


async def test_a_recovered_session_says_that_it_waits_and_with_what_it_will_go_on() -> None:
    async with console(client=FakeClient(demo(), holder=None), size=(80, 24)) as it:
        it.client.emit(SessionRecord(0, 0.0, "", status="recovered", waits_for_wizard=True))
        said = "recovered: nothing begins until somebody takes control: F8"
        await it.until(lambda: it.bars.attention_bar.text.strip() == said)
        for name in ("Greet", *["Nod"] * 6):
            it.client.act(name, "PENDING")
        await it.until(lambda: len(it.screen.store.view.waiting) == 7)
        question = await opened(it)
        assert "it goes on\nwith everything that runs or waits:\n  Greet\n  Nod\n" in question
        assert "  and 2 more\n" in question and "stop everything first (F9)" in question
        await it.press("t")
        await it.until(lambda: it.client.verbs == ["take"])
        await it.until(lambda: not it.bars.attention_bar.display)


async def test_the_question_in_a_recovered_session_names_what_runs_and_is_closed_when_something_joins() -> None:
    """An act whose wait has ended meanwhile goes on at once, before those in the line."""
    async with console(client=FakeClient(demo(), holder=None), size=(80, 24)) as it:
        it.client.act("Greet")
        it.client.emit(SessionRecord(0, 0.0, "", status="recovered", waits_for_wizard=True))
        await it.until(lambda: it.screen.store.view.waits_for_wizard)
        assert "that runs or waits:\n  Greet\nIf the robot should do none of that" in await opened(it)
        it.client.act("Nod", "PENDING")  # a rule's time runs out
        await it.back()
        assert "control, or what it begins, has just changed" in it.notice
        await it.press("t")
        assert "  Greet\n  Nod\n" in await opened(it) and it.client.verbs == []


async def test_who_has_control_is_asked_in_a_line_that_stays_gives_it_and_releases_it() -> None:
    async with console(size=(80, 24)) as it:
        line = it.bars.attention_bar
        it.client.control_record("asked", BEN, ANNA)
        await it.until(lambda: "ben asks for control: F8 to answer" in line.text and line.display)
        await it.pilot.pause(1.1)
        await it.press("down", "up")
        assert line.display, "a key is no answer"
        assert "F8 control" in it.bars.key_hints.text
        said = await opened(it)
        assert "ben asks for control" in said and "Give it to ben (g)" in said
        await it.press("g")
        await it.until(lambda: it.client.verbs == ["give"])
        await it.until(lambda: "WATCHING · ben has control" in it.bars.status_line.text)
        assert not line.display and "you gave control to ben" in it.notice
        it.client.control_record("given", BEN, ANNA)
        await it.until(lambda: "ben gave you control" in it.notice)
        it.client.stop("latched", ("speech",))
        await it.until(lambda: "STOPPED" in it.bars.alarm_bar.text)
        it.client.stop("released")
        await it.until(lambda: it.notice.strip().endswith("the stop is released: LIVE"))
        assert "Release it (r)" in await opened(it)
        await it.press("r")
        await it.until(lambda: it.client.verbs == ["give", "release"])
        await it.until(lambda: "nobody has control" in it.bars.status_line.text)
        assert "you released control" in it.notice


async def test_control_that_was_taken_shows_until_a_key_is_pressed_or_it_comes_back() -> None:
    async with console(size=(80, 24)) as it:
        it.client.time = 872.0
        it.client.control_record("taken", BEN, BEN)
        line = "ben took control at 00:14:32; you are watching; F8 takes it back"
        await it.until(lambda: line in it.bars.attention_bar.text and it.bars.attention_bar.display)
        await it.press("g")
        assert it.bars.attention_bar.display, "a key that was on its way has read nothing"
        assert it.client.sent == []
        await it.pilot.pause(1.1)
        await it.press("down")
        await it.until(lambda: not it.bars.attention_bar.display)
        assert "WATCHING · ben has control" in it.bars.status_line.text
        it.client.control_record("given", BEN, ANNA)
        it.client.control_record("taken", BEN, BEN)
        await it.until(lambda: it.bars.attention_bar.display)
        it.client.control_record("given", BEN, ANNA)
        await it.until(lambda: not it.bars.attention_bar.display)


async def test_an_observer_never_takes_control() -> None:
    client = FakeClient(demo(), you="observer:ben", role="observer")
    async with console(client=client) as it:
        await it.until(lambda: "WATCHING · anna has control" in it.bars.status_line.text)
        await it.press("f8")
        assert it.app.screen is it.screen and "only watches (--observe)" in it.notice
        await it.press("g")
        await it.until(lambda: "anna has control and this console only watches" in it.notice)
        client.control_record("released", ANNA, None)
        await it.until(lambda: "WATCHING · nobody has control" in it.bars.status_line.text)
        await it.press("f9")
        await it.sent("stopAll", "")
        assert client.verbs == []


@pytest.mark.parametrize("you", [ANNA, BEN])
async def test_a_note_is_added_from_every_console_and_one_that_was_not_taken_is_there_the_next_time(you: str) -> None:
    async with console(client=FakeClient(demo(), you=you)) as it:
        line = it.bars.note_line
        await it.press("ctrl+o", "x", "f9")
        await it.sent("stopAll", "")
        await it.press("escape")
        await it.until(lambda: not line.display)
        assert it.client.notes == []
        await it.press("ctrl+o", "backspace")
        await it.until(lambda: isinstance(it.app.focused, Input) and line.display)
        await it.press(*"gmn", "enter")
        await it.until(lambda: bool(it.client.notes))
        assert (it.client.notes[0].text, it.client.notes[0].source) == ("gmn", you)
        assert it.client.asked() == [("stopAll", "")]
        await it.until(lambda: f"note by {you[7:]}: gmn" in it.notice)
        assert it.pane("acts").row_view.has_focus and not line.display
        it.client.emit(NoteRecord(0, 0.0, "", "the child laughed", "wizard:carol"))
        await it.until(lambda: "note by carol: the child laughed" in it.notice)
        it.client.reject = "the disk is full"
        await it.press("ctrl+o", *"cup", "enter")
        await it.until(lambda: "the note was not recorded: the disk is full" in it.notice)
        await it.press("ctrl+o")
        await it.until(lambda: line.value == "cup")


async def test_changed_files_are_taken_over_or_it_says_why_not() -> None:
    async with console() as it:
        it.screen.action_do("take-over")
        await it.until(lambda: it.client.take_overs == 1 and "now uses the changed files" in it.notice)
        it.client.reject = "an act runs or waits"
        it.screen.action_do("take-over")
        await it.until(lambda: it.notice.endswith("the session keeps its files: an act runs or waits"))


def test_what_changes_a_session_needs_control() -> None:
    """Every action that sends something is closed to a console that watches, but for stopping, notes and control."""
    client = ben()
    attach_reply = client.attach_reply()
    store = Store(attach_reply, "ben", client.now)
    free = {action.id for action in ACTIONS if not why_unavailable(action, store)}
    assert free == {
        *("stop", "quit", "palette", "help", "lists", "next-pane", "zoom", "filter", "theme"),
        *("control", "note", "log.follow", "safe", "lock", "previous-pane", "jump", "tour", "redraw", "edit-study"),
        *("memory.fold", "memory.unfold", "scheduler.details", "log.fold", "log.unfold"),
    }
