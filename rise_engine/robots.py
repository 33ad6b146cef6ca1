"""Finding the code behind a robot: drivers by the entry-point group `rise.drivers`, never imported by name.

A profile (data, see docs/reference/robots.md) names its driver. In debug mode the driver is always `simulated`,
whatever the profile says: nothing leaves the machine.
"""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import cast

from rise_engine.robot import Clock, Driver, Robot
from rise_engine.scenario.model import Mode, RobotProfile

GROUP = "rise.drivers"
SIMULATED = "simulated"


class DriverError(LookupError):
    """No usable driver of that name is installed. The message is a sentence for a person."""


class RobotOptionsError(ValueError):
    """The driver cannot understand the profile's options or a fault. The message is a sentence for a person."""


def drivers() -> dict[str, EntryPoint]:
    """The installed drivers by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def find_driver(name: str) -> Driver:
    """The driver of that name. Raises DriverError when it is not installed or cannot be loaded."""
    found = drivers()
    entry = found.get(name)
    if entry is None:
        installed = ", ".join(sorted(found)) or "none"
        raise DriverError(
            f"the robot driver {name!r} is not installed (installed: {installed}); "
            f"a driver is a Python package with an entry point of that name in the group {GROUP!r}"
        )
    try:
        return cast(Driver, entry.load())
    except Exception as error:
        raise DriverError(f"the robot driver {name!r} ({entry.value}) cannot be loaded: {error}") from error


def driver_name(profile: RobotProfile, mode: Mode) -> str:
    """The driver that a session of that mode uses."""
    return SIMULATED if mode == "debug" else profile.driver


def make_robot(profile: RobotProfile, mode: Mode, clock: Clock, seed: int, faults: tuple[str, ...] = ()) -> Robot:
    """The robot for one session.

    Raises DriverError, and RobotOptionsError when the profile's options or a fault cannot be understood.
    """
    driver = find_driver(driver_name(profile, mode))
    try:
        return driver(profile, clock, seed, faults)
    except ValueError as error:
        raise RobotOptionsError(str(error)) from error


def warning_for(profile: RobotProfile, mode: Mode) -> str | None:
    """What a person must know before trusting the mode: `real` with a robot that is only simulated is not real."""
    if mode == "real" and profile.driver == SIMULATED:
        return (
            f"the mode is real, but the robot profile {profile.name!r} has only the simulated driver: "
            "nothing leaves this machine and no robot moves"
        )
    return None
