"""The app: starts and ends sessions, and knows the two keys that work everywhere. All else is in the screens."""

from __future__ import annotations

import asyncio
import signal
from contextlib import suppress
from types import FrameType
from typing import Any, Literal

from textual import events, on

from rise_engine.link.client import Client, EndRefused, EngineGone
from rise_engine.link.places import PlaceError
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.study import condition_problem
from rise_tui import themes
from rise_tui.actions import bindings, use_keys, why_blocked
from rise_tui.model.notice import Notice
from rise_tui.rendering.terminal_app import TerminalApp
from rise_tui.screens.console import ConsoleScreen
from rise_tui.screens.ending import question_of_end
from rise_tui.screens.settings import SettingsScreen
from rise_tui.session import Session
from rise_tui.start import leaving
from rise_tui.start.keeper import PERIOD, Keeper, write
from rise_tui.start.keymap import KeyFile, for_textual, refusal
from rise_tui.start.launch import Launcher, settings_of
from rise_tui.start.settings import Settings

END_SECONDS = 13.0
"""How long the engine may take before the console leaves without it: 6 s for the robot to stop, 5 s for the disk."""
DETACH_SECONDS = 2.0
"""How long saying goodbye to a session that goes on may take."""


class ConsoleApp(TerminalApp):
    """The wizard's console."""

    TITLE = "RISE"
    ENABLE_COMMAND_PALETTE = False  # ours is an action of the registry
    ALLOW_SELECT = False
    BINDINGS = bindings("everywhere")
    CSS = themes.CSS

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
        keys: KeyFile | None = None,
        keeper: Keeper | None = None,
        in_browser: bool = False,
    ) -> None:
        """Either with a `client` of a session that runs, or with what the launcher is to start.

        `told`: what there is to say about the session to begin with. Without a `keeper` nothing is restored or kept.
        """
        super().__init__()
        self.animation_level = "none"
        for known in themes.THEMES:
            self.register_theme(known)
        self.theme = themes.full_name(theme)
        self._launcher = launcher
        self._scenario, self._settings, self._wizard = scenario, settings, wizard
        self._client, self._told = client, told
        self._keys, self._keeper, self._in_browser = keys or KeyFile(), keeper, in_browser
        use_keys(self._keys.own)
        self.set_keymap(for_textual(self._keys))
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
        if self.terminal_writer is not None:
            self.terminal_writer.on_gone = lambda: self._signal_arrived(loop, signal.SIGHUP)
        self.set_interval(PERIOD, self._keep)
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
        return self.terminal_writer is not None and self.terminal_writer.is_gone

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
            session = await Session.attach(client, self._wizard, in_browser=self._in_browser)
        except (EngineGone, ValueError) as error:
            self._not_begun(error)
            return
        if clashes := self._keys.clashes(session.store.scenario.keys):
            await session.leave(end_session=False)
            self.last_words = "\n".join((*map(str, clashes), refusal(self._keys.path)))
            self.exit(return_code=2)
            return
        self._session = session
        if self._settings is None:
            self._settings = settings_of(session.store.hello)
        screen = ConsoleScreen(session)
        await self.push_screen(screen)
        told = self._keeper.restore(screen, themes.short_name(self.theme)) if self._keeper is not None else ""
        if told or self._told:
            session.tell(Notice(self._told or told, "wait"))
            self._told = ""
        if self._keeper is not None and self._keeper.tour_is_due:
            self.call_after_refresh(screen.offer_tour, self._tour_seen)

    def _tour_seen(self) -> None:
        if self._keeper is not None:
            self.run_worker(asyncio.to_thread(write, self._keeper.tour_seen()), group="keep")

    def _keep(self, *, at_once: bool = False) -> None:
        """What has changed on the screen is written, beside the loop: a disk may be slow."""
        console = self.console_screen
        if self._keeper is None or console is None:
            return
        if changed := self._keeper.look(console, themes.short_name(self.theme)):
            if at_once:
                write(changed)
            else:
                self.run_worker(asyncio.to_thread(write, changed), group="keep")

    def _not_begun(self, error: Exception) -> None:
        self.last_words = f"the session could not {'start' if self._client is None else 'be reached'}: {error}"
        self.exit(return_code=1)

    @on(ConsoleScreen.SettingsAsked)
    def _settings_asked(self) -> None:
        if self._session is not None and self._settings is not None:
            screen = SettingsScreen(self._settings, self._session.store, self._launcher)
            self.push_screen(screen, self._settings_chosen)

    def _settings_chosen(self, chosen: tuple[Scenario, Settings] | None) -> None:
        if chosen is not None:
            self.run_worker(self._restart(*chosen), exclusive=True, group="restart")

    async def _restart(self, scenario: Scenario, settings: Settings) -> None:
        """End the running session, and only when that is certain start another one."""
        if self._session is None or not self._may_end(self._session):
            return
        if clashes := self._keys.clashes(scenario.keys):
            self._session.tell(Notice(f"the session goes on, because of your key file: {clashes[0]}", "fault"))
            return
        if problem := condition_problem(scenario, settings.condition):
            self._session.tell(Notice(f"the session goes on: {problem}", "fault"))
            return
        closed = await self._close(self._session, end=True)
        if closed != "done":
            if closed == "late":
                self._session.tell(Notice("the session did not end in time: nothing new was started", "fault"))
            return
        await self._take_away()
        await self._begin(scenario, settings)

    async def _take_away(self) -> None:
        """The screen of the session that was, and whatever has been opened above it meanwhile."""
        while self.console_screen is not None:
            await self.pop_screen()

    def _recoverable(self, session: Session) -> bool:
        store = session.store
        return bool(store.gone and not store.over and store.hello.folder and self._launcher.recover)

    async def _recover(self, session: Session) -> None:
        """Start the engine of this session again and attach to it."""
        recover = self._launcher.recover
        if recover is None:
            return
        session.tell(Notice("the session is being recovered", "wait"))
        loop = asyncio.get_running_loop()

        def tell(sentence: str) -> None:
            with suppress(RuntimeError):  # the console has left meanwhile
                loop.call_soon_threadsafe(session.tell, Notice(sentence, "wait"))

        try:
            recovered = await asyncio.to_thread(recover, session.store.hello, tell)
        except (EngineGone, PlaceError) as error:
            session.tell(Notice(f"it is not recovered: {error}", "fault"))
            return
        await self._close(session, end=False)
        await self._take_away()
        self._told = recovered.told
        await self._enter(recovered.client)

    def _may_end(self, session: Session) -> bool:
        """Ending needs control, which may have gone while the question was open."""
        if reason := why_blocked(session.store, "change"):
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
        except EndRefused as refused:  # control has gone in this very moment
            session.tell(Notice(f"the session goes on: {refused}", "wait"))
            return "refused"
        return "done"

    # --- keys and actions that work everywhere ----------------------------------------------------------------------

    def observe_key(self, event: events.Key, together: bool | None) -> None:
        if (console := self.console_screen) is not None:
            console.observe_key(event, together)

    def admits(self, event: events.Event) -> bool:
        return (console := self.console_screen) is None or console.admits(event)

    def handle_key_first(self, event: events.Key) -> bool:
        return (console := self.console_screen) is not None and console.handle_key_first(event)

    def action_do(self, action: str) -> None:
        console = self.console_screen
        if action == "stop" and console is not None:
            console.stop_all()
        elif action == "lock" and console is not None:
            console.action_do(action)
        elif action == "quit":
            self.run_worker(self.action_quit())

    async def action_quit(self) -> None:
        if self.screen.has_class("-quit"):
            return
        session = self._session
        recoverable = session is not None and self._recoverable(session)
        if session is None or session.store.hello.replay or (session.store.gone and not recoverable):
            await self._leave(0)
            return
        dialog = leaving.question_of_gone(session.store) if recoverable else leaving.question(session.store)
        dialog.add_class("-quit")

        def answered(key: str | None) -> None:
            if key == "r":
                self.run_worker(self._recover(session), exclusive=True, group="restart")
            elif key in ("d", "l"):
                self.run_worker(self._leave(0))
            elif key == leaving.END_KEY:
                self._ask_to_end(session)

        self.push_screen(dialog, answered)

    def _ask_to_end(self, session: Session) -> None:
        question = question_of_end(session.store)
        question.add_class("-quit")

        def answered(yes: bool | None) -> None:
            if yes and self._may_end(session):
                self.run_worker(self._leave(0, end=True))

        self.push_screen(question, answered)

    # --- the end ------------------------------------------------------------------------------------------------------

    def _signal_arrived(self, loop: asyncio.AbstractEventLoop, number: signal.Signals) -> None:
        """In the signal handler itself, or on the writer's thread."""
        if self.terminal_writer is not None:
            self.terminal_writer.hurry()
        self._signal = self._signal or number
        with suppress(RuntimeError):  # the loop has ended already
            loop.call_soon_threadsafe(self._signalled, number)

    def _signalled(self, number: signal.Signals) -> None:
        """The terminal has gone, or somebody ends the program: the session is not theirs to end."""
        if not self._ending:
            self.run_worker(self._leave(128 + number, by=number.name))

    async def _leave(self, code: int, *, end: bool = False, by: str = "") -> None:
        if self._ending:
            return
        self._ending = True
        if self._session is not None:
            closed = await self._close(self._session, end=end)
            if closed == "refused":
                self._ending = False
                return
            self.last_words = leaving.last_words(
                self._session.store, end=end, in_time=closed == "done", patience=END_SECONDS, by=by
            )
        self._keep(at_once=True)
        self.exit(return_code=code)
