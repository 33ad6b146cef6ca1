"""What a session is started with. Light: the engine's process is on its way before anything else is imported."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from msgspec import Struct, field

from rise_engine.bridge import Wire
from rise_engine.errors import RiseError
from rise_engine.link.spawn import Options
from rise_engine.scenario.layout import DEFAULT_PLACES, NAME
from rise_engine.scenario.shipped import place_of


class NothingChosenError(RiseError):
    """Nothing is started and nothing attached to; `lines` say why, for a person."""

    def __init__(self, code: int, *lines: str) -> None:
        super().__init__("\n".join(lines))
        self.code = code
        self.lines = lines


class Settings(Struct, frozen=True):
    """What a session is started with; None and empty: as the scenario says."""

    folder: str
    robot: str | None = None
    mode: str | None = None
    seed: int | None = None
    """None: a new one."""
    places: Mapping[str, str] = field(default_factory=dict)
    """`acts`, `rules`, `memory`: paths relative to the folder, where they differ from the scenario's."""
    wire: Wire = Wire()
    """How ROS 2 is spoken."""
    participant: str = ""
    condition: str = ""


def options(settings: Settings, seed: int | None, recover: str) -> Options:
    """What the engine's process is started with."""
    places = dict(settings.places)
    return Options(
        scenario_place(settings),
        settings.robot,
        settings.mode,
        seed,
        places=places,
        wire=settings.wire,
        participant=settings.participant,
        condition=settings.condition,
        unfinished=recover,
    )


def scenario_place(settings: Settings) -> str:
    """The scenario as the engine is told it; a folder and its scenario.toml are one session."""
    path = place(settings.folder)
    return str(path.parent if path.name == NAME else path)


def nothing_in(settings: Settings) -> str:
    """Why there is nothing to read, in a sentence; empty when there is something."""
    if not settings.folder.strip():
        return "name a folder"
    folder = folder_of(settings.folder)
    usual = [folder / name for name in (NAME, *DEFAULT_PLACES.values())]
    if folder != place(settings.folder):  # a file was named
        usual.append(place(settings.folder))
    if folder.is_dir() and not any(settings.places.values()) and not any(path.exists() for path in usual):
        return f"there is no scenario in {folder}: no scenario.toml, no acts, no rules"
    return ""


def expanded(folder: str) -> Path:
    """With the home folder for `~`; never raises, unlike `Path.expanduser`, because people are still typing it."""
    return Path(os.path.expanduser(folder))  # noqa: PTH111


def place(folder: str) -> Path:
    """What is meant by a scenario's name: the folder or file, or a shipped study where there is none."""
    return Path(place_of(str(expanded(folder)))) if folder.strip() else expanded(folder)


def folder_of(folder: str) -> Path:
    """The folder itself, also where its `scenario.toml` was named."""
    path = place(folder)
    return path.parent if path.suffix == ".toml" else path
