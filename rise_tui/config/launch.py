"""Starting a session: read the scenario and start an engine for it. Only this module knows how an engine is started."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from msgspec import Struct

from rise_engine.run.protocol.client import AttachReply, Client
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineStarted
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.file_names import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Condition, Scenario
from rise_engine.scenario.reading.conditions import conditions_in
from rise_engine.scenario.reading.robot_profiles import DEFAULT_ROBOT, robot_names
from rise_tui.config.settings import find_scenario, scenario_folder, why_no_scenario
from rise_tui.config.study_source import ReportProgress as ReportProgress
from rise_tui.config.study_source import StudySource


class ScenarioProblems(Struct, frozen=True):
    """The scenario does not load."""

    diagnostics: list[Diagnostic]
    sentence: str = ""
    """Replaces the diagnostics when there is nothing to read."""

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
    """How sessions are started. Tests pass in others."""

    start: Callable[[Scenario, SessionOptions], Client]
    """May block. Raises EngineGone with the reason."""
    load_scenario: Callable[[SessionOptions], LoadedScenario] = load_scenario
    recover: Callable[[AttachReply, ReportProgress], RecoveredClient] | None = None
    """Continue a session whose engine has gone, and report the progress. May block. Raises EngineGone."""
    find_study: Callable[[AttachReply], StudySource | None] = lambda attach_reply: None
    """The study that a session belongs to, if its folder is in one."""


def settings_of_session(attach_reply: AttachReply) -> SessionOptions:
    """What a running session was started with."""
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
    """What a folder's scenario says about robot, mode, paths and conditions. The rest of it is not read."""

    robots: list[str]
    robot: str
    mode: str
    paths: Mapping[str, str]
    conditions: Mapping[str, Condition] = {}
    """By name. Empty for a scenario of an earlier version, which lists only names: no session can begin in one."""


def read_summary(folder: str) -> ScenarioSummary | None:
    """The summary, or None if there is nothing to read. Blocking."""
    path = find_scenario(folder)
    try:
        if not folder.strip() or not scenario_folder(folder).is_dir():
            return None
        file = path if path.suffix == ".toml" else path / SCENARIO_FILE
        values = tomllib.loads(file.read_text(encoding="utf-8-sig")) if file.exists() else {}
        names = list_robots(folder)
    except (OSError, ValueError):  # loading it reports what is wrong
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
    """Whether a session with these settings would move a robot, as far as this is known before it loads."""
    found = read_summary(settings.folder) if settings.mode is None else None
    return (settings.mode or (found.mode if found is not None else "")) == "real"
