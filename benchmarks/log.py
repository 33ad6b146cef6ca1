"""A task log of 100,000 rows opens in 0.2 s, scrolls in 10 ms, and no filter delays a key (console.md 9.1, 9.2).

It compares the console's log with the usual widgets for it, `DataTable`, `Log` and `RichLog`, and with the floor: a
bare line-API view that paints nothing. All run in the same app at 120x40, with the same tasks. Opening is measured from
the tasks to the painted end of the log, scrolling as one page up with its painting. A filter's blocking of the loop is
CPU time, too, because other programs block it on a busy machine. Its other times are wall time.
"""

from __future__ import annotations

import asyncio
import gc
import statistics
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from textual.app import App
from textual.geometry import Size
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import DataTable, Log, RichLog

sys.path.insert(0, str(Path(__file__).parents[1]))

from measure import Report

from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol.client import AttachReply
from rise_engine.scenario.loader import load
from rise_tui.model.store import Store
from rise_tui.panes.log import LogPane
from rise_tui.rendering import themes

COUNT = 100_000
PAGES = 60
ROOT = Path(__file__).parents[1]
SLOW = 10
"""The divisor of the rows for widgets that take half a minute for all; their result is extrapolated."""
OPEN, SCROLL, BLOCK, FIRST = 0.2, 0.010, 0.025, 0.1

FUNCTIONS = (("raiseEventTopic", "/next"), ("startCommunicationRobotAct", "R_Praise"), ("assignValue", "step = 3"))


def tasks(count: int) -> dict[int, TaskView]:
    made = {}
    for id in range(1, count + 1):
        function, behavior = FUNCTIONS[id % 3]
        status = "ABORTED" if id % 97 == 0 else "SUCCEEDED"
        reason = "the robot did not answer" if status == "ABORTED" else ""
        at = id * 0.1
        made[id] = TaskView(id, function, behavior, "Blocking", "wizard:anna", status, reason, at, at + 0.1, at + 2.0)
    return made


def row(task: TaskView) -> tuple[str, ...]:
    return f"{task.submitted:.1f}", task.source, task.function, task.behavior, task.status, task.reason


class Bench(App[None]):
    CSS = "Screen { layers: base; }"

    def __init__(self) -> None:
        super().__init__()
        self.animation_level = "none"
        for theme in themes.THEMES:
            self.register_theme(theme)
        self.theme = themes.full_name(themes.DEFAULT)

    def get_theme_variable_defaults(self) -> dict[str, str]:
        return themes.DARK.variables


class Floor(ScrollView, can_focus=True):
    def __init__(self, count: int) -> None:
        super().__init__()
        self.virtual_size = Size(100, count)

    def render_line(self, y: int) -> Strip:
        return Strip.blank(self.size.width)


Opener = Callable[[App[Any], dict[int, TaskView]], Awaitable[Widget]]


async def floor(app: App[Any], made: dict[int, TaskView]) -> Widget:
    widget = Floor(len(made))
    await app.mount(widget)
    widget.scroll_end(animate=False)
    return widget


async def ours(app: App[Any], made: dict[int, TaskView]) -> Widget:
    pane = LogPane(store_of(made))
    await app.mount(pane)
    pane.repaint()
    return pane.row_view


async def log(app: App[Any], made: dict[int, TaskView]) -> Widget:
    widget = Log()
    await app.mount(widget)
    widget.write_lines("  ".join(row(task)) for task in made.values())
    return widget


async def rich_log(app: App[Any], made: dict[int, TaskView]) -> Widget:
    widget = RichLog()
    await app.mount(widget)
    for task in made.values():
        widget.write("  ".join(row(task)))
    return widget


async def data_table(app: App[Any], made: dict[int, TaskView]) -> Widget:
    widget: DataTable[str] = DataTable(cursor_type="row")
    await app.mount(widget)
    widget.add_columns("time", "source", "function", "behavior", "status", "reason")
    widget.add_rows(row(task) for task in made.values())
    widget.move_cursor(row=len(made) - 1, animate=False)
    return widget


def store_of(made: dict[int, TaskView]) -> Store:
    scenario = load(str(ROOT / "scenarios" / "lablinking")).scenario
    assert scenario is not None
    view = SessionView()
    view.tasks = made
    return Store(AttachReply(scenario, "debug", "pepper", 1, view), "anna", lambda: COUNT * 0.1)


async def measured(opener: Opener, made: dict[int, TaskView], rounds: int) -> tuple[float, float]:
    """Median seconds to open, and for one page."""
    opens, pages = [], []
    for _ in range(rounds):
        app = Bench()
        async with app.run_test(size=(120, 40)) as pilot:
            await pilot.pause()
            gc.collect()
            began = time.process_time()
            widget = await opener(app, made)
            await painted(app)
            opens.append(time.process_time() - began)
            widget.focus()
            await pilot.pause()
            for page in range(PAGES):
                before = widget.scroll_offset.y
                began = time.process_time()
                widget.scroll_relative(y=-30, animate=False)
                await painted(app)
                pages.append(time.process_time() - began)
                assert page or before != widget.scroll_offset.y, "it did not scroll"
    return statistics.median(opens), statistics.median(pages)


async def painted(app: App[Any]) -> None:
    """Lay out and render everything that was requested, without a terminal."""
    done = asyncio.Event()
    app.screen.call_after_refresh(done.set)
    await done.wait()


async def filtering(made: dict[int, TaskView], typed: str) -> tuple[float, float, float, int]:
    """Seconds to the first row found, to the end, and the maximum seconds without other work of the loop."""
    app = Bench()
    async with app.run_test(size=(120, 40)) as pilot:
        pane = LogPane(store_of(made))
        await app.mount(pane)
        pane.repaint()
        await pilot.pause()
        longest, going = 0.0, True

        async def watch() -> None:
            nonlocal longest
            last = time.thread_time()
            while going:
                await asyncio.sleep(0)
                now = time.thread_time()
                longest, last = max(longest, now - last), now

        gc.collect()
        watcher = asyncio.ensure_future(watch())
        await asyncio.sleep(0.05)
        longest, first = 0.0, 0.0
        began = time.perf_counter()
        pane.set_filter(typed)
        while True:
            search = pane._search
            assert search is not None
            first = first or (time.perf_counter() - began if pane.row_view.count else 0.0)
            if search.is_complete:
                break
            await asyncio.sleep(0.002)
        end = time.perf_counter() - began
        await pilot.pause()
        going = False
        await watcher
        return first, end, longest, pane.row_view.count


async def all_of_it() -> bool:
    made = tasks(COUNT)
    gc.collect()
    gc.freeze()
    report = Report(f"A task log of {COUNT:,} rows at 120x40 ")
    part = {id: made[id] for id in range(1, COUNT // SLOW + 1)}
    found = {
        "bare line-API view (floor)": await measured(floor, made, 5),
        "rise-tui": await measured(ours, made, 5),
        "Log": await measured(log, made, 3),
    }
    for name, opener in (("DataTable", data_table), ("RichLog", rich_log)):
        opened, scrolled = await measured(opener, part, 1)
        found[f"{name}, from {len(part):,} rows"] = opened * SLOW, scrolled
    mine = found["rise-tui"]
    for name, (opened, scrolled) in found.items():
        ratio = f"{opened / mine[0]:.1f} and {scrolled / mine[1]:.1f} times ours" if name != "rise-tui" else ""
        report.row(name, f"{opened * 1000:.0f} ms", f"page {scrolled * 1000:.2f} ms   {ratio}")
    report.target("opens, seconds", mine[0], OPEN, at_least=False)
    report.target("one page, seconds", mine[1], SCROLL, at_least=False)
    worst = 0.0
    for typed in ("anna", "rprse", "aborted answer", "nothing-like-this", "/R_\\w+.*done", "/.*9.*fail.*", "!event"):
        first, end, longest, count = await filtering(made, typed)
        worst = max(worst, longest)
        shown = f"first {first * 1000:.0f} ms, " if count else ""
        report.row(
            f"filter {typed}", f"{end:.2f} s", f"{shown}{count:,} rows, loop held {longest * 1000:.1f} ms at most"
        )
        if count > 1000:
            report.target("first row found, seconds", first, FIRST, at_least=False)
    report.target("loop held at most, seconds", worst, BLOCK, at_least=False)
    return report.met


def main() -> bool:
    return asyncio.run(all_of_it())


if __name__ == "__main__":
    sys.exit(not main())
