"""The screen of a study between two sessions: the next participant, the progress of all, and the plan.

No session runs here. Slow work runs off the loop; its result is shown when it arrives.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.message import Message
from textual.screen import Screen

from rise_engine.base.errors import StudyError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.kernel.inputs import CheckReport
from rise_engine.study.model import ParticipantStanding, SessionEntry
from rise_tui.actions import STUDY_SCREEN_ACTIONS, bindings_in, bindings_of
from rise_tui.config.key_file import KeyFile, how_to_fix
from rise_tui.config.launch import SessionPreview, SessionRequest, StartedSession, StudyNow, StudySource
from rise_tui.console import overlays, study_dialogs
from rise_tui.console.study_lists import StudyHead, StudyHints, StudyLists
from rise_tui.model.notice import Level
from rise_tui.model.study_rows import (
    NO_CONDITIONS,
    Conditions,
    conditions_of,
    find_participant,
    open_entry,
    running_people,
    running_rehearsal,
)
from rise_tui.rendering.terminal_app import repaint_everything
from rise_tui.screens.checks import ChecksScreen
from rise_tui.screens.help import HelpScreen, screen_help_entries
from rise_tui.screens.palette import open_palette, screen_commands
from rise_tui.screens.reading import ReportOf, ReportScreen
from rise_tui.screens.session_forms import Outcome
from rise_tui.screens.tour import show_when_too_small
from rise_tui.widgets.bars import StudyNotice
from rise_tui.widgets.lines import RowView, StaticLines

WATCH_SECONDS = 2.0
"""Seconds until the screen notices a changed study file, or a session that ended elsewhere."""


class StudyScreen(Screen[None]):
    """The participants, and the possible actions for each."""

    DEFAULT_CSS = "StudyScreen { layout: vertical; background: $background; }"

    BINDINGS: ClassVar[list[BindingType]] = [
        *bindings_in("study"),
        *bindings_of(*STUDY_SCREEN_ACTIONS),
        Binding("tab,shift+tab", "other_list", show=False),
        Binding("escape", "clear_find", show=False),
    ]

    @dataclass
    class SessionReady(Message):
        """A session runs: open a console on it. `stops`: the stop key was pressed meanwhile."""

        started: StartedSession
        stops: bool

    @dataclass
    class WizardNamed(Message):
        """The wizard's name was given."""

        name: str

    def __init__(
        self,
        source: StudySource,
        *,
        wizard: str,
        suggested: str = "",
        login: str = "",
        selected: str = "",
        keys: KeyFile | None = None,
    ) -> None:
        """`wizard`: the wizard's name. If it is empty, the screen asks before the first session. It suggests
        `suggested`, or `login` in debug mode. `selected`: the first participant of the cursor. `keys`: the user's
        own."""
        super().__init__()
        self._source, self.wizard, self._suggested, self._login = source, wizard, suggested, login
        self._keys = keys or KeyFile()
        self._select = selected
        """The participant for the cursor when the study has been read; empty: the next one."""
        self._goes_to_next = True
        """Whether the cursor moves to the next participant when there is one."""
        self.loaded = StudyNow()
        self.is_read = False
        """Whether the study has been read."""
        self.conditions: Conditions = NO_CONDITIONS
        self._fingerprint: object = None
        self.busy = ""
        """The work that must end first, in a sentence; empty: none."""
        self._stop_pressed = False
        self.head, self.notice, self.hints = StudyHead(), StudyNotice(), StudyHints()
        self.lists = StudyLists()

    def compose(self) -> ComposeResult:
        yield self.head
        yield self.lists
        yield self.notice
        yield self.hints

    def on_mount(self) -> None:
        self.lists.focus_people()
        self.set_interval(WATCH_SECONDS, self._watch)
        self.say("reading the study …")
        self.read()

    # --- reading ----------------------------------------------------------------------------------------------------

    @work(group="read", exclusive=True)
    async def read(self) -> None:
        """Read the study now."""
        fingerprint = await asyncio.to_thread(self._source.fingerprint)
        self.loaded = await asyncio.to_thread(self._source.load)
        self._fingerprint, self.is_read = fingerprint, True
        study, standing = self.loaded.study, self.loaded.standing
        self.conditions = conditions_of(study) if study is not None else NO_CONDITIONS
        if self.notice.is_about_reading:
            self.say("")
        self.draw()
        if standing is None or not (self._goes_to_next or self._select):
            return
        self.lists.select(self._select or standing.next)
        names = [each.participant for each in standing.participants]
        if self._select and self._select not in names:
            near = did_you_mean(self._select, names)
            self.say(f"there is no participant {self._select!r} in participants.csv{near}", "wait")
            self.lists.select(standing.next)
        self._select = ""
        self._goes_to_next = not standing.next and any(running_people(standing))  # one is just ending: move then

    def _watch(self) -> None:
        """Look for changes, while nothing covers this screen."""
        if self.app.screen is self and not self.busy:
            self._read_if_changed()

    @work(group="watch", exclusive=True)
    async def _read_if_changed(self) -> None:
        if await asyncio.to_thread(self._source.fingerprint) != self._fingerprint:
            self.read()

    def show_ended_session(self, sentence: str = "", participant: str = "") -> None:
        """Show the result of a session that has ended, and go on to the next participant or the named one."""
        self.busy, self._stop_pressed = "", False
        self._goes_to_next, self._select = True, participant or self._select
        self.lists.clear_find()  # otherwise the search might hide the next participant
        self.say(sentence)
        self.read()

    # --- drawing ----------------------------------------------------------------------------------------------------

    def on_resize(self) -> None:
        show_when_too_small(self.app, None)

    @on(StaticLines.DrawAgain)
    def draw(self) -> None:
        """Draw the bars and the lists."""
        self.head.draw(self.loaded.study, self.wizard, is_read=self.is_read)
        self.hints.draw()
        self.lists.show(self.loaded, self.conditions)

    @on(RowView.CursorMoved)
    def _cursor_moved(self) -> None:
        self._goes_to_next = False

    def say(self, sentence: str, level: Level = "info") -> None:
        """Show the wizard a sentence, above the key hints."""
        self.notice.draw(sentence, level)

    def action_clear_find(self) -> None:
        """Handle Esc: show every participant again."""
        self.lists.clear_find()

    def action_other_list(self) -> None:
        """Switch the focus between the participants and the plan."""
        self.lists.focus_other()

    # --- actions of the registry ------------------------------------------------------------------------------------

    def action_do(self, action: str) -> None:
        """Carry out an action of the registry that works here."""
        calls: dict[str, Callable[[], object]] = {
            "study.open": self.open_selected,
            "study.rehearse": self.rehearse_selected,
            "study.report": self.report_selected,
            "study.outcome": self.judge_selected,
            "study.people": lambda: self._open_editor(self._source.folder),
            "study.wizard": lambda: self._ask_name(lambda: None),
            "study.reload": self._reload,
            "filter": self.lists.open_find,
            "help": lambda: self.app.push_screen(HelpScreen(screen_help_entries("study"))),
            "palette": lambda: open_palette(self.app, screen_commands("study", self.action_do)),
            "theme": lambda: open_palette(self.app, (), "theme"),
            "redraw": lambda: repaint_everything(self.app),
            "quit": lambda: self.app.run_worker(self.app.run_action("quit")),
            "edit-study": self._edit,
        }
        if self.busy and action.startswith("study."):
            self.say(f"not now: {self.busy}", "wait")
        else:
            calls[action]()

    def _edit(self) -> None:
        self._open_editor(str(Path(self._source.folder, self.loaded.study.scenario if self.loaded.study else "")))

    def _open_editor(self, folder: str) -> None:
        self.run_worker(overlays.open_editor(self.app, folder, self.say, runs=self._running_entry() is not None))

    def _reload(self) -> None:
        self.say("reading the study …")
        self.read()

    def stop_pressed(self) -> None:
        """Handle the stop key: stop immediately a session that is starting, or that runs without a console here."""
        entry = self._running_entry()
        if self.busy:
            self._stop_pressed = True
            self._show_sentence(f"STOP will be sent as soon as possible: {self.busy}", "fault")
        elif entry is not None:
            self._stop_pressed = True
            self._close_dialogs()
            self._go_to(entry)
        else:
            self._show_sentence("nothing to stop: no session of this study is running here")

    def _running_entry(self) -> SessionEntry | None:
        """The study's running session, as far as known."""
        standing = self.loaded.standing
        if standing is None:
            return None
        counted = next((open_entry(each) for each in running_people(standing)), None)
        return counted or running_rehearsal(standing)

    def _show_sentence(self, sentence: str, level: Level = "info") -> None:
        self.say(sentence, level)
        if isinstance(self.app.screen, ChecksScreen):
            self.app.screen.say(sentence)

    def _close_dialogs(self) -> None:
        while self.app.screen is not self:
            self.app.pop_screen()

    # --- one participant --------------------------------------------------------------------------------------------

    def open_selected(self) -> None:
        """Do the next step for the participant under the cursor."""
        each = self.lists.selected
        if each is None:
            self._refuse_start()
            return
        if self.lists.people.was_just_displaced:
            self.say("the list has just changed; press again")
            return
        entry, standing = open_entry(each), self.loaded.standing
        rehearsal = running_rehearsal(standing, each.participant) if standing is not None else None
        if rehearsal is not None:
            self._go_to(rehearsal)
        elif each.state == "running" and entry is not None:
            self._go_to(entry)
        elif each.state == "unfinished" and entry is not None:
            self._ask_about_unfinished(each, entry)
        elif each.state == "to-judge" and entry is not None:
            self._with_wizard_name(lambda: self._ask_afterwards(entry))
        elif each.next_run is None:
            self.say(f"{each.participant}: {each.why or f'{each.state}; no run is left'}", "wait")
        else:
            self._with_wizard_name(lambda: self._prepare(SessionRequest(each.participant)))

    def _refuse_start(self) -> None:
        why = "the study does not load" if self.loaded.standing is None else "no participant is selected"
        self.say(f"nothing can be started: {why}", "wait")

    def rehearse_selected(self) -> None:
        """Begin a session that does not count with the participant under the cursor."""
        each, study = self.lists.selected, self.loaded.study
        if each is None or study is None:
            self._refuse_start()
            return

        def go_on(request: SessionRequest | None) -> None:
            if request is not None:
                self._with_wizard_name(lambda: self._prepare(request))

        study_dialogs.ask_what_to_rehearse(self.app, each.participant, study, self.conditions, go_on)

    # --- reports ----------------------------------------------------------------------------------------------------

    def report_selected(self) -> None:
        """Show the report of this participant's last session, from which the others can be opened."""
        each = self.lists.selected
        ended = study_dialogs.ended_sessions(each, self.loaded.standing) if each is not None else []
        if ended:
            self.app.push_screen(ReportScreen(ended, self._source.report))
        else:
            who = each.participant if each is not None else "nobody is selected"
            self.say(f"{who}: no session has ended, so there is no report yet" if each is not None else who, "wait")

    def judge_selected(self) -> None:
        """Correct how the last session of the participant under the cursor counts."""
        each = self.lists.selected
        entry = each.sessions[-1] if each is not None and each.sessions else None
        if entry is None:
            who = each.participant if each is not None else "the study"
            self.say(f"{who} has no session yet, so there is no outcome to correct", "wait")
        elif entry.status != "ended" or entry.outcome is None:
            self.open_selected()  # it asks for the first outcome
        else:
            last = entry
            self._with_wizard_name(
                lambda: study_dialogs.ask_outcome(self.app, last, self.conditions, partial(self._judge, last))
            )

    def show_report(self, title: str, folder: str) -> None:
        """Show the report of a session that has just ended here, over this screen."""
        self.app.push_screen(ReportScreen([ReportOf(title, folder)], self._source.report))

    # --- the wizard's name ------------------------------------------------------------------------------------------

    def _with_wizard_name(self, go_on: Callable[[], None]) -> None:
        """Continue when the wizard's name is known."""
        if self.wizard:
            go_on()
        else:
            self._ask_name(go_on)

    def _ask_name(self, go_on: Callable[[], None]) -> None:
        study = self.loaded.study

        def take(name: str | None) -> None:
            if name:
                self.wizard = name
                self.post_message(self.WizardNamed(name))
                self.draw()
                go_on()

        study_dialogs.ask_name(self.app, study, self.wizard or self._suggested, self._login, take)

    # --- a session begins -------------------------------------------------------------------------------------------

    def _start_job(self, busy: str, work: Coroutine[Any, Any, None]) -> None:
        self.busy = busy
        self.say(f"{busy} …", "wait")
        self.run_worker(work, group="session", exclusive=True)

    def _refused(self, refused: StudyError) -> None:
        self.busy, self._stop_pressed = "", False
        self.say(str(refused), "fault")
        self.read()

    def _prepare(self, request: SessionRequest) -> None:
        self._start_job(f"preparing the session of {request.participant}", self._show_plan(request))

    async def _show_plan(self, request: SessionRequest) -> None:
        try:
            plan = await asyncio.to_thread(self._source.plan, request, self.wizard)
        except StudyError as refused:
            self._refused(refused)
            return
        if clashes := self._keys.clashes(plan.keys):
            self._refused(StudyError(f"{clashes[0]}; {how_to_fix(self._keys.path)}"))
            return
        self.busy = ""
        self.say("")
        each = find_participant(self.loaded.standing, request.participant) if self.loaded.standing else None

        def begin(checks: tuple[CheckReport, ...] | None) -> None:
            if checks is None:
                self.say(f"nothing has been started for {request.participant}")
            else:
                self._start(plan, checks)

        maker = study_dialogs.StudyChecker(self.app, self._source, plan.context, self._show_sentence)
        study_dialogs.show_plan(self.app, plan, each, self.conditions, self.wizard, maker, begin)

    def _start(self, plan: SessionPreview, checks: tuple[CheckReport, ...]) -> None:
        self._start_job(
            f"the session of {plan.request.participant} is starting",
            self._started(lambda report: self._source.start(plan, checks, self.wizard, report)),
        )

    def _go_to(self, entry: SessionEntry) -> None:
        self._start_job(
            f"opening the session of {entry.participant}",
            self._started(lambda report: self._source.attach(entry, self.wizard)),
        )

    async def _started(self, start: Callable[[Callable[[str], None]], StartedSession]) -> None:
        """Start or reach a session off the loop, and open a console on it."""
        loop = asyncio.get_running_loop()

        def report(sentence: str) -> None:
            loop.call_soon_threadsafe(self.say, f"{self.busy}: {sentence}", "wait")

        try:
            started = await asyncio.to_thread(start, report)
        except StudyError as refused:
            self._refused(refused)
            return
        stop, self.busy, self._stop_pressed = self._stop_pressed, "", False
        self.say("")
        self.post_message(self.SessionReady(started, stop))

    # --- unfinished sessions and missing outcomes -------------------------------------------------------------------

    def _ask_about_unfinished(self, each: ParticipantStanding, entry: SessionEntry) -> None:
        def carry_out(key: str | None) -> None:
            if key == "r":
                self._start_job(
                    f"the session of {each.participant} is being recovered",
                    self._started(lambda report: self._source.recover(entry, self.wizard, report)),
                )
            elif key == "g":
                study_dialogs.ask_outcome(
                    self.app, entry, self.conditions, lambda given: self._judge(entry, given), gives_up=True
                )

        study_dialogs.ask_about_unfinished(self.app, entry, self.conditions, carry_out)

    def _ask_afterwards(self, entry: SessionEntry) -> None:
        """Make the checks after a session and ask for its outcome, if that was not possible at its end."""

        def ask(checks: object) -> None:
            if checks is not None:
                judge = partial(self._judge, entry)
                study_dialogs.ask_outcome(self.app, entry, self.conditions, judge)

        study, after = self.loaded.study, self.loaded.after
        if study is None or not after:
            ask(())
            return
        context = study_dialogs.context_afterwards(study, entry, self.wizard)
        maker = study_dialogs.StudyChecker(self.app, self._source, context, self._show_sentence)
        study_dialogs.show_checks_after(self.app, entry, after, maker, self.wizard, ask)

    def _judge(self, entry: SessionEntry, given: Outcome | None) -> None:
        if given is not None:
            self._with_wizard_name(
                lambda: self._start_job(f"recording: {entry.participant} {given.status}", self._write(entry, given))
            )

    async def _write(self, entry: SessionEntry, given: Outcome) -> None:
        try:
            await asyncio.to_thread(self._source.judge, entry, given.status, given.reason, self.wizard)
        except StudyError as refused:
            self._refused(refused)
            return
        self.show_ended_session(f"{entry.participant}, run {entry.run}: {given.status}")
