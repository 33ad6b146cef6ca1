"""The scenarios of a study, and `[factors.NAME]`, whose levels set memory values or choose a scenario.

Scenarios are loaded as the sessions will load them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from msgspec.json import encode
from msgspec.structs import replace

from rise_engine.base.nearest_name import did_you_mean, nearest_name
from rise_engine.expression import lookup
from rise_engine.scenario.checking.memory_paths import MemoryPaths
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, why_not_read
from rise_engine.scenario.files.toml_files import TomlTable
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import SESSION, Json, Scenario
from rise_engine.scenario.settings import names_in
from rise_engine.study.model import Factor, FactorKind, Level, Study
from rise_engine.study.settings import STUDY_TABLES


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
    """Whether any session runs the study's own scenario, because some level chooses no other."""
    return not any(factor.levels and all(level.scenario for level in factor.levels) for factor in study.factors)


def _folders(study: Study) -> list[str]:
    """Return the scenarios in the study's folder."""
    return sorted(file.parent.name for file in Path(study.folder).glob(f"*/{SCENARIO_FILE}"))


def _from_study(diagnostic: Diagnostic, name: str) -> Diagnostic:
    location = diagnostic.location
    if Path(location.file).is_absolute():
        return diagnostic
    return replace(diagnostic, location=replace(location, file=f"{name.rstrip('/')}/{location.file}"))


# --- factors ----------------------------------------------------------------------------------------------------------


_FACTOR_KEYS = tuple(names_in(STUDY_TABLES, "factors.*"))
_LEVEL_KEYS = tuple(names_in(STUDY_TABLES, "factors.*.levels.*"))
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
_LEVEL = re.compile(r"[A-Za-z0-9_-]+\Z")
_LEVELS_FORM = "`levels` is a table: levels.yes.memory = { hesitation = true }"


def read_factors(table: TomlTable, reserved: Collection[str]) -> tuple[Factor, ...]:
    """Read every factor, in the order of the file.

    :param table: `[factors]`.
    :param reserved: names that are not allowed, because plan.csv has other columns of these names.
    """
    factors: list[Factor] = []
    for name, values in table.values.items():
        if not _NAME.match(name):
            message = f"a factor has a name of letters, digits and `_`, beginning with a letter, not `{name}`"
            table.report_key("bad-name", message, name)
        elif name in reserved:
            table.report_key("bad-name", f"plan.csv has a column `{name}` of another meaning", name)
        if not isinstance(values, dict):
            table.report_key("wrong-type", f"a factor is a table: [factors.{name}]", name)
            continue
        factors.append(_read_factor(TomlTable(table.file, (*table.path, name), values, table.diagnostics)))
    _check_overlaps(table, factors)
    return tuple(factors)


def _read_factor(table: TomlTable) -> Factor:
    table.report_unknown_keys(_FACTOR_KEYS)
    labels = _read_labels(table)
    levels = _read_levels(table, labels)
    if not table.read("label_only", bool, False) and not _has_unknown_keys(table):
        _check_difference(table, levels)
    return Factor(table.name, _read_kind(table), levels)


def _is_misspelt(table: TomlTable, key: str) -> bool:
    """Whether the key is there in another spelling, which is already reported."""
    return any(nearest_name(name, (key,)) for name in table.values if name not in _FACTOR_KEYS)


def _has_unknown_keys(table: TomlTable) -> bool:
    """Whether a level has a misspelt key, so that its effect is unknown."""
    levels = table.values.get("levels", {})
    values = levels.values() if isinstance(levels, dict) else ()
    return any(isinstance(each, dict) and each.keys() - set(_LEVEL_KEYS) for each in values)


def _read_kind(table: TomlTable) -> FactorKind:
    form = '`kind` is "between" (one level for each participant) or "within" (every participant has every level)'
    value = table.values.get("kind")
    if value is None:
        if not _is_misspelt(table, "kind"):
            table.report_key("missing-value", f"`kind` is missing; {form}")
    elif value not in ("between", "within"):
        near = did_you_mean(value, ("between", "within"), limit=0) if isinstance(value, str) else ""
        table.report_value("wrong-value", "kind", f"{form}{near}")
    return "within" if value == "within" else "between"


def _read_labels(table: TomlTable) -> dict[str, str]:
    inner = table.section("labels")
    return {name: inner.read(name, str, "", form=f': {name} = "A"') for name in inner.values}


def _read_levels(table: TomlTable, labels: dict[str, str]) -> tuple[Level, ...]:
    inner = table.subtable("levels", _LEVELS_FORM)
    if inner is None:
        return ()
    names = list(inner.values)
    if len(names) < 2 and not (not names and _is_misspelt(table, "levels")):
        what = f"has only the level `{names[0]}`" if names else "has no levels"
        table.report_key(
            "missing-value", f"`{table.name}` {what}; a factor has two or more: levels.NAME.memory = {{ ... }}"
        )
    for name in labels:
        if name not in names:
            near = did_you_mean(name, names)
            table.report_key("unknown-name", f"`{table.name}` has no level `{name}`{near}", "labels", name)
    return tuple(_read_level(inner, name, labels.get(name, "")) for name in names)


def _read_level(levels: TomlTable, name: str, label: str) -> Level:
    if not _LEVEL.match(name):
        message = f"a level has a name of letters, digits, `_` and `-`, not `{name}`; `labels` can be any text"
        levels.report_key("bad-name", message, name)
    values = levels.values[name]
    if not isinstance(values, dict):
        levels.report_value(
            "wrong-type", name, f"a level is a table: levels.{name}.memory = {{ key = true }}, or levels.{name} = {{}}"
        )
        return Level(name, label=label)
    table = TomlTable(levels.file, (*levels.path, name), values, levels.diagnostics)
    table.report_unknown_keys(_LEVEL_KEYS)
    memory = table.read("memory", dict, {}, form=": memory = { key = true }")
    scenario = table.read("scenario", str, "", form=': scenario = "scenario-babble"')
    if "scenario" in values and isinstance(values["scenario"], str) and not scenario.strip():
        table.report_value("missing-value", "scenario", "`scenario` is empty; name a folder, or leave it out")
    description = table.read("description", str, "", form=': description = "The robot hesitates"').strip()
    return Level(name, memory, scenario.strip(), label, description)


def _check_difference(table: TomlTable, levels: tuple[Level, ...]) -> None:
    """Report levels without a difference in the robot's behaviour: their condition would be only a label."""
    for at, level in enumerate(levels):
        same = next((each for each in levels[:at] if behaviour_key(each) == behaviour_key(level)), None)
        if same is not None:
            message = (
                f"the robot does the same in `{same.name}` and `{level.name}`: give them other memory values or "
                "another scenario; or write label_only = true, if people make the difference"
            )
            table.report_key("same-level", message, "levels", level.name)


def behaviour_key(level: Level) -> tuple[str, bytes]:
    """Return a value that is equal for levels with the same robot behaviour. `1` and `true` differ."""
    return level.scenario, encode(level.memory, order="sorted")


def _check_overlaps(table: TomlTable, factors: list[Factor]) -> None:
    """Report a key that two factors set, because neither has priority."""
    setters: dict[str, str] = {}
    for factor in factors:
        keys = dict.fromkeys(key for level in factor.levels for key in level.memory)
        for key in keys:
            other = setters.setdefault(key, factor.name)
            if other != factor.name:
                level = next(each.name for each in factor.levels if key in each.memory)
                message = f"the factor `{other}` sets `{key}` too; a memory value belongs to one factor"
                table.report_key("set-twice", message, factor.name, "levels", level, "memory", key)
    choosers = [factor for factor in factors if any(level.scenario for level in factor.levels)]
    for factor in choosers[1:]:
        level = next(each.name for each in factor.levels if each.scenario)
        message = f"the factor `{choosers[0].name}` chooses the scenario too; only one factor can"
        table.report_key("set-twice", message, factor.name, "levels", level, "scenario")


def check_levels(study: Study, table: TomlTable, scenarios: Mapping[str, Scenario]) -> None:
    """Report unknown memory keys of levels, and values that differ in type from the start value.

    :param study: the study.
    :param table: its study.toml, which gets the diagnostics.
    :param scenarios: the scenarios that could be loaded, by absolute folder.
    """
    for factor in study.factors:
        for level in factor.levels:
            names = dict.fromkeys(_scenarios_of(study, factor, level))
            for name in names:
                scenario = scenarios.get(scenario_folder(study, name))
                if scenario is not None:
                    _check_level(table, factor, level, scenario, name)
        _check_reads(table, study, factor, scenarios)


def _check_reads(table: TomlTable, study: Study, factor: Factor, scenarios: Mapping[str, Scenario]) -> None:
    """Warn of level values that no scenario reads: their condition would be only a label."""
    names = (name for level in factor.levels for name in _scenarios_of(study, factor, level))
    folders = [scenario_folder(study, name) for name in dict.fromkeys(names)]
    if any(each not in scenarios for each in folders) or table.values["factors"][factor.name].get("label_only") is True:
        return
    found = [scenarios[each] for each in folders]
    for level in factor.levels:
        for key in level.memory:
            read = any(_head(key) in scenario.keys_read for scenario in found)
            if not read and not any(memory_key_problem(scenario, key) for scenario in found):
                message = (
                    f"nothing in the scenario reads `{key}`, so it changes nothing that the robot does; correct the "
                    "key, or write label_only = true, if people or a program of yours make the difference"
                )
                keys = ("factors", factor.name, "levels", level.name, "memory", key)
                table.diagnostics.warning("condition-unread", table.value_location(*keys), message)


def memory_key_problem(scenario: Scenario, key: str) -> str:
    """Return why a value set under this key before a session would have no effect. Empty: it has one."""
    head = _head(key)
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
    """Report a value that differs in type from the key's start value. Empty: it does not."""
    start = lookup(scenario.memory, key)[1]
    if start is None or value is None or _kind(start) == _kind(value):
        return ""
    return f"`{key}` is {_kind(start)} at the start, and this is {_kind(value)}"


def _scenarios_of(study: Study, factor: Factor, level: Level) -> Iterator[str]:
    """Give the scenarios, as named in study.toml, that can run in this level."""
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


def _head(key: str) -> str:
    return key.partition(".")[0]


def _kind(value: Json) -> str:
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, int | float):
        return "a number"
    if isinstance(value, str):
        return "a text"
    return "a list" if isinstance(value, list) else "an object"
