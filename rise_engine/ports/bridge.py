"""The port for a robot middleware (ROS 2): one connection per session, with two purposes.

It controls the robot (`robot`), and shows the session to other programs of that middleware, which may take part
(`join`). Both use the connection, so the engine opens it first and closes it last. The engine finds the adapter by the
entry-point group `rise.bridges` and never imports it by name (architecture, "Imports point one way").
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol, TypeAlias, TypeVar, get_args

from msgspec import Struct

from rise_engine.ports.robot import Clock, Robot
from rise_engine.scenario.model import RobotProfile

RosTransport: TypeAlias = Literal["auto", "rclpy", "dds", "off"]
"""The implementation of ROS 2. auto: rclpy if it is installed, else the DDS wheel, and only if the robot needs it. off:
none. rclpy, dds: that implementation, even for a simulated robot."""

ROS_TRANSPORTS: tuple[RosTransport, ...] = get_args(RosTransport)


class RosConnection(Struct, frozen=True):
    """The connection of a session: `--ros` and `--ros-args` of the command line."""

    transport: RosTransport = "auto"
    arguments: tuple[str, ...] = ()
    """The arguments after `--ros-args`: remappings, parameters, an enclave."""


SessionT = TypeVar("SessionT", contravariant=True)
"""The session that a bridge joins: a `rise_engine.run.server.hub.SessionHub`, which ports must not import."""


class Bridge(Protocol[SessionT]):
    """An open connection. All methods belong to the thread of the engine's loop, and none blocks. The engine calls
    `robot` (if it was opened with a profile), then `join` before the session's first record, then `close`.

    The bridge itself restores a lost connection: its robot reports `lost` and later `connected`.
    """

    about: str
    """A description, such as `ROS 2 by rclpy, rmw_cyclonedds_cpp, domain 0`."""

    def robot(self, clock: Clock) -> Robot:
        """Return the robot of the profile that the bridge was opened with. Called at most once.

        :param clock: the session's clock, which the robot must use to measure and wait.
        :return: the robot, not connected yet (`Robot.connect`).
        """
        ...

    def join(self, hub: SessionT) -> None:
        """Show the session to other programs, and let them take part. Called once, before the first record.

        :param hub: the session: its participants, its view and its records (`rise_engine.run.server.hub.SessionHub`).
        """
        ...

    async def close(self) -> None:
        """Release everything, and tell other programs that the session has ended. Takes some seconds at most."""
        ...


ProfileFindingKind: TypeAlias = Literal["wrong", "missing", "unstoppable", "doubtful"]


class ProfileFinding(Struct, frozen=True):
    """A driver's finding about a robot's profile, before anything is connected."""

    sentence: str
    where: str = ""
    """The key that it is about, such as `actions.Speech.carrier.goal.text`; empty: the whole profile."""
    kind: ProfileFindingKind = "wrong"
    """wrong: it can never work. missing: it cannot work on this computer yet, but a rehearsal can. unstoppable: nothing
    can stop the robot meanwhile. doubtful: it works, but is perhaps not intended."""

    @property
    def refuses(self) -> bool:
        """Whether it prevents every session with this robot."""
        return self.kind in ("wrong", "missing")


ProfileChecker: TypeAlias = Callable[[RobotProfile], list[ProfileFinding]]
"""The callable of an entry point in the group `rise.checks`, whose name is a profile's `driver`."""


class BridgeOpener(Protocol):
    """The callable of an entry point in the group `rise.bridges`, whose name is a profile's `driver`.

    [project.entry-points."rise.bridges"]
    ros2 = "rise_adapters.ros2.bridge:open_bridge"
    """

    async def __call__(self, connection: RosConnection, profile: RobotProfile | None) -> Bridge[Any]:
        """Connect. Called in the engine's loop, before the session begins.

        :param connection: how to connect.
        :param profile: the robot to control over this connection; None: none, only other programs take part.
        :return: the open connection, which the caller closes.
        :raises AdapterError: the connection is impossible; includes everything that is wrong in the profile.
        """
        ...


class ParameterReader(Protocol):
    """The callable of an entry point in the group `rise.parameters`."""

    def __call__(
        self,
        arguments: tuple[str, ...],
        *,
        switches: dict[str, str],
        single: list[str],
        many: list[str],
        written: list[str],
    ) -> tuple[list[str], tuple[str, ...]]:
        """Read the middleware's parameters as options of a command line.

        :param arguments: the arguments after `--ros-args`, including `-p mode:=real`.
        :param switches: the flags of options without a value, with the flag for the opposite, or nothing
            (`--record`: `--no-record`).
        :param single: the flags of options with one value (`--mode`).
        :param many: the flags of options that can be given several times (`--fault`).
        :param written: the options on the command line itself, which take precedence.
        :return: the options to insert before `written`, and the middleware's other arguments.
        :raises AdapterError: an argument is not a parameter; with a sentence.
        """
        ...


class Examiner(Protocol):
    """The callable of an entry point in the group `rise.doctors`."""

    def __call__(
        self, connection: RosConnection, profile: RobotProfile | None, *, seconds: float, as_json: bool
    ) -> tuple[str, int]:
        """Check what is installed on this machine, and search for the robot. Changes nothing and moves no robot.

        Called outside any loop; takes a little longer than `seconds`.

        :param connection: how a session would connect.
        :param profile: the robot to search for; None: none.
        :param seconds: the longest time to search for the robot.
        :param as_json: one JSON document (docs/reference/rise-engine.md, "doctor") instead of lines for people.
        :return: the text to print, and an exit status: 0, or 1 if there is a problem.
        """
        ...
