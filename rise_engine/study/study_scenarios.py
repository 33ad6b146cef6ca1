"""The scenarios of a study, loaded as its sessions will load them, with their diagnostics."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from msgspec.structs import replace

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.file_names import SCENARIO_FILE
from rise_engine.scenario.files.study_paths import why_not_read
from rise_engine.scenario.files.toml_files import TomlTable
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.study.model import Study


def scenario_folder(study: Study, named: str = "") -> str:
    """Return the absolute folder of a scenario that the study names. Default: its own scenario."""
    return os.path.normpath(Path(study.folder) / (named or study.scenario))


def scenario_of(study: Study, levels: Mapping[str, str]) -> str:
    """Return the scenario that a session runs, as study.toml names it.

    :param study: the study.
    :param levels: the session's levels by factor. Unknown ones are ignored.
    """
    named = study.scenario
    for factor in study.factors:
        level = next((each for each in factor.levels if each.name == levels.get(factor.name)), None)
        named = level.scenario if level is not None and level.scenario else named
    return named


def load_scenarios(study: Study, table: TomlTable) -> tuple[dict[str, Scenario], list[Diagnostic]]:
    """Load every scenario that a study names.

    :param study: the study as read.
    :param table: its study.toml, which gets the diagnostics of wrong names.
    :return: the scenarios without errors by absolute folder, and all diagnostics in them, with file names relative to
        the study's folder.
    """
    named: dict[str, tuple[str, ...]] = {}
    if _is_used(study):
        named[study.scenario] = ("scenario",)
    for factor in study.factors:
        for level in factor.levels:
            if level.scenario:
                named.setdefault(level.scenario, ("factors", factor.name, "levels", level.name, "scenario"))
    scenarios: dict[str, Scenario] = {}
    findings: list[Diagnostic] = []
    for name, keys in named.items():
        folder = Path(scenario_folder(study, name))
        if problem := why_not_read(Path(study.folder), name):
            table.diagnostics.error("outside-study", table.value_location(*keys), problem)
            continue
        if not folder.is_dir():
            message = f"there is no folder `{name}` in the study{did_you_mean(name, _folders(study))}"
            table.diagnostics.error("no-scenario", table.value_location(*keys), message)
            continue
        loaded = load(folder, robot=study.robot or None, mode=study.mode)
        findings += [_from_study(diagnostic, name) for diagnostic in loaded.diagnostics]
        if loaded.scenario is not None:
            scenarios[str(folder)] = loaded.scenario
    return scenarios, findings


def _is_used(study: Study) -> bool:
    """Whether any session runs the study's own scenario. Not if a factor chooses one in each of its levels."""
    return not any(factor.levels and all(level.scenario for level in factor.levels) for factor in study.factors)


def _folders(study: Study) -> list[str]:
    """Return the scenarios in the study's folder."""
    return sorted(file.parent.name for file in Path(study.folder).glob(f"*/{SCENARIO_FILE}"))


def _from_study(diagnostic: Diagnostic, name: str) -> Diagnostic:
    location = diagnostic.location
    if Path(location.file).is_absolute():
        return diagnostic
    return replace(diagnostic, location=replace(location, file=f"{name.rstrip('/')}/{location.file}"))
