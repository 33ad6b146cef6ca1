"""The app: starts and ends sessions, and knows the two keys that work everywhere. All else is in the screens."""

from __future__ import annotations

import _thread
import asyncio
import os
import signal
from contextlib import suppress
from time import sleep
from types import FrameType
from typing import Any

from textual import events, on

from rise_engine.link.client import Client, EngineGone
from rise_engine.scenario.model import Scenario
from rise_tui import themes
from rise_tui.actions import bindings
from rise_tui.launch import Launcher, Settings
from rise_tui.quiet import KeyWatch, click_driver, outlet_of
from rise_tui.screens.console import ConsoleScreen
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.settings import SettingsScreen
from rise_tui.session import Session

END_SECONDS = 10.0
"""How long the engine may take to stop the robot and end before the console leaves without it."""
GRACE_SECONDS = 3.0
"""How much longer a console that was told to end by a signal may live, whatever holds it up."""


class ConsoleApp(KeyWatch):
    """The wizard's console."""

    TITLE = "RISE"
    ENABLE_COMMAND_PALETTE = False  # ours is an action of the registry
    ALLOW_SELECT = False
    BINDINGS = bindings("everywhere")
    CSS = """
    CommandPalette { background: transparent; }
    CommandPalette > Vertical { margin-top: 4; background: $panel; }
    CommandPalette #--input { border: none; background: $panel; }
    CommandPalette #--input Label { margin: 0 0 0 1; }
    CommandPalette CommandInput, CommandPalette CommandInput:focus { height: 1; border: none; background: $panel; }
    """

    def __init__(
        self,
        scenario: Scenario,
        settings: Settings,
        *,
        wizard: str = "wizard",
        theme: str = themes.DEFAULT,
        launcher: Launcher | None = None,
    ) -> None:
        super().__init__(driver_class=click_driver())
        self.animation_level = "none"
        for known in themes.THEMES:
            self.register_theme(known)
        self.theme = themes.full_name(theme)
        self._launcher = launcher or Launcher()
        self._scenario, self._settings, self._wizard = scenario, settings, wizard
        self._session: Session | None = None
        self._ending = False
        self._signal: signal.Signals | None = None
        self._handlers: dict[signal.Signals, Any] = {}
        self.last_words = ""
        """What the terminal should show after the console has gone."""

    def get_theme_variable_defaults(self) -> dict[str, str]:
        return themes.DARK.variables

    async def on_mount(self) -> None:
        loop = asyncio.get_running_loop()

        def arrived(number: int, frame: FrameType | None) -> None:
            self._signal_arrived(loop, signal.Signals(number))

        for number in (signal.SIGHUP, signal.SIGTERM):
            with suppress(ValueError):  # not the main thread
                self._handlers[number] = signal.signal(number, arrived)
        if (outlet := outlet_of(self)) is not None:
            outlet.lost = lambda: self._signal_arrived(loop, signal.SIGHUP)
        await self._begin(self._scenario, self._settings)

    def on_unmount(self) -> None:
        if self._signal is None:  # else they stay: a second signal must not cut the end short
            for number, before in self._handlers.items():
                signal.signal(number, before)

    @property
    def terminal_gone(self) -> bool:
        """Whether nothing more can be said there."""
        outlet = outlet_of(self)
        return outlet is not None and outlet.gone

    @property
    def console_screen(self) -> ConsoleScreen | None:
        """The console's screen, also when a dialog is open above it."""
        return next((screen for screen in self.screen_stack if isinstance(screen, ConsoleScreen)), None)

    # --- sessions ---------------------------------------------------------------------------------------------------

    async def _begin(self, scenario: Scenario, settings: Settings) -> None:
        try:
            client: Client = self._launcher.start(scenario, settings)
            session = await Session.attach(client, self._wizard)
        except (EngineGone, ValueError) as error:
            self.last_words = f"the session could not start: {error}"
            self.exit(return_code=1)
            return
        self._scenario, self._settings, self._session = scenario, settings, session
        await self.push_screen(ConsoleScreen(session))

    @on(ConsoleScreen.SettingsAsked)
    def _settings_asked(self) -> None:
        if self._session is not None:
            hello = self._session.store.hello
            screen = SettingsScreen(self._settings, hello.scenario, hello.mode, hello.robot, self._launcher)
            self.push_screen(screen, self._settings_chosen)

    def _settings_chosen(self, chosen: tuple[Scenario, Settings] | None) -> None:
        if chosen is not None:
            self.run_worker(self._restart(*chosen), exclusive=True, group="restart")

    async def _restart(self, scenario: Scenario, settings: Settings) -> None:
        await self._end_session()
        while isinstance(self.screen, ConsoleScreen):
            await self.pop_screen()
        await self._begin(scenario, settings)

    async def _end_session(self) -> None:
        if self._session is not None:
            with suppress(EngineGone, TimeoutError):
                await asyncio.wait_for(self._session.end(), END_SECONDS)

    # --- keys and actions that work everywhere ----------------------------------------------------------------------

    def key_arrived(self, event: events.Key) -> None:
        if (console := self.console_screen) is not None:
            console.key_seen(event)

    def action_do(self, action: str) -> None:
        console = self.console_screen
        if action == "stop" and console is not None:
            console.stop_all()
        elif action == "quit":
            self.run_worker(self.action_quit())

    async def action_quit(self) -> None:
        if isinstance(self.screen, Dialog) and self.screen.has_class("-quit"):
            return
        if self._session is None or self._session.store.gone:
            await self._leave(0)
            return
        said = ["The robot is stopped and the session ends. It cannot be continued."]
        dialog = Dialog("End the session?", said, yes="End", key="e", no="Stay")
        dialog.add_class("-quit")

        def answered(yes: bool | None) -> None:
            if yes:
                self.run_worker(self._leave(0))

        self.push_screen(dialog, answered)

    @on(ConsoleScreen.ThemeAsked)
    def _next_theme(self) -> None:
        names = [theme.name for theme in themes.THEMES]
        at = names.index(self.theme) if self.theme in names else -1
        self.theme = names[(at + 1) % len(names)]

    # --- the end ------------------------------------------------------------------------------------------------------

    def _signal_arrived(self, loop: asyncio.AbstractEventLoop, number: signal.Signals) -> None:
        """In the signal handler itself and not on the loop, which may be blocked by a terminal that takes nothing."""
        if (outlet := outlet_of(self)) is not None:
            outlet.hurry()
        if self._signal is None:
            self._signal = number
            with suppress(RuntimeError):  # the interpreter ends already
                # Takes no lock, as threading would: the handler may have interrupted whoever holds it.
                _thread.start_new_thread(_end_at_last, (128 + number,))
        with suppress(RuntimeError):  # the loop has ended already
            loop.call_soon_threadsafe(self._signalled, number)

    def _signalled(self, number: signal.Signals) -> None:
        """The terminal has gone, or somebody ends the program: in order, not at once."""
        if self._ending:
            return
        self.last_words = f"ended by {number.name}"
        self.run_worker(self._leave(128 + number))

    async def _leave(self, code: int) -> None:
        if self._ending:
            return
        self._ending = True
        await self._end_session()
        self.exit(return_code=code)


def _end_at_last(code: int) -> None:
    """Nothing keeps a console alive that nobody sees."""
    sleep(END_SECONDS + GRACE_SECONDS)
    os._exit(code)
