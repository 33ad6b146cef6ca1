"""Each detail of Textual that is not documented and that the console leans on. A new release fails here first."""

from __future__ import annotations

import sys
from typing import Any

import pytest
from textual import events
from textual.app import App, ComposeResult
from textual.geometry import Size
from textual.screen import Screen
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.quiet import KeyWatch, QuietModal, QuietScreen, QuietScrollView, click_driver


class Plain(QuietScrollView, can_focus=True):
    def render_line(self, y: int) -> Strip:
        return Strip.blank(self.size.width)


def paints(screen: Screen[Any]) -> list[Widget]:
    """Everything that the screen is asked to repaint from now on."""
    asked: list[Widget] = []
    original = Widget.refresh

    def refresh(self: Widget, *regions: Any, **options: Any) -> Any:
        asked.append(self)
        return original(self, *regions, **options)

    screen.__dict__["_paints"] = asked
    Widget.refresh = refresh  # type: ignore[method-assign]
    screen.__dict__["_restore"] = lambda: setattr(Widget, "refresh", original)
    return asked


@pytest.mark.parametrize("kind", [QuietScreen, QuietModal])
async def test_a_focus_change_does_not_repaint_the_screen(kind: type[Screen[None]]) -> None:
    class Two(kind):  # type: ignore[valid-type, misc]
        def compose(self) -> ComposeResult:
            yield Plain(id="one")
            yield Plain(id="two")

    app: App[None] = App()
    async with app.run_test() as pilot:
        screen = Two()
        await app.push_screen(screen)
        screen.query_one("#one").focus()
        await pilot.pause()
        asked = paints(screen)
        try:
            screen.query_one("#two").focus()
            await pilot.pause()
        finally:
            screen.__dict__["_restore"]()
        assert screen.focused is screen.query_one("#two")
        assert screen not in asked


async def test_the_stock_screen_still_repaints_so_that_the_trick_is_still_needed() -> None:
    assert Screen.__dict__["focused"]._repaint is True
    assert QuietScreen.__dict__["focused"]._repaint is False
    assert Widget.__dict__["virtual_size"]._layout is True


async def test_growing_content_asks_for_no_layout_and_moves_the_scrollbar() -> None:
    class One(App[None]):
        def compose(self) -> ComposeResult:
            yield Plain(id="one")

    app = One()
    async with app.run_test(size=(40, 10)) as pilot:
        view = app.query_one(Plain)
        view.resize_content(Size(10, 100))
        await pilot.pause()
        assert view.show_vertical_scrollbar and view.max_scroll_y == 90
        view.resize_content(Size(10, 200))
        assert not app.screen._layout_required
        assert view.max_scroll_y == 190
        await pilot.resize_terminal(40, 20)
        await pilot.pause()
        assert view.virtual_size.height == 200 and view.max_scroll_y == 180


async def test_the_focus_repaints_no_whole_list_and_is_still_known() -> None:
    class Two(App[None]):
        def compose(self) -> ComposeResult:
            yield Plain(id="one")
            yield Plain(id="two")

    app = Two()
    async with app.run_test() as pilot:
        app.query_one("#one").focus()
        await pilot.pause()
        asked = paints(app.screen)
        try:
            app.screen.set_focus(app.query_one("#two"))
            await pilot.pause()
        finally:
            app.screen.__dict__["_restore"]()
        assert app.query_one("#two").has_focus and not app.query_one("#one").has_focus
        assert not [widget for widget in asked if isinstance(widget, Plain)]


async def test_every_key_is_seen_once_also_those_that_a_text_field_takes() -> None:
    class Watching(KeyWatch):
        seen: list[str]

        def compose(self) -> ComposeResult:
            self.seen = []
            yield Input()

        def key_arrived(self, event: events.Key) -> None:
            self.seen.append(event.key)

    app = Watching()
    async with app.run_test() as pilot:
        app.query_one(Input).focus()
        await pilot.press("a", "f9", "enter", "up")
        assert app.seen == ["a", "f9", "enter", "up"]
        assert app.query_one(Input).value == "a"


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such driver")
def test_the_driver_asks_for_clicks_but_not_for_every_movement() -> None:
    made = click_driver()
    assert made is not None
    written: list[str] = []

    class Quiet(made):  # type: ignore[valid-type, misc]
        def __init__(self) -> None:
            self._mouse = True

        def write(self, data: str) -> None:
            written.append(data)

        def flush(self) -> None:
            pass

    driver = Quiet()
    driver._enable_mouse_support()
    assert "\x1b[?1003h" not in "".join(written) and "\x1b[?1006h" in "".join(written)
    driver._disable_mouse_support()
    assert "\x1b[?1002l" in "".join(written) and "\x1b[?1000l" in "".join(written)
