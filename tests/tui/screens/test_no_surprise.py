"""What the wizard is told: a robot that is none, an event that nobody took, a row that was another a moment ago."""

from __future__ import annotations

import json

import pytest
from msgspec.structs import replace
from textual.widgets import Input

from rise_engine.author.drawing.rule_text import engine_raises_text
from rise_engine.kernel.records import CueRecord, EventRecord, MemoryRecord
from rise_engine.scenario.model import Rule, Scenario, State, Transition
from rise_tui.panes.memory import MemoryPane
from rise_tui.rendering.text import fit_end, format_value, heading_line, plain_text
from rise_tui.widgets.lines import RowList
from tests.tui.conftest import console
from tests.tui.fake import FakeClient, demo

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


async def test_an_event_or_a_cue_that_nobody_waited_for_is_told_and_stands_in_the_log() -> None:
    waits = Rule("Listen", "a", {"a": State("a", transitions=(Transition(event="cue", target="a"),))})
    scenario = demo()
    scenario = replace(scenario, rules={**scenario.rules, "Listen": waits}, topics=scenario.topics | {"cue"})
    async with console(client=FakeClient(scenario), size=(200, 50)) as it:
        log = it.pane("log").row_view

        def last() -> str:
            return plain_text(log.row_at(log.count - 1).line) if log.count else ""

        it.client.emit(event("engine"))
        await it.pilot.pause(0.2)
        assert "no rule" not in it.notice, "the engine's own"
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
        await it.press("space")
        await it.until(lambda: log.count == 3)
        it.client.emit(CueRecord(0, 0.0, "", "marked", "wizard:anna"))
        it.client.emit(event("engine", topic="/cue"))
        await it.until(lambda: "/cue: no rule waits for it" in it.notice)
        assert "not taken" in last()
        for seconds, is_told in ((30, False), (0, True)):  # whose key was pressed long ago, and just now
            it.screen.session.store.notice = None
            it.client.task("startInteractionRule", "Again")
            it.client.rule("Again", "started", "raise", trigger="start")
            it.client.time += seconds
            it.client.emit(event("rule:Again", topic="/repeat"))
            await it.pilot.pause(0.2)
            assert ("/repeat: no rule waits for it" in it.notice) is is_told
        await it.pilot.pause(0.6)
        await it.press("u")
        await it.until(lambda: "understood = true" in it.notice, "a key that sets a value says what it did")


async def test_delete_does_not_hit_a_row_that_came_under_the_cursor_just_now() -> None:
    async with console() as it:
        ids = [it.client.act("Greet"), *(it.client.act(name, "PENDING") for name in ("Praise", "Filler", "Goodbye"))]
        await it.focus("scheduler")
        rows = it.pane("scheduler").row_view
        await it.until(lambda: rows.current_id == str(ids[0]))
        it.client.end_task(ids[0], "Greet")
        await it.until(lambda: rows.current_id == str(ids[1]))
        await it.press("delete")
        await it.until(lambda: "the list has just changed; press again" in it.notice)
        assert it.client.asked() == []
        assert isinstance(rows, RowList)
        await it.until(lambda: not rows.was_just_displaced)
        await it.press("delete")
        await it.sent("cancelTask", str(ids[1]))
        it.client.end_task(ids[1], "Praise", "CANCELED")
        await it.until(lambda: rows.current_id == str(ids[2]))
        await it.press("down", "delete")  # a cursor that the wizard has moved is where the wizard thinks
        await it.sent("cancelTask", str(ids[3]))


def test_the_engine_raises_its_own_events() -> None:
    scenario = demo()
    assert engine_raises_text(scenario, "Greet_failed") == "Greet raises this event itself when it fails"
    assert engine_raises_text(scenario, "Main_end") == "Main raises this event itself when it ends"
    assert engine_raises_text(scenario, "Main_failed") == engine_raises_text(scenario, "next") == ""


def test_control_characters_are_shown_escaped_and_read_back() -> None:
    for value in ("two\nlines", "bell\x07", "\x9b31m", "hidden\u202e", "\ud800", ["a\x7f"]):
        text = format_value(value)
        assert text.isprintable() and json.loads(text) == value


async def test_a_string_of_two_lines_is_edited_as_json_and_the_remark_about_json_is_never_cut() -> None:
    async with console(size=(80, 24)) as it:
        it.client.emit(MemoryRecord(0, 0.0, "", "note", "one\ntwo", None, "rule:Main", created=True))
        await it.focus("memory")
        pane = it.pane("memory")
        assert isinstance(pane, MemoryPane)
        await it.until(lambda: it.row("memory", "note"))
        pane.row_list.select("note")
        await it.press("enter")
        assert isinstance(it.screen.focused, Input) and it.screen.focused.value == '"one\\ntwo"'
        await it.press("enter")
        await it.sent("assignValue", json.dumps({"note": "one\ntwo"}))
        for size in ((80, 24), (120, 40)):
            await it.pilot.resize_terminal(*size)
            await it.press("home", "enter", "left_curly_bracket")
            await it.until(lambda: "not JSON" in pane.editor.type_line.text)
            assert len(pane.editor.type_line.text) <= pane.editor.type_line.size.width
            await it.press("escape")


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
