"""`rise-engine check`: all errors of a scenario, or the settings of one of its acts."""

from __future__ import annotations

import json
from collections.abc import Iterator

import click

from rise_engine.author.explore.exploration import Exploration, explore_quickly
from rise_engine.base.exit_status import OK, REFUSED
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import pluralize
from rise_engine.cli.options import JSON, LANGUAGE, MODE, ROBOT, SCENARIO
from rise_engine.cli.scenario.loading import diagnostic_row, robots_folder, sound_scenario
from rise_engine.cli.terminal import exit_with_usage, show
from rise_engine.run.engine.drivers import profile_findings
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.reading.robot_profiles import locate_in_profile
from rise_engine.scenario.reading.suppressions import with_ends


@click.command()
@SCENARIO
@JSON
@click.option("--all", "all_of_them", is_flag=True, help="Also list the silenced warnings, with their reasons.")
@click.option("--explain", "act", metavar="ACT", help="Show what scenario.toml sets for this act, and in which line.")
@click.option("--deep", is_flag=True, help="Also explore what can happen in a session, for a few seconds.")
@ROBOT
@MODE
@LANGUAGE
def check(
    folder: str,
    as_json: bool,
    all_of_them: bool,
    act: str | None,
    deep: bool,
    robot: str | None,
    mode: str | None,
    language: str,
) -> int:
    """Report everything that is wrong with the scenario in DIR.

    With --deep, also report what can go wrong in a session. It looks at everything that can happen, as `explore` does,
    but without stops and lost robots, and for five seconds at most.

    Exit status: 0 no errors (there may be warnings); 1 errors or problems; 2 no such folder or act.
    """
    if act is not None:
        _explain_act(load(folder, robot=robot, mode=mode), act, as_json=as_json)
        return OK
    loaded = load(folder, robot=robot, mode=mode, language=language or None)
    scenario, silenced = loaded.scenario, loaded.suppressed
    is_real = (scenario.mode if scenario is not None else mode) == "real"
    diagnostics = loaded.diagnostics + _driver_diagnostics(folder, loaded, is_real=is_real)
    errors = sum(diagnostic.severity == "error" for diagnostic in diagnostics)
    warnings = len(diagnostics) - errors
    exploration = explore_quickly(scenario) if deep and scenario is not None and not errors else None
    lines = [str(diagnostic) for diagnostic in diagnostics]
    for each in silenced if all_of_them else ():
        lines.append(
            f"{each.diagnostic.location}: silenced {each.diagnostic.code}: {each.diagnostic.message} "
            f"(reason: {each.reason})"
        )
    found = (
        f"{pluralize(errors, 'error')}, {pluralize(warnings, 'warning')}" if diagnostics else "no errors or warnings"
    )
    found += f", {len(silenced)} silenced" if silenced else ""
    lines.append(f"{found}{_contents_text(scenario)}")
    document = {
        "errors": errors,
        "warnings": warnings,
        "findings": [diagnostic_row(diagnostic) for diagnostic in diagnostics],
        "silenced": [{**diagnostic_row(each.diagnostic), "reason": each.reason} for each in silenced],
        **({} if exploration is None or scenario is None or not as_json else {"explored": exploration.row(scenario)}),
    }
    show([*lines, *(_exploration_lines(exploration) if exploration is not None else ())], document, as_json=as_json)
    return REFUSED if errors or (exploration is not None and exploration.count("problem")) else OK


def _exploration_lines(exploration: Exploration) -> Iterator[str]:
    """Yield a line for each finding of exploring, and the bounds."""
    for finding in exploration.findings:
        if finding.level != "remark":
            place = f"{finding.location}: " if finding.location is not None else ""
            yield f"{place}{finding.level} {finding.kind}: {finding.text}"
    yield from (*exploration.scope, *exploration.facts)
    yield "`rise-engine explore` looks at more, and shows the path to each finding."


def _driver_diagnostics(folder: str, loaded: LoadResult, *, is_real: bool) -> list[Diagnostic]:
    """Return the driver's diagnostics of the profile; in a rehearsal, problems of real sessions are only warnings."""
    files = FileReader(robots_folder(folder), Diagnostics())
    found = Diagnostics()
    errors = {each.location.file for each in loaded.errors}
    if SCENARIO_FILE in errors or any(name.endswith(f"{loaded.robot.name}.toml") for name in errors):
        return []  # the profile could only be read in part
    for finding in profile_findings(loaded.robot):
        location = locate_in_profile(finding.where, loaded.robot.name, files)
        refused = finding.kind == "wrong" or (finding.kind == "missing" and is_real)
        (found.error if refused else found.warning)("robot-profile", location, finding.sentence)
    return with_ends(found.sorted(), {source.name: source for source in files.sources})


def _contents_text(scenario: Scenario | None) -> str:
    if scenario is None:
        return ""
    more = f"{pluralize(len(scenario.tables), 'table')}, " if scenario.tables else ""
    more += f"{pluralize(len(scenario.conditions), 'condition')}, " if scenario.conditions else ""
    return (
        f" ({pluralize(len(scenario.acts), 'act')}, {pluralize(len(scenario.rules), 'rule')}, "
        f"{pluralize(len(scenario.memory), 'memory key')}, {more}robot {scenario.robot.name})"
    )


def _explain_act(loaded: LoadResult, act: str, *, as_json: bool) -> None:
    """Print the settings of an act, with their lines of scenario.toml."""
    scenario = sound_scenario(loaded)
    if act not in scenario.acts:
        exit_with_usage(f"there is no act {act!r}{did_you_mean(act, scenario.acts)}")
    rows, lines = [], [act]
    for name, value, table in loaded.act_tables.explain(act, scenario.on_failure):
        rows.append(
            {"setting": name, "value": value, "table": table and table.name, "line": table and table.location.line}
        )
        source = "as usual" if table is None else f"{table.header} ({table.location.file}:{table.location.line})"
        lines.append(f"  {name:<13} {json.dumps(value):<11} {source}")
    show(lines, {"act": act, "settings": rows}, as_json=as_json)
