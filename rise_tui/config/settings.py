"""The options for starting a session. Light: the engine's process starts before anything else is imported."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.scenario.shipped_studies import resolve_study
from rise_tui.config.preferences import expand_home


def engine_options(settings: SessionOptions, seed: int | None, recover: str) -> SessionOptions:
    """Return the options for starting the engine's process."""
    return replace(settings, folder=scenario_path(settings), seed=seed, unfinished=recover)


def scenario_path(settings: SessionOptions) -> str:
    """The scenario's path for the engine. A folder and its scenario.toml name the same session."""
    path = find_scenario(settings.folder)
    return str(path.parent if path.name == SCENARIO_FILE else path)


def why_no_scenario(settings: SessionOptions) -> str:
    """Why there is nothing to read, in a sentence; empty: there is."""
    if not settings.folder.strip():
        return "name a folder"
    folder = scenario_folder(settings.folder)
    usual = [folder / name for name in (SCENARIO_FILE, *DEFAULT_PATHS.values())]
    if folder != find_scenario(settings.folder):  # the user named a file
        usual.append(find_scenario(settings.folder))
    if folder.is_dir() and not any(settings.paths.values()) and not any(path.exists() for path in usual):
        return f"there is no scenario in {folder}: no scenario.toml, no acts, no rules"
    return ""


def find_scenario(folder: str) -> Path:
    """Return the path that a scenario's name means: a folder, a file, or a shipped study if neither exists."""
    return Path(resolve_study(str(expand_home(folder)))) if folder.strip() else expand_home(folder)


def scenario_folder(folder: str) -> Path:
    """The scenario's folder, also if its `scenario.toml` was named."""
    path = find_scenario(folder)
    return path.parent if path.suffix == ".toml" else path
