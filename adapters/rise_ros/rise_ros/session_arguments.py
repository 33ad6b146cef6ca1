"""The arguments of the launch file `session.launch.py`, and the command lines that it makes from them.

It uses only Python's own library: `ros2 launch` runs with the system's Python, in which rise-tui is not installed. So
the options of `rise-engine serve` are repeated here; tests compare them with the program's own.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from itertools import pairwise

SERVE_OPTIONS = {
    "study": "Run a session of this study instead of DIR, for --participant.",
    "run": "Choose one of the participant's runs. Default: the next.",
    "pilot": "With --study: run a pilot session, which does not count.",
    "training": "With --study: practise without a participant. The session does not count.",
    "record": "With --study: run its recorders, or not. Default: in sessions that count and in pilots.",
    "confirm": "Confirm this check of the study. Repeatable.",
    "skip_check": "Skip this check of the study. The record keeps the reason. Repeatable.",
    "wizard": "Record the session with this wizard's name.",
    "name": "Name the session's socket. Default: made from DIR.",
    "set": "Set a memory value before the session begins. Repeatable.",
    "rule": "Start an interaction rule. Repeatable.",
    "act": "Start an act. Repeatable.",
    "recover": "Continue the latest session that did not end, if there is one.",
    "session": "Continue this session.",
    "here": "Proceed even if another computer had the session last and may still run it.",
    "new": "Begin a new session, even if an earlier one did not end.",
    "speed": "Run N times as fast.",
    "seed": "Set the seed of all random choices. Default: a new one.",
    "robot": "Use this robot instead of the scenario's.",
    "mode": "Use this mode instead of the scenario's.",
    "participant": "Name this participant in the records.",
    "condition": "Use this condition of the scenario, with its memory values.",
    "language": "Let the robot speak this language (texts/TAG.toml).",
    "allow_untranslated": "With --language: say texts without a translation as the acts have them.",
    "ros": "Choose how to reach ROS 2. auto: as the robot needs it.",
    "fault": "Let the simulated robot fail in this way. Repeatable.",
    "tasks": "In debug mode: carry out these tasks at their times, one JSON object per line.",
    "place": "Read acts, rules or memory from another PATH in the scenario's folder (memory=pilot.json). Repeatable.",
}
"""Every option of `rise-engine serve`, with `_` for `-`, and its help."""

ARGUMENTS = {
    "config": ("", "The scenario's folder (DIR); a study has its own."),
    **{name: ("rclpy" if name == "ros" else "", about) for name, about in SERVE_OPTIONS.items()},
    "params_file": ("", "A file of ROS parameters for the session's node; these arguments take precedence."),
    "ros_arguments": ("", "Further arguments after --ros-args: -r rise/domain_task:=task --log-level debug."),
    "namespace": ("", "Namespace of all these nodes."),
    "ros_domain_id": ("", "ROS domain of all these nodes; without it, that of the terminal."),
    "robot_sim": ("false", "true: a simulated robot on the wire, in place of the robot's wrapper."),
    "respawn": ("false", "true: an engine that crashed is started again, and goes on with the same session."),
}
"""Each argument's default and help. Arguments without a value are not passed on."""

_LAUNCH_ARGUMENTS = ("launch-prefix", "launch-prefix-filter")
"""Arguments of ros2 launch itself."""
_ORDERLY_STATUSES = {*range(7), 74, 130}
"""Exit statuses after which a restart is useless: the session ended, even with open goals on the robot (6) or without
the end of its record (74), or was refused (as in the systemd unit)."""


def typed_arguments(command: Sequence[str], file: str) -> list[str]:
    """Return a command line's words for a launch file (`ros2 launch ...`); empty: another file includes this one."""
    places = [place for place, word in enumerate(command) if word.rpartition("/")[2] == file]
    return [word for word in command[places[0] + 1 :] if ":=" in word] if places else []


def find_problems(given: Mapping[str, str], typed: Iterable[str]) -> list[str]:
    """Return a sentence for each argument that cannot be used. `typed`: the result of `typed_arguments`."""
    problems = []
    for word in typed:
        name = word.partition(":=")[0]
        if name not in (*ARGUMENTS, *_LAUNCH_ARGUMENTS):
            near = get_close_matches(name, ARGUMENTS, 1)
            hint = f"did you mean {near[0]}?" if near else "ros2 launch rise_ros session.launch.py --show-args"
            problems.append(f"the launch argument {name} is unknown; {hint}")
    for name in ("robot_sim", "respawn"):
        if given[name] not in ("true", "false"):
            problems.append(f"the launch argument {name} is true or false, not {given[name]!r}")
    if given["robot_sim"] == "true" and not (given["config"] or given["robot"]):
        problems.append("robot_sim:=true needs to know which robot: say config:=DIR or robot:=NAME too")
    try:
        shlex.split(given["ros_arguments"])
    except ValueError as error:
        problems.append(f"the launch argument ros_arguments cannot be read: {error}")
    return problems


def engine_arguments(given: Mapping[str, str]) -> list[str]:
    """The arguments of `ros2 run rise_ros engine`, without those after `--ros-args`."""
    return [*(["--config", given["config"]] if given["config"] else []), "--ros", given["ros"]]


def engine_ros_arguments(given: Mapping[str, str]) -> list[str]:
    """Return the arguments after `--ros-args`. Options are parameters there: the engine itself checks them, and
    `[a, b]` gives a repeatable option several times."""
    words = ["--params-file", given["params_file"]] if given["params_file"] else []
    for name in SERVE_OPTIONS:
        value = given[name]
        if value and name != "ros":
            words += ["-p", f"{name}:={value if value.startswith('[') else _quote(value)}"]
    return [*words, *shlex.split(given["ros_arguments"])]


def _quote(text: str) -> str:
    """Write any text as YAML."""
    return "'" + text.replace("'", "''") + "'"


def robot_arguments(given: Mapping[str, str]) -> list[str]:
    """The arguments of `ros2 run rise_ros robot_sim`."""
    named = [(f"--{name}", given[name]) for name in ("config", "robot") if given[name]]
    return ["--ros", given["ros"], *(word for pair in named for word in pair)]


def robot_ros_arguments(given: Mapping[str, str]) -> list[str]:
    """Return the part of `ros_arguments` that both sides of an action need: its remappings."""
    words = shlex.split(given["ros_arguments"])
    remaps = [after for word, after in pairwise(words) if word in ("-r", "--remap")]
    return [word for remap in remaps if not remap.startswith("__") for word in ("-r", remap)]


def is_crash(returncode: int) -> bool:
    """Whether an ended engine has neither ended its session nor refused it."""
    return returncode not in _ORDERLY_STATUSES


def recovery_arguments(given: Mapping[str, str]) -> dict[str, str]:
    """Return the same arguments to continue the unfinished session. (A file of parameters may say `new`.)"""
    return {**given, "new": "false", "tasks": "", "recover": "true"}
