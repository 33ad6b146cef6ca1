"""Do the memory values of a study's levels fit the scenarios in which they are set?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.expression import lookup
from rise_engine.scenario.memory_paths import MemoryPaths
from rise_engine.scenario.model import SESSION, Json, Scenario
from rise_engine.scenario.toml_files import TomlTable
from rise_engine.study.model import Factor, Level, Study
from rise_engine.study.study_scenarios import scenario_folder


def check_levels(study: Study, table: TomlTable, scenarios: Mapping[str, Scenario]) -> None:
    """Report memory keys of levels that the scenario does not know, and values of another type than at the start.

    :param study: the study.
    :param table: its study.toml, where findings are told.
    :param scenarios: those that could be loaded, by their absolute folder.
    """
    for factor in study.factors:
        for level in factor.levels:
            names = dict.fromkeys(_scenarios_of(study, factor, level))
            for name in names:
                scenario = scenarios.get(scenario_folder(study, name))
                if scenario is not None:
                    _check_level(table, factor, level, scenario, name)


def memory_key_problem(scenario: Scenario, key: str) -> str:
    """Why a value that is set before a session begins would not be of use under this key, or empty."""
    head = key.partition(".")[0]
    if head in scenario.tables:
        return f"`{head}` is a table, tables/{head}.csv; nothing sets it"
    if head == SESSION and scenario.reads_session:
        return f"the engine keeps `{SESSION}` itself; nothing else sets it"
    paths = MemoryPaths(scenario.memory, scenario.known_keys)
    if not paths.is_known(key):
        near = did_you_mean(key, list(dict.fromkeys([*scenario.memory, *sorted(scenario.known_keys - {SESSION})])))
        return f"the memory has no key `{key}`, and nothing sets it{near}"
    return paths.writing_problem(key)


def memory_type_problem(scenario: Scenario, key: str, value: Json) -> str:
    """That a value is of another type than the key's start value, or empty."""
    start = lookup(scenario.memory, key)[1]
    if start is None or value is None or _kind(start) == _kind(value):
        return ""
    return f"`{key}` is {_kind(start)} at the start, and this is {_kind(value)}"


def _scenarios_of(study: Study, factor: Factor, level: Level) -> Iterator[str]:
    """The scenarios that can run in this level, as study.toml names them."""
    if level.scenario:
        yield level.scenario
        return
    chooser = next((each for each in study.factors if any(level.scenario for level in each.levels)), None)
    if chooser is None or chooser is factor:
        yield study.scenario
        return
    for other in chooser.levels:
        yield other.scenario or study.scenario


def _check_level(table: TomlTable, factor: Factor, level: Level, scenario: Scenario, name: str) -> None:
    for key, value in level.memory.items():
        keys = ("factors", factor.name, "levels", level.name, "memory", key)
        if problem := memory_key_problem(scenario, key):
            table.report_key("unknown-key", f"in {name}: {problem}", *keys)
            continue
        if problem := memory_type_problem(scenario, key, value):
            table.diagnostics.warning("memory-type", table.value_location(*keys), f"in {name}, {problem}")


def _kind(value: Json) -> str:
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, int | float):
        return "a number"
    if isinstance(value, str):
        return "a text"
    return "a list" if isinstance(value, list) else "an object"
