"""What is on the screen, and what is sent, when a wizard works with the lists, panes and dialogs."""

from __future__ import annotations

import json

import pytest
from textual.widgets import Button, Input

from rise_engine.kernel.records import MemoryRecord, RobotRecord
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.model import SourceLocation
from rise_tui.config.launch import ScenarioProblems
from rise_tui.panes.memory import MemoryPane
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.end_session import EndSessionDialog
from rise_tui.screens.help import HelpScreen
from rise_tui.screens.settings import SettingsScreen
from rise_tui.widgets.memory_editor import TextField
from tests.console.conftest import console
from tests.console.fake import FakeClient, FakeLauncher, demo

GREET = "startCommunicationRobotAct", "Greet"


# --- acts and rules -------------------------------------------------------------------------------------------------


async def test_an_act_is_sent_until_the_engine_says_more() -> None:
    client = FakeClient(demo())
    client.answers = False
    async with console(client=client) as it:
        await it.press("enter")
        await it.sent(*GREET)
        await it.until(lambda: "↑ sent" in it.row("acts", "Greet"))
        client.act("Greet", ref=client.sent[0].ref)
        await it.until(lambda: "► running" in it.row("acts", "Greet"))


async def test_a_running_act_shows_progress_and_time_and_then_what_became_of_it() -> None:
    async with console() as it:
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
        it.client.action(task, "Greet", "2", "Animation", "succeeded", value="head_nod")
        it.client.time += 2.1
        await it.until(lambda: "1/4" in it.row("acts", "Greet") and "2.1/" in it.row("acts", "Greet"))
        it.client.end_task(task, "Greet", "ABORTED", "the robot refused action 1")
        await it.until(lambda: "✗ failed" in it.row("acts", "Greet"))
        await it.until(lambda: "the robot refused action 1" in it.bars.failure_bar.text)
        assert it.notice == ""


async def test_delete_stops_a_running_act_and_cancels_a_waiting_one() -> None:
    async with console() as it:
        it.client.act("Greet")
        waiting = it.client.act("Praise", "PENDING")
        await it.until(lambda: "waiting" in it.row("acts", "Praise"))
        await it.press("delete")
        await it.sent("stopCommunicationRobotAct", "Greet")
        await it.press("down", "backspace")
        await it.sent("cancelTask", str(waiting))


async def test_a_rejected_task_says_why_in_the_notice_and_in_the_log() -> None:
    async with console(size=(200, 50)) as it:
        it.client.task("startInteractionRule", "Main", "REJECTED", reason="the rule runs already")
        await it.until(lambda: "the rule runs already" in it.notice)
        log = it.pane("log").row_view
        assert "rejected" in "".join(text for text, _ in log.row_at(0).line)


async def test_a_rejection_by_reply_is_told_and_nothing_stays_sent() -> None:
    client = FakeClient(demo())
    client.reject = "the queue is full"
    async with console(client=client) as it:
        await it.press("g")
        await it.until(lambda: "the queue is full" in it.notice)
        assert "sent" not in it.text("acts")


async def test_rules_start_and_stop_and_show_their_state() -> None:
    async with console() as it:
        await it.press("f2", "enter")
        await it.sent("startInteractionRule", "Main")
        it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
        await it.until(lambda: "running waiting" in " ".join(it.row("rules", "Main").split()))
        await it.press("delete")
        await it.sent("stopInteractionRule", "Main")


# --- panes ----------------------------------------------------------------------------------------------------------


async def test_the_rule_pane_says_why_it_waits_and_what_the_wizard_can_do() -> None:
    async with console() as it:
        it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
        await it.until(lambda: "in waiting" in it.text("rule"))
        text = it.text("rule")
        assert "waits for event next  you: n" in text
        assert "waits for event repeat  you: a" in text  # the key of a rule that raises it
        assert "waits for 600 s to pass" in text
        condition = next(line for line in text.splitlines() if line.split()[:4] == ["if", "task", "=", "4"])
        assert "task is 2" in condition and condition.rstrip().endswith("false")
        assert "taken last" in next(line for line in text.splitlines() if "↓ Greet_end" in line)
        it.client.emit(MemoryRecord(0, 0.0, "", "task", 4, 2, "wizard:anna"))
        it.client.emit(MemoryRecord(0, 0.0, "", "understood", True, False, "wizard:anna"))
        await it.until(lambda: "true" in it.row("rule", "task is 4"))


async def test_enter_on_a_transition_raises_its_event() -> None:
    async with console() as it:
        it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
        await it.until(lambda: "in waiting" in it.text("rule"))
        it.screen.pane_layout.focus_pane("rule")
        await it.press("enter")
        await it.sent("raiseEventTopic", "next")


async def test_the_act_pane_shows_levels_states_and_parameters_with_the_memory() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("act")
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "1", "Speech", "started", message="Hello Ada!")
        await it.until(lambda: "Hello Ada!" in it.text("act"))
        lines = it.text("act").splitlines()
        assert lines[1].split()[:4] == ["1", "╭───", "1", "Speech"] and "started" in lines[1]
        assert lines[3].split()[:4] == ["2", "╰┴┬─", "3", "Wait"] and "after 1, 2" in lines[3]
        assert "after 3  Please put the" in lines[4]
        await it.press("end")
        await it.until(
            lambda: "written: Please put the fork to the {side}." in it.screen.query_one("#act-details").text
        )


async def test_the_scheduler_reorders_and_cancels() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("scheduler")
        running = it.client.act("Greet")
        first = it.client.act("Praise", "PENDING")
        second = it.client.act("Filler", "PENDING")
        await it.until(lambda: len(it.text("scheduler").splitlines()) == 3)
        assert [line.split()[0] for line in it.text("scheduler").splitlines()] == ["now", "next", "2."]
        await it.press("end", "shift+up")
        await it.sent("moveTask", f"{second} 0")
        await it.press("delete")
        await it.sent("cancelTask", str(second))
        await it.press("home", "shift+down")
        await it.until(lambda: "runs already" in it.notice)
        await it.press("delete")
        await it.sent("cancelTask", str(running))
        assert first != second


async def test_the_log_follows_pauses_and_counts_what_is_new() -> None:
    async with console(size=(120, 40)) as it:
        for number in range(60):
            it.client.task("raiseEventTopic", f"/topic{number}", "SUCCEEDED")
        log = it.pane("log").row_view
        await it.until(lambda: log.count == 60 and "following" in it.pane("log").title.text)
        await it.until(lambda: log.scroll_offset.y == 60 - log.size.height, "the newest rows are not in view")
        it.screen.pane_layout.focus_pane("log")
        await it.press("pageup")
        at = log.scroll_offset.y
        for number in range(3):
            it.client.task("raiseEventTopic", f"/late{number}", "SUCCEEDED")
        await it.until(lambda: "paused, 3 new" in it.pane("log").title.text)
        assert log.scroll_offset.y == at
        await it.press("end")
        await it.until(lambda: "following" in it.pane("log").title.text)


async def test_the_log_filters() -> None:
    async with console() as it:
        for number in range(30):
            it.client.task("raiseEventTopic", f"/topic{number}", "SUCCEEDED")
        it.screen.pane_layout.focus_pane("log")
        await it.press("slash", *"topic2")
        log = it.pane("log").row_view
        await it.until(lambda: log.count == 11)  # topic2, topic20 to topic29
        it.client.task("raiseEventTopic", "/topic200", "SUCCEEDED")
        it.client.task("raiseEventTopic", "/other", "SUCCEEDED")
        await it.until(lambda: log.count == 12)
        await it.press("enter")
        assert log.has_focus and log.count == 12
        await it.press("escape")
        await it.until(lambda: log.count == 32)


async def test_the_filter_of_a_list() -> None:
    async with console() as it:
        await it.press("slash", "f", "i", "l")
        await it.until(lambda: it.text("acts").strip().startswith(".") and "Greet" not in it.text("acts"))
        await it.press("escape")
        await it.until(lambda: "Greet" in it.text("acts"))
        assert it.client.sent == []


async def test_one_hundred_thousand_tasks() -> None:
    async with console() as it:
        store = it.screen.session.store
        for _ in range(100_000):
            it.client._tasks += 1
        from rise_engine.kernel.task_view import TaskView

        for number in range(1, 100_001):
            store.view.tasks[number] = TaskView(number, "raiseEventTopic", "/x", "", "file", "SUCCEEDED", "", 1.0)
        store.log.rebuild(store.view)
        log = it.pane("log").row_view
        it.client.task("raiseEventTopic", "/last", "SUCCEEDED")
        await it.until(lambda: log.count == 100_001)
        it.screen.pane_layout.focus_pane("log")
        await it.press("home", "end")
        assert log.scroll_offset.y == 100_001 - log.size.height


# --- memory ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("typed", "kind", "value"),
    [
        ("3", "integer", 3),
        ("2.5", "number", 2.5),
        ("true", "boolean", True),
        ("null", "null", None),
        ("fork", "string", "fork"),
        ('"5"', "string", "5"),
        ("[1]", "array", [1]),
        ('{"a": 1}', "object", {"a": 1}),
    ],
)
async def test_a_value_is_edited_in_its_place_and_its_type_shows_while_typing(
    typed: str, kind: str, value: object
) -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("memory")
        await it.press("home", "enter")
        pane = it.pane("memory")
        assert isinstance(pane, MemoryPane)
        await it.until(lambda: isinstance(it.app.focused, Input))
        assert isinstance(it.app.focused, Input)
        assert it.app.focused.value == "2" and it.app.focused.region.y == pane.row_list.region.y
        it.app.focused.value = typed
        await it.until(lambda: pane.editor.type_line.text == kind)
        await it.press("enter")
        await it.sent("assignValue", json.dumps({"task": value}))
        assert pane.row_list.has_focus


async def test_broken_json_is_a_string_and_says_so() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("memory")
        await it.press("home", "enter")
        assert isinstance(it.app.focused, Input)
        it.app.focused.value = '{"a": '
        pane = it.pane("memory")
        assert isinstance(pane, MemoryPane)
        await it.until(lambda: "string  not JSON" in pane.editor.type_line.text)


async def test_a_change_by_somebody_else_shows_while_editing() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("memory")
        await it.press("home", "enter")
        it.client.emit(MemoryRecord(0, 0.0, "", "task", 3, 2, "rule:Main"))
        pane = it.pane("memory")
        assert isinstance(pane, MemoryPane)
        await it.until(lambda: "is now 3 by rule:Main" in pane.editor.conflict_line.text)


async def test_esc_leaves_the_editor_and_sends_nothing() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("memory")
        await it.press("home", "enter", "9", "escape")
        await it.until(lambda: it.pane("memory").row_view.has_focus)
        assert it.client.sent == []


async def test_a_deleted_key_can_be_brought_back() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("memory")
        await it.press("home", "down", "delete")
        await it.sent("deleteValue", "side")
        it.client.emit(MemoryRecord(0, 0.0, "", "side", None, "left", "wizard:anna", deleted=True))
        await it.until(lambda: "side" not in it.text("memory"))
        await it.press("insert", "enter")
        await it.sent("assignValue", '{"side": "left"}')


async def test_a_key_is_added_without_the_insert_key() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("memory")
        await it.press("end", "enter")
        await it.until(lambda: isinstance(it.app.focused, Input))
        await it.press(*"cups", "enter", "4", "enter")
        await it.sent("assignValue", '{"cups": 4}')


# --- stop -----------------------------------------------------------------------------------------------------------


async def test_stop_shows_who_confirmed_and_stays_until_released_on_purpose() -> None:
    client = FakeClient(demo())
    client.answers = False
    async with console(client=client) as it:
        alarm = it.bars.alarm_bar
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
        assert "STOPPED" in alarm.text
        await it.press("ctrl+r")
        await it.until(lambda: isinstance(it.app.screen, Dialog))
        await it.press("escape")
        assert ("releaseStop", "") not in client.asked()
        await it.press("ctrl+r", "r")
        await it.sent("releaseStop", "")
        client.stop("released")
        await it.until(lambda: "STOPPED" not in it.bars.status_line.text and "LIVE" in it.bars.status_line.text)


async def test_release_is_there_only_while_stopped_and_says_why_not() -> None:
    async with console() as it:
        await it.press("ctrl+r")
        assert it.app.screen is it.screen
        assert "nothing is stopped" in it.notice


# --- the engine's end ----------------------------------------------------------------------------------------------


async def test_an_engine_that_has_ended_is_told_and_keys_do_nothing() -> None:
    async with console() as it:
        it.client.end("the engine stopped: a bug")
        await it.until(lambda: "ENGINE GONE" in it.bars.alarm_bar.text)
        assert "a bug" in it.bars.alarm_bar.text
        await it.press("g", "enter", "f9")
        assert it.client.sent == []
        assert "the engine has gone" in it.notice


async def test_without_an_engine_hints_name_what_is_left_to_do() -> None:
    async with console() as it:
        it.screen.pane_layout.focus_pane("memory")
        await it.until(lambda: "del delete" in it.bars.key_hints.text)
        it.client.end("its process is not there any more")
        await it.until(lambda: it.bars.key_hints.text.startswith(" ^C leave"))
        hints = it.bars.key_hints.text
        assert "unfold" in hints and "find" in hints
        assert not any(word in hints for word in ("STOP", "edit", "add", "delete", "undo", "say", "cue"))


async def test_a_send_that_fails_does_not_end_the_console() -> None:
    async with console() as it:
        it.client.gone = "the process was killed"
        await it.press("g")
        await it.until(lambda: "the process was killed" in it.bars.alarm_bar.text)


async def test_a_lost_robot_is_told() -> None:
    async with console() as it:
        it.client.emit(RobotRecord(0, 0.0, "", status="lost", detail="no answer for 3 s"))
        await it.until(lambda: "✗ lost" in it.bars.status_line.text and "no answer for 3 s" in it.notice)


# --- layout, help, palette, settings --------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "shown"),
    [
        ((79, 24), {"acts", "rules", "rule"}),
        ((80, 24), {"acts", "rules", "rule", "log"}),
        ((120, 40), {"acts", "rules", "rule", "log"}),
        ((200, 50), {"acts", "rules", "rule", "act", "memory", "log", "scheduler"}),
    ],
)
async def test_as_many_panes_as_there_is_room_for(size: tuple[int, int], shown: set[str]) -> None:
    async with console(size=size) as it:
        assert {pane.SCOPE for pane in it.screen.pane_layout.visible_panes()} == shown


async def test_every_pane_is_reached_by_f3_and_its_twin() -> None:
    async with console(size=(80, 24)) as it:
        seen = []
        for key in ("f3", "tab", "f3", "tab", "f3", "f3"):
            await it.press(key)
            pane = it.screen.pane_layout.focused_pane()
            assert pane is not None and pane.row_view.has_focus
            seen.append(pane.SCOPE)
        assert seen == ["rule", "act", "memory", "log", "scheduler", "rule"]
        await it.press("f2")
        assert it.pane("acts").row_view.has_focus
        await it.press("ctrl+l")
        assert it.pane("rules").row_view.has_focus


async def test_zoom_and_back_by_esc() -> None:
    async with console() as it:
        await it.press("f3", "f4")
        assert [pane.SCOPE for pane in it.screen.pane_layout.visible_panes()] == ["rule"]
        await it.press("escape")
        assert len(list(it.screen.pane_layout.visible_panes())) == 4


async def test_resizing_the_terminal_changes_the_layout() -> None:
    async with console(size=(200, 50)) as it:
        await it.pilot.resize_terminal(80, 24)
        await it.until(lambda: it.screen.pane_layout.has_class("-two"))
        await it.until(lambda: it.pane("acts").row_view.region.width < 40)
        await it.pilot.resize_terminal(75, 24)
        await it.until(lambda: not it.screen.pane_layout.has_class("-two"))


async def test_hints_and_tabs_can_be_clicked() -> None:
    async with console() as it:
        hints = it.bars.key_hints
        await it.pilot.click(hints, offset=(hints.text.index("? help") + 1, 0))
        await it.until(lambda: isinstance(it.app.screen, HelpScreen))
        await it.press("escape")
        title = it.pane("rule").title
        await it.pilot.click(title, offset=(title.text.index("memory") + 1, 0))
        await it.until(lambda: it.pane("memory").row_view.has_focus)


async def test_help_shows_scenario_keys_and_actions_and_searches() -> None:
    async with console() as it:
        await it.press("question_mark")
        help_screen = it.app.screen
        assert isinstance(help_screen, HelpScreen)
        await it.until(lambda: "act Greet" in help_screen.list.text and "Stop everything" in help_screen.list.text)
        await it.press(*"zoom")
        await it.until(lambda: "Zoom" in help_screen.list.text and "Stop everything" not in help_screen.list.text)
        await it.press("escape")
        assert it.app.screen is it.screen


@pytest.mark.slow
async def test_the_palette_finds_acts_and_says_why_not() -> None:
    async with console() as it:
        await it.press("colon")
        await it.until(lambda: it.app.screen is not it.screen)
        await it.press(*"act praise")
        await it.pilot.pause(0.5)
        await it.press("enter")
        await it.sent("startCommunicationRobotAct", "Praise")
        it.client.stop("latched")
        await it.until(lambda: it.screen.session.store.key_state == "STOPPED")
        await it.press("colon", *"act filler")
        await it.pilot.pause(0.5)
        await it.press("enter")
        await it.until(lambda: "not now" in it.notice and "STOPPED" in it.notice)


@pytest.mark.slow
async def test_settings_apply_after_asking_and_end_the_running_session_first() -> None:
    first, second = FakeClient(demo()), FakeClient(demo(), mode="real")
    launcher = FakeLauncher(first, second)
    async with console(client=first, launcher=launcher) as it:
        it.screen.action_do("settings")
        await it.until(lambda: isinstance(it.app.screen, SettingsScreen))
        screen = it.app.screen
        assert isinstance(screen, SettingsScreen)
        await it.pilot.pause()
        screen.query_one("#mode").query(Button).last().press()
        await it.pilot.pause()
        screen.query_one("#participant", TextField).value = "P08"
        screen.query_one("#apply", Button).press()
        await it.until(lambda: isinstance(it.app.screen, EndSessionDialog) and it.app.screen.query("#word"))
        assert first.closed == []
        await it.press("e", "n", "d", "enter")
        await it.until(lambda: first.closed == [True])
        await it.until(lambda: "REAL" in it.bars.status_line.text)
        assert launcher.started[1].mode == "real" and launcher.started[1].participant == "P08"


async def test_settings_show_the_findings_of_a_refused_scenario_and_change_nothing() -> None:
    client = FakeClient(demo())
    refused = ScenarioProblems(
        [Diagnostic("error", "unknown-act", "there is no act `Hi`", SourceLocation("rules/main.xml", 3, 4))]
    )
    async with console(client=client, launcher=FakeLauncher(client, prepared=refused)) as it:
        it.screen.action_do("settings")
        await it.until(lambda: isinstance(it.app.screen, SettingsScreen))
        screen = it.app.screen
        assert isinstance(screen, SettingsScreen)
        await it.pilot.pause()
        screen.query_one("#folder", TextField).value = "/elsewhere"
        screen.query_one("#apply", Button).press()
        await it.until(lambda: "rules/main.xml:3:4" in str(screen.findings.content))
        await it.press("escape")
        assert it.app.screen is it.screen and client.closed == []


@pytest.mark.slow
@pytest.mark.parametrize("width", [72, 80, 100, 200])
async def test_help_is_always_among_the_hints(width: int) -> None:
    async with console(size=(width, 30)) as it:
        for name in it.screen.pane_layout.panes:
            it.screen.pane_layout.focus_pane(name)
            await it.until(lambda: it.bars.key_hints.text.count("? help") == 1, name)
            assert it.bars.key_hints.text.startswith(" F9/^G STOP")
