"""What `rise-engine check`, `eval`, `schema`, `robots` and `doctor` print."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from random import Random
from shlex import quote
from textwrap import wrap
from typing import Any

from msgspec import UNSET, to_builtins

from rise_engine.bml.schema import block_schema_text
from rise_engine.cli.terminal import write_json
from rise_engine.engine.drivers import DOCTORS, DriverError, driver_names, load_ros_plugin, profile_findings
from rise_engine.errors import RiseError
from rise_engine.explore.exploration import Exploration, explore_quickly
from rise_engine.expression import EvaluationError, Expression, ExpressionError
from rise_engine.expression.signatures import SIGNATURES
from rise_engine.json_codec import JsonError, decode
from rise_engine.nearest_name import did_you_mean
from rise_engine.ports.bridge import Examiner, RosConnection
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.editor_schemas import act_schema_text, rule_schema_text
from rise_engine.scenario.file_names import SCENARIO_FILE
from rise_engine.scenario.finding_ends import with_ends
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.model import ActionSpec, RobotProfile, Scenario, SourceLocation
from rise_engine.scenario.new_study import write_agents_file
from rise_engine.scenario.robot_profiles import (
    DEFAULT_ROBOT,
    find_profile,
    locate_in_profile,
    read_robot,
    robot_names,
)
from rise_engine.scenario.shipped_studies import StudyCopyError, copy_study, shipped_studies, study_lines
from rise_engine.scenario.source_files import FileReader
from rise_engine.text import clean, pluralize

# --- check ----------------------------------------------------------------------------------------------------------


def check_report(
    folder: str,
    *,
    robot: str | None,
    mode: str | None,
    as_json: bool,
    all_of_them: bool,
    language: str = "",
    deep: bool = False,
) -> int:
    """Print everything that is wrong with a scenario.

    :param folder: the scenario's.
    :param robot: another robot than the scenario's; None: its own.
    :param mode: the same for the mode.
    :param as_json: as one document.
    :param all_of_them: also what was silenced.
    :param language: as for a session in this language; empty: as for one in that of the acts.
    :param deep: also what exploring finds in a few seconds, if there is no error.
    :return: the exit status, 1 when something is an error, or a problem that exploring has found.
    """
    loaded = load(folder, robot=robot, mode=mode, language=language or None)
    scenario, silenced = loaded.scenario, loaded.suppressed
    is_real = (scenario.mode if scenario is not None else mode) == "real"
    diagnostics = loaded.diagnostics + _driver_diagnostics(folder, loaded, is_real=is_real)
    errors = sum(diagnostic.severity == "error" for diagnostic in diagnostics)
    warnings = len(diagnostics) - errors
    exploration = explore_quickly(scenario) if deep and scenario is not None and not errors else None
    if as_json:
        rows = [diagnostic_row(diagnostic) for diagnostic in diagnostics]
        silenced_rows = [{**diagnostic_row(each.diagnostic), "reason": each.reason} for each in silenced]
        explored = {} if exploration is None or scenario is None else {"explored": exploration.row(scenario)}
        write_json({"errors": errors, "warnings": warnings, "findings": rows, "silenced": silenced_rows, **explored})
    else:
        for diagnostic in diagnostics:
            print(str(diagnostic))
        for each in silenced if all_of_them else ():
            diagnostic = each.diagnostic
            print(f"{diagnostic.location}: silenced {diagnostic.code}: {diagnostic.message} (reason: {each.reason})")
        found = f"{pluralize(errors, 'error')}, {pluralize(warnings, 'warning')}" if diagnostics else "no findings"
        found += f", {len(silenced)} silenced" if silenced else ""
        print(f"{found}{_contents_text(scenario)}")
        if exploration is not None:
            _print_exploration(exploration)
    return 1 if errors or (exploration is not None and exploration.count("problem")) else 0


def _print_exploration(exploration: Exploration) -> None:
    """What exploring has found, a line each, and what it has looked at."""
    for finding in exploration.findings:
        if finding.level != "remark":
            place = f"{finding.location}: " if finding.location is not None else ""
            print(f"{place}{finding.level} {finding.kind}: {finding.text}")
    for sentence in (*exploration.looked_at, *exploration.told):
        print(sentence)
    print("`rise-engine explore` looks at more, and shows the way to each finding.")


class UnknownActError(RiseError):
    """There is no such act; the message is a sentence for a person."""


def explain_act_report(folder: str, act: str, *, robot: str | None, mode: str | None, as_json: bool) -> int:
    """Print what holds for an act, and which line of scenario.toml says so.

    :param folder: the scenario's.
    :param act: the act's name.
    :param robot: another robot than the scenario's; None: its own.
    :param mode: the same for the mode.
    :param as_json: as one document.
    :return: the exit status, 1 when the scenario has errors (they go to standard error).
    :raises UnknownActError: the scenario has no act of that name.
    """
    loaded = load(folder, robot=robot, mode=mode)
    if loaded.scenario is None:
        load_or_refuse(folder, robot=robot, mode=mode)
        return 1
    if act not in loaded.scenario.acts:
        raise UnknownActError(f"there is no act {act!r}{did_you_mean(act, loaded.scenario.acts)}")
    settings = loaded.act_tables.explain(act, loaded.scenario.on_failure)
    if as_json:
        rows = [
            {"setting": name, "value": value, "table": table and table.name, "line": table and table.location.line}
            for name, value, table in settings
        ]
        write_json({"act": act, "settings": rows})
    else:
        print(act)
        for name, value, table in settings:
            source = "as usual" if table is None else f"{table.header} ({table.location.file}:{table.location.line})"
            print(f"  {name:<13} {json.dumps(value):<11} {source}")
    return 0


def diagnostic_row(diagnostic: Diagnostic) -> dict[str, Any]:
    """A finding as `--json` has it."""
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


def _driver_diagnostics(folder: str, loaded: LoadResult, *, is_real: bool) -> list[Diagnostic]:
    """What the robot's driver has to say about the profile. What only keeps a real session from beginning is a warning
    in a rehearsal."""
    files = FileReader(_robots_folder(folder), Diagnostics())
    found = Diagnostics()
    errors = {each.location.file for each in loaded.errors}
    if SCENARIO_FILE in errors or any(name.endswith(f"{loaded.robot.name}.toml") for name in errors):
        return []  # what could be read of the robot is less than what is written
    for finding in profile_findings(loaded.robot):
        location = locate_in_profile(finding.where, loaded.robot.name, files)
        refused = finding.kind == "wrong" or (finding.kind == "missing" and is_real)
        (found.error if refused else found.warning)("robot-profile", location, finding.sentence)
    return with_ends(found.sorted(), {source.name: source for source in files.sources})


def load_or_refuse(
    folder: str, *, robot: str | None, mode: str | None, language: str = "", allow_untranslated: bool = False
) -> Scenario | None:
    """The scenario, or None when it is refused; findings go to standard error."""
    loaded = load(folder, robot=robot, mode=mode, language=language or None, allow_untranslated=allow_untranslated)
    print_findings(loaded)
    return loaded.scenario


def print_findings(loaded: LoadResult) -> None:
    """Say on standard error what is wrong, and whether the scenario is refused for it."""
    for diagnostic in loaded.diagnostics:
        print(f"{diagnostic}", file=sys.stderr)
    if loaded.scenario is None:
        print(f"the scenario is refused: {pluralize(len(loaded.errors), 'error')}", file=sys.stderr)


def _contents_text(scenario: Scenario | None) -> str:
    if scenario is None:
        return ""
    more = f"{pluralize(len(scenario.tables), 'table')}, " if scenario.tables else ""
    more += f"{pluralize(len(scenario.conditions), 'condition')}, " if scenario.conditions else ""
    return (
        f" ({pluralize(len(scenario.acts), 'act')}, {pluralize(len(scenario.rules), 'rule')}, "
        f"{pluralize(len(scenario.memory), 'memory key')}, {more}robot {scenario.robot.name})"
    )


# --- eval -----------------------------------------------------------------------------------------------------------


class UnusableMemoryError(RiseError):
    """`--memory` cannot be read; the message is a sentence."""


def strict_json(text: str) -> Any:
    """The value of a JSON text. Raises ValueError with a sentence, also for a key that is there twice."""
    try:
        return decode(text)
    except JsonError as error:
        raise ValueError(f"{error} (column {error.offset + 1})") from None


def read_memory(text: str) -> dict[str, Any]:
    """A memory from JSON or from a file, plain or as in the paper's listing 3. Raises UnusableMemoryError."""
    source = text.strip()
    if source.startswith("@") or not source.startswith("{"):
        path = Path(source.removeprefix("@"))
        try:
            source = path.read_text("utf-8-sig")
        except (OSError, UnicodeDecodeError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            raise UnusableMemoryError(
                f"{text} is neither a JSON object, such as '{{\"task\": 2}}', nor a file that can be read ({reason})"
            ) from None
    try:
        value = strict_json(source)
    except ValueError as error:
        raise UnusableMemoryError(str(error)) from None
    if isinstance(value, dict) and isinstance(value.get("WorkingMemory"), list) and len(value) == 1:
        items = value["WorkingMemory"]
        if not all(isinstance(item, dict) for item in items):
            raise UnusableMemoryError('every entry of "WorkingMemory" is an object')
        value = {key: each for item in items for key, each in item.items()}
    if not isinstance(value, dict):
        raise UnusableMemoryError("the memory is a JSON object")
    return value


def eval_report(text: str, memory: Mapping[str, Any], *, as_json: bool) -> int:
    """Print what an expression gives, and how it was read; the exit status is 1 when it gives nothing."""
    try:
        expression = Expression.parse(text)
    except ExpressionError as error:
        if as_json:
            row = {"expression": text, "error": error.message, "column": error.column, "hint": error.hint}
            write_json(row)
        else:
            print(f"{_one_line(text)}\n{' ' * (error.column - 1)}^\nerror: {error}", file=sys.stderr)
        return 1
    missing: set[str] = set()
    chance = Random(0)
    try:
        value = expression.value(memory, chance.random, missing, chance.randrange)
    except EvaluationError as error:
        if as_json:
            write_json({"expression": text, "error": str(error), "read_as": expression.with_all_brackets})
        else:
            print(f"read as    {expression.with_all_brackets}")
            print(f"error: {error}", file=sys.stderr)
        return 1
    try:
        chance = Random(0)
        holds = str(expression.as_condition(memory, chance.random, None, chance.randrange)).lower()
    except EvaluationError as error:
        holds = f"error: {error}"
    if as_json:
        write_json(
            {
                "expression": text,
                "value": value,
                "type": type_name(value),
                "condition": holds == "true",
                "read_as": expression.with_all_brackets,
                "keys": sorted(expression.keys),
                "missing": sorted(missing),
            }
        )
        return 0
    print(f"value      {json.dumps(value, ensure_ascii=False)}")
    print(f"type       {type_name(value)}")
    if not isinstance(value, bool):
        print(f"condition  {holds}")
    print(f"read as    {expression.with_all_brackets}")
    for key in sorted(missing):
        print(f'missing    the memory has no {key}: it counts as false, 0 or ""')
    return 0


def functions_report(*, as_json: bool) -> int:
    """Print what each function of the language takes and gives."""
    if as_json:
        rows = [{**each._asdict(), "written": list(each.written)} for each in SIGNATURES]
        write_json({"functions": rows})
        return 0
    for each in SIGNATURES:
        print(", ".join(each.written))
        for line in (*wrap(each.meaning.replace("`", ""), 90), f"{each.example} = {each.result}"):
            print(f"    {line}")
    return 0


def type_name(value: Any) -> str:
    """What a memory value is, in JSON's words (a whole number is an integer)."""
    if value is None:
        return "null"
    names = ((bool, "boolean"), (int, "integer"), (float, "number"), (str, "string"), (list, "array"), (dict, "object"))
    return next((name for kind, name in names if isinstance(value, kind)), type(value).__name__)


# --- schema and robots ----------------------------------------------------------------------------------------------


def schema_text(folder: str | None, kind: str, robot: str | None) -> str | None:
    """The RELAX NG schema of act (`cra`), rule or BML files; None when the scenario is refused or the robot unknown."""
    if kind == "rules":
        return rule_schema_text()
    if kind == "bml":
        return block_schema_text()
    if folder is not None:
        scenario = load_or_refuse(folder, robot=robot, mode=None)
        return None if scenario is None else act_schema_text(scenario.robot.actions)
    profile, diagnostics = _read_profile(robot or "generic", None)
    for diagnostic in diagnostics:
        print(f"{diagnostic}", file=sys.stderr)
    return None if diagnostics else act_schema_text(profile.actions)


def robots_report(folder: str | None, *, as_json: bool) -> int:
    """Print every robot that a scenario (in `folder`) can name."""
    home = _robots_folder(folder)
    installed = driver_names()
    rows = []
    for name in robot_names(home):
        profile, diagnostics = _read_profile(name, folder)
        actions = [_action_row(spec) for spec in profile.actions.values() if spec.supported]
        rows.append(
            {
                "name": name,
                "title": profile.title,
                "from": str(find_profile(name, home) or "built in"),
                "driver": profile.driver,
                "installed": profile.driver in installed,
                "actions": actions,
                "findings": [str(diagnostic) for diagnostic in diagnostics],
            }
        )
    if as_json:
        write_json({"robots": rows})
    else:
        print("\n\n".join(_robot_text(row) for row in rows))
    return 0


def doctor_report(folder: str | None, *, robot: str | None, ros: RosConnection, seconds: float, as_json: bool) -> int:
    """Print what there is to know about ROS 2 here and about the robot; the exit status is 1 when something is in the
    way, 2 when there is no such robot."""
    profile: RobotProfile | None = None
    if robot is not None or folder is not None:
        profile, diagnostics = _read_profile(robot or _named_robot(folder), folder)
        if diagnostics:
            for diagnostic in diagnostics:
                print(f"{diagnostic}", file=sys.stderr)
            return 2
    try:
        examine: Examiner = load_ros_plugin(DOCTORS)
    except DriverError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    text, status = examine(ros, profile, seconds=seconds, as_json=as_json)
    sys.stdout.write(text)
    return status


def _named_robot(folder: str | None) -> str:
    """The robot that a scenario names, whatever else is wrong with it."""
    scenario = load(folder or ".").scenario
    return scenario.robot.name if scenario is not None else DEFAULT_ROBOT


def _robots_folder(folder: str | None) -> Path:
    """The folder whose own robots count."""
    path = Path(folder or ".")
    return (path.parent if path.is_file() else path).resolve()


def _read_profile(name: str, folder: str | None) -> tuple[RobotProfile, list[Diagnostic]]:
    diagnostics = Diagnostics()
    profile = read_robot(name, FileReader(_robots_folder(folder), diagnostics), SourceLocation("command line"))
    return profile, diagnostics.sorted()


def _action_row(spec: ActionSpec) -> dict[str, Any]:
    names = {
        parameter.name: [*parameter.codes, *parameter.names]
        for parameter in spec.parameters.values()
        if parameter.type == "name"
    }
    return {"name": spec.name, "substitute": spec.substitute, "channels": list(spec.channels), "names": names}


def _robot_text(row: dict[str, Any]) -> str:
    missing = "" if row["installed"] else ", which is NOT INSTALLED"
    lines = [f"{row['name']}: {row['title']}, driver {row['driver']}{missing}", f"  {row['from']}"]
    for action in row["actions"]:
        instead = f", done as {action['substitute']}" if action["substitute"] else ""
        lines.append(f"  {action['name']}{instead}")
        for parameter, names in action["names"].items():
            known = ", ".join("any other name" if name == "*" else name for name in names) or "any name"
            lines += wrap(f"{parameter}: {known}", 100, initial_indent="    ", subsequent_indent="      ")
    lines += [f"  {diagnostic}" for diagnostic in row["findings"]]
    return "\n".join(map(clean, lines))


# --- the studies that come with the program -------------------------------------------------------------------------


def studies_report() -> int:
    """Print the shipped studies, one in a line."""
    lines = study_lines()
    print("\n".join(lines) if lines else "no study is installed with the program")
    return 0 if lines else 1


def new_report(folder: str, study: str) -> int:
    """Copy a shipped study and say how to go on; the exit status is 1 when it could not be copied."""
    try:
        number = copy_study(study, Path(folder))
        write_agents_file(Path(folder))
    except StudyCopyError as why:
        print(f"error: {why}", file=sys.stderr)
        if study not in shipped_studies():
            sys.stderr.write("".join(f"  {line}\n" for line in study_lines()))
        return 1
    print(f"{folder}: {number} files of the study {study}, which are yours to change")
    print(f"  check it   rise-engine check {quote(folder)}")
    print(f"  run it     rise-tui --config {quote(folder)}")
    if (Path(folder) / "README.md").exists():
        print(f"  read       {Path(folder) / 'README.md'}")
    return 0


# --- small things ---------------------------------------------------------------------------------------------------


def _one_line(text: str) -> str:
    """Every character at the column where it was written."""
    return "".join(" " if character.isspace() else character for character in text)
