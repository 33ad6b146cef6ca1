"""The programs of `ros2 run rise_ros NAME`: those of the Python package rise-tui, and the nodes of `rise_ros.examples`.

They take `--config` where `rise-engine serve` takes only the folder, so that launch files are easier to read:

    ros2 run rise_ros engine --config ~/studies/lab_opening --robot rise --mode real
"""

from __future__ import annotations

import sys
from importlib import import_module

_NODES = "rise_ros.examples"


def engine() -> None:
    """Run a session with `rise-engine serve`, with all its options and `--config DIR`."""
    arguments = sys.argv[1:]
    if "--config" in arguments:
        at = arguments.index("--config")
        arguments[at : at + 2] = arguments[at + 1 : at + 2]
    if "--ros" not in arguments:
        arguments[:0] = ["--ros", "rclpy"]
    _start("rise_engine.cli", ["rise-engine", "serve", *arguments])


def console() -> None:
    """Run the wizard's console, `rise-tui`. It needs a terminal, so it is not for launch files."""
    _start("rise_tui.__main__", ["rise-tui", *sys.argv[1:]])


def doctor() -> None:
    """Run `rise-engine doctor`: what is there of ROS, and what is wrong."""
    _start("rise_engine.cli", ["rise-engine", "doctor", *sys.argv[1:]])


def robot_sim() -> None:
    """Run a simulated robot on the wire."""
    _start(f"{_NODES}.simulated_robot")


def keyword_spotter() -> None:
    _start(f"{_NODES}.keyword_spotter")


def gaze_trigger() -> None:
    _start(f"{_NODES}.gaze_trigger")


def answer_node() -> None:
    _start(f"{_NODES}.answer_node")


def task_tree() -> None:
    """Run a small behaviour tree of py_trees beside a session."""
    _start("rise_ros.task_leaf")


def _start(module: str, arguments: list[str] | None = None) -> None:
    if arguments is not None:
        sys.argv = arguments
    try:
        main = import_module(module).main
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing == "py_trees":
            sys.exit(
                f"py_trees is not installed for this Python ({sys.executable}): sudo apt install ros-jazzy-py-trees, "
                "or pip install py_trees (docs/how-to/behaviour-trees.md)."
            )
        if missing not in ("rise_engine", "rise_tui", "rise_adapters"):
            raise
        sys.exit(
            f"rise-tui is not installed for this Python ({sys.executable}). Activate the environment that you have "
            "installed it into, and source the workspace after that (docs/how-to/install-beside-ros.md)."
        )
    main()
