"""The launch file of a session (adapters/rise_ros/launch): every option of `rise-engine serve`, nothing dropped."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import click
import pytest

from rise_engine.base import exit_status
from rise_engine.cli.arguments import add_ros_parameters
from rise_engine.cli.program import split_ros_args
from rise_engine.cli.session.serve import serve

pytest.importorskip("yaml")

PACKAGE = Path(__file__).parents[2] / "adapters/rise_ros"
FILE = "session.launch.py"


def load(path: Path) -> Any:
    """A file of the ROS package, which is not installed here."""
    spec = spec_from_file_location(path.name.partition(".")[0], path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


made = load(PACKAGE / "rise_ros/session_arguments.py")
programs = load(PACKAGE / "rise_ros/programs.py")


def given(**values: str) -> dict[str, str]:
    return {name: default for name, (default, _) in made.ARGUMENTS.items()} | values


def started(monkeypatch: pytest.MonkeyPatch, arguments: dict[str, str]) -> dict[str, Any]:
    """What `rise-engine serve` makes of the command line that the launch file starts, as far as it is no default."""
    line = [*made.engine_arguments(arguments), "--ros-args", *made.engine_ros_arguments(arguments)]
    monkeypatch.setattr(sys, "argv", ["engine", *line, "--ros-args", "-r", "__ns:=/lab"])
    monkeypatch.setattr(programs, "import_module", lambda name: type("cli", (), {"main": staticmethod(lambda: None)}))
    programs.engine()
    own, ros = split_ros_args(sys.argv[1:])
    own, ros = add_ros_parameters(own, ros, serve)
    params = serve.make_context("serve", own[1:]).params
    plain = serve.make_context("serve", []).params
    return {name: value for name, value in params.items() if value != plain[name]} | {"": " ".join(ros)}


def test_every_option_of_serve_is_an_argument_with_its_help() -> None:
    """Who adds an option writes it there, too: ros2 launch cannot ask the program."""
    own = {
        option.opts[0].removeprefix("--").replace("-", "_"): option.help
        for option in serve.params
        if isinstance(option, click.Option)
    }
    assert own == made.SERVE_OPTIONS
    assert set(made.ARGUMENTS) > {"config", *own, "params_file", "ros_arguments", "respawn"}


@pytest.mark.parametrize(
    ("values", "options"),
    [
        ({"config": "/s/lab"}, {"folder": "/s/lab", "ros": "rclpy", "": "-r __ns:=/lab"}),
        (
            {"config": "/s/LabLinking 2", "condition": "yes+loud", "participant": "007", "mode": "real", "ros": "dds"},
            {"folder": "/s/LabLinking 2", "condition": "yes+loud", "participant": "007", "mode": "real", "ros": "dds"},
        ),
        (
            {"study": "/s/study", "participant": "P07", "run": "2", "wizard": "anna: it's me", "record": "false"},
            {"study": "/s/study", "participant": "P07", "run_number": 2, "wizard": "anna: it's me", "record": False},
        ),
        ({"record": "true", "pilot": "true", "new": "false", "recover": "true"},
         {"record": True, "pilot": True, "recover": True}),
        ({"set": '[task=2, name="Anna"]', "rule": "Table setting", "skip_check": "lamp=broken: no bulb"},
         {"settings": ("task=2", 'name="Anna"'), "rules": ("Table setting",), "skipped": ("lamp=broken: no bulb",)}),
        ({"fault": "[Speech=fail@2, vanish@12.5-20]", "seed": "0", "allow_untranslated": "true", "language": "de"},
         {"faults": ("Speech=fail@2", "vanish@12.5-20"), "seed": 0, "allow_untranslated": True, "language": "de"}),
        ({"ros_arguments": "-r rise/domain_task:='/a task' --log-level debug"},
         {"": "-r rise/domain_task:=/a task --log-level debug -r __ns:=/lab"}),
    ],
)  # fmt: skip
def test_what_is_given_arrives(
    values: dict[str, str], options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    arrived = started(monkeypatch, given(**values))
    assert arrived == {"ros": "rclpy", "": "-r __ns:=/lab"} | options


def test_a_file_of_parameters_counts_less(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "lab.yaml"
    file.write_text("/lab/rise:\n  ros__parameters: {robot: pepper, condition: quiet, new: true}\n")
    arrived = started(monkeypatch, given(params_file=str(file), condition="loud"))
    assert (arrived["robot"], arrived["condition"], arrived["new"]) == ("pepper", "loud", True)


@pytest.mark.parametrize(
    ("values", "typed", "problems"),
    [
        ({}, ["config:=/s", "condition:=loud", "launch-prefix:=xterm -e"], []),
        ({}, ["conditon:=loud"], ["the launch argument conditon is unknown; did you mean condition?"]),
        ({}, ["allow-untranslated:=true", "zzz:=1"],
         ["the launch argument allow-untranslated is unknown; did you mean allow_untranslated?",
          "the launch argument zzz is unknown; ros2 launch rise_ros session.launch.py --show-args"]),
        ({"respawn": "yes", "robot_sim": "true", "ros_arguments": "-r 'a"}, [],
         ["the launch argument respawn is true or false, not 'yes'",
          "robot_sim:=true needs to know which robot: say config:=DIR or robot:=NAME too",
          "the launch argument ros_arguments cannot be read: No closing quotation"]),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_all_at_once(
    values: dict[str, str], typed: list[str], problems: list[str]
) -> None:
    assert made.find_problems(given(**values), typed) == problems


def test_only_what_is_typed_for_this_file_is_looked_at() -> None:
    line = ["/opt/ros/bin/ros2", "launch", "rise_ros", FILE, "config:=/s", "--debug", "conditon:=x"]
    assert made.typed_arguments(line, FILE) == ["config:=/s", "conditon:=x"]
    assert made.typed_arguments(["ros2", "launch", f"/ws/share/{FILE}", "a:=b"], FILE) == ["a:=b"]
    assert made.typed_arguments(["ros2", "launch", "lab", "bringup.launch.py", "robot_ip:=10.0.0.2"], FILE) == []


def test_the_simulated_robot_has_the_same_names() -> None:
    both = given(config="/s", robot="rise", ros_arguments="-r __node:=wizard -r rise/robot/speech:=/voice -p seed:=3")
    assert made.robot_arguments(both) == ["--ros", "rclpy", "--config", "/s", "--robot", "rise"]
    assert made.robot_ros_arguments(both) == ["-r", "rise/robot/speech:=/voice"]


def test_after_a_crash_the_same_session_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "lab.yaml"
    file.write_text("/**:\n  ros__parameters: {new: true}\n")
    first = given(config="/s", participant="P07", new="true", tasks="/t.jsonl", params_file=str(file))
    again = started(monkeypatch, made.recovery_arguments(first))
    assert again == {"folder": "/s", "participant": "P07", "recover": True, "ros": "rclpy", "": "-r __ns:=/lab"}
    unit = (PACKAGE.parents[1] / "packaging/systemd/rise-engine@.service").read_text("utf-8")
    prevented = next(line for line in unit.splitlines() if line.startswith("RestartPreventExitStatus=")).partition("=")
    final = {0, *map(int, prevented[2].split())}
    told = ("REFUSED", "USAGE", "ALREADY_RUNNING", "UNFINISHED", "UNRECOVERABLE", "STILL_RUNNING", "NOT_WRITTEN")
    told += ("INTERRUPTED",)
    assert final == {0, *(getattr(exit_status, name) for name in told)}
    assert {status for status in range(-20, 200) if not made.is_crash(status)} == final, "as the unit for systemd"


def test_a_tree_without_py_trees_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    def start_without(package: str) -> None:
        def fail(name: str) -> None:
            raise ModuleNotFoundError(f"No module named {package!r}", name=package)

        monkeypatch.setattr(programs, "import_module", fail)
        programs.task_tree()

    with pytest.raises(SystemExit, match=r"py_trees is not installed for .*: sudo apt install ros-jazzy-py-trees, or"):
        start_without("py_trees.common")
    with pytest.raises(SystemExit, match="rise-tui is not installed for this Python"):
        start_without("rise_engine.cli")
    with pytest.raises(ModuleNotFoundError):
        start_without("numpy")


@pytest.mark.skipif(find_spec("launch_ros") is None, reason="launch_ros is not installed, or ROS is not sourced")
def test_the_launch_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """With ROS: what it declares, what it starts, and that it refuses."""
    launch = import_module("launch")
    monkeypatch.syspath_prepend(str(PACKAGE))
    file = load(PACKAGE / "launch" / FILE)
    described = file.generate_launch_description()
    declared = {each.name: each for each in described.get_launch_arguments()}
    assert set(declared) == set(made.ARGUMENTS)
    context = launch.LaunchContext()
    context.launch_configurations.update(given(config="/s", condition="loud", robot_sim="true"))
    handler, engine, robot = file.launch(context)
    assert isinstance(handler, launch.actions.RegisterEventHandler)
    assert [each.node_executable for each in (engine, robot)] == ["engine", "robot_sim"]
    monkeypatch.setattr(sys, "argv", ["ros2", "launch", "rise_ros", FILE, "conditon:=loud"])
    with pytest.raises(ValueError, match="did you mean condition"):
        file.launch(context)
