"""Loads a scenario for a command, or refuses it with all its errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec import UNSET, to_builtins

from rise_engine.base.text import pluralize
from rise_engine.cli.terminal import Refused, print_notes
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.model import RobotProfile, Scenario, SourceLocation
from rise_engine.scenario.reading.robot_profiles import read_robot


def load_scenario(
    folder: str,
    *,
    robot: str | None = None,
    mode: str | None = None,
    language: str = "",
    allow_untranslated: bool = False,
) -> Scenario:
    """Load a scenario, and print its warnings on standard error. Ends the command if it has errors.

    :param folder: the scenario's folder.
    :param robot: a robot instead of the scenario's; None: the scenario's.
    :param mode: a mode instead of the scenario's; None: the scenario's.
    :param language: the language of the session; empty: that of the acts.
    :param allow_untranslated: whether missing translations are not errors.
    """
    loaded = load(folder, robot=robot, mode=mode, language=language or None, allow_untranslated=allow_untranslated)
    if loaded.scenario is not None:
        print_notes(*loaded.diagnostics)
    return sound_scenario(loaded)


def sound_scenario(loaded: LoadResult) -> Scenario:
    """Return the loaded scenario. Ends the command if it has errors."""
    if loaded.scenario is None:
        refused = f"the scenario is refused: {pluralize(len(loaded.errors), 'error')}"
        raise Refused(findings=(*loaded.diagnostics, refused))
    return loaded.scenario


def diagnostic_row(diagnostic: Diagnostic) -> dict[str, Any]:
    """Return a diagnostic for `--json`."""
    return {
        "file": diagnostic.location.file,
        "line": diagnostic.location.line,
        "column": diagnostic.location.column,
        **({} if (end := diagnostic.end) is UNSET else {"end_line": end.line, "end_column": end.column}),
        "severity": diagnostic.severity,
        "code": diagnostic.code,
        "message": diagnostic.message,
        **({} if (place := diagnostic.location.template) is UNSET else {"template": to_builtins(place)}),
    }


def robots_folder(folder: str | None) -> Path:
    """Return the folder that may have its own robots."""
    path = Path(folder or ".")
    return (path.parent if path.is_file() else path).resolve()


def read_profile(name: str, folder: str | None) -> tuple[RobotProfile, list[Diagnostic]]:
    """Read the profile of a robot, with its diagnostics."""
    diagnostics = Diagnostics()
    profile = read_robot(name, FileReader(robots_folder(folder), diagnostics), SourceLocation("command line"))
    return profile, diagnostics.sorted()
