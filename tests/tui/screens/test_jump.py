"""Jump mode: a letter for every list, pane and tab, and nothing else happens."""

from __future__ import annotations

import pytest

from rise_engine.scenario.keys import PUNCTUATION
from rise_tui.actions import BY_ID
from rise_tui.console.layout import MONITORING, START_LISTS
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.tour import LETTERS, JumpScreen, label_line
from tests.tui.conftest import Console, console


async def jumping(it: Console) -> JumpScreen:
    await it.press("ctrl+d")
    return await it.shows(JumpScreen)


def text_of(screen: JumpScreen) -> str:
    return "\n".join(plain_text(line) for _, line in screen._labels)


def test_every_list_and_pane_has_a_letter_of_its_own() -> None:
    assert set(LETTERS) == {*START_LISTS, *MONITORING}
    assert len(set(LETTERS.values())) == len(LETTERS)
    assert not set(LETTERS.values()) & set(PUNCTUATION.values())


def test_a_label_names_letter_and_title() -> None:
    line = label_line([("u", "Rule", True), ("c", "Act", False)])
    assert plain_text(line) == "[u]RULE[c]act"


@pytest.mark.slow
async def test_a_letter_stands_on_every_list_pane_and_tab_and_goes_there() -> None:
    async with console(size=(80, 24)) as it:
        for size in ((80, 24), (120, 40), (200, 50)):
            await it.pilot.resize_terminal(*size)
            for name, letter in LETTERS.items():
                screen = await jumping(it)
                said = text_of(screen)
                assert f"[{letter}]{it.pane(name).TITLE.lower()}" in said.lower(), name
                assert "esc leaves" in said
                for region, line in screen._labels:
                    assert region.width and line_width(line) <= region.width
                    assert region.right <= size[0] and region.bottom <= size[1]
                await it.press(letter)
                await it.back()
                await it.until(lambda name=name: it.pane(name).row_view.has_focus)  # type: ignore[misc]
                assert name in {pane.SCOPE for pane in it.screen.pane_layout.visible_panes()}, "also a hidden tab"
        assert it.client.sent == []


@pytest.mark.slow
async def test_any_other_key_leaves_and_does_nothing_and_stop_works() -> None:
    async with console() as it:
        before = it.app.focused
        for key in ("escape", "g", "n", "b", "enter", "space", "comma", "tab", "f3", "ctrl+d"):
            await jumping(it)
            await it.press(key)
            await it.back()
            await it.pilot.pause(0.1)
            assert it.client.sent == [] and it.screen.focused is before, key
            assert it.pane("acts").row_view.has_focus and "again?" not in it.text("acts")
        await jumping(it)
        await it.press("f9", "ctrl+g")
        await it.until(lambda: it.client.asked() == [("stopAll", "")] * 2)
        await it.press("escape")
        await it.press("f3", "f4")  # from a zoomed pane to any other, which is zoomed then
        assert "[a]acts" in text_of(await jumping(it))
        await it.press(LETTERS["memory"])
        await it.until(lambda: it.pane("memory").row_view.has_focus)
        assert [pane.SCOPE for pane in it.screen.pane_layout.visible_panes()] == ["memory"]
        await jumping(it)
        await it.pilot.click(offset=(60, 20))
        await it.back()
        await jumping(it)
        await it.pilot.resize_terminal(100, 35)
        await it.back()


def test_the_key_is_in_the_registry() -> None:
    assert BY_ID["jump"].keys == ("ctrl+d",)
