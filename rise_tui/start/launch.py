"""Starting a session: read the scenario, start an engine for it. The only place that knows how an engine is started."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from msgspec import Struct

from rise_engine.link.client import Client, Hello
from rise_engine.link.spawn import Started
from rise_engine.scenario import Finding, load, robot_names
from rise_engine.scenario.layout import DEFAULT_PLACES, NAME
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.robots import DEFAULT
from rise_tui.start.settings import Settings, folder_of, nothing_in, place

RUNNING = 3
"""What an engine says when a session of its scenario runs already (`rise_engine.serve`)."""


class Refused(Struct, frozen=True):
    """The scenario does not load."""

    findings: list[Finding]
    sentence: str = ""
    """Instead of findings, when there is nothing to read."""

    @property
    def lines(self) -> list[str]:
        return [self.sentence] * bool(self.sentence) + [str(finding) for finding in self.findings]


Tell: TypeAlias = Callable[[str], object]
"""Gets a sentence, on any thread."""
Prepared: TypeAlias = "Scenario | Refused"


def prepare(settings: Settings) -> Prepared:
    """Read and check the scenario. Blocking."""
    if problem := nothing_in(settings):
        return Refused([], problem)
    loaded = load(place(settings.folder), robot=settings.robot, mode=settings.mode, places=settings.places)
    return Refused(list(loaded.findings)) if loaded.scenario is None else loaded.scenario


GOES_ON = "the session goes on; what the robot was doing counts as lost"


class Recovered(NamedTuple):
    """A session that goes on."""

    client: Client
    told: str = GOES_ON
    """What there is to say about it."""


def told_of(found: Started) -> str:
    """What there is to say about a session whose engine has just been started."""
    return "; ".join((GOES_ON, *found.lines) if found.recovered else found.lines)


@dataclass(frozen=True)
class Launcher:
    """How sessions are started; tests give others."""

    start: Callable[[Scenario, Settings], Client]
    """May block. Raises EngineGone with the reason."""
    prepare: Callable[[Settings], Prepared] = prepare
    recover: Callable[[Hello, Tell], Recovered] | None = None
    """Goes on with a session whose engine has gone; tells how far it has come. May block. Raises EngineGone."""


def settings_of(hello: Hello) -> Settings:
    """What a session that runs already was started with."""
    session = hello.view.session
    return Settings(
        hello.scenario.folder,
        hello.robot,
        hello.mode,
        hello.seed,
        places=dict(hello.scenario.paths),
        participant=session.participant if session is not None else "",
        condition=session.condition if session is not None else "",
    )


def robots(folder: str) -> list[str]:
    """The robots that can be chosen for a scenario's folder."""
    return robot_names(folder_of(folder))


class Shown(Struct, frozen=True):
    """What the scenario in a folder says about robot, mode and places, without reading the rest of it."""

    robots: list[str]
    robot: str
    mode: str
    places: Mapping[str, str]


def shown(folder: str) -> Shown | None:
    """None where there is nothing to read. Blocking."""
    path = place(folder)
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
