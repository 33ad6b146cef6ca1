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


class Remap(Struct, frozen=True):
    """`[node:]from:=to`"""

    source: str
    target: str
    node: str = ""
    """Only for the node of this name; empty: for all."""


class RosArguments(Struct, frozen=True):
    remaps: tuple[Remap, ...] = ()
    """Of topics, services and actions."""
    namespace: str = ""
    node: str = ""

    def remaps_for(self, node: str) -> dict[str, str]:
        """The remappings that hold for the node of that name, by what they replace, in the order that counts."""
        found: dict[str, str] = {}
        for remap in self.remaps:
            if remap.node in ("", node):
                found.setdefault(remap.source, remap.target)
        return found


def parse_ros_arguments(arguments: Sequence[str], node: str = "") -> RosArguments:
    """Read the arguments, with or without a leading `--ros-args` and a closing `--`; `node` is the program's own name
    for its node, for rules such as `rise:__ns:=/lab`. Raises PortError with a sentence."""
    remaps: list[Remap] = []
    special: dict[str, str] = {}
    rest = iter(arguments)
    for argument in rest:
        if argument in ("--ros-args", "--", *_FLAGS):
            continue
        if argument in ("-r", "--remap"):
            remap = _remap(_value(argument, rest))
            if remap.source not in ("__ns", "__node", "__name"):
                remaps.append(remap)
            elif remap.node in ("", node):
                special.setdefault("__node" if remap.source == "__name" else remap.source, remap.target)
        elif argument in ("-p", "--param"):
            value = _value(argument, rest)
            if ":=" not in value:
                raise PortError(f"--ros-args: {value!r} is no parameter; one looks like name:=value")
        elif argument in _WITH_VALUE:
            _value(argument, rest)
        else:
            hint = "; did you forget -r before it?" if ":=" in argument else ""
            raise PortError(f"--ros-args: {argument!r} is not understood{hint}")
    namespace = special.get("__ns", "")
    if namespace and not namespace.startswith("/"):
        raise PortError(f"--ros-args: the namespace {namespace!r} must begin with a slash")
    return RosArguments(tuple(remaps), namespace, special.get("__node", ""))


def _value(option: str, rest: Iterator[str]) -> str:
    value = next(rest, None)
    if value is None:
        raise PortError(f"--ros-args: something must follow {option}")
    return value


def _remap(rule: str) -> Remap:
    source, separator, target = rule.partition(":=")
    if not separator or not source or not target:
        raise PortError(f"--ros-args: {rule!r} is no remapping; one looks like from:=to")
    node, _, name = source.rpartition(":")
    if "://" in source:
        raise PortError(f"--ros-args: {rule!r}: remappings of rostopic:// and rosservice:// are not supported")
    return Remap(name, target, node)
