"""A study in its folder, for a console: reads its files, starts its sessions' engines, writes decisions."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from msgspec.structs import replace

from rise_engine.base.errors import FileError, SessionError, StudyError
from rise_engine.base.files import is_locked
from rise_engine.checks.outcome import CheckContext, CheckOutcome
from rise_engine.checks.runner import append_checked, run_check
from rise_engine.kernel.inputs import CheckReport
from rise_engine.ports.bridge import RosConnection
from rise_engine.results.report.document import Document
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.engine.drivers import robot_warnings
from rise_engine.run.protocol.client import AttachReply
from rise_engine.run.protocol.registry import RegistryError, ask_summary
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineRefused, start_engine
from rise_engine.scenario.loader import load as load_scenario
from rise_engine.scenario.model import SIMULATED
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import InputLine, JournalHeader, LineError, read_line
from rise_engine.session.lock import read_holder
from rise_engine.study.begin import BeginRequest, CannotBegin, plan_session, turn_warning
from rise_engine.study.checks import pending_checks
from rise_engine.study.judge import judge_session
from rise_engine.study.model import OutcomeStatus, SessionEntry, Study, StudyCheck, StudyStanding
from rise_engine.study.participants import SessionKind, load_participants
from rise_engine.study.plan_file import read_plan
from rise_engine.study.recording_table import decide_recording, recorders_text
from rise_engine.study.sessions import SESSIONS
from rise_engine.study.state import OpenStudy, StudyStatus, read_state
from rise_engine.study.study_log import LOG_FILE, StudyLogError
from rise_engine.study.study_toml import STUDY_FILE, load_study
from rise_engine.study.traces import study_of_session
from rise_tui.config.launch import (
    ReportProgress,
    SessionPreview,
    SessionRequest,
    StartedSession,
    StudyNow,
    startup_notice,
)
from rise_tui.config.preferences import expand_home
from rise_tui.model.study_rows import NO_CONDITIONS, conditions_of

TAIL_BYTES = 262_144
"""Bytes at the end of a journal that contain its last lines."""
WATCHED_FILES = (STUDY_FILE, "participants.csv", "plan.csv", LOG_FILE)
"""Files of a study that are watched for changes."""


def open_study(named: str, ros: RosConnection) -> StudyFolder:
    """The study that is named by its folder or its study.toml."""
    path = expand_home(named)
    return StudyFolder(str((path.parent if path.name == STUDY_FILE else path).absolute()), ros)


def find_study(attach_reply: AttachReply, ros: RosConnection) -> StudyFolder | None:
    """The study of a console's session; None: there is none, or it is not on this computer."""
    folder = study_of_session(Path(attach_reply.folder)) if attach_reply.folder else None
    return StudyFolder(str(folder), ros) if folder is not None else None


class StudyFolder:
    """Implements `rise_tui.config.launch.StudySource`."""

    def __init__(self, folder: str, ros: RosConnection) -> None:
        """`ros`: the connection of sessions that begin here to ROS 2."""
        self.folder, self._ros = folder, ros
        self._root = Path(folder, SESSIONS)
        self._running: tuple[Path, ...] = ()
        """Sessions that ran when the study was last read."""

    # --- reading ----------------------------------------------------------------------------------------------------

    def load(self) -> StudyNow:
        """Return the study in its present state."""
        checked = load_study(self.folder)
        problems = [str(each) for each in checked.errors]
        if checked.study is not None:
            for part in (load_participants(checked.study), read_plan(checked.study)):
                problems += [str(each) for each in part.errors]
        if problems or checked.study is None:
            return StudyNow(checked.study, problems=tuple(problems))
        try:
            state = read_state(Path(self.folder))
        except FileError as error:
            return StudyNow(checked.study, problems=tuple(error.lines))
        except (StudyLogError, OSError) as error:
            return StudyNow(checked.study, problems=(str(error),))
        self._running = tuple(each.path for each in state.sessions if each.entry.status == "running")
        after = pending_checks(state.study, "after", state.log, datetime.now().astimezone())
        return StudyNow(state.study, self._with_lengths(state.standing), after=after)

    def _with_lengths(self, standing: StudyStanding) -> StudyStanding:
        """Add the length of each session without an outcome. The study's log has only the others."""

        def measured(entry: SessionEntry) -> SessionEntry:
            if entry.outcome is not None or entry.status == "running":
                return entry
            return replace(entry, seconds=_last_time(self._root / entry.folder / JOURNAL))

        people = (replace(each, sessions=tuple(map(measured, each.sessions))) for each in standing.participants)
        return replace(standing, participants=tuple(people))

    def fingerprint(self) -> object:
        """A value that changes when a file changes, a session begins or an engine goes."""
        stamps = [_stamp(Path(self.folder, name)) for name in WATCHED_FILES]
        return stamps, _stamp(self._root), [is_locked(folder / JOURNAL) for folder in self._running]

    def _state(self) -> StudyStatus:
        """Read the study's state. Raises StudyError."""
        try:
            return read_state(Path(self.folder))
        except (FileError, StudyLogError, OSError) as error:
            raise StudyError(_one_line(error)) from None

    # --- previews ---------------------------------------------------------------------------------------------------

    def plan(self, request: SessionRequest, wizard: str) -> SessionPreview:
        """Return what would run if every check passes."""
        state = self._state()
        study = state.study
        mode = "debug" if request.purpose == "debug" else study.mode
        try:
            plan = plan_session(
                state,
                BeginRequest(
                    request.participant, request.run, request.purpose, request.condition, mode, _all_passed(study)
                ),
            )
        except CannotBegin as error:
            raise StudyError("; ".join(error.lines)) from None
        robot = study.robot or None
        loaded = load_scenario(plan.run.scenario, robot=robot, mode=plan.mode)
        scenario = loaded.scenario
        if scenario is None:
            raise StudyError(f"{plan.run.scenario} does not load: {'; '.join(map(str, loaded.errors))}")
        now = datetime.now().astimezone()
        standing = next((each for each in state.standing.participants if each.participant == plan.participant), None)
        recording = decide_recording(study, state.participants, plan.participant, plan.purpose)
        return SessionPreview(
            SessionRequest(plan.participant, plan.purpose, request.condition, request.run),
            plan.run,
            slot=plan.slot,
            attempt=plan.attempt,
            runs=standing.runs if standing is not None else 1,
            title=scenario.title,
            mode=plan.mode,
            robot=scenario.robot.title or scenario.robot.name,
            simulated=scenario.robot.driver == SIMULATED,
            warnings=tuple(robot_warnings(scenario)),
            recorded=str(self._root),
            recorders=recorders_text(recording.settings),
            unrecorded=recording.remark,
            language=plan.language,
            warning=turn_warning(state, plan),
            context=CheckContext(
                study,
                plan.participant,
                plan.run.scenario,
                plan.mode,
                plan.purpose,
                plan.run.run,
                robot,
                wizard,
                self._ros,
                SessionKind(plan.run, plan.language),
            ),
            checks=() if plan.purpose == "debug" else pending_checks(study, "before", state.log, now),
            keys=scenario.keys,
        )

    # --- checks -----------------------------------------------------------------------------------------------------

    async def check(self, check: StudyCheck, context: CheckContext) -> CheckOutcome:
        """Examine something, or run a program."""
        return await run_check(check, context)

    def note_check(self, check: StudyCheck, context: CheckContext, report: CheckReport) -> None:
        """Write the result of a check."""
        try:
            append_checked(check, context, report)
        except (StudyLogError, OSError) as error:
            raise StudyError(f"the result of the check {check.id} cannot be saved: {error}") from None

    # --- sessions ---------------------------------------------------------------------------------------------------

    def start(
        self, plan: SessionPreview, checks: Sequence[CheckReport], wizard: str, report: ReportProgress
    ) -> StartedSession:
        """Begin a session. Its engine decides under the study's lock whether that is possible."""
        request = plan.request
        options = SessionOptions(
            "",
            mode="debug" if request.purpose == "debug" else None,
            participant=request.participant,
            condition=request.condition,
            study=self.folder,
            run=request.run,
            purpose=request.purpose,
            checks=tuple(checks),
            wizard=wizard,
            ros=self._ros,
        )
        return self._start_engine(options, wizard, report)

    def recover(self, entry: SessionEntry, wizard: str, report: ReportProgress) -> StartedSession:
        """Continue a session that did not end. The options have its folder and its participant."""
        options = SessionOptions(
            "",
            participant=entry.participant,
            study=self.folder,
            purpose=entry.purpose,
            unfinished=str(self._root / entry.folder),
            wizard=wizard,
            ros=self._ros,
        )
        return self._start_engine(options, wizard, report)

    def _start_engine(self, options: SessionOptions, wizard: str, report: ReportProgress) -> StartedSession:
        found = start_engine(options, report)
        if isinstance(found, EngineRefused):
            if found.socket:  # another console has just started or continued it
                return self._reach(found.socket, wizard)
            raise StudyError("; ".join(found.lines))
        who = wizard or _last_wizard(found.name)
        return StartedSession(SocketClient(found.name, who, "wizard"), startup_notice(found), who)

    def attach(self, entry: SessionEntry, wizard: str) -> StartedSession:
        """Attach to a running session."""
        holder = read_holder(self._root / entry.folder)
        if holder is None or not holder.socket:
            raise StudyError(f"the session of {entry.participant} is just beginning or ending: try again")
        if not holder.is_this_computer:
            raise StudyError(f"the session of {entry.participant} runs elsewhere: {holder}")
        return self._reach(holder.socket, wizard)

    def _reach(self, socket: str, wizard: str) -> StartedSession:
        who = wizard or _last_wizard(socket)
        if not who:
            raise StudyError("the session does not answer: try again, or see `rise-engine sessions`")
        return StartedSession(SocketClient(socket, who, "wizard"), wizard=who)

    def report(self, folder: str) -> Document:
        """The report of a session. A blinded study shows the label of its condition."""
        from rise_engine.results.report.making import make_session_report  # not needed to begin a session

        study = load_study(self.folder, check_scenarios=False).study
        conditions = conditions_of(study) if study is not None else NO_CONDITIONS
        try:
            return make_session_report(self._root / folder, label=conditions.label).document
        except (SessionError, OSError) as error:
            raise StudyError(_one_line(error)) from None

    def judge(self, entry: SessionEntry, status: OutcomeStatus, reason: str, wizard: str) -> None:
        """Write how a session counts that has ended, or that will not continue."""
        try:
            with OpenStudy(Path(self.folder)) as study:
                source = f"wizard:{wizard}"
                judge_session(study, entry.participant, status, reason, session=entry.folder, source=source)
        except (StudyError, FileError, StudyLogError, OSError) as error:
            raise StudyError(_one_line(error)) from None


def _last_time(journal: Path) -> float:
    """The session time of the last whole entry in a journal; 0 without one, or if it cannot be read."""
    try:
        with journal.open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - TAIL_BYTES))
            lines = file.read().split(b"\n")
    except OSError:
        return 0.0
    for line in reversed(lines):
        with suppress(LineError):
            found = read_line(line)
            if not isinstance(found, JournalHeader):
                return found.input.t if isinstance(found, InputLine) else found.t
    return 0.0


def _stamp(path: Path) -> tuple[int, int]:
    """When a file was changed, and its length; zeros if it does not exist."""
    try:
        found = os.stat(path)  # noqa: PTH116
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_size


def _all_passed(study: Study) -> tuple[CheckReport, ...]:
    """Return reports of all checks before a session, as passed."""
    return tuple(CheckReport(id=check.id, result="passed") for check in study.checks if check.when == "before")


def _last_wizard(name: str) -> str:
    """The wizard who last held control of a session; empty: unknown."""
    try:
        found = ask_summary(name)
    except RegistryError:
        return ""
    return found.wizard if found is not None else ""


def _one_line(error: Exception) -> str:
    return "; ".join(str(error).splitlines())
