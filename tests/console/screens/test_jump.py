"""Jump mode: a letter for every list, pane and tab, and nothing else happens."""

from __future__ import annotations

import pytest

from rise_engine.scenario.keys import PUNCTUATION
from rise_tui.actions import BY_ID
from rise_tui.console.layout import MONITORING, START_LISTS
from rise_tui.rendering.text import line_width, plain_text
from rise_tui.screens.jump import LETTERS, JumpScreen, label_line
from tests.console.conftest import Console, console


async def jumping(it: Console) -> JumpScreen:
    await it.press("ctrl+d")
    await it.until(lambda: isinstance(it.app.screen, JumpScreen))
    screen = it.app.screen
    assert isinstance(screen, JumpScreen)
    return screen


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
@pytest.mark.parametrize("size", [(80, 24), (120, 40), (200, 50)])
async def test_the_letters_stand_on_every_list_pane_and_tab(size: tuple[int, int]) -> None:
    async with console(size=size) as it:
        screen = await jumping(it)
        said = text_of(screen)
        for name, letter in LETTERS.items():
            title = it.pane(name).TITLE
            assert f"[{letter}]{title.lower()}" in said.lower(), name
        assert "esc leaves" in said
        for region, line in screen._labels:
            assert region.width and line_width(line) <= region.width
            assert region.right <= size[0] and region.bottom <= size[1]


@pytest.mark.slow
@pytest.mark.parametrize("size", [(80, 24), (200, 50)])
@pytest.mark.parametrize("name", list(LETTERS))
async def test_a_letter_goes_there_also_to_a_hidden_tab(name: str, size: tuple[int, int]) -> None:
    async with console(size=size) as it:
        await jumping(it)
        await it.press(LETTERS[name])
        await it.until(lambda: it.app.screen is it.screen)
        await it.until(lambda: it.pane(name).row_view.has_focus)
        assert name in {pane.SCOPE for pane in it.screen.pane_layout.visible_panes()}
        assert it.client.sent == []


@pytest.mark.slow
@pytest.mark.parametrize("key", ["escape", "g", "n", "b", "enter", "space", "comma", "tab", "f3", "ctrl+d"])
async def test_any_other_key_leaves_and_does_nothing(key: str) -> None:
    async with console() as it:
        before = it.app.focused
        await jumping(it)
        await it.press(key)
        await it.until(lambda: it.app.screen is it.screen)
        await it.pilot.pause(0.1)
        assert it.client.sent == [] and it.screen.focused is before
        assert it.pane("acts").row_view.has_focus and "again?" not in it.text("acts")


@pytest.mark.parametrize("key", ["f9", "ctrl+g"])
async def test_stop_works_while_jumping(key: str) -> None:
    async with console() as it:
        await jumping(it)
        await it.press(key)
        await it.sent("stopAll", "")


async def test_from_a_zoomed_pane_to_any_other_which_is_then_zoomed() -> None:
    async with console() as it:
        await it.press("f3", "f4")
        assert "[a]acts" in text_of(await jumping(it))
        await it.press(LETTERS["memory"])
        await it.until(lambda: it.pane("memory").row_view.has_focus)
        assert [pane.SCOPE for pane in it.screen.pane_layout.visible_panes()] == ["memory"]


async def test_a_click_or_another_size_leaves() -> None:
    async with console() as it:
        await jumping(it)
        await it.pilot.click(offset=(60, 20))
        await it.until(lambda: it.app.screen is it.screen)
        await jumping(it)
        await it.pilot.resize_terminal(100, 35)
        await it.until(lambda: it.app.screen is it.screen)


def test_the_key_is_in_the_registry() -> None:
    assert BY_ID["jump"].keys == ("ctrl+d",)
