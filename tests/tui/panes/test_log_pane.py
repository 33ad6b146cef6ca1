from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import pytest
from textual.widgets import Input

from rise_engine.kernel.records import MistakeRecord, TimingRecord
from rise_engine.kernel.task_view import TaskView
from rise_tui.model.log_rows import row_of
from rise_tui.panes.log import LogPane
from rise_tui.panes.log_export import (
    CLIPBOARD_BYTES,
    COLUMNS,
    ExportFailed,
    clipboard_remark,
    clipboard_text,
    export_folder,
    json_lines,
    save_tasks,
    table_lines,
)
from rise_tui.rendering.text import StyledLine, highlight_matches, plain_text
from rise_tui.screens.reading import DetailScreen
from rise_tui.widgets.task_log import TaskLog
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo


def log_of(it: Console) -> tuple[LogPane, TaskLog]:
    pane = it.pane("log")
    assert isinstance(pane, LogPane)
    return pane, pane.task_log


def events(it: Console, count: int, start: int = 0) -> None:
    for number in range(start, start + count):
        it.client.time = 100.0 + number
        it.client.task("raiseEventTopic", f"/topic{number}", "SUCCEEDED")


def many(it: Console, count: int) -> None:
    store = it.screen.session.store
    it.client._tasks = count
    for id in range(1, count + 1):
        name = "/rare" if id % 1000 == 0 else "/often"
        store.view.tasks[id] = TaskView(id, "raiseEventTopic", name, "", "file", "SUCCEEDED", "", id * 0.1)
    store.log.rebuild(store.view)


def fully_shown(pane: LogPane) -> bool:
    return pane._search is None or pane._search.is_complete


@pytest.mark.slow
async def test_a_broken_expression_is_said_and_the_last_good_filter_stays() -> None:
    async with console(size=(120, 40)) as it:
        events(it, 20)
        pane, log = log_of(it)
        await it.focus("log")
        await it.press("slash", *"/topic1")
        await it.until(lambda: log.count == 11)
        await it.press("(")
        await it.until(lambda: "at 8: the ( is not closed" in pane.title.text)
        assert log.count == 11 and "11 of 20" in pane.title.text
        await it.press("enter")
        await it.until(lambda: "not a valid filter yet" in it.notice)
        assert isinstance(it.app.focused, Input)
        await it.press("backspace")
        await it.until(lambda: "at 8" not in pane.title.text)
        await it.press("enter")
        assert log.has_focus and pane.filter_text == "/topic1"
        it.client.cut()
        await it.until(lambda: it.client.attached == 2)
        events(it, 1, 111)
        await it.until(lambda: log.count == 12, "attaching again searches the new log")
        pane.set_filter("topic111")
        await it.until(lambda: log.count == 1)
        assert [text for text, role in log.row_at(0).line if role == "match"] == ["topic111"]
        style = log.styles_on("")["match"]
        assert style.bold and style.underline, "what was found is marked not only by colour"
        pane.set_filter("failed")
        await it.until(lambda: log.count == 0)
        task = it.client.act("Greet")
        await it.until(lambda: row_of(task) in it.screen.session.store.log.all)
        assert log.count == 0
        it.client.end_task(task, "Greet", "ABORTED", "the robot fell silent")
        await it.until(lambda: log.count == 1, "a task that ends otherwise is found then")
        task = it.client.act("Greet", "SUCCEEDED")
        pane.set_filter("late")
        assert log.count == 0
        for size in ((200, 50), (120, 40), (80, 24)):
            it.client.emit(MistakeRecord(0, 0.0, "", task, "Greet", "none", "wizard:anna"))
            await it.until(lambda: log.count == 0)
            await it.pilot.resize_terminal(*size)
            it.client.emit(MistakeRecord(0, 0.0, "", task, "Greet", "late", "wizard:anna"))
            await it.until(lambda: log.count == 1 and "! late" in plain_text(log._lines.get(0, ())), str(size))
            assert "Greet" in plain_text(log.row_at(0).line) and "✓" in plain_text(log.row_at(0).line)
        pane.set_filter("! late")
        assert log.count == 1


@pytest.mark.slow
async def test_a_hundred_thousand_rows_are_shown_and_searched_in_slices_and_a_keystroke_restarts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with console() as it:
        pane, log = log_of(it)
        many(it, 100_000)
        await it.focus("log")
        await it.until(lambda: log.count == 100_000)
        await it.press("home", "end")
        assert log.scroll_offset.y == 100_000 - log.size.height
        pane.set_filter("rare")
        assert pane._search is not None and not pane._search.is_complete
        assert log.count >= 1 and "…" in pane.title.text  # the newest are there at once
        first = pane._search
        pane.set_filter("often")
        assert pane._search is not first
        await it.until(lambda: fully_shown(pane))
        assert log.count == 99_900 and log.following
        pane.set_filter("rare")
        await it.until(lambda: fully_shown(pane) and log.count == 100)
        assert "100 of 100000" in pane.title.text and "…" not in pane.title.text
        assert log.current_id == str(row_of(100_000))
        with monkeypatch.context() as still:
            still.setattr(pane._slicer, "wake", lambda: None)  # its first slice is all there is for now
            pane.set_filter("often")
            await it.press("pageup")
            assert log.count < 99_900
        pane.repaint()
        seen = log.row_at(log.scroll_offset.y).id, log.current_id
        await it.until(lambda: fully_shown(pane) and log.count == 99_900)
        assert (log.row_at(log.scroll_offset.y).id, log.current_id) == seen and not log.following
        it.client.task("raiseEventTopic", "/often", "SUCCEEDED")
        await it.until(lambda: log.count == 99_901)
        for top in range(0, 20_000, 150):
            log.scroll_to(y=top, animate=False)
            for y in range(log.size.height):
                log.render_line(y)
        assert len(log._lines) <= log.size.height, "scrolling keeps no rows"
        assert len(list(log.query("*"))) == 0


# --- times -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_going_to_a_time_finds_the_nearest_row_and_now_follows_again() -> None:
    async with console() as it:
        events(it, 100)  # at 100 s to 199 s
        pane, log = log_of(it)
        await it.focus("log")
        await it.until(lambda: log.count == 100)

        async def ask() -> None:
            it.screen.action_do("log.time")
            await it.until(lambda: isinstance(it.app.focused, Input))

        for typed, found in (
            ("2:00", "/topic20"),
            ("1:59.6", "/topic20"),
            ("-9s", "/topic90"),
            ("0", "/topic0"),
            ("9h", "/topic99"),
        ):
            await ask()
            await it.press(*typed, "enter")
            await it.until(lambda: log.has_focus)
            task = pane.selected_task
            assert task is not None and task.behavior == found
            assert log.following is (found == "/topic99")
        await it.press("home")
        await it.until(lambda: not log.following)
        await ask()
        await it.press(*"soon", "enter")
        await it.until(lambda: "14:32" in it.notice)
        assert isinstance(it.app.focused, Input)
        await it.press(*["backspace"] * 4, *"now", "enter")
        await it.until(lambda: log.following)
        assert log.current_id == str(row_of(100))


# --- details ---------------------------------------------------------------------------------------------------------


async def test_details_tell_everything_and_go_on_to_the_neighbours() -> None:
    async with console(size=(120, 40)) as it:
        events(it, 1)
        it.client.time = 110.0
        task = it.client.act("Greet")
        it.client.action(task, "Greet", "hello", "Speech", "succeeded", message="Dear reader, welcome to this study")
        it.client.end_task(task, "Greet", "ABORTED", "the gesture failed")
        it.client.emit(TimingRecord(0, 0.0, "", task, "Greet", "ABORTED", 108.0, 109.5, 110.0, 110.0, 110.4, 110.0))
        it.client.emit(MistakeRecord(0, 0.0, "", task, "Greet", "late", "wizard:anna"))
        await it.focus("log")
        _, log = log_of(it)
        await it.until(lambda: log.count == 2)
        await it.press("enter")
        screen = it.app.screen
        assert isinstance(screen, DetailScreen)
        await it.until(lambda: "Dear reader, welcome to this study" in screen.list.text)
        text = screen.list.text
        for part in ("Greet", "✗ failed", "the gesture failed", "! late", "wizard:anna", "Blocking", "hello", "Speech"):
            assert part in text
        times = [line.split() for line in text.splitlines() if "00:01:" in line]
        assert times[0][:2] == ["cue", "00:01:48.0"] and times[1][:4] == ["key", "00:01:49.5", "+1.5", "s"]
        assert any(line[:2] == ["robot", "00:01:50.4"] for line in times)
        await it.press("left")
        await it.until(lambda: "/topic0" in screen.list.text)
        await it.press("f9")
        await it.sent("stopAll", "")
        await it.press("escape")
        assert it.app.screen is it.screen and it.client.asked() == [("stopAll", "")]


# --- copy ------------------------------------------------------------------------------------------------------------


class Terminal:
    """What would reach the terminal's clipboard."""

    def __init__(self, it: Console, monkeypatch: pytest.MonkeyPatch) -> None:
        self.copied = ""
        monkeypatch.setattr(type(it.app), "copy_to_clipboard", lambda _, text: setattr(self, "copied", text))


async def test_a_letter_copies_the_row_and_the_notice_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMUX", "/tmp/x,1,0")
    async with console(size=(120, 40)) as it:
        terminal = Terminal(it, monkeypatch)
        events(it, 3)
        await it.focus("log")
        pane, log = log_of(it)
        await it.until(lambda: log.count == 3)
        await it.press("enter", "c")
        await it.until(lambda: "copied the row" in it.notice)
        assert terminal.copied.split("\t")[:2] == ["3", "102.0"] and "/topic2" in terminal.copied
        assert "set-clipboard on" in it.notice
        pane.set_filter("topic0")
        it.screen.action_do("log.copy-all")
        await it.until(lambda: "copied 1 row;" in it.notice)
        assert terminal.copied.splitlines()[0] == "\t".join(COLUMNS) and len(terminal.copied.splitlines()) == 2
        terminal.copied = ""
        await it.press("escape")
        pane.set_filter("")
        many(it, 5000)
        pane.repaint()
        it.screen.action_do("log.copy-all")
        await it.until(lambda: "not copied, 5000 rows: more than 75 kB" in it.notice and "filter" in it.notice)
        assert terminal.copied == ""


def test_the_guard_counts_bytes_and_stops_early() -> None:
    lines = ["é" * 100] * 1000
    with pytest.raises(ExportFailed):
        clipboard_text(lines)
    made = []

    def endless() -> Any:
        while True:
            made.append(1)
            yield "x" * 1000

    with pytest.raises(ExportFailed):
        clipboard_text(endless())
    assert len(made) == CLIPBOARD_BYTES // 1001 + 1
    assert len(base64.b64encode(clipboard_text(["x" * 70_000]).encode())) < 100_000


def test_what_keeps_a_copy_from_arriving() -> None:
    assert clipboard_remark({"TERM": "xterm-256color"}) == ""
    assert "set-clipboard on" in clipboard_remark({"TERM": "tmux-256color"})
    assert "save to a file" in clipboard_remark({"STY": "1.pts", "TERM": "screen"})


# --- save ------------------------------------------------------------------------------------------------------------

TASKS = [
    TaskView(1, "assignValue", 'note = "a\tb\nc\\"', "", "wizard:anna", "SUCCEEDED", "", 1.23456, 1.3, 2.0),
    TaskView(2, "say", "Grüße", "Blocking", "wizard:anna", "PENDING", "", 2.0, mark="late"),
]


def test_a_table_keeps_every_value_in_its_cell() -> None:
    head, first, second = table_lines(TASKS)
    assert head.split("\t") == list(COLUMNS)
    assert len(first.split("\t")) == len(second.split("\t")) == len(COLUMNS)
    cells = dict(zip(COLUMNS, first.split("\t"), strict=True))
    assert cells["submitted"] == "1.235" and cells["took"] == "0.7" and cells["behavior"] == 'note = "a\\tb\\nc\\\\"'
    assert dict(zip(COLUMNS, second.split("\t"), strict=True))["ended"] == "n/a"


def test_files_by_their_ending_never_over_another(tmp_path: Path) -> None:
    path = save_tasks(str(tmp_path / "log.tsv"), TASKS, Path())
    assert path.is_absolute() and len(path.read_text("utf-8").splitlines()) == 3
    lines = [json.loads(line) for line in save_tasks("log.jsonl", TASKS, tmp_path).read_text("utf-8").splitlines()]
    assert lines[1]["behavior"] == "Grüße" and lines[1]["mistake"] == "late" and lines[1]["ended"] is None
    assert lines == [json.loads(line) for line in json_lines(TASKS)]
    assert path.stat().st_mode & 0o777 == 0o600, "who takes part is nobody else's business"
    before = path.read_text("utf-8")
    with pytest.raises(ExportFailed, match="exists already"):
        save_tasks(str(path), [], Path())
    assert path.read_text("utf-8") == before
    for name, said in (("log.doc", "end the name"), ("", "end the name"), ("no/where.tsv", "No such file")):
        with pytest.raises(ExportFailed, match=said):
            save_tasks(str(tmp_path / name) if name else "", TASKS, tmp_path)


def test_a_full_disk_leaves_no_half_file(tmp_path: Path) -> None:
    def failing() -> Any:
        yield TASKS[0]
        raise OSError(28, "No space left on device")

    with pytest.raises(ExportFailed, match="No space left"):
        save_tasks(str(tmp_path / "log.tsv"), failing(), Path())
    assert list(tmp_path.iterdir()) == []


def names_in(folder: Path) -> list[str]:
    return [each.name for each in folder.iterdir()]


def test_without_a_folder_of_the_session_it_is_the_current_one(tmp_path: Path) -> None:
    assert export_folder(str(tmp_path)) == tmp_path
    assert export_folder("") == export_folder(str(tmp_path / "gone")) == Path()


async def test_the_rows_shown_are_saved_to_the_folder_of_the_session(tmp_path: Path) -> None:
    (tmp_path / "mine.tsv").write_text("kept")
    async with console(size=(120, 40), client=FakeClient(demo(), folder=str(tmp_path))) as it:
        events(it, 20)
        await it.focus("log")
        pane, log = log_of(it)
        pane.set_filter("topic1")
        await it.until(lambda: log.count == 11)
        await it.press("enter", "s")
        await it.until(lambda: pane.save_bar.is_open)
        assert pane.save_bar.text.startswith("rise-log_") and pane.save_bar.text.endswith(".tsv")
        pane.save_bar.field.value = "mine.tsv"
        await it.press("enter")
        await it.until(lambda: "exists already" in it.notice)
        assert pane.save_bar.is_open and (tmp_path / "mine.tsv").read_text() == "kept"
        pane.save_bar.field.value = "other.jsonl"
        await it.press("enter")
        await it.until(lambda: log.has_focus)
        await it.until(lambda: f"saved 11 rows to {tmp_path}/other.jsonl" in it.notice.replace("\n   ", ""))
        assert len((tmp_path / "other.jsonl").read_text("utf-8").splitlines()) == 11
        assert it.client.sent == []


def test_marking_a_line() -> None:
    line: StyledLine = (("abc", "muted"), ("def", "plain"))
    assert highlight_matches(line, [(1, 4)]) == (("a", "muted"), ("bc", "match"), ("d", "match"), ("ef", "plain"))
    assert highlight_matches(line, []) == line
    assert highlight_matches(line, [(0, 1), (5, 6), (9, 12)]) == (
        ("a", "match"),
        ("bc", "muted"),
        ("de", "plain"),
        ("f", "match"),
    )


@pytest.mark.slow
async def test_older_tasks_that_are_in_the_record_only_are_told_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What can be searched, copied or saved from here is not silently incomplete (console.md 3.3)."""
    monkeypatch.setattr("rise_engine.kernel.view.MAX_ENDED_TASKS", 40)
    monkeypatch.setattr("rise_engine.kernel.view.FORGET_AT_ONCE", 10)
    monkeypatch.chdir(tmp_path)
    async with console(size=(200, 50)) as it:
        await it.focus("log")
        pane, log = log_of(it)
        store = it.screen.session.store
        events(it, 50)
        await it.until(lambda: log.count == 50)
        assert pane.title.text.strip().endswith("following")
        await it.press("up")
        selected = log.current_id
        events(it, 3, start=50)
        await it.until(lambda: log.count == 42)
        assert store.log.all == [row_of(id) for id in store.view.tasks] and store.view.forgotten == 11
        assert log.current_id == selected, "the cursor stays on its task"
        assert pane.title.text.strip().endswith("11 older tasks are only in the record")
        pane.set_filter("topic")
        await it.until(lambda: fully_shown(pane) and "42 of 42" in pane.title.text)
        assert pane.title.text.strip().endswith("11 older tasks are only in the record")
        events(it, 10, start=53)
        await it.until(lambda: fully_shown(pane) and "41 of 41" in pane.title.text)
        pane.carry_out("log.save")
        await it.press("enter")
        await it.until(lambda: "saved 41 rows" in it.notice)
        assert "; 22 older tasks are only in the record: rise-engine export " in " ".join(it.notice.split())
