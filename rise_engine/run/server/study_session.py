"""A session of a study from its options to its entries in the study's log.

It writes in this order, under the log's lock, so that a kill after any write leaves a known state. After `taken`, the
participant gets the same row again. Then come the session's folder, ignored while it is empty, and the journal.
`session` and, at the end, `outcome` repeat what these say, so the next opening of the study can write them.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from rise_engine.base import exit_status
from rise_engine.base.errors import FileError, RiseError, SessionError
from rise_engine.kernel.inputs import CheckReport, SessionStarted
from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import assigned_keys
from rise_engine.run.server.spawn import EngineRefused
from rise_engine.session.folder import SessionInfo, describe_session, find_session, mark_abandoned
from rise_engine.session.lock import read_holder
from rise_engine.study.begin import (
    BeginRequest,
    CannotBegin,
    SessionPlan,
    plan_session,
    running_problem,
    sessions_to_give_up,
    unfinished_sessions_of,
)
from rise_engine.study.recording_table import RecordingDecision, decide_recording
from rise_engine.study.sessions import (
    SESSIONS,
    StudySession,
    given_up_fields,
    refuse_running_elsewhere,
    session_fields,
)
from rise_engine.study.state import OpenStudy, StudyStatus
from rise_engine.study.study_log import LockedLog, StudyLogError

# --- refusals ---------------------------------------------------------------------------------------------------------


class ServeRefused(RiseError):
    """A session cannot be served."""

    def __init__(
        self,
        code: int,
        *lines: str,
        unfinished: Sequence[Path] = (),
        others: Sequence[Path] = (),
        socket: str = "",
    ) -> None:
        super().__init__(*lines)
        self.report = EngineRefused(code, list(lines), _describe_all(unfinished), _describe_all(others), socket)


def _describe_all(folders: Sequence[Path]) -> list[tuple[str, str]]:
    return [(str(folder), describe_session(folder)) for folder in folders]


_LOG = logging.getLogger(__name__)
_CHECK_FIELDS = ("id", "text", "result", "value", "reason", "source")


class StudyPreparation:
    """A study's decisions about the session that will begin or continue."""

    def __init__(self, options: SessionOptions) -> None:
        """:param options: with the study's folder."""
        self.options = options
        self.folder = Path(options.study).absolute()
        self.root = self.folder / SESSIONS
        """The folder of its sessions."""
        self.plan: SessionPlan | None = None
        """The plan of the new session; None: one continues."""
        self.state: StudyStatus
        """The study's state when the session was chosen."""

    # --- choosing ---------------------------------------------------------------------------------------------------

    def choose(self) -> Path | None:
        """Return the folder of the participant's session to continue; None: `plan` is the new one.

        :raises ServeRefused: with all reasons.
        """
        with ExitStack() as stack:
            open = self._open(stack)
            self.state = open.state
            unfinished = self._session_to_recover(open.state)
            if unfinished is None:
                self.plan = self._plan(open)
            return unfinished

    def refuse_running(self) -> None:
        """Name the running session of the study. Raises ServeRefused."""
        with ExitStack() as stack:
            self._raise_running(self._open(stack).state)
        raise ServeRefused(exit_status.REFUSED, f"a session of this study is just beginning or ending: {self.folder}")

    def _open(self, stack: ExitStack) -> OpenStudy:
        try:
            return stack.enter_context(OpenStudy(self.folder))
        except FileError as error:
            raise ServeRefused(exit_status.REFUSED, *error.lines) from None
        except StudyLogError as error:
            raise ServeRefused(exit_status.NOT_WRITTEN, str(error)) from None

    def _request(self, state: StudyStatus) -> BeginRequest:
        options = self.options
        mode = "debug" if options.purpose == "debug" else options.mode or state.study.mode
        return BeginRequest(
            participant=options.participant,
            run=options.run,
            purpose="debug" if mode == "debug" else options.purpose,
            condition=options.condition,
            mode="debug" if mode == "debug" else "real",
            checks=options.checks,
            seed=options.seed,
        )

    def _plan(self, open: OpenStudy) -> SessionPlan:
        state = open.state
        varied = {
            key.partition(".")[0] for factor in state.study.factors for each in factor.levels for key in each.memory
        }
        if beside := [key for key in dict.fromkeys(assigned_keys(self.options)) if key in varied]:
            sentences = [f"`{key}` cannot be set: a factor of the study says what it is" for key in beside]
            raise ServeRefused(exit_status.USAGE, *sentences)
        request = self._request(state)
        if self.options.unfinished == "new":
            state = state.with_outcomes(map(given_up_fields, sessions_to_give_up(state, request)))
        try:
            return plan_session(state, request)
        except CannotBegin as error:
            if error.running:
                self._raise_running(open.state, *error.lines)
            if error.unfinished is not None:
                path = self.root / error.unfinished.folder
                raise ServeRefused(exit_status.UNFINISHED, *error.lines, unfinished=[path]) from None
            raise ServeRefused(exit_status.REFUSED, *error.lines) from None

    def _raise_running(self, state: StudyStatus, *sentences: str) -> None:
        """Refuse because a session runs. Only the participant's own is named, with its socket for a console."""
        participant = self.options.participant
        running = next((each for each in state.sessions if each.entry.status == "running"), None)
        if running is None:
            return
        sentences = sentences or (running_problem(state, participant),)
        if participant and running.entry.participant == participant:
            holder = read_holder(running.path)
            socket = holder.socket if holder is not None and holder.is_this_computer else ""
            raise ServeRefused(exit_status.ALREADY_RUNNING, *sentences, socket=socket)
        raise ServeRefused(exit_status.REFUSED, *sentences)

    def _session_to_recover(self, state: StudyStatus) -> Path | None:
        """Return the folder of the session to recover; None: a new one begins. Raises ServeRefused."""
        wanted = self.options.unfinished
        if wanted in ("ask", "new"):
            return None
        if wanted == "recover":
            theirs = unfinished_sessions_of(state, self._request(state))
            if not theirs:
                return None
            session = theirs[-1]
        else:
            session = self._named_session(state, wanted)
        if running := running_problem(state, session.entry.participant):
            self._raise_running(state, running)
        if state.places.is_out(session.entry.participant) and session.entry.purpose == "counted":
            why = "is excluded or has withdrawn"
            raise ServeRefused(exit_status.REFUSED, f"{session.entry.participant} {why}: {session.name} does not go on")
        return session.path

    def _named_session(self, state: StudyStatus, wanted: str) -> StudySession:
        named = self.root / wanted
        try:
            path = find_session(str(named) if named.is_dir() else wanted)
        except SessionError as error:
            raise ServeRefused(exit_status.USAGE, str(error)) from None
        session = next((each for each in state.sessions if each.path.resolve() == path.resolve()), None)
        if session is None:
            raise ServeRefused(exit_status.USAGE, f"{path.name} is not a session of the study {state.study.id}")
        owner, named_participant = session.entry.participant, self.options.participant
        if named_participant not in ("", owner):
            raise ServeRefused(
                exit_status.USAGE,
                f"{path.name} is the session of {owner}, not of {named_participant}: nothing was started",
            )
        if session.entry.outcome is not None:
            raise ServeRefused(exit_status.USAGE, f"{path.name} is over: it was judged {session.entry.outcome}")
        return session

    # --- beginning --------------------------------------------------------------------------------------------------

    def first_input(self) -> SessionStarted:
        """Return the first input of the new session, without versions."""
        assert self.plan is not None
        return self.plan.first_input(self.state.study)

    def open_for_beginning(self, stack: ExitStack) -> LockedLog:
        """Lock the log until the stack closes, check that nothing has changed, and take the row.

        :raises ServeRefused: something has changed, or the log cannot be written.
        """
        open = self._open(stack)
        assert self.plan is not None
        if self._plan(open) != self.plan:
            raise ServeRefused(
                exit_status.REFUSED, "the study changed while the session was prepared, so it did not begin: try again"
            )
        new = self.options.unfinished == "new"
        given_up = sessions_to_give_up(open.state, self._request(open.state)) if new else []
        try:
            for session in given_up:  # check all of them before anything is written
                refuse_running_elsewhere(session, here=self.options.from_other_computer)
            for session in given_up:
                give_up(open.log, session)
            if self.plan.takes_slot:
                drawn = {"levels": dict(self.plan.drawn)} if self.plan.drawn else {}
                open.log.append("taken", slot=self.plan.slot, participant=self.plan.participant, **drawn)
        except StudyLogError as error:
            raise ServeRefused(exit_status.NOT_WRITTEN, str(error)) from None
        except SessionError as error:
            raise ServeRefused(exit_status.ALREADY_RUNNING, str(error)) from None
        return open.log

    def note_begun(self, log: LockedLog, folder: Path, info: SessionInfo) -> None:
        """Write that the session began, with the checks before it. Raises StudyLogError."""
        checks = [{name: getattr(each, name) for name in _CHECK_FIELDS} for each in self.options.checks]
        log.append("session", **session_fields(folder.name, info), checks=checks)

    def decide_recording(self, info: SessionInfo) -> RecordingDecision:
        """Decide which recorders run in a new or continued session.

        :param info: its session.toml.
        """
        state, purpose = self.state, info.purpose or "counted"
        asked = self.options.record
        return decide_recording(state.study, state.participants, info.participant, purpose, asked)

    # --- continuing and ending --------------------------------------------------------------------------------------

    def unrecorded_checks(self, folder: Path, view: SessionView) -> list[CheckReport]:
        """Return the checks of a continued session that are missing in its record."""
        entry = next(
            (each for each in self.state.log if each.kind == "session" and each.get("folder") == folder.name), None
        )
        given = (entry.get("checks") if entry is not None else None) or []
        reports = [CheckReport(**{name: each[name] for name in _CHECK_FIELDS}) for each in given]
        return [each for each in reports if each.id not in view.checks]

    def note_ended(self) -> None:
        """Write the outcome after the journal is closed. If that fails, the study's next opening writes it."""
        try:
            with OpenStudy(self.folder):
                pass  # opening it writes the state of the session folders
        except (FileError, StudyLogError) as error:
            _LOG.error("the outcome is in the journal and not yet in the study's log: %s", error)


def give_up(log: LockedLog, session: StudySession) -> None:
    """Give up a session that did not end, so that it is not offered again for continuing.

    :raises StudyLogError: it cannot be written.
    """
    log.append("outcome", **given_up_fields(session))
    mark_abandoned(session.path)
