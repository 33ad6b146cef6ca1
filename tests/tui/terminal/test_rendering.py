"""Each detail of Textual that is not documented and that the console leans on. A new release fails here first.

`docs/decisions/0024` lists them, with what each is for.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from time import monotonic
from typing import Any

import pytest
from rich.segment import Segment
from textual import events
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual._xterm_parser import XTermParser
from textual.app import App, ComposeResult
from textual.driver import Driver
from textual.drivers.linux_driver import LinuxDriver
from textual.pilot import Pilot
from textual.screen import ModalScreen, Screen
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Input, Static

from rise_tui.rendering.terminal_app import TerminalApp
from rise_tui.rendering.terminal_driver import TerminalWriter
from rise_tui.screens.dialog import SingleDismissModal
from tests.patience import PATIENCE


async def until(pilot: Pilot[Any], holds: Callable[[], object]) -> None:
    end = monotonic() + PATIENCE
    while not holds():
        assert monotonic() < end
        await pilot.pause(0.01)


# --- what is private to Textual ---------------------------------------------------------------------------------------


def test_the_stock_driver_can_still_be_given_a_reader_and_a_writer() -> None:
    """What ours replaces, calls or hands over: without any of them no key comes, or a stalled terminal holds us up."""
    assert {"run_input_thread", "write", "start_application_mode", "stop_application_mode"} <= set(LinuxDriver.__dict__)
    assert {"_enable_mouse_support", "_disable_mouse_support"} <= set(LinuxDriver.__dict__)
    assert hasattr(Driver, "process_message")
    assert "WriterThread(self._file)" in inspect.getsource(LinuxDriver.start_application_mode)
    assert "self.exit_event" in inspect.getsource(LinuxDriver.run_input_thread)
    assert {"fileno", "exit_event", "_file"} <= set(LinuxDriver.__init__.__code__.co_names)


def test_the_parser_still_takes_characters_one_by_one_and_is_asked_for_what_was_not_completed() -> None:
    parser = XTermParser()
    assert [event.key for event in parser.feed("g")] == ["g"]  # type: ignore[attr-defined]
    assert list(parser.tick()) == []


async def test_whatever_is_painted_still_goes_through_display_as_one_of_two_updates() -> None:
    """Without this every frame would be written whole: 27 kB for a dialog, 47 kB for a change of focus."""
    shown: list[Any] = []

    class Watching(TerminalApp):
        def compose(self) -> ComposeResult:
            yield Static("before")

        def _display(self, screen: Any, renderable: Any) -> None:
            shown.append(renderable)
            super()._display(screen, renderable)

    app = Watching()
    async with app.run_test() as pilot:
        await pilot.pause()
        assert any(isinstance(each, LayoutUpdate) for each in shown)
        shown.clear()
        app.query_one(Static).update("after")
        await until(pilot, lambda: shown)
        assert all(isinstance(each, LayoutUpdate | ChopsUpdate) for each in shown)
        update = next(each for each in shown if isinstance(each, ChopsUpdate))
        assert {"chops", "spans", "chop_ends"} <= set(vars(update)), "what the difference is made from"
        assert app._batch_count == 0 and app._driver is not None, "which it asks for"


async def test_the_stock_modal_still_takes_away_what_is_below_it_when_it_is_dismissed_twice() -> None:
    """When it does not any more, `SingleDismissModal` can go."""

    class Stock(ModalScreen[None]):
        pass

    class Ours(SingleDismissModal[None]):
        pass

    for kind, left in ((Stock, 1), (Ours, 2)):
        app: App[None] = App()
        async with app.run_test() as pilot:
            await app.push_screen(Screen())
            dialog = kind()
            await app.push_screen(dialog)
            await pilot.pause()
            dialog.dismiss()
            dialog.dismiss()
            await pilot.pause()
            assert len(app.screen_stack) == left, kind


# --- a terminal that does not take what it is given -------------------------------------------------------------------


def writer() -> TerminalWriter:
    with open(os.devnull, "w") as file:  # noqa: PTH123
        return TerminalWriter(file)


@pytest.mark.parametrize("texts", [["x"] * 20, ["x" * 10_000]])
def test_a_terminal_that_takes_nothing_is_behind_until_it_has(texts: list[str]) -> None:
    one = writer()
    assert not one.is_behind
    for text in texts:
        one.count_queued(text)
    assert one.is_behind
    one.is_gone = True  # so that `write` takes it
    for text in texts:
        one.write(text)
    assert not one.is_behind


class Numbered(Widget):
    word = "old"

    def render_line(self, y: int) -> Strip:
        return Strip([Segment(f"{self.word}{y}".ljust(self.size.width, "."))], self.size.width)


async def test_frames_are_skipped_while_the_terminal_stalls_and_what_they_showed_is_painted_afterwards(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class One(TerminalApp):
        def compose(self) -> ComposeResult:
            yield Numbered()

    app = One()
    written: list[str] = []
    async with app.run_test(size=(40, 10)) as pilot:
        await pilot.pause()
        app._driver.terminal_writer = stalled = writer()  # type: ignore[union-attr]
        display = App._display

        def shows(self: App[Any], screen: Any, update: Any) -> None:
            written.append(update.render_segments(app.console))
            display(self, screen, None)

        monkeypatch.setattr(App, "_display", shows)
        stalled.count_queued("x" * 20_000)
        numbered = app.query_one(Numbered)
        numbered.word = "late"
        numbered.refresh()
        await until(pilot, lambda: app._catching_up is not None)
        assert written == []
        stalled.is_gone = True
        stalled.write("x" * 20_000)
        await until(pilot, lambda: "late9" in "".join(written))
        assert app._catching_up is None
        written.clear()
        app.screen.refresh()
        await until(pilot, lambda: written)
        assert not "".join(written), "nothing differs"
        app.repaint_everything()
        await until(pilot, lambda: "late9" in "".join(written))


# --- keys -------------------------------------------------------------------------------------------------------------


async def test_every_key_is_observed_once_also_those_that_a_text_field_takes() -> None:
    class Watching(TerminalApp):
        seen: list[str]

        def compose(self) -> ComposeResult:
            self.seen = []
            yield Input()

        def observe_key(self, event: events.Key, together: bool) -> None:
            self.seen.append(event.key)

        def admits(self, event: events.Event) -> bool:
            return not (isinstance(event, events.Key) and event.key == "n")

        def handle_key_first(self, event: events.Key) -> bool:
            return event.key == "x"

    app = Watching()
    async with app.run_test() as pilot:
        app.query_one(Input).focus()
        await pilot.press("a", "f9", "x", "n", "enter", "up")
        assert app.seen == ["a", "f9", "x", "n", "enter", "up"]
        assert app.query_one(Input).value == "a"


async def test_an_error_while_a_key_is_observed_ends_the_app_as_any_other() -> None:
    class Broken(TerminalApp):
        def observe_key(self, event: events.Key, together: bool) -> None:
            raise ValueError(event.key)

    app = Broken()
    with pytest.raises(ValueError, match="y"):
        async with app.run_test() as pilot:
            await pilot.pause()
            await pilot.press("y")
