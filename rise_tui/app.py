"""The app: starts and ends sessions, and knows the two keys that work everywhere. All else is in the screens."""

from __future__ import annotations

import _thread
import asyncio
import gc
import os
import signal
from contextlib import suppress
from time import sleep
from types import FrameType
from typing import Any, Literal

from textual import events, on

from rise_engine.link.client import Client, EngineGone
from rise_engine.scenario.model import Scenario
from rise_tui import themes
from rise_tui.actions import bindings
from rise_tui.choose import tilde
from rise_tui.launch import Launcher, settings_of
from rise_tui.notice import Notice
from rise_tui.quiet import KeyWatch, click_driver, outlet_of
from rise_tui.screens.console import ConsoleScreen
from rise_tui.screens.dialog import Answer, Dialog
from rise_tui.session import Session
from rise_tui.settings import Settings

END_SECONDS = 13.0
"""How long the engine may take before the console leaves without it: 6 s for the robot to stop, 5 s for the disk."""
GRACE_SECONDS = 3.0
"""How much longer a console that was told to end by a signal may live, whatever holds it up."""
DETACH_SECONDS = 2.0
"""How long saying goodbye to a session that goes on may take."""


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
        scenario: Scenario | None = None,
        settings: Settings | None = None,
        *,
        wizard: str = "wizard",
        theme: str = themes.DEFAULT,
        launcher: Launcher,
        client: Client | None = None,
        told: str = "",
    ) -> None:
        """Either with a `client` of a session that runs, or with what the launcher is to start.

        `told`: what there is to say about the session to begin with.
        """
        super().__init__(driver_class=click_driver())
        self.animation_level = "none"
        for known in themes.THEMES:
            self.register_theme(known)
        self.theme = themes.full_name(theme)
        self._launcher = launcher
        self._scenario, self._settings, self._wizard = scenario, settings, wizard
        self._client, self._told = client, told
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
        if self._client is not None:
            await self._enter(self._client)
        elif self._scenario is not None and self._settings is not None:
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
        """Start a session and attach to it."""
        try:
            client = await asyncio.to_thread(self._launcher.start, scenario, settings)
        except (EngineGone, ValueError) as error:
            self._not_begun(error)
            return
        self._settings = settings
        await self._enter(client)

    async def _enter(self, client: Client) -> None:
        try:
            session = await Session.attach(client, self._wizard)
        except (EngineGone, ValueError) as error:
            self._not_begun(error)
            return
        self._session = session
        if self._settings is None:
            self._settings = settings_of(session.store.hello)
        await self.push_screen(ConsoleScreen(session))
        self.call_after_refresh(_collect_again)
        if self._told:
            session.tell(Notice(self._told, "wait"))
            self._told = ""

    def _not_begun(self, error: Exception) -> None:
        self.last_words = f"the session could not {'start' if self._client is None else 'be reached'}: {error}"
        self.exit(return_code=1)

    @on(ConsoleScreen.SettingsAsked)
    def _settings_asked(self) -> None:
        if self._session is not None and self._settings is not None:
            hello = self._session.store.hello
            from rise_tui.screens.settings import SettingsScreen  # not needed to begin

            screen = SettingsScreen(self._settings, hello.scenario, hello.mode, hello.robot, self._launcher)
            self.push_screen(screen, self._settings_chosen)

    def _settings_chosen(self, chosen: tuple[Scenario, Settings] | None) -> None:
        if chosen is not None:
            self.run_worker(self._restart(*chosen), exclusive=True, group="restart")

    async def _restart(self, scenario: Scenario, settings: Settings) -> None:
        """End the running session, and only when that is certain start another one."""
        if self._session is None or not self._may_end(self._session):
            return
        closed = await self._close(self._session, end=True)
        if closed != "done":
            if closed == "late":
                self._session.tell(Notice("the session did not end in time: nothing new was started", "fault"))
            return
        while isinstance(self.screen, ConsoleScreen):
            await self.pop_screen()
        await self._begin(scenario, settings)

    def _may_end(self, session: Session) -> bool:
        """Ending needs control, which may have gone while the question was open."""
        if reason := session.store.cannot_act():
            session.tell(Notice(f"the session goes on: {reason}", "wait"))
        return not reason

    async def _close(self, session: Session, *, end: bool) -> Literal["done", "late", "refused"]:
        """`late`: the engine did not confirm it in time. `refused`: this console may not end the session."""
        try:
            await asyncio.wait_for(session.leave(end_session=end), END_SECONDS if end else DETACH_SECONDS)
        except EngineGone:
            return "done"
        except TimeoutError:
            return "late"
        except PermissionError as refused:  # control has gone in this very moment
            session.tell(Notice(f"the session goes on: {refused}", "wait"))
            return "refused"
        return "done"

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
        session = self._session
        if session is None or session.store.gone or session.store.hello.replay:
            await self._leave(0)
            return
        dialog = self._leaving(session)
        dialog.add_class("-quit")

        def answered(key: str | None) -> None:
            if key == "d" or (key == "e" and self._may_end(session)):
                self.run_worker(self._leave(0, end=key == "e"))

        self.push_screen(dialog, answered)

    def _leaving(self, session: Session) -> Dialog:
        """What can be done when leaving: a session can be ended only by who has control."""
        store = session.store
        why_not = store.cannot_act()
        if not self._launcher.outlives:  # an engine in this process ends with it
            said = ["The robot is stopped and the session ends. It cannot be continued."]
            return Dialog("End the session?", said, Answer("e", "End"), no="Stay")
        detach = ["Detach  the session goes on without this console;", "        rise-tui brings it back."]
        if why_not:
            said = [*detach, f"Ending the session needs control: {why_not}."]
            return Dialog("Leave?", said, Answer("d", "Detach"), no="Stay", first="d")
        said = [*detach, "End     the robot is stopped; it cannot be continued."]
        return Dialog("Leave?", said, Answer("d", "Detach"), Answer("e", "End the session"), no="Stay", first="d")

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
                _thread.start_new_thread(_end_at_last, (128 + number, self._patience))
        with suppress(RuntimeError):  # the loop has ended already
            loop.call_soon_threadsafe(self._signalled, number)

    @property
    def _patience(self) -> float:
        """Seconds that leaving may take after a signal."""
        return (DETACH_SECONDS if self._launcher.outlives else END_SECONDS) + GRACE_SECONDS

    def _signalled(self, number: signal.Signals) -> None:
        """The terminal has gone, or somebody ends the program: the session is not theirs to end."""
        if not self._ending:
            self.run_worker(self._leave(128 + number, by=number.name))

    async def _leave(self, code: int, *, end: bool = False, by: str = "") -> None:
        if self._ending:
            return
        self._ending = True
        if self._session is not None:
            end = end or not self._launcher.outlives
            closed = await self._close(self._session, end=end)
            if closed == "refused":
                self._ending = False
                return
            self.last_words = self._parting(self._session, end=end, in_time=closed == "done", by=by)
        self.exit(return_code=code)

    def _parting(self, session: Session, *, end: bool, in_time: bool, by: str) -> str:
        """What became of the session, in one line."""
        store = session.store
        if store.hello.replay:
            return ""
        title, lead = store.scenario.title, f"{by}: " if by else ""
        if store.gone and not store.over:
            again = f"rise-tui --config {tilde(store.scenario.folder)}"
            return f"{lead}the engine has gone; to recover the session: {again}"
        if end and not in_time:
            return f"{lead}{title} did not end within {END_SECONDS:g} s: look at the robot; rise-tui shows what runs"
        if end or store.over:
            kept = store.hello.folder
            return f"{lead}ended: the record is in {tilde(kept)}" if kept else f"{lead}ended: {title}"
        return f"{lead}detached: {title} goes on; come back with: rise-tui"


def _collect_again() -> None:
    """The console is painted: what was made so far stays, so the collector need not look at it (see `cli`)."""
    gc.freeze()
    gc.enable()


def _end_at_last(code: int, seconds: float) -> None:
    """Nothing keeps a console alive that nobody sees."""
    sleep(seconds)
    os._exit(code)
