"""Whether everything records, in one word; and a mark that cameras see."""

from __future__ import annotations

import pytest

from rise_engine.kernel.records import RecordingRecord, RecordingStatus, SessionRecord, SyncRecord
from rise_tui.console.overlays import FLASH_SECONDS, Flash, flash_rows
from rise_tui.model.status import status_line
from rise_tui.model.store import LATE_FLASH_SECONDS, Store
from rise_tui.rendering.text import line_width, plain_text
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

WIDTHS = (60, 80, 100, 120, 200)


def recorder(name: str, status: RecordingStatus, reason: str = "") -> RecordingRecord:
    return RecordingRecord(0, 0.0, "", name, status, "/data/room.mkv", None, reason, "node:recorders")


def store_after(*records: RecordingRecord | SessionRecord) -> Store:
    client = FakeClient(demo())
    client.emit(*records)
    return Store(client.attach_reply(), "anna", client.now)


def text(store: Store, width: int = 120) -> str:
    line = status_line(store, width)
    assert line_width(line) == width
    return plain_text(line)


def test_nothing_is_said_where_nothing_records_from_outside() -> None:
    assert "● REC " in text(store_after()) and "ALL" not in text(store_after())


def test_one_word_says_that_everything_records() -> None:
    store = store_after(recorder("camera", "started"), recorder("bag", "running"))
    assert "● ALL REC" in text(store) and "camera" not in text(store)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(
    ("records", "word", "role"),
    [
        ([("camera", "running"), ("bag", "stalled")], "bag STALLED", "fault"),
        ([("camera", "failed"), ("bag", "stalled")], "camera FAILED", "fault"),
        ([("camera", "stalled"), ("bag", "stalled"), ("mic", "running")], "camera +1 STALLED", "fault"),
        ([("camera", "stopped"), ("bag", "running")], "camera stopped", "wait"),
    ],
)
def test_what_does_not_record_never_gives_way(
    width: int, records: list[tuple[str, RecordingStatus]], word: str, role: str
) -> None:
    store = store_after(*(recorder(*each) for each in records))
    shown = text(store, width)
    assert word.rpartition(" ")[2] in shown and "ALL REC" not in shown
    assert word in shown or (width < 80 and "+1" in word)
    assert role in [each for piece, each in status_line(store, width) if word.rpartition(" ")[2] in piece]
    assert " LIVE " in shown and "pepper" in shown and "DEBUG" in shown


def test_it_records_again() -> None:
    store = store_after(recorder("camera", "stalled", "it has not grown for 3 s"), recorder("camera", "running"))
    assert "● ALL REC" in text(store)


def test_no_word_lies_about_what_has_gone() -> None:
    store = store_after(recorder("camera", "running"), SessionRecord(0, 0.0, "", status="recovered"))
    assert "● REC " in text(store), "the engine before has died, and perhaps the recorder with it"
    store.view.apply(recorder("camera", "failed", "it does not answer"))
    for gone in ("gone_reason", "cut_since"):
        broken = store_after(recorder("camera", "running"))
        setattr(broken, gone, "killed" if gone == "gone_reason" else 1.0)
        assert "REC" not in text(broken)


async def test_a_red_line_says_what_does_not_record_and_goes_when_it_does() -> None:
    async with console(size=(80, 24)) as it:
        it.client.time = 75.0
        it.client.emit(recorder("camera", "stalled", "its file has not grown for 3 s"))
        await it.until(lambda: it.bars.attention_bar.display)
        line = it.bars.attention_bar.text
        assert line.strip() == "✗ not recorded: camera STALLED at 00:01:15: its file has not grown for 3 s"
        assert "camera STALLED" in it.bars.status_line.text and not it.bars.alarm_bar.display
        it.client.emit(recorder("camera", "running"))
        await it.until(lambda: "ALL REC" in it.bars.status_line.text)
        assert not it.bars.attention_bar.display


# --- flashes ---


def flash(number: int = 3) -> SyncRecord:
    return SyncRecord(0, 0.0, "", number, "flash", "", "node:recorders")


def flashes(it: Console) -> list[int]:
    return [each.number for each in it.app.screen.query(Flash)]


@pytest.mark.parametrize("size", [(80, 24), (200, 50), (12, 4), (4, 2)])
@pytest.mark.parametrize("number", [1, 10, 888])
def test_the_number_is_as_large_as_fits(size: tuple[int, int], number: int) -> None:
    width, height = size
    rows = flash_rows(number, width, height)
    assert len(rows) == height and {len(row) for row in rows} == {width}
    painted = sum(row.count("#") for row in rows)
    assert (painted > 0) is (width >= 2 * (4 * len(str(number)) - 1) and height >= 5)
    if size == (80, 24) and number < 100:
        assert sum("#" in row for row in rows) == 20


async def test_a_mark_is_flashed_for_a_moment_over_whatever_there_is_and_no_key_is_lost() -> None:
    async with console(size=(80, 24)) as it:
        it.client.emit(flash(7))
        await it.until(lambda: flashes(it) == [7])
        [shown] = it.app.screen.query(Flash)
        assert shown.region.size == (80, 24) and shown.region.offset == (0, 0)
        top = {
            segment.style.bgcolor.name for segment in shown.render_line(0) if segment.style and segment.style.bgcolor
        }
        assert top == {"#ffffff"}, "a dark console turns white"
        focused = it.app.focused
        await it.pilot.press("f9")
        await it.until(lambda: [each.function for each in it.client.sent] == ["stopAll"])
        assert it.app.focused is focused and not isinstance(focused, Flash)
        await it.pilot.pause(FLASH_SECONDS + 0.1)
        assert flashes(it) == []
        await it.pilot.press("f9")
        await it.until(lambda: len(it.client.sent) == 2)
        await it.pilot.pause(0.1)
        assert flashes(it) == [], "a key does not show the last mark again"
        await it.pilot.press("?")
        await it.until(lambda: it.app.screen is not it.screen)
        dialog = it.app.screen
        before = dialog.region
        it.client.emit(flash(1), flash(2))
        await it.until(lambda: flashes(it) == [2])
        [shown] = dialog.query(Flash)
        assert shown.region.size == (80, 24) and it.app.screen is dialog and dialog.region == before
        await it.pilot.pause(FLASH_SECONDS + 0.1)
        assert not dialog.query(Flash) and it.app.screen is dialog
        await it.press("escape")
        it.client.emit(flash(4), at=it.client.time - LATE_FLASH_SECONDS - 0.1)
        await it.until(lambda: "mark 4 came too late to be shown here" in it.bars.notice_line.text)
        assert flashes(it) == []
        it.client.emit(SyncRecord(0, 0.0, "", 5, "sound", "up", "node:recorders"))
        await it.pilot.pause(0.2)
        assert flashes(it) == []
