"""Finds a robot's code: drivers in the group `rise.drivers`, connections in the group `rise.bridges`.

Entry points name them; nothing is imported by name. A bridge shares a session's connection. A profile (see
docs/reference/robots.md) names its driver. In debug mode the driver is always `simulated`: no robot moves.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import EntryPoint
from typing import Any, cast

from msgspec.structs import replace

from rise_engine.base.errors import AdapterError, RiseError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.kernel.speech import SPEECH, why_not_speak
from rise_engine.ports.bridge import Bridge, BridgeOpener, ProfileChecker, ProfileFinding, RosConnection
from rise_engine.ports.robot import Clock, Driver, Robot
from rise_engine.scenario.model import SIMULATED, Mode, RobotProfile, Scenario

DRIVERS = "rise.drivers"
BRIDGES = "rise.bridges"
CHECKS = "rise.checks"
DOCTORS = "rise.doctors"
PARAMETERS = "rise.parameters"
ROS_BRIDGE = "ros2"
"""The bridge that `--ros` controls."""


class RobotOptionsError(RiseError):
    """The profile's options or a fault are invalid for the driver. The message is a sentence for a person."""


def driver_names() -> set[str]:
    """Return the values that a profile's `driver` can have here: the installed drivers and bridges."""
    return installed_plugins(DRIVERS).names | installed_plugins(BRIDGES).names


def _load_plugin(entry: EntryPoint, what: str) -> Any:
    """Load the code of an entry point. Raises AdapterError, in which `what` names it."""
    try:
        return entry.load()
    except Exception as error:  # importing it runs code of other authors
        raise AdapterError(f"{what} ({entry.value}) cannot be loaded: {error}") from error


def find_driver(name: str) -> Driver:
    """Load the driver of that name. Raises AdapterError if it is not installed or cannot be loaded."""
    entry = find_plugin(DRIVERS, name)
    if entry is None:
        raise AdapterError(_unknown_driver(name))
    return cast(Driver, _load_plugin(entry, f"the robot driver {name!r}"))


def _unknown_driver(name: str) -> str:
    return (
        f"the robot driver {name!r} is not installed: a driver is a Python package with an entry point of that name in "
        f"the group {DRIVERS!r}{did_you_mean(name, sorted(driver_names()))}"
    )


def driver_name_for(profile: RobotProfile, mode: Mode) -> str:
    """Return the driver that a session of that mode uses."""
    return SIMULATED if mode == "debug" else profile.driver


def make_robot(
    profile: RobotProfile,
    mode: Mode,
    clock: Clock,
    seed: int,
    faults: tuple[str, ...] = (),
    bridge: Bridge[Any] | None = None,
) -> Robot:
    """Make the robot for one session, over `bridge` if its driver is a bridge.

    Raises AdapterError, and RobotOptionsError if the profile's options or a fault are invalid.
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
    """Connect a session to ROS 2, if its robot needs that or the user wants it.

    :param connection: how ROS 2 is reached.
    :param profile: the session's robot.
    :param mode: the session's.
    :return: the open connection, which the caller closes; None: the session does not use ROS 2.
    :raises AdapterError: the connection is not possible.
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
    """Return the findings of a profile's own driver about it, whatever the mode."""
    entry = find_plugin(CHECKS, profile.driver)
    if entry is None:
        known = profile.driver in driver_names()
        return [] if known else [ProfileFinding(_unknown_driver(profile.driver), "driver", "missing")]
    try:
        check: ProfileChecker = _load_plugin(entry, f"the check of the robot driver {profile.driver!r}")
    except AdapterError as error:
        return [ProfileFinding(str(error), "driver", "missing")]
    return check(profile)


def load_ros_plugin(group: str) -> Any:
    """Load a plugin of the ROS 2 bridge from a group of entry points. Raises AdapterError.

    BRIDGES has a `BridgeOpener`, DOCTORS an `Examiner`, PARAMETERS a `ParameterReader`.
    """
    entry = find_plugin(group, ROS_BRIDGE)
    if entry is None:
        raise AdapterError(f"no ROS 2 bridge is installed: no entry point {ROS_BRIDGE!r} in the group {group!r}")
    return _load_plugin(entry, "the ROS 2 bridge")


def unstoppable_actions(findings: Iterable[ProfileFinding]) -> list[str]:
    """Return the actions that nothing can stop, among the findings about a profile."""
    return [each.where.split(".")[1] for each in findings if each.kind == "unstoppable"]


def robot_warnings(scenario: Scenario) -> list[str]:
    """Return warnings about the robot before a real session: it is only simulated, or F9 cannot stop an action."""
    profile = scenario.robot
    if scenario.mode != "real":
        return []
    if profile.driver == SIMULATED:
        return [
            f"the mode is real, but the robot profile {profile.name!r} has only the simulated driver: "
            "nothing leaves this machine and no robot moves"
        ]
    found = unstoppable_actions(profile_findings(narrow_profile(profile, needed_actions(scenario))))
    return [f"F9 cannot stop {', '.join(found)}: keep a hand on the robot's own switch"] if found else []


def needed_actions(scenario: Scenario) -> frozenset[str]:
    """Return the robot's actions that a scenario can use, including free speech of a wizard.

    Actions of the engine do not count. An action that the robot replaces counts as its replacement.
    """
    used = {call.type for act in scenario.acts.values() for action in act.actions for call in action.calls}
    if not why_not_speak(scenario):
        used.add(SPEECH)
    actions = scenario.robot.actions
    sent = {sent_as(scenario.robot, name) for name in used if name in actions and not actions[name].engine}
    return frozenset(name for name in sent if name in actions and actions[name].supported)


def narrow_profile(profile: RobotProfile, needed: frozenset[str]) -> RobotProfile:
    """Restrict a robot's profile to these actions, so that other missing actions do not matter."""
    actions = {
        name: spec if name in needed or spec.engine or spec.substitute is not None else replace(spec, supported=False)
        for name, spec in profile.actions.items()
    }
    return replace(profile, actions=actions)


def sent_as(profile: RobotProfile, action: str) -> str:
    """Return the action that the robot does for an action of a scenario."""
    spec = profile.actions.get(action)
    return spec.substitute if spec is not None and spec.substitute is not None else action
