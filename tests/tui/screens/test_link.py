"""What a console says and does when its connection, the disk or the engine fails."""

from __future__ import annotations

import pytest

from rise_engine.kernel.records import MemoryRecord, SessionRecord
from rise_tui.console import session as session_module
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

pytestmark = pytest.mark.slow  # many keys each


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "REATTACH_SECONDS", 0.05)


async def attached_again(it: Console, times: int = 2) -> None:
    await it.until(lambda: it.screen.session.store.log.rebuild_count == times)


# --- the connection ---------------------------------------------------------------------------------------------------


async def test_a_cut_connection_comes_back_by_itself_with_the_true_state() -> None:
    async with console(size=(200, 50)) as it:
        it.client.act("Praise", "SUCCEEDED")
        await it.until(lambda: it.pane("log").row_view.count == 1)
        it.client.cut()
        it.client.act("Greet")
        it.client.emit(MemoryRecord(0, 0.0, "", "task", 4, 2, "wizard:anna"))
        await attached_again(it)
        await it.until(lambda: "► running" in it.row("acts", "Greet") and it.row("memory", "task").split()[1] == "4")
        assert it.pane("log").row_view.count == 2
        assert "the connection is back" in it.notice and "may or may not have arrived: look at the log" in it.notice
        it.client.act("Filler")
        await it.until(lambda: it.pane("log").row_view.count == 3)
        assert "LIVE" in it.bars.status_line.text and not it.bars.alarm_bar.display
        it.client.cut()
        it.client.control_record("taken", "wizard:ben", "wizard:ben")
        await attached_again(it, 3)
        await it.until(lambda: "ben took control while the connection was cut" in it.bars.attention_bar.text)
        assert "WATCHING · ben has control" in it.bars.status_line.text
        it.client.gone = "its process no longer exists"
        it.client.cut()
        await it.until(lambda: "ENGINE GONE" in it.bars.alarm_bar.text, "an engine may go while the connection is cut")


async def test_what_was_sent_while_it_was_cut_is_not_shown_as_sent_and_a_stop_is_asked_for_again() -> None:
    client = FakeClient(demo())
    client.answers = False
    async with console(client=client) as it:
        await it.press("g")
        await it.until(lambda: "↑ sent" in it.row("acts", "Greet"))
        client.cut()
        await attached_again(it)
        await it.until(lambda: "sent" not in it.row("acts", "Greet"))
        await it.press("f9")
        await it.until(lambda: "STOP sent" in it.bars.alarm_bar.text)
        client.cut()
        await attached_again(it, 3)
        await it.until(lambda: "STOP may not have arrived: press F9 again" in it.notice)


async def test_while_it_is_cut_the_screen_says_so_and_keys_are_refused() -> None:
    client = FakeClient(demo())
    async with console(client=client) as it:
        client.unreachable = 10_000
        client.cut()
        await it.until(lambda: "CUT, reconnecting" in it.bars.status_line.text)
        await it.press("g")
        await it.until(lambda: "Greet not started: the connection is cut" in it.notice)
        await it.until(lambda: "CONNECTION CUT" in it.bars.alarm_bar.text and it.bars.alarm_bar.display)
        assert client.sent == []
        await it.press("f9")
        await it.until(lambda: "STOP NOT SENT" in it.bars.alarm_bar.text)
        assert "STOP was NOT sent" in it.notice and "its own switch" in it.bars.alarm_bar.text
        client.unreachable = 0
        await attached_again(it)
        await it.until(lambda: not it.bars.alarm_bar.display)
        assert client.sent == [], "nothing was queued"
        client.cut()
        client.you = "wizard:anna#2"  # the engine has not yet noticed that the first one is cut
        await attached_again(it, 3)
        await it.until(lambda: "WATCHING · anna has control" in it.bars.status_line.text)
        assert not it.bars.attention_bar.display
        client.task("assignValue", '{"task": 3}', "SUCCEEDED", ref="anna-1")
        await it.pilot.pause(0.2)
        assert "task = 3" not in it.notice, "a second console of the same wizard is another one"
        client.control_record("released", "wizard:anna", None)
        await it.until(lambda: client.verbs == ["take"], "control comes back when nobody else has it")
        await it.until(lambda: "LIVE" in it.bars.status_line.text and "anna#2" in it.bars.status_line.text)


async def test_in_a_session_that_waits_for_a_wizard_control_does_not_come_back_by_itself() -> None:
    async with console() as it:
        it.client.cut()
        it.client.emit(SessionRecord(0, 0.0, "", status="recovered", waits_for_wizard=True))
        it.client.control_record("released", "wizard:anna", None)
        await attached_again(it)
        await it.until(lambda: "nothing begins until somebody takes control: F8" in it.bars.attention_bar.text)
        await it.until(lambda: not it.screen.store.reclaims_control)
        assert it.client.verbs == []


# --- the engine -------------------------------------------------------------------------------------------------------


async def test_a_session_that_somebody_ends_is_told_as_that() -> None:
    async with console() as it:
        it.client.end_in_order("ended by wizard:ben")
        await it.until(lambda: "SESSION ENDED" in it.bars.alarm_bar.text)
        assert "ENDED" in it.bars.status_line.text and "recovered" not in it.bars.alarm_bar.text
        await it.press("g")
        assert "the session is over" in it.notice


async def test_nothing_to_recover_is_not_promised() -> None:
    client = FakeClient(demo(), folder="")
    client.journal(trouble="the disk is read-only")
    async with console(client=client) as it:
        await it.until(lambda: "NOT RECORDING" in it.bars.alarm_bar.text, "trouble of before shows at once")
        client.end("a bug")
        await it.until(lambda: "ENGINE GONE" in it.bars.alarm_bar.text)
        assert "recovered" not in it.bars.alarm_bar.text


# --- the record -------------------------------------------------------------------------------------------------------


async def test_a_record_that_lags_shows_and_one_that_fails_is_an_alarm_and_nothing_starts() -> None:
    async with console(size=(80, 24)) as it:
        it.client.journal(behind=0.4)
        it.client.journal(behind=3.2)
        await it.until(lambda: "disk 3 s behind" in it.bars.status_line.text)
        it.client.journal()
        await it.until(lambda: "behind" not in it.bars.status_line.text)
        it.client.journal(trouble="no space is left on the disk")
        await it.until(lambda: "NOT RECORDING" in it.bars.alarm_bar.text and it.bars.alarm_bar.display)
        for size in ((120, 40), (80, 24)):
            await it.pilot.resize_terminal(*size)
            said = it.bars.alarm_bar.text
            assert "no space is left on the disk" in said
            assert "the session is paused until the disk accepts records again" in said
            assert "F9 still stops the robot" in said and "…" not in said
        assert "PAUSED" in it.bars.status_line.text and "LIVE" not in it.bars.status_line.text
        await it.press("g")
        await it.until(lambda: "Greet not started: NOT RECORDING, the session is paused: no space" in it.notice)
        assert it.client.sent == []
        await it.press("f9")
        await it.sent("stopAll", "")
        it.client.stop("latched", ("pepper/speech",), ("pepper/base",))
        await it.until(lambda: "STOPPED" in it.bars.alarm_bar.text)
        lines = it.bars.alarm_bar.text.splitlines()
        assert len(lines) == 3
        assert "STOPPED" in lines[0] and "NOT CONFIRMED  pepper: base" in lines[1]
        assert "NOT RECORDING" in lines[2] and "no space is left" in lines[2]
        it.client.stop("latched", ("pepper/speech", "pepper/base"))
        await it.until(lambda: "confirmed      pepper: speech, base" in it.bars.alarm_bar.text)
        it.client.stop("requested")
        await it.until(lambda: "STOP requested" in it.bars.alarm_bar.text)
        assert "NOT RECORDING" in it.bars.alarm_bar.text
        it.client.journal()
        await it.until(lambda: "NOT RECORDING" not in it.bars.alarm_bar.text)
        assert "the disk accepts records again" in it.notice
        it.client.end("its process no longer exists")
        await it.until(lambda: "ENGINE GONE" in it.bars.alarm_bar.text)
        assert "its process no longer exists" in it.bars.alarm_bar.text
        assert "ctrl+c recovers the session, or leaves" in it.bars.alarm_bar.text
        assert "GONE" in it.bars.status_line.text


# --- a replay ---------------------------------------------------------------------------------------------------------


async def test_a_replay_says_so_and_starts_nothing() -> None:
    client = FakeClient(demo(), you="observer:replay", role="observer", replay=True)
    async with console(client=client) as it:
        await it.until(lambda: "REPLAY" in it.bars.status_line.text)
        assert "DEBUG" not in it.bars.status_line.text and "LIVE" not in it.bars.status_line.text
        await it.press("g")
        await it.until(lambda: "Greet not started: this is a replay" in it.notice)
        for key in ("f8", "ctrl+o"):
            await it.press(key)
            assert it.app.screen is it.screen and "this is a replay" in it.notice
        assert client.sent == []
        await it.press("ctrl+c")
        await it.until(lambda: not it.app.is_running)
        assert it.app.exit_message == ""
