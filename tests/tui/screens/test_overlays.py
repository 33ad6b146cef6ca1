"""Overlays begin below the rows about the robot, and dim the keys. The terminal's cursor is where the focus is."""

from __future__ import annotations

import pytest
from textual.geometry import Offset
from textual.screen import Screen

from rise_tui.widgets.lines import FOCUS_MARK
from tests.tui.conftest import Console, console

SIZES = ((80, 24), (120, 40), (200, 50))


def box_top(it: Console) -> int:
    return it.app.screen.query_one("#box").region.y


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("opens", ["palette", "help", "quit", "settings"])
async def test_an_overlay_begins_below_the_alarm_that_comes_while_it_is_open(size: tuple[int, int], opens: str) -> None:
    async with console(size) as it:
        it.screen.action_do(opens)
        await it.until(lambda: it.app.screen is not it.screen and it.app.screen.query("#box"))
        await it.until(lambda: box_top(it) >= it.screen.kept_rows)
        before = it.screen.kept_rows
        await it.press("f9")
        it.client.stop("latched", ("speech",), ("robot",))
        await it.until(lambda: it.screen.kept_rows > before and "NOT CONFIRMED" in it.bars.alarm_bar.text)
        await it.until(lambda: it.app.screen is it.screen or box_top(it) >= it.screen.kept_rows)
        if it.app.screen is not it.screen:
            assert it.app.screen.query_one("#box").region.bottom <= size[1]


@pytest.mark.parametrize("opens", ["palette", "help", "quit", "settings", "control"])
async def test_keys_below_an_overlay_are_dim_and_the_hints_name_what_works(opens: str) -> None:
    async with console() as it:
        await it.press("g")
        await it.until(lambda: ("g", "key") in it.bars.key_strip.lines[0])
        hints = it.bars.key_hints.text
        it.screen.action_do(opens)
        await it.until(lambda: it.app.screen is not it.screen)
        await it.until(lambda: ("g", "muted") in it.bars.key_strip.lines[0])
        assert it.bars.key_hints.text.split() == ["F9/^G", "STOP", "esc", "closes", "what", "is", "open"]
        await it.press("escape")
        await it.until(lambda: it.bars.key_hints.text == hints and ("g", "key") in it.bars.key_strip.lines[0])


@pytest.mark.parametrize("opens", ["tour", "jump"])
async def test_what_shows_the_console_leaves_its_keys_as_they_are(opens: str) -> None:
    async with console() as it:
        await it.until(lambda: ("g", "key") in it.bars.key_strip.lines[0])
        hints = it.bars.key_hints.text
        it.screen.action_do(opens)
        await it.until(lambda: it.app.screen is not it.screen)
        await it.pilot.pause(0.2)
        assert ("g", "key") in it.bars.key_strip.lines[0] and it.bars.key_hints.text == hints


async def test_the_cursor_of_the_terminal_is_where_the_focus_is() -> None:
    """Braille displays and screen readers follow it."""

    def at() -> Offset:
        it.screen.refresh()
        return it.app.cursor_position

    async with console() as it:
        rows = it.pane("acts").row_view
        for _ in range(3):
            await it.until(lambda: at() == rows.region.offset + Offset(0, rows.cursor - rows.scroll_offset.y))
            await it.press("down")
        await it.press("f2")
        await it.until(lambda: at() == it.pane("rules").row_view.region.offset)
        await it.press("ctrl+t", "x")
        await it.until(lambda: isinstance(it.app.screen, Screen) and at() == it.app.focused.cursor_screen_offset)  # type: ignore[union-attr]


async def test_the_focus_has_a_mark_in_its_title_and_its_row() -> None:
    async with console() as it:
        acts, rules = it.pane("acts"), it.pane("rules")

        def marked() -> tuple[bool, bool]:
            return acts.title.text.startswith(FOCUS_MARK), rules.title.text.startswith(FOCUS_MARK)

        def first_cells(pane: str) -> str:
            rows = it.pane(pane).row_view
            return "".join(rows.render_line(y).text[:1] for y in range(min(rows.count, rows.size.height)))

        await it.until(lambda: marked() == (True, False))
        assert first_cells("acts").strip() == FOCUS_MARK and not first_cells("rules").strip()
        await it.press("f2")
        await it.until(lambda: marked() == (False, True))
        assert first_cells("rules").strip() == FOCUS_MARK and not first_cells("acts").strip()
