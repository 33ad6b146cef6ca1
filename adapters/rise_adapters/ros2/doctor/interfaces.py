"""Whether the interface package `rise_interfaces` is built and sourced, and is the one that this program speaks."""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from rise_adapters.ros2.doctor.environment import Environment, sourced_prefixes
from rise_adapters.ros2.doctor.finding import DoctorFinding
from rise_adapters.ros2.transport import selection
from rise_adapters.ros2.transport.interfaces import RISE_INTERFACES, InterfaceCatalog
from rise_adapters.ros2.transport.interfaces.hashes import read_built_hashes
from rise_adapters.ros2.transport.port import PortError

INTERFACES = "rise_interfaces"


def check_interfaces(environment: Environment, kind: selection.TransportKind | None = None) -> Iterator[DoctorFinding]:
    """Whether `rise_interfaces` is built and sourced, and is the one that this program speaks."""
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
            "note", "interfaces", f"{INTERFACES} is built; whether it is the right one cannot be told without rosbags"
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
    """Of the types that this program speaks, by name; empty when that cannot be told here."""
    types = InterfaceCatalog([RISE_INTERFACES], environment)  # the standard ones are in ROS
    names = [
        f"{INTERFACES}/{kind}/{file.stem}"
        for kind in ("msg", "srv", "action")
        for file in sorted((RISE_INTERFACES / kind).glob(f"*.{kind}"))
    ]
    try:
        return {name: types.type_hash(name) for name in names}
    except PortError:  # neither ROS nor rosbags has those
        return {}


def built_hashes(folder: Path) -> dict[str, str]:
    """Those that were computed when an interface package was built, `PREFIX/share/PACKAGE`."""
    found: dict[str, str] = {}
    for file in (*folder.glob("msg/*.json"), *folder.glob("srv/*.json"), *folder.glob("action/*.json")):
        found |= read_built_hashes(file)
    return found


def _is_importable(package: str) -> bool:
    spec = find_spec(package)
    return spec is not None and spec.origin is not None  # a mere folder of that name is no package
