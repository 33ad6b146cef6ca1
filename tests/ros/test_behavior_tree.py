"""What the leaves for behaviour trees say of themselves, where nothing of ROS is installed: names, ports, programs."""

from __future__ import annotations

import re
from inspect import getsource
from pathlib import Path
from xml.etree import ElementTree

import pytest

from rise_engine.kernel.task_handlers import TaskHandlers
from rise_engine.scenario.loader import load

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "adapters/rise_behavior_tree"
LEAF = (PACKAGE / "include/rise_behavior_tree/task_leaf.hpp").read_text("utf-8")
PAGE = (ROOT / "docs/how-to/behaviour-trees.md").read_text("utf-8")
PORTS = re.findall(r'BT::(?:In|Out)putPort<\w+(?:::\w+)?>\(\s*"(\w+)"', LEAF)


def tasks(tree: str) -> list[dict[str, str]]:
    return [dict(each.attrib) for each in ElementTree.fromstring(tree).iter("RiseTask")]


def test_the_tree_that_comes_along_asks_for_what_its_study_has() -> None:
    scenario = load(ROOT / "scenarios/greeting").scenario
    assert scenario is not None
    asked = tasks((PACKAGE / "trees/greeting.xml").read_text("utf-8"))
    assert len(asked) == 3
    for task in asked:
        assert task.keys() <= set(PORTS)
        known = {
            "startCommunicationRobotAct": scenario.acts,
            "startInteractionRule": scenario.rules,
            "raiseEventTopic": {key.behavior for key in scenario.keys.values()},
        }
        assert task["behavior"] in known[task["function"]]


def test_the_page_shows_that_tree_and_names_every_port() -> None:
    shown = "".join(line for line in PAGE.splitlines() if line.startswith("    ") and "<" in line)
    assert tasks(f"<Sequence>{shown}</Sequence>") == tasks((PACKAGE / "trees/greeting.xml").read_text("utf-8"))
    table = PAGE[PAGE.index("| port |") :].partition("\n\n")[0]
    assert re.findall(r"^\| `(\w+)`", table, re.MULTILINE) == PORTS


def test_what_both_leaves_say_is_the_same() -> None:
    python = (ROOT / "adapters/rise_ros/rise_ros/task_leaf.py").read_text("utf-8")
    for sentence in (
        "the session refused the task; rise/task_state and its record say why",
        "the session went before the task had ended",
        "no session is there",
        "the session did not answer",
        "rise/domain_task",
    ):
        assert f'"{sentence}"' in python and f'"{sentence}"' in LEAF


def test_the_functions_that_they_name_are_functions() -> None:
    python = (ROOT / "adapters/rise_ros/rise_ros/task_leaf.py").read_text("utf-8")
    named = set(re.findall(r'"((?:start|raise|assign)\w+)"', python + LEAF)) - {"assign"}
    assert named == {"startCommunicationRobotAct", "startInteractionRule", "raiseEventTopic", "assignValue"}
    assert all(f'"{function}"' in getsource(TaskHandlers.__init__) for function in named)


def test_its_package_is_one_that_colcon_takes() -> None:
    package = pytest.importorskip("catkin_pkg.package", reason="catkin_pkg is not installed")
    found = package.parse_package(str(PACKAGE))
    found.validate()
    assert found.name == PACKAGE.name
    needed = {"rclcpp", "rclcpp_action", "behaviortree_cpp", "rise_interfaces"}
    assert {each.name for each in found.build_depends} == needed
    cmake = (PACKAGE / "CMakeLists.txt").read_text("utf-8")
    assert all(f"find_package({name}" in cmake for name in needed)
