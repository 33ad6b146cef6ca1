"""What is on the screen, and what is sent, when a wizard works with the lists, panes and dialogs."""

from __future__ import annotations

import json

import pytest
from textual.widgets import Button, Input

from rise_engine.kernel.records import MemoryRecord, OpenGoal, RobotRecord
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.model import SourceLocation
from rise_tui.config.launch import ScenarioProblems
from rise_tui.panes.memory import MemoryPane
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.help import HelpScreen
from rise_tui.screens.session_forms import EndSessionDialog
from rise_tui.screens.settings import SettingsScreen
from rise_tui.widgets.fields import TextField
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, FakeLauncher, demo

GREET = "startCommunicationRobotAct", "Greet"

pytestmark = pytest.mark.slow  # many keys each


def waits(it: Console) -> None:
    """The rule is where it waits for the wizard."""
    it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)


# --- acts and rules -------------------------------------------------------------------------------------------------


async def test_acts_and_rules_are_started_followed_and_stopped() -> None:
    async with console(size=(200, 50)) as it:
        client = it.client
        client.answers = False
        await it.press("enter")
        await it.until(lambda: "enter again: “Hello" in it.row("acts", "enter again"))
        assert client.asked() == [] and "enter again: “Hello" in it.notice
        await it.press("enter")
        await it.sent(*GREET)
        await it.until(lambda: "↑ sent" in it.row("acts", "Greet"))
        task = client.act("Greet", ref=client.sent[0].ref)
        await it.until(lambda: "► running" in it.row("acts", "Greet"), "sent until the engine says more")
        client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
        client.action(task, "Greet", "2", "Animation", "succeeded", value="head_nod")
        client.time += 2.1
        await it.until(lambda: "2.1/" in it.row("acts", "Greet"))
        client.end_task(task, "Greet", "ABORTED", "the robot refused action 1")
        await it.until(lambda: "✗ failed" in it.row("acts", "Greet"))
        await it.until(lambda: "the robot refused action 1" in it.bars.failure_bar.text)
        assert it.notice == ""
        client.act("Greet")
        waiting = client.act("Praise", "PENDING")
        await it.until(lambda: "waiting" in it.row("acts", "Praise"))
        await it.press("delete")
        await it.sent("stopCommunicationRobotAct", "Greet")
        await it.press("down", "delete")
        await it.sent("cancelTask", str(waiting))
        client.answer()
        await it.press("f2", "enter", "enter")
        await it.sent("startInteractionRule", "Main")
        waits(it)
        await it.until(lambda: "running waiting" in " ".join(it.row("rules", "Main").split()))
        await it.press("delete")
        await it.sent("stopInteractionRule", "Main")


async def test_what_is_rejected_says_why_and_nothing_stays_sent() -> None:
    async with console(size=(200, 50)) as it:
        it.client.task("startInteractionRule", "Main", "REJECTED", reason="the rule runs already")
        await it.until(lambda: "the rule runs already" in it.notice)
        assert "rejected" in "".join(text for text, _ in it.pane("log").row_view.row_at(0).line)
        it.client.reject = "the queue is full"
        await it.press("g")
        await it.until(lambda: "the queue is full" in it.notice)
        assert "sent" not in it.text("acts")
        it.client.sent.clear()
        await it.press("slash", "f", "i", "l")
        await it.until(lambda: it.text("acts").strip().startswith(".") and "Greet" not in it.text("acts"))
        await it.press("escape")
        await it.until(lambda: "Greet" in it.text("acts"))
        assert it.client.sent == [], "letters of a filter start nothing"


# --- panes ----------------------------------------------------------------------------------------------------------


async def test_the_rule_pane_says_why_it_waits_and_raises_the_event_under_the_cursor() -> None:
    async with console() as it:
        waits(it)
        await it.until(lambda: "in waiting" in it.text("rule"))
        text = it.text("rule")
        assert "waits for event next  you: n" in text
        assert "waits for event repeat  you: a" in text  # the key of a rule that raises it
        assert "waits for 600 s to pass" in text
        condition = next(line for line in text.splitlines() if line.split()[:4] == ["if", "task", "=", "4"])
        assert "task is 2" in condition and condition.rstrip().endswith("false")
        assert "last step" in next(line for line in text.splitlines() if "↓ Greet_end" in line)
        it.client.emit(MemoryRecord(0, 0.0, "", "task", 4, 2, "wizard:anna"))
        it.client.emit(MemoryRecord(0, 0.0, "", "understood", True, False, "wizard:anna"))
        await it.until(lambda: "true" in it.row("rule", "task is 4"))
        await it.focus("rule")
        await it.press("enter")
        await it.until(lambda: "enter again: event next" in it.notice)
        assert it.client.asked() == []
        await it.press("enter")
        await it.sent("raiseEventTopic", "next")


async def test_the_act_pane_shows_levels_and_the_scheduler_reorders_and_cancels() -> None:
    async with console() as it:
        await it.focus("act")
        running = it.client.act("Greet")
        it.client.action(running, "Greet", "1", "Speech", "started", message="Hello Ada!")
        await it.until(lambda: "Hello Ada!" in it.text("act"))
        lines = it.text("act").splitlines()
        assert lines[1].split()[:4] == ["1", "╭───", "1", "Speech"] and "started" in lines[1]
        assert lines[3].split()[:4] == ["2", "╰┴┬─", "3", "Wait"] and "after 1, 2" in lines[3]
        assert "after 3  Please put the" in lines[4]
        await it.press("end")
        await it.until(
            lambda: "written: Please put the fork to the {side}." in it.screen.query_one("#act-details").text
        )
        await it.focus("scheduler")
        it.client.act("Praise", "PENDING")
        second = it.client.act("Filler", "PENDING")
        await it.until(lambda: len(it.text("scheduler").splitlines()) == 3)
        assert [line.split()[0] for line in it.text("scheduler").splitlines()] == ["now", "next", "2."]
        await it.press("end", "shift+up")
        await it.sent("moveTask", f"{second} 0")
        await it.press("delete")
        await it.sent("cancelTask", str(second))
        await it.press("home", "shift+down")
        await it.until(lambda: "already running" in it.notice)
        await it.press("delete")
        await it.sent("cancelTask", str(running))


async def test_the_log_follows_pauses_and_filters() -> None:
    async with console(size=(120, 40)) as it:
        log, title = it.pane("log").row_view, it.pane("log").title

        def raised(*topics: str) -> None:
            for topic in topics:
                it.client.task("raiseEventTopic", topic, "SUCCEEDED")

        raised(*(f"/topic{number}" for number in range(60)))
        await it.until(lambda: log.count == 60 and "following" in title.text)
        await it.until(lambda: log.scroll_offset.y == 60 - log.size.height, "the newest rows are not in view")
        await it.focus("log")
        await it.press("pageup")
        at = log.scroll_offset.y
        raised("/late0", "/late1", "/late2")
        await it.until(lambda: "paused, 3 new" in title.text)
        assert log.scroll_offset.y == at
        await it.press("end")
        await it.until(lambda: "following" in title.text)
        await it.press("slash", *"topic2")
        await it.until(lambda: log.count == 11)  # topic2, topic20 to topic29
        raised("/topic200", "/other")
        await it.until(lambda: log.count == 12)
        await it.press("enter")
        assert log.has_focus and log.count == 12
        await it.press("escape")
        await it.until(lambda: log.count == 65)


# --- memory ---------------------------------------------------------------------------------------------------------


async def test_a_value_is_edited_in_its_place_and_its_type_shows_while_typing() -> None:
    async with console() as it:
        pane = it.pane("memory")
        assert isinstance(pane, MemoryPane)
        await it.focus("memory")

        async def edit() -> Input:
            await it.press("home", "enter")
            await it.until(lambda: isinstance(it.app.focused, Input))
            assert isinstance(it.app.focused, Input)
            return it.app.focused

        for typed, kind, value in (
            ("3", "integer", 3),
            ("2.5", "number", 2.5),
            ("true", "boolean", True),
            ("null", "null", None),
            ("fork", "string", "fork"),
            ('"5"', "string", "5"),
            ("[1]", "array", [1]),
            ('{"a": 1}', "object", {"a": 1}),
        ):
            field = await edit()
            assert field.value == "2" and field.region.y == pane.row_list.region.y
            field.value = typed
            await it.until(lambda kind=kind: pane.editor.type_line.text == kind, typed)  # type: ignore[misc]
            await it.press("enter")
            await it.sent("assignValue", json.dumps({"task": value}))
            assert pane.row_list.has_focus
        it.client.sent.clear()
        field = await edit()
        field.value = '{"a": '
        await it.until(lambda: "string  not JSON" in pane.editor.type_line.text)
        it.client.emit(MemoryRecord(0, 0.0, "", "task", 3, 2, "rule:Main"))
        await it.until(lambda: "is now 3 by rule:Main" in pane.editor.conflict_line.text)
        await it.press("9", "escape")
        await it.until(lambda: pane.row_view.has_focus)
        assert it.client.sent == [], "esc sends nothing"
        await it.press("end", "enter")  # a key is added without the insert key
        await it.until(lambda: isinstance(it.app.focused, Input))
        await it.press(*"cups", "enter", "4", "enter")
        await it.sent("assignValue", '{"cups": 4}')
        await it.press("home", "down", "delete")
        await it.sent("deleteValue", "side")
        it.client.emit(MemoryRecord(0, 0.0, "", "side", None, "left", "wizard:anna", deleted=True))
        await it.until(lambda: "side" not in it.text("memory"))
        await it.press("insert", "enter")  # what was deleted is brought back
        await it.sent("assignValue", '{"side": "left"}')


# --- stop -----------------------------------------------------------------------------------------------------------


async def test_stop_shows_who_confirmed_and_stays_until_released_on_purpose() -> None:
    async with console() as it:
        client, alarm = it.client, it.bars.alarm_bar
        await it.press("ctrl+r")
        assert it.app.screen is it.screen
        assert "nothing is stopped" in it.notice
        client.answers = False
        await it.press("f9")
        await it.until(lambda: "STOP sent" in alarm.text and alarm.display)
        client.task("stopAll", "", "SUCCEEDED", ref=client.sent[0].ref)
        client.answer()
        client.stop("requested")
        await it.until(lambda: "STOP requested" in alarm.text)
        client.stop("latched", ("pepper/speech", "pepper/gaze"), ("pepper/base",))
        await it.until(lambda: "STOPPED" in alarm.text and "STOPPED" in it.bars.status_line.text)
        assert "pepper: speech, gaze" in alarm.text
        assert "NOT CONFIRMED  pepper: base" in alarm.text
        await it.press("escape", "enter", "g")
        assert "STOPPED" in alarm.text and client.asked() == [("stopAll", "")]
        assert "STOPPED" in it.notice and "ctrl+r" in it.notice, "keys start nothing and say why"
        await it.press("ctrl+r")
        await it.shows(Dialog)
        await it.press("escape")
        assert "releaseStop" not in [function for function, _ in client.asked()]
        await it.press("ctrl+r", "r")
        await it.sent("releaseStop", '{"stop":1}')
        client.stop("released")
        await it.until(lambda: "STOPPED" not in it.bars.status_line.text and "LIVE" in it.bars.status_line.text)


# --- the engine's end -----------------------------------------------------------------------------------------------


async def test_an_engine_that_has_ended_is_told_keys_do_nothing_and_hints_name_what_is_left() -> None:
    async with console() as it:
        await it.focus("memory")
        await it.until(lambda: "del delete" in it.bars.key_hints.text)
        it.client.end("the engine stopped: a bug")
        await it.until(lambda: "ENGINE GONE" in it.bars.alarm_bar.text and "a bug" in it.bars.alarm_bar.text)
        await it.until(lambda: it.bars.key_hints.text.startswith(" ^C leave"))
        hints = it.bars.key_hints.text
        assert "unfold" in hints and "find" in hints
        assert not any(word in hints for word in ("STOP", "edit", "add", "delete", "undo", "say", "cue"))
        await it.press("g", "enter", "f9")
        assert it.client.sent == []
        assert "the engine has gone" in it.notice


async def test_a_lost_robot_is_told_and_a_send_that_fails_does_not_end_the_console() -> None:
    async with console() as it:
        it.client.emit(RobotRecord(0, 0.0, "", status="lost", detail="no answer for 3 s"))
        await it.until(lambda: "✗ lost" in it.bars.status_line.text and "no answer for 3 s" in it.notice)
        it.client.gone = "the process was killed"
        await it.press("g")
        await it.until(lambda: "the process was killed" in it.bars.alarm_bar.text)


# --- layout and settings --------------------------------------------------------------------------------------------


async def test_there_are_as_many_panes_as_there_is_room_for_and_help_is_always_among_the_hints() -> None:
    async with console(size=(200, 50)) as it:
        shown = {"acts", "rules", "rule", "act", "memory", "log", "scheduler"}
        for size, panes, css in (
            ((200, 50), shown, "-all"),
            ((120, 40), {"acts", "rules", "rule", "log"}, "-two"),
            ((80, 24), {"acts", "rules", "rule", "log"}, "-two"),
            ((79, 24), {"acts", "rules", "rule"}, ""),
        ):
            await it.pilot.resize_terminal(*size)
            await it.focus("log")
            await it.focus("rule")
            assert {pane.SCOPE for pane in it.screen.pane_layout.visible_panes()} == panes
            assert not css or it.screen.pane_layout.has_class(css)
            assert css != "-two" or it.screen.pane_layout.has_class("-narrow") is (size[0] < 100)
            for name in sorted(shown):
                await it.focus(name)
                await it.until(lambda: it.bars.key_hints.text.count("? help") == 1, f"{name} at {size}")
                assert it.bars.key_hints.text.startswith(" F9/^G STOP")


async def test_every_pane_is_reached_by_f3_zoomed_clicked_and_esc_goes_back() -> None:
    async with console(size=(80, 24)) as it:
        seen = []
        for key in ("f3", "tab", "f3", "tab", "f3", "f3"):
            await it.press(key)
            pane = it.screen.pane_layout.focused_pane()
            assert pane is not None and pane.row_view.has_focus
            seen.append(pane.SCOPE)
        assert seen == ["rule", "act", "memory", "log", "scheduler", "rule"]
        await it.press("f4")
        assert [pane.SCOPE for pane in it.screen.pane_layout.visible_panes()] == ["rule"]
        await it.press("escape")
        assert len(list(it.screen.pane_layout.visible_panes())) == 4
        await it.press("f2")
        assert it.pane("acts").row_view.has_focus
        await it.press("ctrl+l")
        assert it.pane("rules").row_view.has_focus
        hints, title = it.bars.key_hints, it.pane("rule").title
        await it.pilot.click(hints, offset=(hints.text.index("? help") + 1, 0))
        await it.shows(HelpScreen)
        await it.press("escape")
        await it.pilot.click(title, offset=(title.text.index("memory") + 1, 0))
        await it.until(lambda: it.pane("memory").row_view.has_focus)


async def test_settings_show_what_is_wrong_and_apply_after_asking_and_ending_the_running_session() -> None:
    first, second = FakeClient(demo()), FakeClient(demo(), mode="real")
    refused = ScenarioProblems(
        [Diagnostic("error", "unknown-act", "there is no act `Hi`", SourceLocation("rules/main.xml", 3, 4))]
    )
    launcher = FakeLauncher(first, second, prepared=refused)
    async with console(client=first, launcher=launcher) as it:
        it.screen.action_do("settings")
        screen = await it.shows(SettingsScreen)
        screen.query_one("#folder", TextField).value = "/elsewhere"
        screen.query_one("#apply", Button).press()
        await it.until(lambda: "rules/main.xml:3:4" in str(screen.findings.content))
        await it.press("escape")
        await it.back()
        assert first.closed == []
        launcher.prepared = first.scenario
        it.screen.action_do("settings")
        screen = await it.shows(SettingsScreen)
        screen.query_one("#mode").query(Button).last().press()
        await it.pilot.pause()
        screen.query_one("#participant", TextField).value = "P08"
        screen.query_one("#apply", Button).press()
        await it.shows(EndSessionDialog)
        assert first.closed == []
        assert it.app._session is not None
        it.app._session.store.view.left_open = (OpenGoal("pepper/speech", "3/1", "Speech", "it refused to stop"),)
        await it.press("e", "n", "d", "enter")
        await it.until(lambda: first.closed == [True])
        await it.until(lambda: "REAL" in it.bars.status_line.text)
        assert launcher.started[1].mode == "real" and launcher.started[1].participant == "P08"
        await it.until(lambda: "LOOK AT THE ROBOT" in it.notice)
