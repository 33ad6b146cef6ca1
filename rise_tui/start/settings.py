"""What a session is started with. Light: the engine's process is on its way before anything else is imported."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TypeAlias

from msgspec.structs import replace

from rise_engine.errors import RiseError
from rise_engine.scenario.layout import DEFAULT_PLACES, NAME
from rise_engine.scenario.shipped import place_of
from rise_engine.session_options import SessionOptions


class NothingChosenError(RiseError):
    """Nothing is started and nothing attached to; `lines` say why, for a person."""

    def __init__(self, code: int, *lines: str) -> None:
        super().__init__("\n".join(lines))
        self.code = code
        self.lines = lines


Settings: TypeAlias = SessionOptions
"""What a session is started with."""


def options(settings: Settings, seed: int | None, recover: str) -> SessionOptions:
    """What the engine's process is started with."""
    return replace(settings, folder=scenario_place(settings), seed=seed, unfinished=recover)


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
