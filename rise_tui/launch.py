"""Starting a session: read the scenario, start an engine for it. The only place that knows how an engine is started."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from rise_engine.link.client import Client
from rise_engine.scenario import Finding, load
from rise_engine.scenario.model import Scenario


@dataclass(frozen=True)
class Settings:
    """What a session is started with; None and empty: as the scenario says."""

    folder: str
    robot: str | None = None
    mode: str | None = None
    seed: int = 0
    places: Mapping[str, str] = field(default_factory=dict)
    """`acts`, `rules`, `memory`: paths relative to the folder, where they differ from the scenario's."""


@dataclass(frozen=True)
class Refused:
    """The scenario does not load."""

    findings: list[Finding]

    @property
    def lines(self) -> list[str]:
        return [str(finding) for finding in self.findings]


Prepared: TypeAlias = "Scenario | Refused"


def prepare(settings: Settings) -> Prepared:
    """Read and check the scenario. Blocking."""
    loaded = load(settings.folder, robot=settings.robot, mode=settings.mode, places=settings.places)
    return Refused(list(loaded.findings)) if loaded.scenario is None else loaded.scenario


def start(scenario: Scenario, settings: Settings) -> Client:
    """Start an engine. Returns at once; `attach` says when it could not start."""
    from rise_engine.link.local import start_local

    return start_local(scenario, seed=settings.seed)


@dataclass(frozen=True)
class Launcher:
    """How sessions are started; tests give others."""

    prepare: Callable[[Settings], Prepared] = prepare
    start: Callable[[Scenario, Settings], Client] = start


def robots(folder: str) -> list[str]:
    """The robots that can be chosen for a scenario's folder."""
    from rise_engine.scenario import robot_names

    path = Path(folder).expanduser()
    return robot_names(path.parent if path.suffix == ".toml" else path)
