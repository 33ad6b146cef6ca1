"""The app: starts and ends sessions, and knows the two keys that work everywhere. All else is in the screens."""

from __future__ import annotations

import asyncio
import signal
from contextlib import suppress

from textual import events, on

from rise_engine.link.client import Client, EngineGone
from rise_engine.scenario.model import Scenario
from rise_tui import themes
from rise_tui.actions import bindings
from rise_tui.launch import Launcher, Settings
from rise_tui.quiet import KeyWatch, click_driver
from rise_tui.screens.console import ConsoleScreen
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.settings import SettingsScreen
from rise_tui.session import Session

END_SECONDS = 10.0
"""How long the engine may take to stop the robot and end before the console leaves without it."""


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
        self.last_words = ""
        """What the terminal should show after the console has gone."""

    def get_theme_variable_defaults(self) -> dict[str, str]:
        return themes.DARK.variables

    async def on_mount(self) -> None:
        loop = asyncio.get_running_loop()
        for number in (signal.SIGHUP, signal.SIGTERM):
            with suppress(NotImplementedError, ValueError, RuntimeError):  # not the main thread, or no such signals
                loop.add_signal_handler(number, self._signalled, number)
        await self._begin(self._scenario, self._settings)

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

    def _signalled(self, number: signal.Signals) -> None:
        """The terminal has gone, or somebody ends the program: in order, not at once."""
        self.last_words = f"ended by {number.name}"
        self.run_worker(self._leave(128 + number))

    async def _leave(self, code: int) -> None:
        if self._ending:
            return
        self._ending = True
        await self._end_session()
        self.exit(return_code=code)
