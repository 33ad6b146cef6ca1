"""Finding the code behind a robot: drivers by the entry-point group `rise.drivers`, and drivers that share a session's
connection by the group `rise.bridges`. None is imported by name.

A profile (data, see docs/reference/robots.md) names its driver. In debug mode the driver is always `simulated`,
whatever the profile says: no robot moves.
"""

from __future__ import annotations

from importlib.metadata import EntryPoint
from typing import Any, cast

from rise_engine.base.errors import AdapterError, RiseError
from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.ports.bridge import Bridge, BridgeOpener, ProfileChecker, ProfileFinding, RosConnection
from rise_engine.ports.robot import Clock, Driver, Robot
from rise_engine.scenario.model import SIMULATED, Mode, RobotProfile

DRIVERS = "rise.drivers"
BRIDGES = "rise.bridges"
CHECKS = "rise.checks"
DOCTORS = "rise.doctors"
PARAMETERS = "rise.parameters"
ROS_BRIDGE = "ros2"
"""The bridge that `--ros` is about."""


class RobotOptionsError(RiseError):
    """The driver cannot understand the profile's options or a fault. The message is a sentence for a person."""


def driver_names() -> set[str]:
    """What a profile's `driver` can name here: the installed drivers, and those that a bridge is."""
    return installed_plugins(DRIVERS).names | installed_plugins(BRIDGES).names


def _load_plugin(entry: EntryPoint, what: str) -> Any:
    """The code behind an entry point. Raises AdapterError, in which `what` names it."""
    try:
        return entry.load()
    except Exception as error:  # code of others runs as it is imported
        raise AdapterError(f"{what} ({entry.value}) cannot be loaded: {error}") from error


def find_driver(name: str) -> Driver:
    """The driver of that name. Raises AdapterError when it is not installed or cannot be loaded."""
    entry = find_plugin(DRIVERS, name)
    if entry is None:
        installed = ", ".join(sorted(installed_plugins(DRIVERS).names)) or "none"
        raise AdapterError(
            f"the robot driver {name!r} is not installed (installed: {installed}); "
            f"a driver is a Python package with an entry point of that name in the group {DRIVERS!r}"
        )
    return cast(Driver, _load_plugin(entry, f"the robot driver {name!r}"))


def driver_name_for(profile: RobotProfile, mode: Mode) -> str:
    """The driver that a session of that mode uses."""
    return SIMULATED if mode == "debug" else profile.driver


def make_robot(
    profile: RobotProfile,
    mode: Mode,
    clock: Clock,
    seed: int,
    faults: tuple[str, ...] = (),
    bridge: Bridge[Any] | None = None,
) -> Robot:
    """The robot for one session, over `bridge` if its driver is one.

    Raises AdapterError, and RobotOptionsError when the profile's options or a fault cannot be understood.
    """
    name = driver_name_for(profile, mode)
    if name == ROS_BRIDGE and bridge is not None:
        if faults:
            raise RobotOptionsError(f"only a simulated robot has faults on request, and {profile.name} is real")
        return bridge.robot(clock)
    try:
        driver = find_driver(name)
    except AdapterError:
        if find_plugin(BRIDGES, name) is None:
            raise
        raise AdapterError(
            f"{profile.title} is reached over ROS 2, which this session does not use; "
            "run it in real time without `--ros off`, or rehearse with `--mode debug`"
        ) from None
    try:
        return driver(profile, clock, seed, faults)
    except ValueError as error:
        raise RobotOptionsError(str(error)) from error


async def open_bridge(connection: RosConnection, profile: RobotProfile, mode: Mode) -> Bridge[Any] | None:
    """Connect a session with ROS 2, when its robot needs that or it is asked for.

    :param connection: how ROS 2 is spoken.
    :param profile: the session's robot.
    :param mode: the session's.
    :return: the open connection, which whoever called closes; None: the session does without.
    :raises AdapterError: it cannot be had.
    """
    reaches_robot = driver_name_for(profile, mode) == ROS_BRIDGE
    if connection.transport == "off" or (connection.transport == "auto" and not reaches_robot):
        return None
    try:
        opener: BridgeOpener = load_ros_plugin(BRIDGES)
    except AdapterError as error:
        raise AdapterError(str(error)) from error
    return await opener(connection, profile if reaches_robot else None)


def profile_findings(profile: RobotProfile) -> list[ProfileFinding]:
    """What the driver that the profile names has to say about it, whatever the mode."""
    entry = find_plugin(CHECKS, profile.driver)
    if entry is None:
        return []
    try:
        check: ProfileChecker = _load_plugin(entry, f"the check of the robot driver {profile.driver!r}")
    except AdapterError as error:
        return [ProfileFinding(str(error), "driver", "missing")]
    return check(profile)


def load_ros_plugin(group: str) -> Any:
    """What the ROS 2 bridge offers in a group of entry points (BRIDGES: a `BridgeOpener`, DOCTORS: an `Examiner`,
    PARAMETERS: a `ParameterReader`). Raises AdapterError."""
    entry = find_plugin(group, ROS_BRIDGE)
    if entry is None:
        raise AdapterError(f"no ROS 2 bridge is installed: no entry point {ROS_BRIDGE!r} in the group {group!r}")
    return _load_plugin(entry, "the ROS 2 bridge")


def simulated_robot_warning(profile: RobotProfile, mode: Mode) -> str | None:
    """What a person must know before trusting the mode: `real` with a robot that is only simulated is not real."""
    if mode == "real" and profile.driver == SIMULATED:
        return (
            f"the mode is real, but the robot profile {profile.name!r} has only the simulated driver: "
            "nothing leaves this machine and no robot moves"
        )
    return None
