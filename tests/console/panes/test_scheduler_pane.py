from __future__ import annotations

import pytest

from rise_engine.kernel.records import TaskRecord
from rise_tui.panes.scheduler import SchedulerPane
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.detail import DetailScreen
from tests.console.conftest import Console, console


async def queue(it: Console) -> list[int]:
    """One act runs and three wait; the clock is 1.9 s into the first."""
    first = it.client.act("Greet")  # typically 3.9 s
    waiting = [it.client.act(name, "PENDING") for name in ("Praise", "Filler")]
    waiting.append(it.client.task("say", "Please put the fork down", "PENDING"))
    it.client.time += 1.9
    it.screen.pane_layout.focus_pane("scheduler")
    it.pane("scheduler").repaint()
    await it.until(lambda: "Please" in it.text("scheduler"))
    pane = it.pane("scheduler")
    assert isinstance(pane, SchedulerPane)
    pane.repaint()
    return [first, *waiting]


async def test_what_runs_says_how_long_still_and_what_waits_when() -> None:
    async with console(size=(120, 40)) as it:
        await queue(it)
        rows = it.text("scheduler").splitlines()
        assert "1.9 of 3.9 s, 2.0 s left" in rows[0] and rows[0].startswith(" now")
        assert rows[1].startswith(" next") and "in ~2 s" in rows[1]
        assert rows[2].startswith("   2.") and "in ~3 s" in rows[2]  # Praise takes 1.0 s
        assert "“Please" in rows[3] and "in ~4 s" in rows[3]
        it.client.time += 5
        it.pane("scheduler").repaint()
        rows = it.text("scheduler").splitlines()
        assert "6.9 of 3.9 s, 3.0 s over" in rows[0] and "any moment" in rows[1]


async def test_a_running_speech_has_no_typical_time_and_nothing_is_made_up() -> None:
    async with console(size=(120, 40)) as it:
        it.client.task("say", "Hello", "ACTIVE")
        it.client.act("Greet", "PENDING")
        it.client.time += 2
        it.screen.pane_layout.focus_pane("scheduler")
        await it.until(lambda: "“Hello”" in it.text("scheduler"))
        it.pane("scheduler").repaint()
        assert "for 2.0 s" in it.row("scheduler", "Hello") and "not known" in it.row("scheduler", "Greet")


@pytest.mark.slow
async def test_a_name_a_state_and_a_time_have_room_at_every_width() -> None:
    for size in ((80, 24), (120, 40), (200, 50)):
        async with console(size=size) as it:
            await queue(it)
            pane = it.pane("scheduler")
            assert isinstance(pane, SchedulerPane)
            for width in range(38, 140):
                for row in pane.make_rows(width):
                    assert line_width(row.line) <= width
                text = plain_text(pane.make_rows(width)[0].line)
                assert "Greet" in text and "► running" in text and "2.0 s left" in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("row", "key", "sent"),
    [
        (2, "shift+up", ("moveTask", "3 0")),
        (1, "shift+down", ("moveTask", "2 1")),
        (3, "left", ("moveTask", "4 0")),
        (3, "delete", ("cancelTask", "4")),
        (0, "delete", ("cancelTask", "1")),
    ],
)
async def test_tasks_are_moved_and_cancelled(row: int, key: str, sent: tuple[str, str]) -> None:
    async with console(size=(120, 40)) as it:
        await queue(it)
        await it.press("home", *["down"] * row, key)
        await it.sent(*sent)
        assert len(it.client.sent) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("row", "key", "said"),
    [(0, "left", "runs already"), (1, "left", "starts next already"), (1, "shift+up", "starts next already"),
     (3, "shift+down", "last one already")],
)  # fmt: skip
async def test_a_move_that_changes_nothing_is_not_sent(row: int, key: str, said: str) -> None:
    async with console(size=(120, 40)) as it:
        await queue(it)
        await it.press("home", *["down"] * row, key)
        await it.until(lambda: said in it.notice)
        assert it.client.sent == []


async def test_details_of_a_waiting_task_follow_it() -> None:
    async with console(size=(120, 40)) as it:
        ids = await queue(it)
        await it.press("home", "down", "enter")
        screen = it.app.screen
        assert isinstance(screen, DetailScreen)
        await it.until(lambda: "○ waiting" in screen.list.text and "waits for" in screen.list.text)
        it.client.emit(
            TaskRecord(0, 0.0, "", ids[1], "startCommunicationRobotAct", "Praise", "Blocking", "wizard:anna", "ACTIVE")
        )
        await it.until(lambda: "► running" in screen.list.text)
        await it.press("escape")
        assert it.client.sent == []


async def test_the_queue_is_filtered() -> None:
    async with console(size=(120, 40)) as it:
        await queue(it)
        await it.press("slash", *"fork")
        await it.until(lambda: it.text("scheduler").count("\n") == 0 and "Please" in it.text("scheduler"))
        assert "1 of 4" in it.pane("scheduler").title.text
