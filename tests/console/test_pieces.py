"""Painting in pieces, and what it waits for: a key on its way, a terminal that takes nothing, a turn of the loop."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from time import monotonic
from typing import Any

import pytest
from rich.segment import Segment
from textual.app import App, ComposeResult
from textual.geometry import Region
from textual.pilot import Pilot
from textual.screen import Screen
from textual.strip import Strip

from rise_tui.quiet import EmptyScreen, Outlet, QuietApp, QuietScreen, Slices
from rise_tui.quiet.compositor import RowCompositor
from rise_tui.quiet.slices import SLICE
from tests.console.test_quiet import Plain


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


@asynccontextmanager
async def on_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> AsyncIterator[tuple[Screenful, Pilot[Any], Outlet, list[str]]]:
    """The screen, its terminal, and what is written to it from now on."""
    async with screenful() as (screen, pilot):
        app = screen.app
        assert isinstance(app, Wired)
        yield screen, pilot, await wired(app), displayed(app, monkeypatch)


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
    async with on_terminal(monkeypatch) as (screen, pilot, made, written):
        one = screen.query_one("#one", Numbered)
        one.word = "new"
        one.refresh()
        made.key_read()
        screen._on_timer_update()
        assert isinstance(screen.app, Wired) and not written and not screen.app._prepared  # a key goes first
        await until(pilot, lambda: written)
        assert len(written) == 1 and all(f"new{y}" in written[0] for y in range(12))


async def test_nothing_is_painted_while_the_terminal_stalls_and_everything_afterwards(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with on_terminal(monkeypatch) as (screen, pilot, made, written):
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


class Clock:
    """Stands still but for what is done."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


async def test_what_would_take_too_long_waits_for_the_next_slice(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr("rise_tui.quiet.slices.perf_counter", clock)
    app = Wired()
    async with app.run_test():
        await wired(app)
        done: list[float] = []

        def job(share: float) -> Callable[[], None]:
            def do() -> None:
                clock.now += share * SLICE
                done.append(share)

            return do

        slices = Slices(app)
        slices.do([job(0.1), job(0.2), job(0.4), job(0.7), job(0.7)])
        assert done == []  # whoever asks for it goes on first
        turns = []
        while slices.busy:
            await asyncio.sleep(0)
            turns.append(len(done))
        assert turns == [3, 4, 5]


async def test_a_row_that_would_take_too_long_waits_for_the_next_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    monkeypatch.setattr("rise_tui.quiet.screens.perf_counter", clock)
    async with on_terminal(monkeypatch) as (screen, pilot, made, written):
        paint, rows = RowCompositor.paint_piece, []

        def slow(self: RowCompositor, *arguments: Any) -> None:
            rows.append(at[0])
            clock.now += 0.6 * SLICE
            paint(self, *arguments)

        at = [0]
        turn = screen._paint

        def paint_turn(app: QuietApp, outlet: Outlet) -> None:
            at[0] += 1
            turn(app, outlet)

        monkeypatch.setattr(RowCompositor, "paint_piece", slow)
        monkeypatch.setattr(screen, "_paint", paint_turn)
        screen.query_one("#one", Numbered).refresh()
        await until(pilot, lambda: written)
        assert made.key_wait() == 0 and len(rows) == 12 and len(set(rows)) == 12  # one in each turn
