"""Starting a session: read the scenario, start an engine for it. The only place that knows how an engine is started."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from rise_engine.link.client import Client
from rise_engine.scenario import Finding, load
from rise_engine.scenario.loader import DEFAULT_PLACES
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.robots import DEFAULT
from rise_engine.scenario.settings import NAME


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
    sentence: str = ""
    """Instead of findings, when there is nothing to read."""

    @property
    def lines(self) -> list[str]:
        return [self.sentence] * bool(self.sentence) + [str(finding) for finding in self.findings]


Prepared: TypeAlias = "Scenario | Refused"


def prepare(settings: Settings) -> Prepared:
    """Read and check the scenario. Blocking."""
    if not settings.folder.strip():
        return Refused([], "name a folder")
    folder = folder_of(settings.folder)
    usual = [folder / name for name in (NAME, *DEFAULT_PLACES.values())]
    if folder != expanded(settings.folder):  # a file was named
        usual.append(expanded(settings.folder))
    if folder.is_dir() and not any(settings.places.values()) and not any(path.exists() for path in usual):
        return Refused([], f"there is no scenario in {folder}: no scenario.toml, no acts, no rules")
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

    return robot_names(folder_of(folder))


def expanded(folder: str) -> Path:
    """With the home folder for `~`; never raises, unlike `Path.expanduser`, because people are still typing it."""
    return Path(os.path.expanduser(folder))  # noqa: PTH111


def folder_of(folder: str) -> Path:
    """The folder itself, also where its `scenario.toml` was named."""
    path = expanded(folder)
    return path.parent if path.suffix == ".toml" else path


@dataclass(frozen=True)
class Shown:
    """What the scenario in a folder says about robot, mode and places, without reading the rest of it."""

    robots: list[str]
    robot: str
    mode: str
    places: Mapping[str, str]


def shown(folder: str) -> Shown | None:
    """None where there is nothing to read. Blocking."""
    path = expanded(folder)
    try:
        if not folder.strip() or not folder_of(folder).is_dir():
            return None
        file = path if path.suffix == ".toml" else path / NAME
        values = tomllib.loads(file.read_text(encoding="utf-8-sig")) if file.exists() else {}
        names = robots(folder)
    except (OSError, ValueError):  # loading it says what is wrong
        return None

    def text(key: str, otherwise: str) -> str:
        value = values.get(key)
        return value if isinstance(value, str) and value else otherwise

    robot = text("robot", DEFAULT)
    places = {place: text(place, usual) for place, usual in DEFAULT_PLACES.items()}
    return Shown(
        names if robot in names else [*names, robot],
        robot,
        "real" if text("mode", "") == "real" else "debug",
        places,
    )
