"""What of ROS 2 is installed and sourced on this machine, and which transport a session would use."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from rise_adapters.ros2.doctor.environment import (
    CYCLONE_RMW,
    DEFAULT_RMW,
    DISTRIBUTION,
    Environment,
    installed_version,
    sourced_prefixes,
)
from rise_adapters.ros2.doctor.finding import DoctorFinding, Level
from rise_adapters.ros2.transport import selection
from rise_engine.base.errors import AdapterError

_INSTALLED = Path("/opt/ros")


def check_installation(
    environment: Environment, *, wanted: bool = False, installed: Path = _INSTALLED
) -> Iterator[DoctorFinding]:
    """Whether ROS 2 is installed and sourced, and whether this Python can use it. `wanted`: rclpy is what is used."""
    name, prefixes = environment.get("ROS_DISTRO", ""), sourced_prefixes(environment)
    if name and prefixes:
        yield DoctorFinding("ok", "ros", f"ROS 2 {name.capitalize()} is sourced: {', '.join(map(str, prefixes[:6]))}")
        if name != DISTRIBUTION:
            yield DoctorFinding(
                "warning",
                "ros",
                f"this program is made for and tested with ROS 2 {DISTRIBUTION.capitalize()}, not {name}",
            )
    elif name or prefixes:
        which = "ROS_DISTRO, but not AMENT_PREFIX_PATH" if name else "AMENT_PREFIX_PATH, but not ROS_DISTRO"
        yield DoctorFinding(
            "warning", "ros", f"ROS 2 is sourced only in part: there is {which}", f"source {_setup_file(installed)}"
        )
    elif found := _installed_distributions(installed):
        level: Level = "warning" if wanted else "note"
        yield DoctorFinding(
            level,
            "ros",
            f"ROS 2 is installed ({', '.join(found)}), but not sourced in this terminal",
            f"source {_setup_file(installed)}",
        )
    else:
        yield DoctorFinding(
            "note",
            "ros",
            "there is no ROS 2 on this machine; it is not needed for robots whose nodes use "
            f"{CYCLONE_RMW}: the transport `dds` talks to them without it",
        )
    for prefix in prefixes:
        if not prefix.is_dir():
            yield DoctorFinding(
                "warning",
                "ros",
                f"AMENT_PREFIX_PATH names {prefix}, which is not there",
                "open a new terminal and source again",
            )
    missing = selection.why_unavailable()["rclpy"]
    if not missing:
        yield DoctorFinding(
            "ok", "ros", f"rclpy {installed_version('rclpy') or 'of an unknown version'} can be used from this Python"
        )
    else:
        yield DoctorFinding("problem" if wanted else "warning" if name else "note", "ros", missing)


def check_middleware(environment: Environment, kind: selection.TransportKind | None = None) -> Iterator[DoctorFinding]:
    """Which middleware nodes of this terminal use, and whether the transport can talk to it."""
    installed = installed_rmw(environment)
    named = environment.get("RMW_IMPLEMENTATION", "")
    if installed:
        yield DoctorFinding("ok", "rmw", f"installed middleware: {', '.join(installed)}")
    if named and installed and named not in installed:
        yield DoctorFinding(
            "problem" if kind == "rclpy" else "warning",
            "rmw",
            f"RMW_IMPLEMENTATION is {named}, which is not installed",
            f"sudo apt install ros-{environment.get('ROS_DISTRO') or DISTRIBUTION}-{named.replace('_', '-')}",
        )
    elif named:
        yield DoctorFinding("ok", "rmw", f"RMW_IMPLEMENTATION is {named}")
    elif installed:
        default = DEFAULT_RMW if DEFAULT_RMW in installed else installed[0]
        yield DoctorFinding("note", "rmw", f"RMW_IMPLEMENTATION is not set, so nodes of this terminal use {default}")
    used = named or (DEFAULT_RMW if installed else "")
    if kind == "dds" and used and used != CYCLONE_RMW:
        yield DoctorFinding(
            "warning",
            "rmw",
            f"nodes that are started in this terminal use {used}; of those, the transport `dds` gets topics at best, "
            "and no services or actions",
            f"export RMW_IMPLEMENTATION={CYCLONE_RMW} for the robot's nodes, or use --ros rclpy here",
        )


def installed_rmw(environment: Environment) -> list[str]:
    """The middlewares that the sourced workspaces have, by the index of ament."""
    names = {
        entry.name
        for prefix in sourced_prefixes(environment)
        for entry in (prefix / "share/ament_index/resource_index/rmw_typesupport").glob("rmw_*")
    }
    return sorted(names - {"rmw_implementation"})


def check_transport(choice: str) -> tuple[selection.TransportKind | None, list[DoctorFinding]]:
    """The transport that a session would use with `--ros CHOICE`, and why."""
    found: list[DoctorFinding] = []
    missing = selection.why_unavailable()
    try:
        kind: selection.TransportKind | None = selection.select_transport(choice)
    except AdapterError as error:
        kind = None
        found += [DoctorFinding("problem", "transport", line) for line in error.lines]
    else:
        why = "as asked for" if choice != "auto" else "rclpy is here" if kind == "rclpy" else "rclpy is not here"
        found.append(DoctorFinding("ok", "transport", f"ROS is spoken by {kind}: {why}"))
    wheels = {name: installed_version(name) for name in ("cyclonedds", "rosbags")}
    versions = [f"{name} {number}" for name, number in wheels.items() if number]
    if not missing["dds"]:
        found.append(DoctorFinding("ok", "transport", f"for the transport `dds`: {', '.join(versions)}"))
    elif kind is not None and kind != "dds":
        found.append(DoctorFinding("note", "transport", f"the transport `dds` cannot be used: {missing['dds']}"))
    if missing["dds"] and kind != "rclpy" and not wheels["cyclonedds"] and sys.version_info >= (3, 14):
        found.append(
            DoctorFinding(
                "note", "transport", "cyclonedds is not offered for this Python; it is for Python 3.11 to 3.13"
            )
        )
    return kind, found


def _installed_distributions(installed: Path) -> list[str]:
    return sorted(file.parent.name for file in installed.glob("*/setup.bash"))


def _setup_file(installed: Path) -> str:
    names = _installed_distributions(installed)
    name = DISTRIBUTION if DISTRIBUTION in names or not names else names[-1]
    return f"{installed}/{name}/setup.bash"
