"""This computer: the installed and sourced parts of ROS 2, the transport of a session, its domain and discovery."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

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
    """Check whether `rise_interfaces` is built and sourced, and matches this program's version."""
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
    """The hashes of this program's types, by name; empty if they cannot be computed here."""
    types = InterfaceCatalog([RISE_INTERFACES], environment)  # ROS has the standard ones
    names = [
        f"{INTERFACES}/{kind}/{file.stem}"
        for kind in ("msg", "srv", "action")
        for file in sorted((RISE_INTERFACES / kind).glob(f"*.{kind}"))
    ]
    try:
        return {name: types.type_hash(name) for name in names}
    except PortError:  # without ROS and rosbags
        return {}


def built_hashes(folder: Path) -> dict[str, str]:
    """The hashes from the build of an interface package, `PREFIX/share/PACKAGE`."""
    found: dict[str, str] = {}
    for file in (*folder.glob("msg/*.json"), *folder.glob("srv/*.json"), *folder.glob("action/*.json")):
        found |= read_built_hashes(file)
    return found


def _is_importable(package: str) -> bool:
    spec = find_spec(package)
    return spec is not None and spec.origin is not None  # a folder of that name alone is no package


_INSTALLED = Path("/opt/ros")


def check_installation(
    environment: Environment, *, wanted: bool = False, installed: Path = _INSTALLED
) -> Iterator[DoctorFinding]:
    """Check whether ROS 2 is installed and sourced, and usable by this Python. `wanted`: the transport is rclpy."""
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
    """Check which middleware the nodes of this terminal use, and whether the transport can reach it."""
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
    """The transport of a session with `--ros CHOICE`, and why."""
    found: list[DoctorFinding] = []
    missing = selection.why_unavailable()
    try:
        kind: selection.TransportKind | None = selection.select_transport(choice)
    except AdapterError as error:
        kind = None
        found += [DoctorFinding("problem", "transport", line) for line in error.lines]
    else:
        why = "as asked for" if choice != "auto" else "rclpy is here" if kind == "rclpy" else "rclpy is not here"
        found.append(DoctorFinding("ok", "transport", f"ROS 2 is reached through {kind}: {why}"))
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


# --- domain and discovery ---------------------------------------------------------------------------------------------


_SAFE_DOMAINS = 101
"""Above this, the ports of DDS overlap with those that Linux assigns to programs."""


def check_network(environment: Environment, kind: selection.TransportKind | None = None) -> Iterator[DoctorFinding]:
    """Check settings that silently prevent programs from finding each other."""
    yield from _check_domain(environment.get("ROS_DOMAIN_ID", "").strip())
    local = environment.get("ROS_LOCALHOST_ONLY", "")
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if local == "1":
        yield DoctorFinding(
            "warning",
            "network",
            "ROS_LOCALHOST_ONLY is set: nothing outside of this machine is found, whatever the discovery range says",
            "unset it; in Jazzy, ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST does the same",
        )
    elif reach == "LOCALHOST":
        yield DoctorFinding(
            "note", "network", "the discovery range is LOCALHOST: only programs on this machine are found"
        )
    elif reach == "OFF":
        yield DoctorFinding(
            "problem", "network", "the discovery range is OFF: no node is found, not even on this machine",
            "unset ROS_AUTOMATIC_DISCOVERY_RANGE",
        )  # fmt: skip
    elif reach not in ("", "SUBNET", "SYSTEM_DEFAULT"):
        yield DoctorFinding(
            "problem",
            "network",
            f"ROS_AUTOMATIC_DISCOVERY_RANGE is {reach!r}; it can be SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT",
        )
    if uri := environment.get("CYCLONEDDS_URI", "").strip():
        named = environment.get("RMW_IMPLEMENTATION", "")
        if kind == "rclpy" and named != CYCLONE_RMW:
            yield DoctorFinding(
                "note", "network", f"CYCLONEDDS_URI is set, and means nothing to {named or DEFAULT_RMW}"
            )
        else:
            yield from _check_cyclone(
                uri, bool(environment.get("ROS_STATIC_PEERS")) or reach == "LOCALHOST" or local == "1"
            )
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"):
        if (file := environment.get(name, "")) and not Path(file).is_file():
            yield DoctorFinding("warning", "network", f"{name} names {file}, which does not exist")
    if kind == "dds":
        if environment.get("ROS_DISCOVERY_SERVER"):
            yield DoctorFinding(
                "warning", "network", "ROS_DISCOVERY_SERVER is set: `dds` does not find programs that only it knows"
            )
        if environment.get("ROS_SECURITY_ENABLE", "").lower() == "true":
            yield DoctorFinding(
                "problem",
                "network",
                "ROS_SECURITY_ENABLE is set, and the transport `dds` has no security: it and secured nodes do not talk",
                "use --ros rclpy",
            )


def _check_domain(number: str) -> Iterator[DoctorFinding]:
    if not number:
        yield DoctorFinding("ok", "network", "ROS domain 0 (ROS_DOMAIN_ID is not set)")
    elif not (number.isascii() and number.isdigit()) or int(number) > 232:
        yield DoctorFinding("problem", "network", f"ROS_DOMAIN_ID must be a number from 0 to 232, not {number!r}")
    elif int(number) > _SAFE_DOMAINS:
        yield DoctorFinding(
            "note",
            "network",
            f"ROS domain {int(number)}: above {_SAFE_DOMAINS} its ports may be taken by other programs",
            "choose a number from 0 to 101, the same for all programs",
        )
    else:
        yield DoctorFinding("ok", "network", f"ROS domain {int(number)}")


def _check_cyclone(uri: str, peers: bool) -> Iterator[DoctorFinding]:
    """The effect of a CYCLONEDDS_URI on discovery. `peers`: whether addresses to search are set elsewhere."""
    pieces: list[ElementTree.Element] = []
    for part in _split_uri(uri):
        words = part
        if not part.startswith("<"):
            path = Path(part.removeprefix("file://"))
            try:
                words = path.read_text("utf-8")
            except (OSError, UnicodeDecodeError):
                yield DoctorFinding("problem", "network", f"CYCLONEDDS_URI names the file {path}, which cannot be read")
                continue
        try:
            pieces.append(ElementTree.fromstring(f"<all>{_drop_declaration(words)}</all>"))
        except ElementTree.ParseError as error:
            yield DoctorFinding("problem", "network", f"CYCLONEDDS_URI holds XML that is not well-formed: {error}")
    elements = [each for piece in pieces for each in piece.iter()]
    settings = {_local_name(each): (each.text or "").strip() for each in elements}
    interfaces = [each for each in elements if _local_name(each) == "NetworkInterface"]
    names = [each.get("name") or each.get("address") or "" for each in interfaces]
    silent = settings.get("AllowMulticast", "").lower() in ("false", "spdp", "none") or any(
        each.get("multicast", "").lower() == "false" for each in interfaces
    )
    loopback = bool(names) and all(name in ("lo", "localhost") or name.startswith("127.") for name in names)
    if loopback:
        yield DoctorFinding(
            "note", "network", "CYCLONEDDS_URI names the loopback only: just programs on this machine are found"
        )
    elif names:
        yield DoctorFinding("note", "network", f"CYCLONEDDS_URI names the network interface {', '.join(names)}")
    if silent and not peers and not any(_local_name(each) == "Peer" for each in elements):
        yield DoctorFinding(
            "problem",
            "network",
            "CYCLONEDDS_URI switches multicast off and names no peers: no node is found",
            'add <Discovery><Peers><Peer address="localhost"/></Peers></Discovery>, with the robot\'s address too',
        )
    elif silent:
        yield DoctorFinding(
            "note",
            "network",
            "CYCLONEDDS_URI switches multicast off: a program with another setting is not found, and nothing says so",
            "give all programs the same setting",
        )


def _split_uri(uri: str) -> list[str]:
    """Split CYCLONEDDS_URI, a list of files and XML with commas; the XML may contain commas itself."""
    parts: list[str] = []
    for piece in uri.split(","):
        if parts and parts[-1].startswith("<") and not piece.lstrip().startswith(("<", "file://", "/")):
            parts[-1] += f",{piece}"
        elif piece.strip():
            parts.append(piece.strip())
    return parts


def _drop_declaration(words: str) -> str:
    words = words.lstrip("\ufeff \n\t\r")
    return words.partition("?>")[2] if words.startswith("<?xml") else words


def _local_name(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2]
