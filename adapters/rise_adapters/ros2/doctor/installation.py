"""What is installed and sourced of ROS 2 on this machine, and which transport a session would use."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from rise_adapters.ros2.doctor.finding import (
    CYCLONE_RMW,
    DEFAULT_RMW,
    DISTRIBUTION,
    DoctorFinding,
    Environment,
    Level,
    installed_version,
    sourced_prefixes,
)
from rise_adapters.ros2.transport import selection
from rise_adapters.ros2.transport.interfaces import RISE_INTERFACES, InterfaceCatalog
from rise_adapters.ros2.transport.interfaces.definitions import read_built_hashes
from rise_adapters.ros2.transport.port import PortError
from rise_engine.base.errors import AdapterError

# --- the interface package --------------------------------------------------------------------------------------------

INTERFACES = "rise_interfaces"


def check_interfaces(environment: Environment, kind: selection.TransportKind | None = None) -> Iterator[DoctorFinding]:
    """Whether `rise_interfaces` is built and sourced, and matches this program's version."""
    built = [prefix / "share" / INTERFACES for prefix in sourced_prefixes(environment)]
    built = [folder for folder in built if folder.is_dir()]
    remedy = f"colcon build --packages-select {INTERFACES}, and source install/setup.bash"
    if not built:
        if kind == "rclpy":
            yield DoctorFinding(
                "problem", "interfaces", f"{INTERFACES} is not built, or its workspace is not sourced", remedy
            )
        elif sourced_prefixes(environment):
            yield DoctorFinding(
                "note", "interfaces", f"{INTERFACES} is not built here; `dds` needs no build, but `ros2` does", remedy
            )
        else:
            yield DoctorFinding("ok", "interfaces", f"{INTERFACES} comes with this program")
        return
    if len(built) > 1:
        yield DoctorFinding(
            "warning",
            "interfaces",
            f"{INTERFACES} is sourced {len(built)} times; the first counts: {', '.join(map(str, built))}",
        )
    if kind == "rclpy" and not _is_importable(INTERFACES):
        yield DoctorFinding("problem", "interfaces", f"{INTERFACES} is built, but this Python does not find it", remedy)
        return
    ours, theirs = own_hashes(environment), built_hashes(built[0])
    if not ours:
        yield DoctorFinding(
            "note", "interfaces", f"{INTERFACES} is built; without rosbags, its version cannot be checked"
        )
        return
    missing = sorted(set(ours) - set(theirs))
    other = sorted(name for name in ours if name in theirs and ours[name] != theirs[name])
    for names, what in ((missing, "lacks"), (other, "has another version of")):
        if names:
            listed = ", ".join(name.removeprefix(f"{INTERFACES}/") for name in names)
            yield DoctorFinding(
                "problem",
                "interfaces",
                f"the {INTERFACES} in {built[0]} {what} {listed}",
                f"build the {INTERFACES} of this release: {remedy}",
            )
    if not missing and not other:
        yield DoctorFinding(
            "ok", "interfaces", f"{INTERFACES} is built and is the one of this program ({len(ours)} types)"
        )


def own_hashes(environment: Environment = os.environ) -> dict[str, str]:
    """The hashes of this program's types, by name; empty when they cannot be computed here."""
    types = InterfaceCatalog([RISE_INTERFACES], environment)  # the standard ones are in ROS
    names = [
        f"{INTERFACES}/{kind}/{file.stem}"
        for kind in ("msg", "srv", "action")
        for file in sorted((RISE_INTERFACES / kind).glob(f"*.{kind}"))
    ]
    try:
        return {name: types.type_hash(name) for name in names}
    except PortError:  # neither ROS nor rosbags is here
        return {}


def built_hashes(folder: Path) -> dict[str, str]:
    """The hashes from the build of an interface package, `PREFIX/share/PACKAGE`."""
    found: dict[str, str] = {}
    for file in (*folder.glob("msg/*.json"), *folder.glob("srv/*.json"), *folder.glob("action/*.json")):
        found |= read_built_hashes(file)
    return found


def _is_importable(package: str) -> bool:
    spec = find_spec(package)
    return spec is not None and spec.origin is not None  # a folder of that name alone is not a package


_INSTALLED = Path("/opt/ros")


def check_installation(
    environment: Environment, *, wanted: bool = False, installed: Path = _INSTALLED
) -> Iterator[DoctorFinding]:
    """Whether ROS 2 is installed and sourced, and whether this Python can use it. `wanted`: the transport is rclpy."""
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
                f"AMENT_PREFIX_PATH names {prefix}, which does not exist",
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
    """Which middleware the nodes of this terminal use, and whether the transport can reach it."""
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
    """The middlewares of the sourced workspaces, from the index of ament."""
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
