"""Opens what helps to find one's way over the console: help, palette, themes, jump mode, the tour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from textual.geometry import Region

from rise_tui.rendering.terminal_app import TerminalApp
from rise_tui.screens.arrangement import too_small

if TYPE_CHECKING:
    from rise_tui.commands import Command
    from rise_tui.screens.console import ConsoleScreen

# What is opened here is imported when it is opened: none of it is needed to begin.


def open_help(console: ConsoleScreen) -> None:
    from rise_tui.screens.help import HelpScreen

    pane = console.panes.focused()
    console.app.push_screen(HelpScreen(console.session.store, pane.PLACE if pane is not None else None))


def open_palette(console: ConsoleScreen) -> None:
    """Everything that can be done, with the focused pane's actions first."""
    from rise_tui.commands import commands, theme_commands

    pane = console.panes.focused()
    place = pane.PLACE if pane is not None else None
    found = list(commands(console.session.store, place, console.action_do, console.start))
    found += theme_commands(partial(_use_theme, console))
    _open_palette(console, found, "command, act, rule, event or theme")


def choose_theme(console: ConsoleScreen) -> None:
    """The palette with the themes alone."""
    from rise_tui.commands import theme_commands

    _open_palette(console, list(theme_commands(partial(_use_theme, console))), "theme")


def _open_palette(console: ConsoleScreen, found: Sequence[Command], placeholder: str) -> None:
    from rise_tui.screens.palette import Palette

    def chosen(number: str | None) -> None:
        if not number:
            return
        command = found[int(number)]
        if command.why_not:
            console.say(f"{command.title}: not now, {command.why_not}")
        else:
            command.run()

    console.app.push_screen(Palette(found, placeholder=placeholder), chosen)


def _use_theme(console: ConsoleScreen, name: str) -> None:
    console.app.theme = name


def jump(console: ConsoleScreen) -> None:
    from rise_tui.screens.jump import JumpScreen

    def go(name: str | None) -> None:
        if name:
            console.panes.go_to(name)

    console.app.push_screen(JumpScreen(console.panes, console.hints.region), go)


def start_tour(console: ConsoleScreen, seen: Callable[[], None] | None = None) -> None:
    """`seen` is called when it has ended, however it ends."""
    from rise_tui.screens.tour import TourScreen

    def ended(_: None) -> None:
        if seen is not None:
            seen()

    console.panes.unzoom()
    screen = TourScreen(partial(_part, console), lambda: console.panes.region)
    console.app.push_screen(screen, ended)


def offer_tour(console: ConsoleScreen, seen: Callable[[], None]) -> None:
    """On a first run: only where it disturbs nobody."""
    from rise_tui.screens.tour import offered

    if offered(console.session.store):
        start_tour(console, seen)


def redraw(console: ConsoleScreen) -> None:
    if isinstance(console.app, TerminalApp):
        console.app.repaint_everything()


def watch_size(console: ConsoleScreen) -> None:
    """Say what is needed when the window has become too small for a console."""
    if too_small(*console.app.size):
        from rise_tui.screens.small import SmallScreen

        if not any(isinstance(screen, SmallScreen) for screen in console.app.screen_stack):
            console.app.push_screen(SmallScreen(console.session.store))


def _part(console: ConsoleScreen, name: str) -> Region:
    """Where something stands that the tour points at."""
    panes = console.panes
    if name == "status":
        return console.status.region
    if name == "acts":
        return panes.panes["acts"].region
    if name == "watching":
        return next((pane.region for pane in panes.shown() if pane.PLACE not in ("acts", "rules")), panes.region)
    hints = console.hints.region
    return hints if name == "stop" else Region(hints.x + hints.width // 3, hints.y, 2 * hints.width // 3, hints.height)
