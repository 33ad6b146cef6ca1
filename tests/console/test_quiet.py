"""Each detail of Textual that is not documented and that the console leans on. A new release fails here first."""

from __future__ import annotations

import asyncio
import gc
import os
import weakref
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from time import monotonic
from typing import Any

import pytest
from rich.segment import Segment
from textual import events
from textual._styles_cache import StylesCache
from textual.app import App, ComposeResult
from textual.geometry import Region, Size
from textual.messages import Update
from textual.pilot import Pilot
from textual.screen import Screen
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.quiet import (
    EmptyScreen,
    KeyWatch,
    Outlet,
    QuietApp,
    QuietModal,
    QuietScreen,
    QuietScrollView,
    Slices,
    begin,
    is_busy,
)
from rise_tui.quiet.compositor import RowCompositor
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


# --- painting that waits ---------------------------------------------------------------------------------


def outlet() -> Outlet:
    with open(os.devnull, "w") as file:  # noqa: PTH123
        return Outlet(file)


def test_painting_waits_for_a_key_but_not_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr("rise_tui.quiet.outlet.monotonic", lambda: now)
    one = outlet()
    assert one.key_wait() == 0
    one.key_read()
    assert one.key_wait() == pytest.approx(Outlet.KEY_SECONDS)
    now += Outlet.KEY_SECONDS + 0.001
    assert one.key_wait() == 0
    waited = []
    for _ in range(100):  # keys without end
        one.key_read()
        waited.append(one.key_wait())
        now += Outlet.KEY_SECONDS / 2
    assert waited[0] > 0 and 0 in waited


@pytest.mark.parametrize("texts", [["x"] * 20, ["x" * 10_000]])
def test_painting_waits_for_a_terminal_that_takes_nothing(texts: list[str]) -> None:
    one = outlet()
    assert one.stall_wait() == 0
    for text in texts:
        one.given(text)
    assert one.stall_wait() > 0
    one.hurry()
    assert one.stall_wait() == 0  # what is left is written, or given up, by the end
    one.calm()
    one.gone = True  # so that `write` takes it
    for text in texts:
        one.write(text)
    assert one.stall_wait() == 0


class Wired(QuietApp):
    """An app under Pilot that believes to have a terminal."""

    def compose(self) -> ComposeResult:
        yield Plain(id="one")
        yield Plain(id="two")


async def wired(app: QuietApp) -> Outlet:
    made = outlet()
    app._driver.outlet = made  # type: ignore[union-attr]
    return made


class Screenful(QuietScreen[None]):
    """Two lists above each other, and something that lies on the second."""

    CSS = """
    Screenful { layers: below above; }
    #above { layer: above; offset: 5 15; width: 10; height: 3; }
    """

    def compose(self) -> ComposeResult:
        yield Numbered(id="one")
        yield Numbered(id="two")
        yield Numbered(id="above")


class Numbered(Plain):
    DEFAULT_CSS = "Numbered { height: 12; }"

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.asked: list[int] = []
        self.word = id

    def render_line(self, y: int) -> Strip:
        self.asked.append(y)
        return Strip([Segment(f"{self.word}{y}".ljust(self.size.width, "."))], self.size.width)


@asynccontextmanager
async def screenful() -> AsyncIterator[tuple[Screenful, Pilot[Any]]]:
    app = Wired()
    async with app.run_test(size=(80, 24)) as pilot:
        screen = Screenful()
        await app.push_screen(screen)
        await pilot.pause()
        yield screen, pilot


def displayed(app: QuietApp, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is written from now on."""
    written: list[str] = []
    monkeypatch.setattr(App, "_display", lambda self, screen, what: written.append(what.render_segments(app.console)))
    return written


def painted_by(screen: QuietScreen[None]) -> list[str]:
    """What a terminal shows after each piece has been written."""
    lines = [[" "] * 80 for _ in range(24)]

    def put(x: int, y: int, strip: Strip) -> None:
        lines[y][x : x + strip.cell_length] = strip.text

    compositor = screen._compositor
    assert isinstance(compositor, RowCompositor)
    while compositor.has_more:
        compositor.paint_piece(2, [], put)
    return ["".join(line) for line in lines]


async def test_pieces_show_the_same_as_a_whole_frame_of_the_stock_compositor() -> None:
    async with screenful() as (screen, _):
        stock = [strip.text for strip in screen._compositor.render_strips()]
        screen._compositor._dirty_regions.add(screen.size.region)
        assert painted_by(screen) == stock
        assert "above0" in stock[15]


async def test_a_piece_asks_for_its_rows_only_and_every_piece_has_its_turn() -> None:
    async with screenful() as (screen, _):
        one, two = screen.query_one("#one", Numbered), screen.query_one("#two", Numbered)
        compositor = screen._compositor
        assert isinstance(compositor, RowCompositor)
        for widget in (one, two):
            widget._styles_cache.clear()
            widget.asked.clear()
        dirty = {Region(0, 0, 80, 3), Region(0, 20, 80, 1)}
        compositor._dirty_regions |= dirty
        rows: list[int] = []
        for _ in range(3):
            compositor._dirty_regions.add(Region(0, 0, 80, 1))  # changes all the time
            compositor.paint_piece(2, [], lambda x, y, strip: rows.append(y))
        assert rows == [0, 1, 2, 20] and set(one.asked) == {0, 1, 2} and two.asked == [8]
        assert compositor.has_more


async def test_a_look_that_changes_between_two_pieces_is_in_the_second() -> None:
    """What is looked up once for the pieces of a frame is looked up again when something else becomes due."""
    async with screenful() as (screen, _):
        one, compositor = screen.query_one("#one", Numbered), screen._compositor
        assert isinstance(compositor, RowCompositor)
        begins: dict[int, str] = {}

        def put(x: int, y: int, strip: Strip) -> None:
            begins.setdefault(y, strip.text[:3])

        compositor._dirty_regions.add(Region(0, 0, 80, 4))
        one._styles_cache.clear()
        compositor.paint_piece(2, [], put)
        one.styles.padding = (0, 0, 0, 3)
        compositor.update_widgets({one})
        while compositor.has_more:
            compositor.paint_piece(2, [], put)
        assert [begins[y] for y in range(4)] == ["one", "one", "   ", "   "]


@pytest.mark.parametrize("again", ["reflow", "reflow_visible"])
async def test_a_size_that_changes_between_two_pieces_is_looked_up_again(again: str) -> None:
    async with screenful() as (screen, _):
        compositor = screen._compositor
        assert isinstance(compositor, RowCompositor)
        compositor._dirty_regions.add(screen.size.region)
        compositor.paint_piece(2, [], lambda x, y, strip: None)
        assert compositor._painters
        getattr(compositor, again)(screen, screen.size)
        assert not compositor._painters


async def test_whoever_paints_in_a_way_of_its_own_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    async with screenful() as (screen, _):
        own = Strip([Segment("own".ljust(80))], 80)
        monkeypatch.setattr(Numbered, "render_lines", lambda self, crop: [own.crop(0, crop.width)] * crop.height)
        screen._compositor._dirty_regions.add(Region(0, 0, 80, 2))
        assert [line[:3] for line in painted_by(screen)[:3]] == ["own", "own", "   "]


async def test_in_the_midst_of_a_batch_no_frame_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    async with screenful() as (screen, pilot):
        app = screen.app
        assert isinstance(app, Wired)
        await wired(app)
        written = displayed(app, monkeypatch)
        one = screen.query_one("#one", Numbered)
        with app.batch_update():
            one.word = "new"
            one.refresh()
            one.asked.clear()
            screen._refresh_layout()  # as when a screen appears
            for _ in range(5):
                await pilot.pause(0.01)
            assert not written and not app._prepared and not one.asked
        await until(pilot, lambda: written)
        assert all(f"new{y}" in "".join(written) for y in range(12))


async def test_the_screen_below_the_console_is_painted_only_when_that_has_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []

    class Below(Wired):
        def get_default_screen(self) -> Screen[Any]:
            return EmptyScreen(id="_default")

        def _display(self, screen: Screen[Any], renderable: Any) -> None:
            shown.append(type(screen).__name__)

    app = Below()
    async with app.run_test() as pilot:
        await pilot.pause()
        assert shown == []
        await app.push_screen(Screenful())
        await until(pilot, lambda: "Screenful" in shown)
        assert "EmptyScreen" not in shown
        await app.pop_screen()
        await until(pilot, lambda: "EmptyScreen" in shown)


async def test_painting_gives_way_to_a_key_between_two_pieces_and_is_written_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with screenful() as (screen, pilot):
        app = screen.app
        assert isinstance(app, Wired)
        made = await wired(app)
        written = displayed(app, monkeypatch)
        one = screen.query_one("#one", Numbered)
        one.word = "new"
        one.refresh()
        made.key_read()
        screen._on_timer_update()
        assert not written and not app._prepared  # a key goes first
        await until(pilot, lambda: written)
        assert len(written) == 1 and all(f"new{y}" in written[0] for y in range(12))


async def test_nothing_is_painted_while_the_terminal_stalls_and_everything_afterwards(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with screenful() as (screen, pilot):
        app = screen.app
        assert isinstance(app, Wired)
        made = await wired(app)
        written = displayed(app, monkeypatch)
        made.given("x" * 20_000)
        screen.query_one("#one", Numbered).word = "late"
        screen.query_one("#one").refresh()
        screen.refresh(layout=True)
        for _ in range(5):
            await pilot.pause(0.02)
        assert written == []
        made.gone = True
        made.write("x" * 20_000)
        await until(pilot, lambda: "late11" in "".join(written))


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


async def until(pilot: Pilot[Any], holds: Callable[[], object]) -> None:
    end = monotonic() + 20
    while not holds():
        assert monotonic() < end
        await pilot.pause(0.01)


async def test_jobs_in_slices_give_way_and_are_all_done() -> None:
    app = Wired()
    async with app.run_test():
        done: list[int] = []
        slices = Slices(app)
        slices.do([lambda n=n: done.append(n) for n in range(3)])  # type: ignore[misc]
        assert done == [0, 1, 2]  # without a terminal, at once
        made = await wired(app)
        made.key_read()
        slices.do([lambda: done.append(3)])
        assert done == [0, 1, 2] and slices.busy  # a key goes first
        end = monotonic() + 20
        while slices.busy:
            assert monotonic() < end
            await asyncio.sleep(0.005)
        assert done == [0, 1, 2, 3]


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
