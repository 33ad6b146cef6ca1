"""The preparation of a session, with all refusals: its name, scenario, robot and journal.

`SessionPreparation` locks the session's name, chooses between a new session and one that did not end, loads or recovers
it, and opens its journal. A refusal is a `ServeRefused`, with the exit status and sentences for a person.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from random import SystemRandom
from uuid import uuid4

from msgspec.structs import replace

from rise_engine.base import exit_status
from rise_engine.base.errors import AdapterError, SessionError
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.ports.bridge import Bridge, RosConnection
from rise_engine.ports.robot import Robot
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import RobotOptionsError, make_robot, open_bridge
from rise_engine.run.engine.engine import versions
from rise_engine.run.protocol.registry import RegistryError, SessionLock, acquire_lock, session_name
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import first_input, set_conflicts, start_problems
from rise_engine.run.recording.companion import CompanionRequest, companions_for
from rise_engine.run.server.hub import SessionHub
from rise_engine.run.server.spawn import ReportStartup, StartupProgress
from rise_engine.run.server.study_session import ServeRefused as ServeRefused
from rise_engine.run.server.study_session import StudyPreparation
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import (
    JOURNAL,
    belongs_to,
    create_session,
    find_session,
    find_unfinished,
    mark_abandoned,
    participant_text,
    read_info,
    running_sessions,
    sessions_folder,
)
from rise_engine.session.journal import Journal
from rise_engine.session.lock import JournalLock, JournalLockedError, one_at_a_time, running_message
from rise_engine.session.recovery import RecoveredSession, recover
from rise_engine.study.begin import CannotBegin, SessionPlan
from rise_engine.study.model import RecordingSettings
from rise_engine.study.recording_table import RecordingDecision
from rise_engine.study.study_log import StudyLogError
from rise_engine.study.traces import study_of_session


class SessionPreparation:
    """One session, from its options to its open journal. The caller closes it."""

    def __init__(self, options: SessionOptions, report: ReportStartup) -> None:
        """Choose the session, and load its scenario or recover it, which can take long.

        :param options: the user's.
        :param report: gets sentences about a recovery.
        :raises ServeRefused: nothing was started; locks are released.
        """
        self.options = options = _with_study_of_session(options)
        self.study = StudyPreparation(options) if options.study else None
        """Only for a session of a study."""
        self.recovered: RecoveredSession | None = None
        self.started = SessionStarted()
        """The first input of a new session."""
        self.lock: JournalLock | None = None
        """The journal's lock of a continued session, until the journal is open."""
        self.name = options.socket_name or session_name(Path(options.study or options.folder))
        self.name_lock = self._acquire_name()
        try:
            unfinished = self._choose_unfinished()
            if unfinished is not None:
                self._recover(unfinished, report)
            else:
                self._load_scenario()
                self._refuse_other_memory()
        except SessionError as error:  # for example, an edited file of another session
            self.close()
            raise ServeRefused(exit_status.FAILED, str(error)) from None
        except BaseException:
            self.close()
            raise

    def _acquire_name(self) -> SessionLock:
        try:
            lock = acquire_lock(self.name)
        except RegistryError as error:
            raise ServeRefused(exit_status.FAILED, str(error)) from None
        if lock is None and self.study is not None:
            self.study.refuse_running()
        if lock is None:
            raise ServeRefused(
                exit_status.ALREADY_RUNNING, f"a session of this scenario is running already: {self.name}"
            )
        return lock

    def close(self) -> None:
        """Release the locks that are still held."""
        if self.lock is not None:
            self.lock.release()
        self.name_lock.close()

    def _choose_unfinished(self) -> Path | None:
        """Return the folder of the session to continue; None for a new session."""
        options = self.options
        if self.study is not None:
            return self.study.choose()
        self._refuse_if_running(options.folder)
        if options.unfinished not in ("ask", "new", "recover"):
            try:
                folder = find_session(options.unfinished)
                self._check_participant(folder)
            except SessionError as error:
                raise ServeRefused(exit_status.USAGE, str(error)) from None
            return folder
        unfinished = find_unfinished(str(Path(options.folder).absolute()))
        theirs = [each for each in unfinished if self._is_same_participant(each)]
        others = [each for each in unfinished if each not in theirs]
        if options.unfinished == "ask" and unfinished:
            raise ServeRefused(
                exit_status.UNFINISHED,
                "an earlier session of this scenario did not end: recover it, or begin a new one",
                unfinished=theirs,
                others=others,
            )
        if options.unfinished == "new":
            for folder in theirs:  # others can still be recovered
                mark_abandoned(folder)
            return None
        if others and not theirs:
            raise ServeRefused(
                exit_status.UNFINISHED,
                f"no session of {participant_text(options.participant, options.condition)} waits to be recovered",
                others=others,
            )
        return theirs[0] if theirs else None

    def _is_same_participant(self, unfinished: Path) -> bool:
        """Whether a session is of the named participant and condition, by its journal. Its other files may differ."""
        return belongs_to(read_info(unfinished, compare=False), self.options.participant, self.options.condition)

    def _refuse_if_running(self, scenario_folder: str) -> None:
        """Refuse a second session of a scenario in any environment, unless it has its own socket name."""
        if self.options.socket_name is not None:
            return
        for folder, holder in running_sessions(str(Path(scenario_folder).absolute())).items():
            socket = holder.socket if holder is not None and holder.is_this_computer and self.study is None else ""
            raise ServeRefused(exit_status.ALREADY_RUNNING, running_message(folder, holder), socket=socket)

    def _check_participant(self, folder: Path) -> None:
        """Check that a session does not continue for another participant. Raises SessionError."""
        options, info = self.options, read_info(folder)
        if not belongs_to(info, options.participant, options.condition):
            owner = participant_text(info.participant, info.condition)
            named = participant_text(options.participant, options.condition)
            raise SessionError(f"{folder.name} is the session of {owner}, not of {named}: nothing was started")

    def _load_scenario(self) -> None:
        options = self.options
        folder, robot, mode, seed = options.folder, options.robot, options.mode, options.seed
        self.language = options.language
        if self.study is not None and (plan := self.study.plan) is not None:
            folder, mode, seed = plan.run.scenario, plan.mode, plan.seed
            robot = robot or self.study.state.study.robot or None
            self.language = _language_of_session(plan, options, robot)
        loaded = load(
            folder,
            robot=robot,
            mode=mode,
            paths=options.paths,
            language=self.language or None,
            allow_untranslated=options.allow_untranslated,
        )
        if loaded.scenario is None:
            raise ServeRefused(exit_status.REFUSED, *map(str, loaded.diagnostics))
        self.scenario: Scenario = loaded.scenario
        if self.study is not None:
            self.started = self.study.first_input()
        elif problems := start_problems(self.scenario, options):
            raise ServeRefused(exit_status.USAGE, *(f"error: {problem}" for problem in problems))
        else:
            self.started = first_input(self.scenario, options)
        self.seed = seed if seed is not None else SystemRandom().randrange(2**31)
        self.speed, self.faults, self.ros = options.speed, options.faults, options.ros
        self.started = replace(self.started, injected_faults=self.faults, speed=self.speed, goals=uuid4().hex)
        self._files = loaded.files

    def _refuse_other_memory(self) -> None:
        """Check that the first tasks do not change values of the condition, from the command line or a study's plan."""
        if problems := set_conflicts(self.scenario, self.started, self.options.first_tasks):
            raise ServeRefused(exit_status.USAGE, *(f"error: {problem}" for problem in problems))

    def open_journal(self, changed: Callable[[], None], now: Callable[[], float]) -> Journal:
        """Open the journal of a continued session, or make the folder and journal of a new one.

        :param changed: passed to `Journal`, which calls it on its thread.
        :param now: returns the session's time.
        :raises ServeRefused: it cannot be written, or another session of the scenario has begun meanwhile.
        """
        try:
            if self.recovered is not None:
                journal = Journal(
                    self.folder / JOURNAL, size=self.recovered.size, lock=self.lock, changed=changed, now=now
                )
                self.lock = None  # the journal owns it now
                return journal
            return self._begin(changed, now)
        except OSError as error:
            raise ServeRefused(exit_status.NOT_WRITTEN, f"the journal cannot be opened: {error}") from None
        except (SessionError, StudyLogError) as error:
            raise ServeRefused(exit_status.NOT_WRITTEN, str(error)) from None

    def _begin(self, changed: Callable[[], None], now: Callable[[], float]) -> Journal:
        """Make the new session's folder and journal, and its entry in the study's log."""
        root = sessions_folder() if self.study is None else self.study.root
        with suppress(OSError):
            root.mkdir(0o700, parents=True, exist_ok=True)
        with ExitStack() as stack:
            log = self.study.open_for_beginning(stack) if self.study is not None else None
            stack.enter_context(one_at_a_time(root))
            self._refuse_if_running(self.scenario.folder)
            self._make_folder(root)
            journal = Journal(self.folder / JOURNAL, changed=changed, now=now)
            if self.study is not None and log is not None:
                try:
                    self.study.note_begun(log, self.folder, read_info(self.folder))
                except BaseException:
                    journal.close()
                    raise
            return journal

    def _make_folder(self, root: Path) -> None:
        self.folder = create_session(
            root,
            self.scenario,
            self._files,
            seed=self.seed,
            faults=self.faults,
            connection=self.ros,
            versions=versions(),
            begun=self.started,
            language=self.language,
            allow_untranslated=self.options.allow_untranslated,
            wizard=self.options.wizard or (self.options.login if self.scenario.mode == "debug" else ""),
        )
        self.name_lock.write_folder(self.folder)

    def _recover(self, folder: Path, report: ReportStartup) -> None:
        def on_progress(sentence: str) -> None:
            report(StartupProgress(f"recovering: {sentence}"))

        try:
            self.name_lock.write_folder(folder)
            with one_at_a_time(folder.parent):
                self._refuse_if_running(read_info(folder).scenario_folder)
                self.lock = JournalLock(folder / JOURNAL, here=self.options.from_other_computer)
            self.recovered = recover(folder, lock=self.lock, on_progress=on_progress)
        except JournalLockedError as error:
            holder = error.holder
            socket = holder.socket if holder and holder.is_this_computer else ""
            raise ServeRefused(exit_status.ALREADY_RUNNING, str(error), socket=socket) from None
        except (OSError, SessionError) as error:
            raise ServeRefused(exit_status.UNRECOVERABLE, f"{folder.name} cannot be recovered: {error}") from None
        info = self.recovered.info
        self.scenario, self.folder = self.recovered.scenario, folder
        self.seed, self.speed, self.faults = info.seed, info.speed, info.faults
        self.ros = RosConnection(info.ros, info.ros_args)

    @property
    def session_id(self) -> str:
        """The source of the goals' UUIDs. It stays the same after a recovery and in a renamed folder."""
        begun = self.recovered.kernel.begun if self.recovered is not None else self.started
        return begun.goals or f"{self.folder.name} {self.seed}"

    def decide_recording(self) -> RecordingDecision:
        """Decide which recorders run, once its journal is open; none outside of a study."""
        if self.study is None:
            return RecordingDecision(RecordingSettings())
        return self.study.decide_recording(read_info(self.folder))

    def companions(self, settings: RecordingSettings) -> list[CompanionRequest]:
        """Make the requests for the processes that record the session."""
        info = read_info(self.folder)
        request = CompanionRequest(
            kind="recorders",
            socket=str(self.name_lock.socket.absolute()),
            session=self.folder.name,
            folder=str(self.folder.absolute()),
            study=str(self.study.folder) if self.study is not None else "",
            task=info.study,
            participant=info.participant,
            run=info.run,
            settings=settings,
        )
        return companions_for(request)

    async def connect(self) -> Bridge[SessionHub] | None:
        """Open the session's connection to ROS, if it has one. Raises ServeRefused."""
        try:
            return await open_bridge(self.ros, self.scenario.robot, self.scenario.mode)
        except AdapterError as error:
            raise ServeRefused(exit_status.REFUSED, *(f"error: {line}" for line in error.lines)) from None

    def make_robot(self, clock: RealClock, bridge: Bridge[SessionHub] | None) -> Robot:
        """Make the session's robot, over the bridge if that is its driver. Raises ServeRefused."""
        try:
            return make_robot(self.scenario.robot, self.scenario.mode, clock, self.seed, self.faults, bridge)
        except AdapterError as error:
            raise ServeRefused(exit_status.REFUSED, f"error: {error}") from None
        except RobotOptionsError as error:
            raise ServeRefused(exit_status.USAGE, f"error: {error}") from None


def _language_of_session(plan: SessionPlan, options: SessionOptions, robot: str | None) -> str:
    """Return the language of a study's session. Raises ServeRefused: the user wants another one."""
    if not plan.language:
        return options.language
    try:
        return plan.spoken_in(options.language, load(plan.run.scenario, robot=robot, mode=plan.mode))
    except CannotBegin as error:
        raise ServeRefused(exit_status.REFUSED, *error.lines) from None


def _with_study_of_session(options: SessionOptions) -> SessionOptions:
    """Add the study of a named session that belongs to one, if the user did not name it."""
    if options.study or options.unfinished in ("ask", "new", "recover"):
        return options
    try:
        study = study_of_session(find_session(options.unfinished))
    except SessionError:
        return options
    return options if study is None else replace(options, study=str(study))
