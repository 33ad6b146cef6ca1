"""A study's session on the console's side: the label of its condition, and the questions at its end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from textual.app import App

from rise_engine.base.errors import StudyError
from rise_engine.checks import CheckContext
from rise_engine.kernel.inputs import CheckReport, OutcomeReport
from rise_engine.kernel.records import SessionRecord
from rise_engine.run.protocol.client import AttachReply
from rise_engine.study.model import SessionEntry
from rise_tui.config.launch import RecoveredClient
from rise_tui.config.study_source import ReportProgress, StudySource
from rise_tui.console.session import ConsoleSession
from rise_tui.console.study_dialogs import StudyChecker
from rise_tui.model.check_list import CheckList
from rise_tui.model.notice import Notice
from rise_tui.model.status import participant_text, running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.model.study_rows import conditions_of
from rise_tui.rendering.text import clean
from rise_tui.screens.checks import ChecksScreen
from rise_tui.screens.outcome import OutcomeDialog, end_session_dialog


class Ending(NamedTuple):
    """How a session should end."""

    reports: tuple[CheckReport | OutcomeReport, ...]
    """What to record before it ends."""
    sentence: str
    """The sentence for the study's screen afterwards."""


def run_text(of: SessionRecord) -> str:
    """`P07, run 2`: without the condition, which a hidden study shows only in its session."""
    return f"{clean(of.participant)}, run {of.run}"


class StudyDay:
    """What the app knows of the study whose sessions it shows."""

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

        `find`: finds the study by the session's folder if nobody named it.
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
        """The sentence for a session that was over before anybody ended it here."""
        of = store.view.session
        asks = "; press enter to record its outcome" if self.unjudged(store) and store.ended_in_order else ""
        return f"{run_text(of) if of is not None else ''}: {clean(store.gone_reason)}{asks}"

    def unjudged(self, store: Store) -> str:
        """The participant whose session still needs an outcome; empty: none does."""
        of = store.view.session
        return of.participant if of is not None and of.purpose == "counted" and store.view.outcome is None else ""

    async def ask_how_it_ends(self, app: App[Any], session: ConsoleSession) -> Ending | None:
        """Ask the checks after a session, its outcome and the word, in a worker. None when somebody leaves."""
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
        """Make the checks after the session; None when somebody leaves."""
        store = session.store
        if (source := self.source) is None:
            return ()
        now = await asyncio.to_thread(source.load)  # its checks may have changed in the meantime
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
