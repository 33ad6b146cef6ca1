"""Imports rclpy when it is needed. It belongs to ROS, not to this program."""

from __future__ import annotations

import re
from importlib import import_module
from typing import Any, NamedTuple

from rise_adapters.ros2.transport.port import PortError


class Rclpy(NamedTuple):
    """The parts of rclpy that this program uses."""

    Context: Any
    Node: Any
    executors: Any
    events: Any
    qos: Any
    rmw: str
    """The RMW in use: `rmw_cyclonedds_cpp`."""


def load_rclpy() -> Rclpy:
    """Import rclpy. Raises PortError if it cannot be used here."""
    why = rclpy_missing()
    if why:
        raise PortError(why)
    return Rclpy(
        import_module("rclpy.context").Context,
        import_module("rclpy.node").Node,
        import_module("rclpy.executors"),
        import_module("rclpy.event_handler"),
        import_module("rclpy.qos"),
        import_module("rclpy").get_rmw_implementation_identifier(),
    )


def rclpy_missing() -> str:
    """Why rclpy cannot be used here, in a sentence; empty: it can."""
    try:
        rclpy = import_module("rclpy")
        import_module("rclpy.node")  # loads the compiled part, which fails with another Python
        rclpy.get_rmw_implementation_identifier()
    except ImportError as error:
        if isinstance(error, ModuleNotFoundError) and error.name == "rclpy":
            return (
                "rclpy cannot be imported: ROS 2 is not installed, or not sourced (`. /opt/ros/jazzy/setup.sh`), or "
                "this Python is not the one it was made for."
            )
        return f"rclpy is here, but it cannot be loaded: {first_line(error)}"
    except Exception as error:  # the requested RMW is not installed
        return f"rclpy is here, but it does not start: {first_line(error)}"
    return ""


def first_line(error: BaseException) -> str:
    """The first line of an error. rclpy's messages continue with places in C files."""
    if type(error).__name__ == "UnknownROSArgsError":
        return f"it does not know the arguments {error}"
    text = str(error).strip() or type(error).__name__
    return re.sub(r",? at .*\.(c|cpp):\d+.*$", "", text.splitlines()[0]).strip()
