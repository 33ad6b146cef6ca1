from __future__ import annotations

import pytest

from rise_engine.kernel.records import SessionRecord
from rise_tui.panes.tasks import SchedulerPane
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.reading import DetailScreen
from tests.tui.conftest import Console, console


async def queue(it: Console) -> list[int]:
    """One act runs and three wait; the clock is 1.9 s into the first."""
    first = it.client.act("Greet")  # typically 3.9 s
    waiting = [it.client.act(name, "PENDING") for name in ("Praise", "Filler")]
    waiting.append(it.client.task("say", "Please put the fork down", "PENDING"))
    it.client.time += 1.9
    await it.focus("scheduler")
    it.pane("scheduler").repaint()
    await it.until(lambda: "Please" in it.text("scheduler"))
    pane = it.pane("scheduler")
    assert isinstance(pane, SchedulerPane)
    pane.repaint()
    return [first, *waiting]


@pytest.mark.slow
async def test_what_runs_says_how_long_still_and_what_waits_when() -> None:
    async with console(size=(120, 40)) as it:
        it.client.task("say", "Hello", "ACTIVE")
        it.client.act("Greet", "PENDING")
        it.client.time += 2
        await it.focus("scheduler")
        await it.until(lambda: "“Hello”" in it.text("scheduler"))
        it.pane("scheduler").repaint()
        # A speech that runs has no typical time, and nothing is made up.
        assert "for 2.0 s" in it.row("scheduler", "Hello") and "not known" in it.row("scheduler", "Greet")
        it.client.task_record(1, "say", "Hello", "SUCCEEDED")
        it.client.end_task(2, "Greet", "CANCELED")
        ids = await queue(it)
        rows = it.text("scheduler").splitlines()
        assert "1.9 of 3.9 s, 2.0 s left" in rows[0] and rows[0].startswith(" now")
        assert rows[1].startswith(" next") and "in ~2 s" in rows[1]
        assert rows[2].startswith("   2.") and "in ~3 s" in rows[2]  # Praise takes 1.0 s
        assert "“Please" in rows[3] and "in ~4 s" in rows[3]
        pane = it.pane("scheduler")
        assert isinstance(pane, SchedulerPane)
        for width in range(38, 140):
            for row in pane.make_rows(width):
                assert line_width(row.line) <= width
            text = plain_text(pane.make_rows(width)[0].line)
            assert "Greet" in text and "► running" in text and "2.0 s left" in text
        it.client.time += 5
        pane.repaint()
        rows = it.text("scheduler").splitlines()
        assert "6.9 of 3.9 s, 3.0 s over" in rows[0] and "any moment" in rows[1]
        await it.press("slash", *"fork")
        await it.until(lambda: it.text("scheduler").count("\n") == 0 and "Please" in it.text("scheduler"))
        assert "1 of 4" in pane.title.text
        await it.press("escape", "home", "down", "enter")
        screen = await it.shows(DetailScreen)
        await it.until(lambda: "○ waiting" in screen.list.text and "waits for" in screen.list.text)
        it.client.task_record(ids[1], "startCommunicationRobotAct", "Praise", "ACTIVE")
        await it.until(lambda: "► running" in screen.list.text)
        await it.press("escape")
        assert it.client.sent == []


@pytest.mark.slow
async def test_tasks_are_moved_and_cancelled_and_a_move_that_changes_nothing_is_not_sent() -> None:
    async with console(size=(80, 24)) as it:
        await queue(it)
        for row, key, sent in (
            (2, "shift+up", ("moveTask", "3 0")),
            (1, "shift+down", ("moveTask", "2 1")),
            (3, "left", ("moveTask", "4 0")),
            (3, "delete", ("cancelTask", "4")),
            (0, "delete", ("cancelTask", "1")),
        ):
            it.client.sent.clear()
            await it.press("home", *["down"] * row, key)
            await it.sent(*sent)
            assert len(it.client.sent) == 1
        it.client.sent.clear()
        for row, key, said in (
            (0, "left", "already running"),
            (1, "left", "it is already next"),
            (1, "shift+up", "it is already next"),
            (3, "shift+down", "already the last one"),
        ):
            it.screen.session.store.notice = None
            await it.press("home", *["down"] * row, key)
            await it.until(lambda said=said: said in it.notice)  # type: ignore[misc]
            assert it.client.sent == []


@pytest.mark.slow
async def test_of_what_waits_for_a_wizard_no_time_is_told() -> None:
    async with console(size=(120, 40)) as it:
        it.client.emit(SessionRecord(0, 0.0, "", status="recovered", waits_for_wizard=True))
        await queue(it)
        assert it.text("scheduler").count("not known") == 3 and "in ~" not in it.text("scheduler")
        assert "1 running, 3 waiting until somebody takes control" in it.pane("scheduler").title.text
        it.client.time += 600.0
        await it.pilot.pause(1.1)
        assert "waits for a wizard" in it.text("scheduler") and " over" not in it.text("scheduler")
