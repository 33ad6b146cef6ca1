"""The questions about a study: the next session, checks, outcome, unfinished sessions; and the end of its session."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from textual.app import App

from rise_engine.base.errors import StudyError
from rise_engine.checks.outcome import CheckContext, CheckOutcome
from rise_engine.kernel.inputs import CheckReport, OutcomeReport
from rise_engine.kernel.records import SessionRecord
from rise_engine.run.protocol.client import AttachReply
from rise_engine.study.checks import PendingCheck
from rise_engine.study.model import ParticipantStanding, Purpose, SessionEntry, Study, StudyCheck, StudyStanding
from rise_tui.config.launch import RecoveredClient, ReportProgress, SessionPreview, SessionRequest, StudySource
from rise_tui.config.preferences import abbreviate_home
from rise_tui.console.questions import RECOVERY_LINES
from rise_tui.console.session import ConsoleSession
from rise_tui.model.check_list import CheckList
from rise_tui.model.notice import Notice
from rise_tui.model.status import participant_text, running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.model.study_rows import HIDDEN, Conditions, begun_text, condition_names, conditions_of, session_line
from rise_tui.rendering.text import StyledLine, StyledSpan, clean, format_clock, wrap
from rise_tui.screens.checks import CheckMaker, ChecksScreen
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.screens.reading import ReportOf
from rise_tui.screens.session_forms import Outcome, OutcomeDialog, RehearsalDialog, WizardNameDialog, end_session_dialog

LABEL = 13
"""Cells for the label of a line in the preview."""
TEXT = 60
"""Cells for the text of such a line."""
REAL_REHEARSALS: tuple[Purpose, ...] = ("debug", "training", "pilot")


class StudyChecker:
    """Makes the checks of one session of a study, and writes their results off the loop."""

    def __init__(self, app: App[Any], source: StudySource, context: CheckContext, warn: Callable[[str], None]) -> None:
        """`warn` receives results that could not be written."""
        self._app, self._source, self._context, self._warn = app, source, context, warn

    async def make(self, check: StudyCheck) -> CheckOutcome:
        return await self._source.check(check, self._context)

    def note(self, check: StudyCheck, report: CheckReport) -> None:
        self._app.run_worker(self._write(check, report), group="checked")

    async def _write(self, check: StudyCheck, report: CheckReport) -> None:
        try:
            await asyncio.to_thread(self._source.note_check, check, self._context, report)
        except StudyError as refused:
            self._warn(str(refused))


def plan_title(plan: SessionPreview) -> str:
    """`P07 · run 2 of 2`."""
    run = f"run {plan.run.run} of {plan.runs}" if plan.runs > 1 else ""
    attempt = f"attempt {plan.attempt}" if plan.attempt > 1 else ""
    return " · ".join(filter(None, (clean(plan.request.participant), run, attempt)))


def plan_lines(
    plan: SessionPreview, each: ParticipantStanding | None, conditions: Conditions, wizard: str
) -> list[StyledLine]:
    """Describe the next session, in lines."""
    counted = plan.request.purpose == "counted"
    condition = conditions.described(plan.run.condition) or "none in this study"
    if conditions.hidden and not plan.request.condition:
        condition = HIDDEN
    real, moves = plan.mode == "real", "  no robot moves" if plan.simulated else "  the robot moves"
    counts: StyledSpan = (f"yes, slot {plan.slot}", "plain") if counted else (f"no: {plan.request.purpose}", "wait")
    lines: list[StyledLine] = [_line("out of turn", (text, "wait")) for text in wrap(plan.warning, TEXT) if text]
    language: StyledSpan = (f"   language {clean(plan.language)}" if plan.language else "", "strong")
    lines += [
        _line("participant", (plan_title(plan), "strong"), language),
        _line("condition", (condition, "muted" if condition == HIDDEN else "strong")),
        _line("mode", (plan.mode.upper(), "wait" if real else "accent"), (moves * real, "plain")),
        _line("robot", (plan.robot, "plain")),
        *(_line("", (text, "wait")) for warning in plan.warnings for text in wrap(warning, TEXT)),
        _line("scenario", (plan.title, "plain")),
        _line("counts", counts),
        _line("recorded in", (abbreviate_home(plan.recorded), "plain")),
        *_recorder_lines(plan),
        _line("wizard", (wizard, "plain")),
    ]
    done = [session_line(entry, conditions) for entry in each.sessions] if each is not None else []
    lines += [_line("before" if at == 0 else "", (text, "plain")) for at, text in enumerate(done or ["nothing yet"])]
    names = ", ".join(each.check.id for each in plan.checks) or "none"
    return [*lines, _line("checks", (names, "plain"))]


def _recorder_lines(plan: SessionPreview) -> list[StyledLine]:
    """The recorders of the session, and why the study's own do not record it; nothing for a study without recorders."""
    spans: list[StyledSpan] = [(text, "plain") for text in wrap(plan.recorders, TEXT) if text]
    spans += [(text, "wait") for text in wrap(plan.unrecorded, TEXT) if text]
    return [_line("recorded by" if at == 0 else "", span) for at, span in enumerate(spans)]


def _line(label: str, *spans: StyledSpan) -> StyledLine:
    return ((f" {label:<{LABEL}}", "muted"), *((clean(text), role) for text, role in spans))


def show_plan(
    app: App[object],
    plan: SessionPreview,
    each: ParticipantStanding | None,
    conditions: Conditions,
    wizard: str,
    maker: CheckMaker,
    begin: Callable[[tuple[CheckReport, ...] | None], None],
) -> None:
    """Show the next session, then make the checks. `begin` gets their results; None: the wizard left."""
    counted = plan.request.purpose == "counted"
    kind = "session" if counted else f"{plan.request.purpose} session"
    screen = ChecksScreen(
        plan_title(plan),
        CheckList(plan.checks, plan.request.purpose, binding=counted),
        maker,
        go=f"begin the {kind} of {clean(plan.request.participant)} in {plan.mode.upper()}",
        wizard=f"wizard:{wizard}",
        intro=plan_lines(plan, each, conditions, wizard),
    )
    app.push_screen(screen, begin)


def ended_sessions(each: ParticipantStanding, standing: StudyStanding | None) -> list[ReportOf]:
    """Every ended session of a participant, including rehearsals, in the order of their starts."""
    rehearsals = standing.rehearsals if standing is not None else ()
    theirs = [*each.sessions, *(entry for entry in rehearsals if entry.participant == each.participant)]
    return [
        ReportOf(_report_title(entry), entry.folder)
        for entry in sorted(theirs, key=lambda entry: entry.started)
        if entry.status == "ended"
    ]


def _report_title(entry: SessionEntry) -> str:
    what = f"run {entry.run}" if entry.purpose == "counted" else entry.purpose
    attempt = f", attempt {entry.attempt}" if entry.attempt > 1 else ""
    return f"{clean(entry.participant)}, {what}{attempt}, {begun_text(entry.started)}"


def context_afterwards(study: Study, entry: SessionEntry, wizard: str) -> CheckContext:
    """The context of the checks after a session that is over."""
    scenario = str(Path(study.folder, study.scenario))
    return CheckContext(
        study, entry.participant, scenario, study.mode, entry.purpose, entry.run, wizard=wizard, session=entry.folder
    )


def show_checks_after(
    app: App[object],
    entry: SessionEntry,
    after: Sequence[PendingCheck],
    maker: CheckMaker,
    wizard: str,
    take: Callable[[tuple[CheckReport, ...] | None], None],
) -> None:
    """Make the checks after a session that is already over."""
    screen = ChecksScreen(
        f"After the session of {clean(entry.participant)}, run {entry.run}",
        CheckList(after, entry.purpose, binding=False),
        maker,
        go="record the outcome",
        wizard=f"wizard:{wizard}",
    )
    app.push_screen(screen, take)


def entry_title(entry: SessionEntry, conditions: Conditions) -> str:
    """`P07 · run 2 · calm`."""
    parts = (entry.participant, f"run {entry.run}", conditions.shown(entry.condition))
    return " · ".join(clean(part) for part in parts if part)


def entry_lines(entry: SessionEntry) -> list[str]:
    """The time of a session, and its progress."""
    return [
        f"Started {begun_text(entry.started)}; its record ends at {format_clock(entry.seconds)}.",
        clean(entry.folder),
    ]


def ask_outcome(
    app: App[object],
    entry: SessionEntry,
    conditions: Conditions,
    take: Callable[[Outcome | None], None],
    *,
    gives_up: bool = False,
) -> None:
    """Ask how a session that is over counts. `gives_up`: it did not end, and will not continue."""
    because = f": {clean(entry.reason)}" if entry.reason else ""
    if entry.outcome is not None:
        sentences = wrap(f"It counts as {entry.outcome}{because}. The study log keeps this entry.", TEXT)
    else:
        how = "It is given up and will not be continued." if gives_up else "It ended without an outcome."
        sentences = [how]
    title = f"Which outcome? {entry_title(entry, conditions)}"
    lines = [*entry_lines(entry), "", *sentences]
    app.push_screen(OutcomeDialog(title, lines, ends=False, corrects=entry.outcome is not None), take)


def ask_about_unfinished(
    app: App[object], entry: SessionEntry, conditions: Conditions, take: Callable[[str | None], None]
) -> None:
    """Ask whether to recover an unfinished session or give it up."""
    lines = [
        *entry_lines(entry),
        "",
        *RECOVERY_LINES,
        "Give up  you record the outcome. If it is aborted, the",
        "         participant may run it again, as a new attempt.",
    ]
    choices = DialogChoice("r", "Recover"), DialogChoice("g", "Give up")
    app.push_screen(Dialog(f"{entry_title(entry, conditions)} did not end", lines, *choices, no="Leave it"), take)


def ask_what_to_rehearse(
    app: App[object],
    participant: str,
    study: Study,
    conditions: Conditions,
    take: Callable[[SessionRequest | None], None],
) -> None:
    """Ask for the purpose of a rehearsal and its condition."""
    purposes: Sequence[Purpose] = REAL_REHEARSALS if study.mode == "real" else ("debug",)
    app.push_screen(RehearsalDialog(participant, purposes, condition_names(study), conditions), take)


def ask_name(
    app: App[object], study: Study | None, suggested: str, login: str, take: Callable[[str | None], None]
) -> None:
    """Ask for the wizard's name. Debug mode suggests the login; a real session does not, because a login is private."""
    real = study is not None and study.mode == "real"
    offered = tuple(study.wizards) if study is not None and real else ()
    if offered and suggested not in offered:
        suggested = ""
    app.push_screen(WizardNameDialog(suggested or ("" if real else login), offered), take)


class Ending(NamedTuple):
    """The end of a session."""

    reports: tuple[CheckReport | OutcomeReport, ...]
    """Reports to record before it ends."""
    sentence: str
    """The sentence for the study's screen afterwards."""


def run_text(of: SessionRecord) -> str:
    """`P07, run 2`: without the condition, which a hidden study shows only in its session."""
    return f"{clean(of.participant)}, run {of.run}"


class StudyDay:
    """The app's knowledge of the study whose sessions it shows."""

    def __init__(self, source: StudySource | None) -> None:
        self.source = source
        """None: the session has no study, or the study cannot be reached."""

    def has(self, session: ConsoleSession) -> bool:
        """Whether a session belongs to this study, and this console may act in it."""
        store = session.store
        acts = store.attach_reply.role == "wizard" and not store.attach_reply.shadow
        return self.source is not None and store.is_of_study and acts

    async def read(self, session: ConsoleSession, find: Callable[[AttachReply], StudySource | None]) -> None:
        """Read the study's labels of its conditions.

        `find`: finds the study by the session's folder if it was not named.
        """
        if self.source is None:
            self.source = await asyncio.to_thread(find, session.store.attach_reply)
        study = (await asyncio.to_thread(self.source.load)).study if self.source is not None else None
        session.store.condition_labels = conditions_of(study).labels if study is not None else {}
        session.on_change({"status"})

    def recover(self, attach_reply: AttachReply, report: ReportProgress) -> RecoveredClient:
        """Recover a session of this study as its participant's, like `Launcher.recover`. Raises StudyError."""
        of, source = attach_reply.view.session, self.source
        if of is None or source is None:
            raise StudyError("it is of no study")
        name = Path(attach_reply.folder).name
        entry = SessionEntry(of.participant, of.run, of.attempt, of.purpose or "counted", name, "", "unfinished")
        started = source.recover(entry, attach_reply.view.wizard, report)
        return RecoveredClient(started.client, started.notice)

    def over_text(self, store: Store) -> str:
        """The sentence for a session that ended elsewhere."""
        of = store.view.session
        asks = "; press enter to record its outcome" if self.unjudged(store) and store.ended_in_order else ""
        return f"{run_text(of) if of is not None else ''}: {clean(store.gone_reason)}{asks}"

    def unjudged(self, store: Store) -> str:
        """The participant whose session still needs an outcome; empty: none."""
        of = store.view.session
        return of.participant if of is not None and of.purpose == "counted" and store.view.outcome is None else ""

    async def ask_how_it_ends(self, app: App[Any], session: ConsoleSession) -> Ending | None:
        """Ask the checks after a session, its outcome and the word, in a worker; None: the wizard left."""
        store = session.store
        of = store.view.session
        if of is None or of.purpose != "counted":
            question = end_session_dialog(store, "It does not count. The screen of the study opens next.")
            question.add_class("-quit")
            yes = await app.push_screen_wait(question)
            return Ending((), "the rehearsal has ended; it does not count") if yes else None
        checked = await self._make_checks(app, session, of)
        if checked is None:
            return None
        lines = [
            session_title(store),
            *running_lines(store),
            "",
            "What runs is stopped, and the session ends permanently.",
        ]
        dialog = OutcomeDialog(f"End the session of {participant_text(store)}?", lines, ends=True)
        dialog.add_class("-quit")
        outcome = await app.push_screen_wait(dialog)
        if outcome is None:
            return None
        report = OutcomeReport(status=outcome.status, reason=outcome.reason, source=store.own_name)
        return Ending((*checked, report), f"{run_text(of)}: {outcome.status}")

    async def _make_checks(
        self, app: App[Any], session: ConsoleSession, of: SessionRecord
    ) -> tuple[CheckReport, ...] | None:
        """Make the checks after the session; None: the wizard left."""
        store = session.store
        if (source := self.source) is None:
            return ()
        now = await asyncio.to_thread(source.load)  # its checks may have changed meanwhile
        if not now.after or (study := now.study) is None:
            return ()
        attached = store.attach_reply
        context = CheckContext(
            study,
            of.participant,
            attached.scenario.folder,
            "real" if attached.mode == "real" else "debug",
            run=of.run,
            robot=attached.robot,
            wizard=store.wizard,
            session=Path(attached.folder).name,
        )
        warn = partial(self._warn, session)
        screen = ChecksScreen(
            f"After the session of {participant_text(store)}",
            CheckList(now.after, "counted", binding=False),
            StudyChecker(app, source, context, warn),
            go="record the outcome and end the session",
            wizard=store.own_name,
        )
        screen.add_class("-quit")
        return await app.push_screen_wait(screen)

    @staticmethod
    def _warn(session: ConsoleSession, sentence: str) -> None:
        session.show_notice(Notice(sentence, "fault"))
