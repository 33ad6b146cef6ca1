"""Each detail of Textual that is not documented and that the console leans on. A new release fails here first."""

from __future__ import annotations

import asyncio
import gc
import weakref
from time import monotonic
from typing import Any

import pytest
from textual import events
from textual._styles_cache import StylesCache
from textual.app import App, ComposeResult
from textual.geometry import Size
from textual.messages import Update
from textual.screen import Screen
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.quiet import (
    KeyWatch,
    QuietModal,
    QuietScreen,
    QuietScrollView,
    begin,
    is_busy,
)
from rise_tui.quiet.scrollbar import QuietScrollBar


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


async def test_the_widths_of_a_list_follow_its_style_and_its_size() -> None:
    class One(App[None]):
        CSS = "Plain { scrollbar-size-vertical: 1; }"

        def compose(self) -> ComposeResult:
            yield Plain(id="one")

    app = One()
    async with app.run_test(size=(40, 10)) as pilot:
        view = app.query_one(Plain)
        await pilot.pause()
        assert (view.painted_width, view.row_width) == (40, 40)
        view.resize_content(Size(10, 100))
        await pilot.pause()
        assert (view.painted_width, view.row_width) == (40, 39)  # one for the scrollbar
        view.styles.padding = (0, 2)
        await pilot.pause()
        assert (view.painted_width, view.row_width) == (36, 35)
        await pilot.resize_terminal(30, 10)
        await pilot.pause()
        assert (view.painted_width, view.row_width) == (26, 25)


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

        def key_arrived(self, event: events.Key, together: bool | None) -> None:
            self.seen.append(event.key)

        def takes(self, event: events.Key) -> bool:
            return event.key == "x"

    app = Watching()
    async with app.run_test() as pilot:
        app.query_one(Input).focus()
        await pilot.press("a", "f9", "x", "enter", "up")
        assert app.seen == ["a", "f9", "x", "enter", "up"]
        assert app.query_one(Input).value == "a"


async def test_a_key_from_the_terminal_needs_no_turn_of_the_loop_when_nothing_is_before_it() -> None:
    class Watching(KeyWatch):
        def __init__(self) -> None:
            super().__init__()
            self.seen: list[str] = []
            self.taken: list[str] = []

        def key_arrived(self, event: events.Key, together: bool | None) -> None:
            self.seen.append(event.key)

        def passes(self, event: events.Event) -> bool:
            return not (isinstance(event, events.Key) and event.key == "n")

        def takes(self, event: events.Key) -> bool:
            self.taken.append(event.key)
            return event.key == "x"

        async def on_event(self, event: events.Event) -> None:
            if isinstance(event, events.Key) and event.key == "i":
                assert not self.key_read(events.Key("x", "x")), "it is in the midst of a key"
            await super().on_event(event)

    app = Watching()
    async with app.run_test() as pilot:
        await pilot.pause()
        assert app.key_read(events.Key("x", "x")) and app.key_read(events.Key("n", "n"))
        assert (app.seen, app.taken) == (["x", "n"], ["x"])
        other = events.Key("o", "o")
        assert not app.key_read(other)
        app.post_message(other)
        assert not app.key_read(events.Key("x", "x")), "something is before it"
        await pilot.pause()
        assert (app.seen, app.taken) == (["x", "n", "o"], ["x", "o"])
        await pilot.press("i")
        assert app.seen[3:] == ["i"]
        app.screen.post_message(Update(app.screen))
        app.screen.check_idle()
        assert app.screen.message_queue_size and not is_busy(app.screen), "only to paint"
        app.screen.post_message(events.Click(None, 0, 0, 0, 0, 1, False, False, False))
        assert is_busy(app.screen)


async def test_an_error_while_a_key_is_seen_ends_the_app_as_any_other() -> None:
    class Broken(KeyWatch):
        def key_arrived(self, event: events.Key, together: bool | None) -> None:
            raise ValueError(event.key)

    app = Broken()
    with pytest.raises(ValueError, match="y"):
        async with app.run_test() as pilot:
            await pilot.pause()
            assert app.key_read(events.Key("y", "y"))


async def test_a_dialog_that_has_closed_leaves_no_painted_lines() -> None:
    class Asking(QuietModal[None]):
        def compose(self) -> ComposeResult:
            yield Plain()

    app: App[None] = App()
    async with app.run_test() as pilot:
        asking = Asking()
        await app.push_screen(asking)
        await pilot.pause()
        painted = weakref.ref(asking.query_one(Plain)._styles_cache)
        cached = StylesCache.get_inner_outer.cache_info().currsize
        assert cached and painted() is not None  # that Textual keeps them is what makes this necessary
        asking.dismiss()
        del asking
        await pilot.pause()
        end = monotonic() + 20
        while painted() is not None:
            assert monotonic() < end
            gc.collect()
            await pilot.pause(0.02)


# --- scrollbars ----------------------------------------------------------------------------------------


async def test_a_scrollbar_repaints_only_where_its_thumb_has_moved() -> None:
    class One(App[None]):
        CSS = "Plain { scrollbar-size-vertical: 1; }"

        def compose(self) -> ComposeResult:
            yield Plain(id="one")

    app = One()
    async with app.run_test(size=(20, 10)) as pilot:
        view = app.query_one(Plain)
        view.resize_content(Size(10, 10_000))
        await pilot.pause()
        bar = view.vertical_scrollbar
        assert isinstance(bar, QuietScrollBar)
        asked = paints(app.screen)
        try:
            view.scroll_to(y=3, animate=False)
            await pilot.pause()
            assert bar not in asked and view.scroll_offset.y == 3
            view.resize_content(Size(10, 10_001))  # for which Textual asks the bar for a repaint
            await pilot.pause()
            assert bar not in asked
            view.scroll_to(y=9_000, animate=False)
            await pilot.pause()
            assert bar in asked
        finally:
            app.screen.__dict__["_restore"]()


async def test_the_scrollbar_looks_as_the_stock_one_does() -> None:
    class Stock(Plain):
        vertical_scrollbar = ScrollView.vertical_scrollbar

    class Two(App[None]):
        CSS = "Plain, Stock { scrollbar-size-vertical: 1; height: 10; }"

        def compose(self) -> ComposeResult:
            yield Plain(id="one")
            yield Stock(id="two")

    app = Two()
    async with app.run_test(size=(20, 20)) as pilot:
        for y in (0, 3, 40, 67):
            for view in app.query(Plain):
                view.resize_content(Size(10, 77))
                view.scroll_to(y=y, animate=False)
            await pilot.pause()
            lines = [list(strip) for strip in app.screen._compositor.render_strips()]
            assert lines[:10] == lines[10:], y


# --- work that is begun at once --------------------------------------------------------------------------


async def test_work_is_begun_at_once_and_goes_on_in_a_task() -> None:
    done: list[str] = []
    gate: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    async def work() -> str:
        done.append("begun")
        done.append(await gate)
        await asyncio.sleep(0)
        return "result"

    rest = begin(work())
    assert rest is not None and done == ["begun"]
    task = asyncio.create_task(rest)
    gate.set_result("told")
    assert await task == "result" and done == ["begun", "told"]


async def test_work_that_waits_for_nothing_is_done_and_what_goes_wrong_is_raised() -> None:
    async def short() -> None:
        pass

    async def wrong() -> None:
        raise ValueError

    async def later() -> None:
        await asyncio.sleep(0)
        raise ValueError

    assert begin(short()) is None
    with pytest.raises(ValueError):
        begin(wrong())
    rest = begin(later())
    assert rest is not None
    with pytest.raises(ValueError):
        await rest


async def test_work_that_was_begun_can_be_cancelled() -> None:
    cleaned: list[bool] = []

    async def work() -> None:
        try:
            await asyncio.sleep(100)
        finally:
            cleaned.append(True)

    rest = begin(work())
    assert rest is not None
    task = asyncio.create_task(rest)
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert cleaned == [True]
