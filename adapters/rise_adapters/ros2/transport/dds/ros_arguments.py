"""What stands behind `--ros-args`: remappings, as every ROS 2 program takes them
(https://design.ros2.org/articles/ros_command_line_arguments.html).

The rclpy transport leaves this to rclpy; this is for the transport that does without ROS.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec import Struct

from rise_adapters.ros2.transport.port import PortError

# What is right for ROS and means nothing here: logging, and parameters, which `parameters` has read before.
_WITH_VALUE = {"--params-file", "--log-level", "--log-config-file", "--log-file-name", "-e", "--enclave"}
_FLAGS = {
    *("--disable-stdout-logs", "--enable-stdout-logs", "--disable-rosout-logs", "--enable-rosout-logs"),
    *("--disable-external-lib-logs", "--enable-external-lib-logs"),
}


class RosArguments(Struct, frozen=True):
    node: str
    namespace: str = "/"
    remaps: tuple[tuple[str, str], ...] = ()
    """Of topics, services and actions of that node: what is replaced, and by what. The first that fits counts."""


def parse_ros_arguments(arguments: Sequence[str], node: str) -> RosArguments:
    """Read the arguments, with or without a leading `--ros-args` and a closing `--`; `node` is the program's own name
    for its node, for rules such as `rise:__ns:=/lab`. Raises PortError with a sentence."""
    remaps: list[tuple[str, str, str]] = []
    special: dict[str, str] = {}
    rest = iter(arguments)
    for argument in rest:
        if argument in ("--ros-args", "--", *_FLAGS):
            continue
        if argument in ("-r", "--remap"):
            only_for, source, target = _parse_remap(_next_value(argument, rest))
            if source not in ("__ns", "__node", "__name"):
                remaps.append((only_for, source, target))
            elif only_for in ("", node):
                special.setdefault("__node" if source == "__name" else source, target)
        elif argument in ("-p", "--param"):
            value = _next_value(argument, rest)
            if ":=" not in value:
                raise PortError(f"--ros-args: {value!r} is no parameter; one looks like name:=value")
        elif argument in _WITH_VALUE:
            _next_value(argument, rest)
        else:
            hint = "; did you forget -r before it?" if ":=" in argument else ""
            raise PortError(f"--ros-args: {argument!r} is not understood{hint}")
    namespace = special.get("__ns", "/")
    if not namespace.startswith("/"):
        raise PortError(f"--ros-args: the namespace {namespace!r} must begin with a slash")
    name = special.get("__node", node)
    return RosArguments(name, namespace, tuple((source, to) for only, source, to in remaps if only in ("", name)))


def _next_value(option: str, rest: Iterator[str]) -> str:
    value = next(rest, None)
    if value is None:
        raise PortError(f"--ros-args: something must follow {option}")
    return value


def _parse_remap(rule: str) -> tuple[str, str, str]:
    """`[node:]from:=to` as the node that it holds for (empty: for all), from, to."""
    source, separator, target = rule.partition(":=")
    if not separator or not source or not target:
        raise PortError(f"--ros-args: {rule!r} is no remapping; one looks like from:=to")
    node, _, name = source.rpartition(":")
    if "://" in source:
        raise PortError(f"--ros-args: {rule!r}: remappings of rostopic:// and rosservice:// are not supported")
    return node, name, target
