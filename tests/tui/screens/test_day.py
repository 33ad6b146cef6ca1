"""A day at the console leaves nothing behind: no widget, no timer, no object that grows with what was done.

`benchmarks/console_day.py` does the same for a whole day, and looks at the process's memory.
"""

from __future__ import annotations

import asyncio
import gc
from collections import Counter

import pytest
from textual._styles_cache import StylesCache
from textual.message_pump import MessagePump
from textual.timer import Timer

from rise_engine.kernel.records import MemoryRecord
from tests.tui.conftest import Console, console

FOCUS_CHANGES, RECORDS = 30, 600
SLACK = 10
"""Objects more or less of one kind that are a matter of the moment: what is just on its way."""


KINDS = (MessagePump, StylesCache, Timer, asyncio.Task)
"""Widgets, screens, what is painted of them, and what runs for them."""


def living() -> Counter[str]:
    """Objects of Textual's and asyncio's that would pile up, and all of ours."""
    gc.collect()
    ours = (
        each for each in gc.get_objects() if isinstance(each, KINDS) or str(type(each).__module__).startswith("rise_")
    )
    return Counter(type(each).__qualname__ for each in ours)


async def some_time(at: Console, number: int) -> None:
    """Focus changes, records about what is there already, a dialog and a filter."""
    for _ in range(FOCUS_CHANGES):
        at.screen.pane_layout.focus_next_pane()
        await asyncio.sleep(0)
    for one in range(RECORDS // 10):
        for _ in range(9):
            at.client.emit(MemoryRecord(0, 0.0, "", "side", f"value {number} {one}", None, "rule:x", created=False))
        at.client.rule("Main", "stayed", "waiting")
        if not one % 20:
            await at.pilot.pause()
    for keys in (("question_mark", "escape"), ("colon", "escape"), ("slash", "a", "escape")):
        await at.press(*keys)
    await at.pilot.pause()


@pytest.mark.slow
async def test_nothing_grows_with_what_is_done() -> None:
    async with console() as at:
        await some_time(at, 0)  # what is made once, is made by now
        widgets, before = len(at.app.query("*")), living()
        await some_time(at, 1)
        assert len(at.app.query("*")) == widgets
        grown = {name: (before[name], now) for name, now in living().items() if now > before[name] + SLACK}
        assert not grown
