"""The app: starts and ends sessions, and handles the two keys that work everywhere. The screens do the rest."""

from __future__ import annotations

import asyncio
import signal
from contextlib import suppress
from pathlib import Path
from time import monotonic
from types import FrameType
from typing import Any, Literal

from textual import events, on
from textual.await_complete import AwaitComplete

from rise_engine.base.errors import StudyError
from rise_engine.base.exit_status import NOT_WRITTEN, STILL_RUNNING
from rise_engine.kernel.records import open_goals_warning
from rise_engine.run.protocol.client import Client, EngineGone, Rejected
from rise_engine.run.protocol.registry import RegistryError
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import start_problems
from rise_engine.scenario.model import Scenario
from rise_tui.config.key_file import KeyFile, how_to_fix
from rise_tui.config.launch import Launcher, StudySource, settings_of_session
from rise_tui.config.preferences import Preferences
from rise_tui.console import overlays, questions
from rise_tui.console.input import EARLY_ENTER, EnterGuard
from rise_tui.console.layout import SAVE_SECONDS, UiState, save_all
from rise_tui.console.screen import ConsoleScreen
from rise_tui.console.session import ConsoleSession
from rise_tui.console.study_dialogs import StudyDay
from rise_tui.console.study_screen import StudyScreen
from rise_tui.key_labels import why_blocked
from rise_tui.model.alarms import unrecorded_end_text
from rise_tui.model.notice import Notice
from rise_tui.rendering import themes
from rise_tui.rise_app import RiseApp, is_editing, takes_text
from rise_tui.screens.reading import ReportScreen
from rise_tui.screens.session_forms import end_session_dialog
from rise_tui.screens.settings import SettingsScreen

ALWAYS_ADMITTED = frozenset({"f9", "ctrl+g", "ctrl+c"})
"""Keys that count even in one piece with other keys."""
DETACH_PATIENCE = 2.0
"""Seconds for detaching from a session that continues."""


class ConsoleApp(RiseApp):
    """The wizard's console."""

    def __init__(
        self,
        client: Client | None,
        *,
        launcher: Launcher,
        study: StudySource | None = None,
        settings: SessionOptions | None = None,
        wizard: str = "wizard",
        login: str = "",
        participant: str = "",
        theme: str = themes.DEFAULT,
        notice: str = "",
        keys: KeyFile | None = None,
        ui_state: UiState | None = None,
    ) -> None:
        """`client`: a running session; None: the screen of `study` opens. `launcher`: starts another session, or this
        one's engine again.

        `wizard`: the wizard's name. With a study it may be empty; then the console asks for it and suggests `login` in
        debug mode. `participant`: the first row of the cursor on the study's screen. `settings`: the session's options;
        None: as the session reports them. `notice`: the first remark about the session. Without `ui_state` nothing is
        restored or saved.
        """
        self._keys = keys or KeyFile()
        super().__init__(theme, self._keys)
        self._launcher, self._settings, self._wizard = launcher, settings, wizard
        self._client, self._notice = client, notice
        self._login, self._participant = login, participant
        self._day = StudyDay(study)
        self._ui_state = ui_state or UiState(Preferences(), fresh=True, keeps_changes=False)
        self._session: ConsoleSession | None = None
        self._is_leaving = False
        self._enter_guard = EnterGuard()
        self._keys_together = False
        """Whether the last key came in one piece with others."""
        self._signal: signal.Signals | None = None
        self._handlers: dict[signal.Signals, Any] = {}
        self.exit_message = ""
        """The terminal's text after the end of the console."""

    async def on_mount(self) -> None:
        loop = asyncio.get_running_loop()

        def handle_signal(number: int, frame: FrameType | None) -> None:
            self._on_signal(loop, signal.Signals(number))

        for number in (signal.SIGHUP, signal.SIGTERM):
            with suppress(ValueError):  # not the main thread
                self._handlers[number] = signal.signal(number, handle_signal)
        if self.terminal_writer is not None:
            self.terminal_writer.on_gone = lambda: self._on_signal(loop, signal.SIGHUP)
        self.set_interval(SAVE_SECONDS, self._save_ui_state)
        if self._client is not None:
            await self._show_session(self._client, self._notice)
        else:
            await self._show_study(self._notice)

    def on_unmount(self) -> None:
        if self._signal is None:  # otherwise they stay: a second signal must not interrupt the end
            for number, before in self._handlers.items():
                signal.signal(number, before)

    @property
    def console_screen(self) -> ConsoleScreen | None:
        """The console's screen, even under an open dialog."""
        return next((screen for screen in self.screen_stack if isinstance(screen, ConsoleScreen)), None)

    @property
    def study_screen(self) -> StudyScreen | None:
        """The study's screen, even under another screen."""
        return next((screen for screen in self.screen_stack if isinstance(screen, StudyScreen)), None)

    # --- the study between two sessions -----------------------------------------------------------------------------

    async def _show_study(self, sentence: str = "", participant: str = "") -> None:
        """Close the session's screen, and go to the next participant or the named one."""
        source = self._day.source
        if source is None:
            return
        self._session = self._settings = None
        await self._close_console_screen()
        if (screen := self.study_screen) is None:
            screen = StudyScreen(
                source,
                wizard=self._wizard,
                suggested=self._ui_state.preferences.wizard,
                login=self._login,
                selected=self._participant,
                keys=self._keys,
            )
            await self.push_screen(screen)
        screen.show_ended_session(sentence, participant)

    @on(StudyScreen.SessionReady)
    async def _open_session_of_study(self, event: StudyScreen.SessionReady) -> None:
        started = event.started
        self._wizard = started.wizard or self._wizard
        await self._show_session(started.client, started.notice)
        if event.stops and (console := self.console_screen) is not None:
            console.stop_all()

    @on(StudyScreen.WizardNamed)
    def _keep_wizard(self, event: StudyScreen.WizardNamed) -> None:
        self._wizard = event.name
        self.run_worker(asyncio.to_thread(save_all, self._ui_state.save_wizard_name(event.name)), group="keep")

    # --- sessions ---------------------------------------------------------------------------------------------------

    async def _start_session(self, scenario: Scenario, settings: SessionOptions, notice: str = "") -> None:
        """Start a session and attach to it.

        :param notice: what people must know of the session before.
        """
        try:
            client = await asyncio.to_thread(self._launcher.start, scenario, settings)
        except (EngineGone, ValueError) as error:
            await self._exit_without_session(f"the session could not start: {error}")
            return
        self._settings = settings
        await self._show_session(client, notice)

    async def _show_session(self, client: Client, notice: str = "") -> None:
        try:
            session = await ConsoleSession.attach(client, self._wizard)
        except (EngineGone, ValueError) as error:
            await self._exit_without_session(f"the session could not be reached: {error}")
            return
        if clashes := self._keys.clashes(session.store.scenario.keys):
            await session.close(end_session=False)
            await self._exit_without_session("\n".join((*map(str, clashes), how_to_fix(self._keys.path))), code=2)
            return
        self._session = session
        # Also while it is unknown whether it has a study: a session that has just begun has no record yet.
        self.run_worker(self._day.read(session, self._launcher.find_study), group="study")
        if self._settings is None:
            self._settings = settings_of_session(session.store.attach_reply)
        screen = ConsoleScreen(session)
        await self.push_screen(screen)
        remark = self._ui_state.restore(screen.pane_layout, session.store.attach_reply, themes.short_name(self.theme))
        if notice := notice or remark:
            session.show_notice(Notice(notice, "wait"))
        if self._ui_state.tour_is_due:
            self.call_after_refresh(screen.offer_tour, self._save_tour_seen)

    def _save_tour_seen(self) -> None:
        self.run_worker(asyncio.to_thread(save_all, self._ui_state.mark_tour_seen()), group="keep")

    def _save_ui_state(self, *, at_once: bool = False) -> None:
        """Write the changes of the screen, off the loop, because a disk may be slow."""
        console = self.console_screen
        if console is None:
            return
        if changed := self._ui_state.collect_changes(console.pane_layout, themes.short_name(self.theme)):
            if at_once:
                save_all(changed)
            else:
                self.run_worker(asyncio.to_thread(save_all, changed), group="keep")

    async def _exit_without_session(self, message: str, code: int = 1) -> None:
        """Exit, because there is no session to show, or return to the screen of a study."""
        if self.study_screen is not None:
            await self._show_study(message)
            return
        self.exit_message = message
        self.exit(return_code=code)

    @on(ConsoleScreen.OpenSettings)
    def _open_settings(self) -> None:
        if self._session is not None and self._settings is not None:
            screen = SettingsScreen(self._settings, self._session.store, self._launcher)
            self.push_screen(screen, self._apply_settings)

    def _apply_settings(self, chosen: tuple[Scenario, SessionOptions] | None) -> None:
        if chosen is not None:
            self.run_worker(self._restart(*chosen), exclusive=True, group="restart")

    async def _restart(self, scenario: Scenario, settings: SessionOptions) -> None:
        """End the running session, and start another one when it has certainly ended."""
        if self._session is None or not self._check_may_end(self._session):
            return
        if clashes := self._keys.clashes(scenario.keys):
            self._session.show_notice(Notice(f"the session goes on, because of your key file: {clashes[0]}", "fault"))
            return
        if problems := start_problems(scenario, settings):
            self._session.show_notice(Notice(f"the session goes on: {problems[0]}", "fault"))
            return
        closed = await self._leave_session(self._session, end=True)
        if closed != "done":
            if closed == "late":
                self._session.show_notice(Notice("the session did not end in time: nothing new was started", "fault"))
            return
        store = self._session.store
        warning = unrecorded_end_text(store) or open_goals_warning(store.view.left_open)
        await self._close_console_screen()
        await self._start_session(scenario, settings, warning)

    async def _close_console_screen(self) -> None:
        """Close the screen of the last session, and everything above it."""
        while self.console_screen is not None:
            await self.pop_screen()

    def _is_recoverable(self, session: ConsoleSession) -> bool:
        store = session.store
        recover = (self._launcher.recover or self._day.has(session)) and not store.attach_reply.shadow
        return bool(store.gone_reason and not store.ended_in_order and store.attach_reply.folder and recover)

    async def _recover(self, session: ConsoleSession) -> None:
        """Start the engine of this session again and attach to it."""
        recover = self._day.recover if self._day.has(session) else self._launcher.recover
        if recover is None:
            return
        session.show_notice(Notice("the session is being recovered", "wait"))
        loop = asyncio.get_running_loop()

        def report(sentence: str) -> None:
            with suppress(RuntimeError):  # the console has left meanwhile
                loop.call_soon_threadsafe(session.show_notice, Notice(sentence, "wait"))

        try:
            recovered = await asyncio.to_thread(recover, session.store.attach_reply, report)
        except (EngineGone, RegistryError, StudyError) as error:
            session.show_notice(Notice(f"could not recover it: {error}", "fault"))
            return
        await self._leave_session(session, end=False)
        await self._close_console_screen()
        await self._show_session(recovered.client, recovered.notice)

    def _check_may_end(self, session: ConsoleSession) -> bool:
        """Check whether this console may end the session. Control may have gone while the question was open."""
        if reason := why_blocked(session.store, "change"):
            session.show_notice(Notice(f"the session goes on: {reason}", "wait"))
        return not reason

    async def _leave_session(self, session: ConsoleSession, *, end: bool) -> Literal["done", "late", "refused"]:
        """Detach, or end the session. `late`: not confirmed in time. `refused`: this console may not end it."""
        patience = questions.end_patience(session.store) if end else DETACH_PATIENCE
        try:
            await asyncio.wait_for(session.close(end_session=end), patience)
        except EngineGone:
            return "done"
        except TimeoutError:
            return "late"
        except Rejected as refused:  # control has just gone
            session.show_notice(Notice(f"the session goes on: {refused}", "wait"))
            return "refused"
        return "done"

    # --- keys and actions that work everywhere ----------------------------------------------------------------------

    def observe_key(self, event: events.Key, together: bool) -> None:
        self._keys_together = together
        if (console := self.console_screen) is not None:
            console.observe_key(event, together)

    def push_screen(self, *args: Any, **options: Any) -> Any:
        """Open a screen. Enter waits until the wizard can have seen it."""
        self._note_change()
        return super().push_screen(*args, **options)

    def pop_screen(self) -> AwaitComplete:
        """Close a screen. The same holds for the one below it."""
        self._note_change()
        return super().pop_screen()

    @on(ConsoleScreen.LineOpened)
    def _note_change(self) -> None:
        self._enter_guard.note_change(monotonic())

    def admits(self, event: events.Event) -> bool:
        if (
            isinstance(event, events.Key)
            and not self._enter_guard.admits(event.key, event.time)
            and self._refuses_enter()
        ):
            return False
        if (console := self.console_screen) is not None:
            return console.admits(event) and (not is_editing(self) or super().admits(event))
        if is_editing(self):
            return super().admits(event)
        # On the screen of a study, a paste must not act as commands either (console.md 2.3).
        if not isinstance(event, events.Key) or takes_text(self.focused):
            return True
        return not self._keys_together or event.key in ALWAYS_ADMITTED

    def _refuses_enter(self) -> bool:
        """Say why an Enter came too soon. False: in the editor, where nothing starts."""
        if is_editing(self):
            return False
        if (console := self.console_screen) is not None:
            console.show_notice(EARLY_ENTER)
        elif (study := self.study_screen) is not None:
            study.say(EARLY_ENTER)
        return True

    def handle_key_first(self, event: events.Key) -> bool:
        return (console := self.console_screen) is not None and console.handle_key_first(event)

    def action_do(self, action: str) -> None:
        console, study = self.console_screen, self.study_screen
        if action == "stop" and console is not None:
            console.stop_all()
            overlays.show_stop_in_editor(self)
        elif action == "stop" and study is not None:
            study.stop_pressed()
        elif action == "lock" and console is not None:
            console.action_do(action)
        elif action == "quit":
            self.run_worker(self.action_quit())

    async def action_quit(self) -> None:
        if self.screen.has_class("-quit"):
            return
        session = self._session
        asks = self.screen is not self.study_screen and not isinstance(self.screen, ReportScreen)
        if session is None and self.study_screen is not None and asks:
            question = questions.leave_study_dialog()
            question.add_class("-quit")
            self.push_screen(question, self._leave_study)
            return
        recoverable = session is not None and self._is_recoverable(session)
        if session is None or session.store.attach_reply.replay or (session.store.gone_reason and not recoverable):
            if session is not None and self._day.has(session):
                await self._back_to_study(session)
            else:
                await self._leave_and_exit(0)
            return
        in_study = self._day.has(session)
        if session.store.attach_reply.shadow:
            dialog = questions.leave_shadow_dialog(session.store)
        elif recoverable:
            dialog = questions.engine_gone_dialog(session.store, in_study=in_study)
        else:
            dialog = questions.leave_dialog(session.store)
        dialog.add_class("-quit")

        def carry_out(key: str | None) -> None:
            if key == "r":
                self.run_worker(self._recover(session), exclusive=True, group="restart")
            elif key in ("d", "l"):
                self.run_worker(self._leave_and_exit(0))
            elif key == "b":
                self.run_worker(self._back_to_study(session), exclusive=True, group="restart")
            elif key == questions.END_KEY and in_study:
                self.run_worker(self._end_session_of_study(session), exclusive=True, group="end")
            elif key == questions.END_KEY:
                self._confirm_end(session)

        self.push_screen(dialog, carry_out)

    def _leave_study(self, key: str | None) -> None:
        if key:
            self.run_worker(self._leave_and_exit(0))

    def _confirm_end(self, session: ConsoleSession) -> None:
        question = end_session_dialog(session.store)
        question.add_class("-quit")

        def end_if_confirmed(yes: bool | None) -> None:
            if yes and self._check_may_end(session):
                self.run_worker(self._leave_and_exit(0, end=True))

        self.push_screen(question, end_if_confirmed)

    async def _back_to_study(self, session: ConsoleSession) -> None:
        """Leave a session that is over or whose engine has gone. The cursor goes to the next participant."""
        await self._leave_session(session, end=False)
        await self._show_study(self._day.over_text(session.store), self._day.unjudged(session.store))

    async def _end_session_of_study(self, session: ConsoleSession) -> None:
        """Ask the questions after a session, end it, and go on to the next participant."""
        ending = await self._day.ask_how_it_ends(self, session)
        if ending is None or not self._check_may_end(session):
            return
        if not await session.report(ending.reports):
            return
        closed = await self._leave_session(session, end=True)
        if closed == "late":
            session.show_notice(Notice("the session did not end in time: look at the robot", "fault"))
        elif closed == "done":
            store = session.store
            warning = unrecorded_end_text(store) or open_goals_warning(store.view.left_open)
            sentence = "; ".join(filter(None, (warning, ending.sentence)))
            await self._show_study(sentence)
            if (screen := self.study_screen) is not None and (folder := session.store.attach_reply.folder):
                screen.show_report(sentence, Path(folder).name)

    # --- the end ------------------------------------------------------------------------------------------------------

    def _on_signal(self, loop: asyncio.AbstractEventLoop, number: signal.Signals) -> None:
        """Runs in the signal handler itself, or on the writer's thread."""
        if self.terminal_writer is not None:
            self.terminal_writer.end_quickly()
        self._signal = self._signal or number
        with suppress(RuntimeError):  # the loop has ended already
            loop.call_soon_threadsafe(self._leave_by_signal, number)

    def _leave_by_signal(self, number: signal.Signals) -> None:
        """Leave because the terminal has gone or a signal came. Neither may end the session."""
        if not self._is_leaving:
            self.run_worker(self._leave_and_exit(128 + number, signal_name=number.name))

    async def _leave_and_exit(self, code: int, *, end: bool = False, signal_name: str = "") -> None:
        if self._is_leaving:
            return
        self._is_leaving = True
        if self._session is not None:
            patience = questions.end_patience(self._session.store)
            closed = await self._leave_session(self._session, end=end)
            if closed == "refused":
                self._is_leaving = False
                return
            self.exit_message = questions.exit_message(
                self._session.store, end=end, in_time=closed == "done", patience=patience, signal_name=signal_name
            )
            if end and self._session.store.end_unrecorded:
                code = NOT_WRITTEN
            elif end and (closed == "late" or self._session.store.view.left_open):
                code = STILL_RUNNING
        elif self._day.source is not None:
            busy = self.study_screen.busy if self.study_screen is not None else ""
            self.exit_message = questions.study_exit_message(self._day.source.folder, busy, signal_name)
        self._save_ui_state(at_once=True)
        self.exit(return_code=code)
