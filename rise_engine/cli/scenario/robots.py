"""`rise-engine robots`, `schema` and `doctor`: the actions of robots, and a check whether one answers."""

from __future__ import annotations

import sys
from textwrap import wrap
from typing import Any

import click

from rise_engine.base.exit_status import USAGE
from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.cli.options import JSON, ROBOT, ROS, SCENARIO_OR_NONE, number
from rise_engine.cli.scenario.loading import load_scenario, read_profile, robots_folder
from rise_engine.cli.terminal import Refused, show, write_xml
from rise_engine.ports.bridge import Examiner, RosConnection, RosTransport
from rise_engine.run.engine.drivers import DOCTORS, driver_names, load_ros_plugin
from rise_engine.scenario.editor_schemas import act_schema_text, rule_schema_text
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import ActionSpec, RobotProfile
from rise_engine.scenario.reading.robot_profiles import DEFAULT_ROBOT, find_profile, robot_names

SCHEMAS = "rise.schemas"
"""The entry-point group for a package's own schemas, each a function that returns the text."""


@click.command()
@SCENARIO_OR_NONE
@click.option(
    "--kind",
    type=click.Choice(["cra", "rules", *installed_plugins(SCHEMAS).names]),
    required=True,
    help="Choose acts (cra), rules, or BML 1.0.",
)
@ROBOT
def schema(folder: str | None, kind: str, robot: str | None) -> None:
    """Print the RELAX NG schema of act, rule or BML files, for an editor that completes and checks them.

    With DIR, it also knows the actions of that scenario and its robot.
    """
    if kind == "rules":
        text = rule_schema_text()
    elif plugin := find_plugin(SCHEMAS, kind):
        text = plugin.load()()
    elif folder is not None:
        text = act_schema_text(load_scenario(folder, robot=robot).robot.actions)
    else:
        profile, diagnostics = read_profile(robot or "generic", None)
        if diagnostics:
            raise Refused(findings=diagnostics)
        text = act_schema_text(profile.actions)
    write_xml(text.rstrip("\n"))


@click.command()
@SCENARIO_OR_NONE
@JSON
def robots(folder: str | None, as_json: bool) -> None:
    """List the robots that a scenario can name, where each comes from and what it can do."""
    home = robots_folder(folder)
    installed = driver_names()
    rows = []
    for name in robot_names(home):
        profile, diagnostics = read_profile(name, folder)
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
    lines = [line for row in rows for line in ("", *_robot_lines(row))]
    show(lines[1:], {"robots": rows}, as_json=as_json)


def _action_row(spec: ActionSpec) -> dict[str, Any]:
    names = {
        parameter.name: [*parameter.codes, *parameter.names]
        for parameter in spec.parameters.values()
        if parameter.type == "name"
    }
    return {"name": spec.name, "substitute": spec.substitute, "channels": list(spec.channels), "names": names}


def _robot_lines(row: dict[str, Any]) -> list[str]:
    missing = "" if row["installed"] else ", which is NOT INSTALLED"
    lines = [f"{row['name']}: {row['title']}, driver {row['driver']}{missing}", f"  {row['from']}"]
    for action in row["actions"]:
        instead = f", done as {action['substitute']}" if action["substitute"] else ""
        lines.append(f"  {action['name']}{instead}")
        for parameter, names in action["names"].items():
            known = ", ".join("any other name" if name == "*" else name for name in names) or "any name"
            lines += wrap(f"{parameter}: {known}", 100, initial_indent="    ", subsequent_indent="      ")
    return [*lines, *(f"  {diagnostic}" for diagnostic in row["findings"])]


@click.command()
@SCENARIO_OR_NONE
@ROBOT
@ROS
@click.option(
    "--seconds",
    metavar="N",
    type=number("--seconds", "a number of seconds above 0, up to 600", 600, above=0),
    default="3",
    help="Look for the robot for at most N seconds. Default: 3.",
)
@JSON
def doctor(folder: str | None, robot: str | None, ros: RosTransport, seconds: float, as_json: bool) -> int:
    """Examine ROS 2 on this machine, and find out whether the robot of the scenario in DIR, or of --robot, answers.

    Nothing is sent to the robot. Exit status: 0; 1 if there is a problem; 2 if there is no such robot.
    """
    profile: RobotProfile | None = None
    if robot is not None or folder is not None:
        profile, diagnostics = read_profile(robot or _named_robot(folder), folder)
        if diagnostics:
            raise Refused(status=USAGE, findings=diagnostics)
    examine: Examiner = load_ros_plugin(DOCTORS)
    connection = RosConnection(ros, click.get_current_context().obj)
    text, status = examine(connection, profile, seconds=seconds, as_json=as_json)
    sys.stdout.write(text)
    return status


def _named_robot(folder: str | None) -> str:
    """Return the robot of a scenario; the default robot if the scenario has errors."""
    scenario = load(folder or ".").scenario
    return scenario.robot.name if scenario is not None else DEFAULT_ROBOT
