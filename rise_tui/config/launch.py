"""How a console starts sessions, alone or of a study, and what it sees of a study. Tests use other implementations.

The console uses no file of a study and no engine's process; `rise_tui.cli.study_folder` does. Only this module starts
engines.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeAlias

from msgspec import Struct

from rise_engine.checks.outcome import CheckContext, CheckOutcome
from rise_engine.kernel.inputs import CheckReport
from rise_engine.results.report.document import Document
from rise_engine.run.protocol.client import AttachReply, Client
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineStarted
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Condition, KeyBinding, Scenario
from rise_engine.scenario.reading.conditions import conditions_in
from rise_engine.scenario.reading.robot_profiles import DEFAULT_ROBOT, robot_names
from rise_engine.study.checks import PendingCheck
from rise_engine.study.model import OutcomeStatus, PlannedRun, Purpose, SessionEntry, Study, StudyCheck, StudyStanding
from rise_tui.config.settings import find_scenario, scenario_folder, why_no_scenario

ReportProgress: TypeAlias = Callable[[str], object]
"""Receives a sentence, on any thread."""


class StudyNow(Struct, frozen=True):
    """A study's folder at one moment."""

    study: Study | None = None
    standing: StudyStanding | None = None
    """None: the study does not load, so nothing can start."""
    problems: tuple[str, ...] = ()
    """The errors of the study, one diagnostic each."""
    after: tuple[PendingCheck, ...] = ()
    """The checks after a session."""


class SessionRequest(Struct, frozen=True):
    """A session that a person may want to begin."""

    participant: str
    purpose: Purpose = "counted"
    condition: str = ""
    """A condition other than the participant's, for a rehearsal; empty: the participant's."""
    run: int = 0
    """The number of the run; 0: the next."""


class SessionPreview(Struct, frozen=True):
    """What would run if a session began now."""

    request: SessionRequest
    run: PlannedRun
    slot: int | None
    """The row of the plan that it has or takes; None: none."""
    attempt: int
    runs: int
    title: str
    """The scenario's."""
    mode: str
    robot: str
    """In words for a person."""
    recorded: str
    """The folder for the session's own folder."""
    context: CheckContext
    """The context of the checks."""
    checks: tuple[PendingCheck, ...] = ()
    """The checks before the session; none in debug mode."""
    keys: dict[str, KeyBinding] = {}
    """Of the scenario."""
    recorders: str = ""
    """The recorders of the session: `camera (obs), bag (rosbag2)`; empty: none."""
    language: str = ""
    """The participant's language in the study; empty: not given."""
    warning: str = ""
    """A sentence that another participant is next; empty: it is this participant's turn."""
    simulated: bool = False
    """Whether no robot moves, in any mode."""
    warnings: tuple[str, ...] = ()
    """Sentences about the robot, such as what F9 cannot stop."""
    unrecorded: str = ""
    """Why the study's recorders do not record all of it, in a sentence; empty: they do, or there are none."""


class StartedSession(Struct, frozen=True):
    """A running session."""

    client: Client
    notice: str = ""
    """The notice about it."""
    wizard: str = ""
    """The wizard's name, if returning to a session revealed it; empty: unchanged."""


class StudySource(Protocol):
    """One study. Every method except `check` may block, and runs off the console's loop."""

    folder: str
    """Absolute."""

    def load(self) -> StudyNow:
        """Return the present study. Never raises: the result contains the errors."""

    def fingerprint(self) -> object:
        """A value that changes when any input of `load` changes."""

    def plan(self, request: SessionRequest, wizard: str) -> SessionPreview:
        """Return what would run. Raises StudyError with the reason if nothing can."""

    async def check(self, check: StudyCheck, context: CheckContext) -> CheckOutcome:
        """Examine something, or run a program. A check that needs an answer returns a question. Never raises."""

    def note_check(self, check: StudyCheck, context: CheckContext, report: CheckReport) -> None:
        """Write the result of a check, even if no session begins after it. Raises StudyError."""

    def start(
        self, plan: SessionPreview, checks: Sequence[CheckReport], wizard: str, report: ReportProgress
    ) -> StartedSession:
        """Begin the session. Raises StudyError if nothing was started."""

    def attach(self, entry: SessionEntry, wizard: str) -> StartedSession:
        """Attach to a running session. Raises StudyError."""

    def recover(self, entry: SessionEntry, wizard: str, report: ReportProgress) -> StartedSession:
        """Continue a session that did not end. Raises StudyError."""

    def report(self, folder: str) -> Document:
        """Return the report of a session, by its folder's name, for the wizard. A blinded study shows its conditions'
        labels. May take a second. Raises StudyError."""

    def judge(self, entry: SessionEntry, status: OutcomeStatus, reason: str, wizard: str) -> None:
        """Write how a session counts that has ended, or that will not continue. Raises StudyError."""


class ScenarioProblems(Struct, frozen=True):
    """The scenario does not load."""

    diagnostics: list[Diagnostic]
    sentence: str = ""
    """Replaces the diagnostics if there is nothing to read."""

    @property
    def lines(self) -> list[str]:
        return [self.sentence] * bool(self.sentence) + [str(diagnostic) for diagnostic in self.diagnostics]


LoadedScenario: TypeAlias = "Scenario | ScenarioProblems"


def load_scenario(settings: SessionOptions) -> LoadedScenario:
    """Read and check the scenario. Blocking."""
    if problem := why_no_scenario(settings):
        return ScenarioProblems([], problem)
    loaded = load(
        find_scenario(settings.folder),
        robot=settings.robot,
        mode=settings.mode,
        paths=settings.paths,
        language=settings.language or None,
        allow_untranslated=settings.allow_untranslated,
    )
    return ScenarioProblems(list(loaded.diagnostics)) if loaded.scenario is None else loaded.scenario


SESSION_GOES_ON = "the session goes on; what the robot was doing counts as lost"


class RecoveredClient(NamedTuple):
    """A session that continues."""

    client: Client
    notice: str = SESSION_GOES_ON
    """The notice about it."""


def startup_notice(found: EngineStarted) -> str:
    """The notice about a session whose engine has just started."""
    return "; ".join((SESSION_GOES_ON, *found.lines) if found.recovered else found.lines)


@dataclass(frozen=True)
class Launcher:
    """How sessions are started. Tests use other implementations."""

    start: Callable[[Scenario, SessionOptions], Client]
    """May block. Raises EngineGone with the reason."""
    load_scenario: Callable[[SessionOptions], LoadedScenario] = load_scenario
    recover: Callable[[AttachReply, ReportProgress], RecoveredClient] | None = None
    """Continue a session whose engine has gone, and report the progress. May block. Raises EngineGone."""
    find_study: Callable[[AttachReply], StudySource | None] = lambda attach_reply: None
    """The study of a session, if its folder is in one."""


def settings_of_session(attach_reply: AttachReply) -> SessionOptions:
    """The options with which a running session was started."""
    session = attach_reply.view.session
    return SessionOptions(
        attach_reply.scenario.folder,
        attach_reply.robot,
        attach_reply.mode,
        attach_reply.seed,
        paths=dict(attach_reply.scenario.paths),
        participant=session.participant if session is not None else "",
        condition=session.condition if session is not None else "",
        language=attach_reply.scenario.language if attach_reply.scenario.says_language else "",
    )


def list_robots(folder: str) -> list[str]:
    """The robots to choose from for a scenario's folder."""
    return robot_names(scenario_folder(folder))


class ScenarioSummary(Struct, frozen=True):
    """A scenario's robot, mode, paths and conditions, without the rest of it."""

    robots: list[str]
    robot: str
    mode: str
    paths: Mapping[str, str]
    conditions: Mapping[str, Condition] = {}
    """By name. Empty for a scenario of an earlier version, which lists only names and cannot begin with one."""


def read_summary(folder: str) -> ScenarioSummary | None:
    """The summary, or None if there is nothing to read. Blocking."""
    path = find_scenario(folder)
    try:
        if not folder.strip() or not scenario_folder(folder).is_dir():
            return None
        file = path if path.suffix == ".toml" else path / SCENARIO_FILE
        values = tomllib.loads(file.read_text(encoding="utf-8-sig")) if file.exists() else {}
        names = list_robots(folder)
    except (OSError, ValueError):  # loading it reports the errors
        return None

    def text(key: str, otherwise: str) -> str:
        value = values.get(key)
        return value if isinstance(value, str) and value else otherwise

    robot = text("robot", DEFAULT_ROBOT)
    paths = {kind: text(kind, usual) for kind, usual in DEFAULT_PATHS.items()}
    return ScenarioSummary(
        names if robot in names else [*names, robot],
        robot,
        "real" if text("mode", "") == "real" else "debug",
        paths,
        conditions_in(values),
    )


def is_real(settings: SessionOptions) -> bool:
    """Whether a session with these settings would move a robot, as far as known before it loads."""
    found = read_summary(settings.folder) if settings.mode is None else None
    return (settings.mode or (found.mode if found is not None else "")) == "real"
