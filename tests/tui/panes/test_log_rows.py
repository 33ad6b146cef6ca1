"""The log shows what people and the robot did; notes are rows; the rules' own is there on request."""

from __future__ import annotations

import pytest

from rise_engine.kernel.records import (
    CheckRecord,
    EventRecord,
    NoteRecord,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    SyncRecord,
)
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import MAX_REMARKS, SessionView
from rise_tui.config.preferences import Preferences
from rise_tui.console.layout import UiState
from rise_tui.model.log_rows import LogRows, row_of, task_of
from rise_tui.panes.log import LogPane
from rise_tui.panes.log_export import rows_of
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo


def pane_of(it: Console) -> LogPane:
    pane = it.pane("log")
    assert isinstance(pane, LogPane)
    return pane


def texts(it: Console) -> list[str]:
    log = pane_of(it).task_log
    return [" ".join("".join(text for text, _ in log.row_at(at).line).split()) for at in range(log.count)]


@pytest.mark.parametrize(
    ("function", "source", "status", "own"),
    [
        ("raiseEventTopic", "rule:Main", "SUCCEEDED", True),
        ("assignValue", "rule:Main", "SUCCEEDED", True),
        ("startInteractionRule", "rule:Main", "ACTIVE", True),
        ("assignValue", "rule:Main", "REJECTED", False),
        ("startCommunicationRobotAct", "rule:Main", "ACTIVE", False),
        ("raiseEventTopic", "wizard:anna", "SUCCEEDED", False),
        ("raiseEventTopic", "ros:gaze", "SUCCEEDED", False),
        ("assignValue", "ros:speech", "SUCCEEDED", False),
        ("stopAll", "wizard:anna", "SUCCEEDED", False),
        ("markCue", "wizard:anna", "SUCCEEDED", False),
        ("markMistake", "wizard:anna", "SUCCEEDED", False),
    ],
)
def test_what_is_the_rules_own(function: str, source: str, status: str, own: bool) -> None:
    view = SessionView(tasks={1: TaskView(1, function, "x", "None", source, status, "", 1.0)})
    rows = LogRows()
    rows.rebuild(view)
    assert rows.all == [row_of(1)] and rows.own_count == int(own)


def test_rows_keep_their_order_whenever_they_are_taken_in() -> None:
    client = FakeClient(demo())
    client.emit(NoteRecord(0, 0.0, "", "before all", "wizard:anna"))
    client.task("raiseEventTopic", "/a", "SUCCEEDED")
    client.emit(NoteRecord(0, 0.0, "", "first", "wizard:anna"), NoteRecord(0, 0.0, "", "second", "wizard:ben"))
    client.task("raiseEventTopic", "/b", "SUCCEEDED")
    client.emit(RobotRecord(0, 0.0, "", "lost", "unplugged"))
    rows = LogRows()
    rows.rebuild(client._view)
    assert [task_of(row) for row in rows.all] == [None, 1, None, None, 2, None] and rows.all == sorted(rows.all)
    found = [rows.task_at(row, client._view) for row in rows.all]
    assert [each.behavior for each in found if each] == ["before all", "/a", "first", "second", "/b", "lost"]
    grown = LogRows()
    for id in client._view.tasks:
        for remark in client._view.remarks:
            if remark.after == id - 1:
                grown.add_remark(remark)
        grown.all.append(row_of(id))
        grown.main.append(row_of(id))
    for remark in client._view.remarks:
        if remark.after == 2:
            grown.add_remark(remark)
    assert grown.all == rows.all == grown.main


def test_more_notes_than_anybody_writes_are_bounded() -> None:
    view = SessionView()
    for number in range(MAX_REMARKS + 10):
        view.apply(NoteRecord(number, 1.0, "", "x" * 5000, "wizard:anna"))
    assert len(view.remarks) == MAX_REMARKS and all(len(remark.text) == 1000 for remark in view.remarks)


def test_the_log_goes_on_after_any_number_of_remarks_without_a_task() -> None:
    """A robot's link may come and go for hours. The log once stopped after 4,095 remarks, and said that it followed."""
    view, rows = SessionView(), LogRows()
    rows.rebuild(view)
    for number in range(10_000):
        view.apply(NoteRecord(number, float(number), "", f"note {number}", "wizard:anna"))
        rows.add_remark(view.remarks[-1])
    shown = [rows.task_at(row, view) for row in rows.all]
    assert [task.behavior for task in shown if task is not None] == [f"note {number}" for number in range(10_000)]
    assert rows.main == rows.all == sorted(set(rows.all))


@pytest.mark.slow
async def test_what_is_reported_about_the_session_is_in_the_log_without_any_key() -> None:
    async with console(size=(80, 24)) as it:
        lights = (0, 0.0, "", "lights", "The lamp is on")
        it.client.emit(CheckRecord(*lights, "failed", "", "it is dark", "wizard:ben"))
        await it.until(lambda: "check failed: The lamp is on: it is dark" in it.notice)
        it.client.emit(CheckRecord(*lights, "skipped", "", "daylight", "wizard:ben"))
        for status, size_now in (("running", 1), ("running", 2), ("stalled", 2)):
            it.client.emit(RecordingRecord(0, 0.0, "", "camera", status, "/a", size_now, "", "node:camera"))  # type: ignore[arg-type]
        await it.until(lambda: "recording stalled: camera" in it.notice)
        it.client.emit(SyncRecord(0, 0.0, "", 1, "sound", "", "node:camera"))
        it.client.emit(OutcomeRecord(0, 0.0, "", "aborted", "a fire drill", "wizard:anna"))
        await it.until(lambda: "the session counts as aborted: a fire drill" in it.notice)
        it.client.emit(NoteRecord(0, 0.0, "", "the child laughed", "wizard:ben"))
        it.client.emit(RobotRecord(0, 0.0, "", "lost", "unplugged"))
        it.client.emit(RuleRecord(0, 0.0, "", "Main", "faulted", None, reason="ran away"))  # type: ignore[arg-type]
        task = it.client.act("Greet")
        it.client.end_task(task, "Greet", "ABORTED", "no voice")
        for size in ((200, 50), (120, 40), (80, 24)):
            await it.pilot.resize_terminal(*size)
            await it.until(lambda: len(texts(it)) == 10, "that a recording goes on is no news")
            dark, daylight, runs, stalled, mark, outcome, note, robot, fault, failed = texts(it)
            assert "check" in dark and "✗ failed" in dark
            assert "- skipped" in daylight
            assert "camera ► running" in runs and "camera ✗ stalled" in stalled
            assert "sync" in mark and "mark 1" in mark
            assert "outcome" in outcome and "a fire drill ■ aborted" in outcome
            assert "note" in note and "ben" in note and note.endswith("the child laughed")
            assert "✗ lost" in robot and "unplugged" in robot
            assert "Main ✗ faulted" in fault
            assert "Greet ✗ failed" in failed and "no voice" in failed
            # Also beside the bar about the failed act.
            assert pane_of(it).display and pane_of(it).task_log.size.height >= 3


@pytest.mark.slow
async def test_what_rules_did_for_themselves_is_hidden_counted_and_shown_on_request() -> None:
    async with console(size=(80, 24)) as it:
        for number in range(3):
            it.client.task("raiseEventTopic", f"/begin_{number}", "SUCCEEDED", source="rule:Main")
        it.client.act("Greet", "SUCCEEDED", source="rule:Main")
        await it.until(lambda: len(texts(it)) == 1)
        assert "+3 by rules →" in pane_of(it).title.text
        await it.focus("log")
        await it.press("right")
        await it.until(lambda: len(texts(it)) == 4)
        assert "+3 by rules ←" in pane_of(it).title.text
        it.client.task("assignValue", "n = 1", "SUCCEEDED", source="rule:Main")
        await it.until(lambda: len(texts(it)) == 5)
        await it.press("left")
        await it.until(lambda: len(texts(it)) == 1)
        it.client.emit(NoteRecord(0, 0.0, "", "the begin of laughter", "wizard:ben"))
        pane = pane_of(it)
        pane.set_filter("begin")  # finds notes, and only in what is shown
        await it.until(lambda: len(texts(it)) == 1 and "laughter" in texts(it)[0])
        pane.show_own_rows(True)
        await it.until(lambda: len(texts(it)) == 4)
        assert list(rows_of(pane.store, pane.task_log.ids))[3].behavior == "the begin of laughter"
        keeper = UiState(Preferences(rules_own=True))
        pane.show_own_rows(False)
        panes = it.screen.pane_layout
        keeper.restore(panes, it.screen.store.attach_reply, "dark")
        assert pane.own_rows_shown and keeper.collect_changes(panes, "dark") == [], "whether it is shown lasts"
        pane.show_own_rows(False)
        ((_, found),) = keeper.collect_changes(panes, "dark")
        assert isinstance(found, Preferences) and not found.rules_own


async def test_a_key_that_came_too_early_is_seen_although_a_rule_raised_its_event() -> None:
    async with console(size=(120, 40)) as it:
        it.client.task("startInteractionRule", "Again")
        it.client.rule("Again", "started", "raise", trigger="start")
        it.client.task("raiseEventTopic", "/repeat", "SUCCEEDED", source="rule:Again")
        it.client.act("Praise")
        await it.until(lambda: len(texts(it)) == 2)
        it.client.emit(EventRecord(0, 0.0, "", "/repeat", "rule:Again", None))
        await it.until(lambda: len(texts(it)) == 3)
        assert "/repeat - not taken" in texts(it)[1]


async def test_a_row_names_the_task_that_it_is_about_and_the_value_that_it_sets() -> None:
    async with console(size=(120, 40)) as it:
        greeting = it.client.act("Greet", "SUCCEEDED")
        it.client.task("markMistake", f"{greeting} wrong", "SUCCEEDED")
        it.client.task("assignValue", '{"quiet": false, "side": "left"}', "SUCCEEDED")
        await it.until(lambda: len(texts(it)) == 3)
        assert "mistake Greet wrong" in texts(it)[1] and "set quiet = false, s…" in texts(it)[2]
        pane_of(it).set_filter("greet")
        await it.until(lambda: len(texts(it)) == 2)
