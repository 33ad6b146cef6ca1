"""What the wizard is told: a robot that is none, an event that nobody took, a row that was another a moment ago."""

from __future__ import annotations

import json

import pytest
from msgspec.structs import replace
from textual.widgets import Input

from rise_engine.drawing.rule_text import engine_raises_text
from rise_engine.kernel.records import CueRecord, EventRecord, MemoryRecord
from rise_engine.scenario.model import Rule, Scenario, State, Transition
from rise_tui.panes.memory import MemoryPane
from rise_tui.rendering.text import fit_end, format_value, heading_line, plain_text
from rise_tui.widgets.row_list import RowList
from tests.console.conftest import console
from tests.console.fake import FakeClient, demo

pytestmark = pytest.mark.slow  # many keys each


def with_driver(driver: str) -> Scenario:
    scenario = demo()
    return replace(scenario, robot=replace(scenario.robot, driver=driver))


async def test_a_real_session_on_a_simulated_robot_says_so_for_ever() -> None:
    async with console(client=FakeClient(with_driver("simulated"), mode="real"), size=(80, 24)) as it:
        await it.until(lambda: "REAL (simulated!)" in it.bars.status_line.text)
    async with console(client=FakeClient(with_driver("ros"), mode="real")) as it:
        await it.until(lambda: "REAL  pepper ●" in it.bars.status_line.text)
    async with console(client=FakeClient(with_driver("ros"))) as it:
        await it.until(lambda: "DEBUG  pepper (sim) ●" in it.bars.status_line.text)


def event(source: str, taken_by: str | None = None, topic: str = "/next") -> EventRecord:
    return EventRecord(0, 0.0, "", topic, source, taken_by)


async def test_an_event_that_nobody_waited_for_is_told_and_stands_in_the_log() -> None:
    async with console(size=(200, 50)) as it:
        log = it.pane("log").row_view

        def last() -> str:
            return plain_text(log.row_at(log.count - 1).line) if log.count else ""

        await it.press("n")
        await it.until(lambda: "raised next" in it.notice)
        it.client.emit(event("wizard:anna", "Main"))
        await it.pilot.pause(0.2)
        assert "done" in last() and "no rule" not in it.notice
        await it.pilot.pause(0.5)
        await it.press("n")
        await it.until(lambda: log.count == 2)
        it.client.emit(event("wizard:anna"))
        await it.until(lambda: "/next: no rule waits for it" in it.notice)
        assert "not taken" in last() and "done" in plain_text(log.row_at(0).line)


async def test_a_cue_that_nobody_waited_for_is_told_and_stands_in_the_log() -> None:
    waits = Rule("Listen", "a", {"a": State("a", transitions=(Transition(event="cue", target="a"),))})
    scenario = demo()
    scenario = replace(scenario, rules={**scenario.rules, "Listen": waits}, topics=scenario.topics | {"cue"})
    async with console(client=FakeClient(scenario), size=(200, 50)) as it:
        log = it.pane("log").row_view
        await it.press("space")
        await it.until(lambda: log.count == 1)
        it.client.emit(CueRecord(0, 0.0, "", "marked", "wizard:anna"))
        it.client.emit(event("engine", topic="/cue"))
        await it.until(lambda: "/cue: no rule waits for it" in it.notice)
        assert "not taken" in plain_text(log.row_at(0).line)


async def test_whose_lost_events_are_told() -> None:
    async with console() as it:
        it.client.emit(event("engine"))
        await it.pilot.pause(0.2)
        assert "no rule" not in it.notice
        it.client.task("startInteractionRule", "Again")
        it.client.rule("Again", "started", "raise", trigger="start")
        it.client.time += 30
        it.client.emit(event("rule:Again", topic="/repeat"))
        await it.pilot.pause(0.2)
        assert "no rule" not in it.notice
        it.client.task("startInteractionRule", "Again")
        it.client.rule("Again", "started", "raise", trigger="start")
        it.client.emit(event("rule:Again", topic="/repeat"))
        await it.until(lambda: "/repeat: no rule waits for it" in it.notice)


async def test_delete_does_not_hit_a_row_that_came_under_the_cursor_just_now() -> None:
    async with console() as it:
        first, second = it.client.act("Greet"), it.client.act("Praise", "PENDING")
        it.screen.pane_layout.focus_pane("scheduler")
        rows = it.pane("scheduler").row_view
        await it.until(lambda: rows.current_id == str(first))
        it.client.end_task(first, "Greet")
        await it.until(lambda: rows.current_id == str(second))
        for key in ("delete", "backspace"):
            await it.press(key)
        await it.until(lambda: "the list has just changed; press again" in it.notice)
        assert it.client.asked() == []
        assert isinstance(rows, RowList)
        await it.until(lambda: not rows.was_just_displaced)
        await it.press("delete")
        await it.sent("cancelTask", str(second))


async def test_a_cursor_that_the_wizard_has_moved_is_where_the_wizard_thinks() -> None:
    async with console() as it:
        ids = [it.client.act(name, "PENDING") for name in ("Greet", "Praise", "Filler")]
        it.screen.pane_layout.focus_pane("scheduler")
        rows = it.pane("scheduler").row_view
        await it.until(lambda: rows.current_id == str(ids[0]))
        it.client.end_task(ids[0], "Greet", "CANCELED")
        await it.until(lambda: rows.current_id == str(ids[1]))
        await it.press("down", "delete")
        await it.sent("cancelTask", str(ids[2]))


def test_the_engine_raises_its_own_events() -> None:
    scenario = demo()
    assert engine_raises_text(scenario, "Greet_failed") == "Greet raises this event itself when it fails"
    assert engine_raises_text(scenario, "Main_end") == "Main raises this event itself when it ends"
    assert engine_raises_text(scenario, "Main_failed") == engine_raises_text(scenario, "next") == ""


async def test_enter_does_not_forge_an_event_of_the_engine() -> None:
    async with console() as it:
        it.client.rule("Main", "started", "greeting", trigger="start")
        await it.until(lambda: "in greeting" in it.text("rule"))
        it.screen.pane_layout.focus_pane("rule")
        await it.press("enter")
        await it.until(lambda: "Greet raises this event itself when it ends" in it.notice)
        await it.pilot.pause(0.1)
        assert it.client.asked() == []


async def test_a_key_that_sets_a_value_says_what_it_did() -> None:
    async with console() as it:
        await it.press("u")
        await it.until(lambda: "understood = true" in it.notice)


def test_control_characters_are_shown_escaped_and_read_back() -> None:
    for value in ("two\nlines", "bell\x07", "\x9b31m", "hidden\u202e", "\ud800", ["a\x7f"]):
        text = format_value(value)
        assert text.isprintable() and json.loads(text) == value


async def test_a_string_of_two_lines_is_edited_as_json() -> None:
    async with console() as it:
        it.client.emit(MemoryRecord(0, 0.0, "", "note", "one\ntwo", None, "rule:Main", created=True))
        it.screen.pane_layout.focus_pane("memory")
        pane = it.pane("memory")
        assert isinstance(pane, MemoryPane)
        await it.until(lambda: it.row("memory", "note"))
        pane.row_list.select("note")
        await it.press("enter")
        assert isinstance(it.screen.focused, Input) and it.screen.focused.value == '"one\\ntwo"'
        await it.press("enter")
        await it.sent("assignValue", json.dumps({"note": "one\ntwo"}))


async def test_the_remark_about_json_is_never_cut() -> None:
    for size in ((80, 24), (120, 40)):
        async with console(size=size) as it:
            it.screen.pane_layout.focus_pane("memory")
            pane = it.pane("memory")
            assert isinstance(pane, MemoryPane)
            await it.press("home", "enter", "left_curly_bracket")
            await it.until(lambda pane=pane: "not JSON" in pane.editor.type_line.text)  # type: ignore[misc]
            assert len(pane.editor.type_line.text) <= pane.editor.type_line.size.width


async def test_the_end_of_a_state_stays_in_the_list_of_rules() -> None:
    states = {name: State(name, (), (), (Transition("e", target=name),)) for name in ("After task 1, step 3",)}
    scenario = replace(demo(), rules={"R": Rule("R", "After task 1, step 3", states)}, keys={})
    async with console(client=FakeClient(scenario), size=(80, 24)) as it:
        it.client.rule("R", "entered", "After task 1, step 3")
        await it.until(lambda: "► After task 1, step 3" in it.text("rules"))
    assert fit_end("After task 1, step 3", 10) == "…1, step 3"
    assert fit_end("short", 7) == "short  "


def test_a_long_name_leaves_its_state() -> None:
    line = plain_text(heading_line("A" * 60, ("► running", "accent"), (("12.3 of 14 s ", "plain"),), 40))
    assert len(line) == 40 and "► running" in line and "12.3 of 14 s" in line and "…" in line
