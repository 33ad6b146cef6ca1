"""The port behind which a robot middleware stands (ROS 2): one connection per session, for two purposes.

It reaches the robot (`robot`), and it shows the session to other programs of that middleware, which may take part in it
(`join`). Both share the connection, so the engine opens it first and closes it last. The adapter is found by the
entry-point group `rise.bridges` and never imported by name (architecture, "Imports point one way").
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

from msgspec import Struct

from rise_engine.errors import RiseError

if TYPE_CHECKING:  # consoles import this before they start an engine, and have no time to lose
    from rise_engine.link.room import Room
    from rise_engine.robot import Clock, Robot
    from rise_engine.scenario.model import RobotProfile

Transport: TypeAlias = Literal["auto", "rclpy", "dds", "off"]
"""By what ROS 2 is spoken. auto: by rclpy where it is installed, else by the DDS wheel, and only when the robot needs
it. off: not at all. The other two: by that, and also in a session whose robot is simulated."""

TRANSPORTS: tuple[Transport, ...] = ("auto", "rclpy", "dds", "off")


class Wire(Struct, frozen=True):
    """How a session wants to be connected."""

    transport: Transport = "auto"
    arguments: tuple[str, ...] = ()
    """As after `--ros-args`: remappings, parameters, an enclave."""


class BridgeError(RiseError):
    """The connection cannot be had. `lines` say everything that is in the way, for a person, with what to do."""

    def __init__(self, lines: Sequence[str]) -> None:
        super().__init__("\n".join(lines))
        self.lines = list(lines)


class Bridge(Protocol):
    """An open connection. All methods belong to the engine's loop, and none blocks."""

    about: str
    """For a person: `ROS 2 by rclpy, rmw_cyclonedds_cpp, domain 0`."""

    def robot(self, clock: Clock) -> Robot:
        """The robot of the profile that the bridge was opened with."""
        ...

    def join(self, room: Room) -> None:
        """Show the session to other programs, and let them take part; before the session's first record."""
        ...

    async def close(self) -> None:
        """Let go of everything."""
        ...


class BridgeOpener(Protocol):
    """The callable that an entry point of the group `rise.bridges` names."""

    async def __call__(self, wire: Wire, profile: RobotProfile | None) -> Bridge:
        """Connect.

        :param wire: by what, and the middleware's own arguments.
        :param profile: the robot that is reached over this connection; None when there is none.
        :raises BridgeError: with all that is in the way, also with everything that is wrong in the profile.
        """
        ...


class ParameterReader(Protocol):
    """The callable that an entry point of the group `rise.parameters` names."""

    def __call__(
        self, arguments: tuple[str, ...], *, switches: list[str], single: list[str], many: list[str], written: list[str]
    ) -> tuple[list[str], tuple[str, ...]]:
        """The middleware's parameters as options of a command line, to stand before what is `written` there; and the
        middleware's other arguments. Options by kind: without value, with one, and that can be given several times.

        Raises BridgeError with a sentence for what is no parameter.
        """
        ...


class Examiner(Protocol):
    """The callable that an entry point of the group `rise.doctors` names."""

    def __call__(self, wire: Wire, profile: RobotProfile | None, *, seconds: float, as_json: bool) -> tuple[str, int]:
        """Look at what is installed and, for `seconds` at most, for the robot. Gives what to print (lines, or one JSON
        document) and an exit status: 1 when something is in the way."""
        ...
