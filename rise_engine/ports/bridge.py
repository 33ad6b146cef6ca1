"""The port behind which a robot middleware stands (ROS 2): one connection per session, for two purposes.

It reaches the robot (`robot`), and it shows the session to other programs of that middleware, which may take part in it
(`join`). Both share the connection, so the engine opens it first and closes it last. The adapter is found by the
entry-point group `rise.bridges` and never imported by name (architecture, "Imports point one way").
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, Protocol, TypeAlias, TypeVar, get_args

from msgspec import Struct

from rise_engine.ports.robot import Clock, Robot
from rise_engine.scenario.model import RobotProfile

RosTransport: TypeAlias = Literal["auto", "rclpy", "dds", "off"]
"""By what ROS 2 is spoken. auto: by rclpy where it is installed, else by the DDS wheel, and only when the robot needs
it. off: not at all. The other two: by that, and also in a session whose robot is simulated."""

ROS_TRANSPORTS: tuple[RosTransport, ...] = get_args(RosTransport)


class RosConnection(Struct, frozen=True):
    """How a session wants to be connected: `--ros` and `--ros-args` of the command line."""

    transport: RosTransport = "auto"
    arguments: tuple[str, ...] = ()
    """As after `--ros-args`: remappings, parameters, an enclave."""


SessionT = TypeVar("SessionT", contravariant=True)
"""The session that a bridge joins: a `rise_engine.run.server.hub.SessionHub`, which knows the ports, not they it."""


class Bridge(Protocol[SessionT]):
    """An open connection. All methods belong to the thread of the engine's loop, and none blocks. The engine calls
    `robot` (when it was opened with a profile), then `join` before the session's first record, then `close`.

    A connection that is lost on the way is the bridge's to make anew: its robot reports `lost` and later `connected`.
    """

    about: str
    """For a person: `ROS 2 by rclpy, rmw_cyclonedds_cpp, domain 0`."""

    def robot(self, clock: Clock) -> Robot:
        """The robot of the profile that the bridge was opened with. Called once at most.

        :param clock: the session's, by which the robot measures and waits.
        :return: the robot, not connected yet (`Robot.connect`).
        """
        ...

    def join(self, hub: SessionT) -> None:
        """Show the session to other programs, and let them take part. Called once, before the session's first record,
        so that they miss none.

        :param hub: the session: who takes part, its view and its records (`rise_engine.run.server.hub.SessionHub`).
        """
        ...

    async def close(self) -> None:
        """Let go of everything, and tell other programs that the session has gone. It takes some seconds at most."""
        ...


ProfileFindingKind: TypeAlias = Literal["wrong", "missing", "unstoppable", "unread"]


class ProfileFinding(Struct, frozen=True):
    """One thing that a driver has to say about a robot's profile, before anything is connected."""

    sentence: str
    where: str = ""
    """The key that it is about, `actions.Speech.carrier.goal.text`; empty: the profile as a whole."""
    kind: ProfileFindingKind = "wrong"
    """wrong: it can never work. missing: it cannot work on this computer, or not yet; a rehearsal can. unstoppable: it
    works, and nothing stops the robot while it does. unread: nothing takes it, which may be a slip."""

    @property
    def refuses(self) -> bool:
        """Whether no session with this robot can begin."""
        return self.kind in ("wrong", "missing")


ProfileChecker: TypeAlias = Callable[[RobotProfile], list[ProfileFinding]]
"""The callable that an entry point of the group `rise.checks` names; that name is a profile's `driver`."""


class BridgeOpener(Protocol):
    """The callable that an entry point of the group `rise.bridges` names; that name is a profile's `driver`.

    [project.entry-points."rise.bridges"]
    ros2 = "rise_adapters.ros2.bridge:open_bridge"
    """

    async def __call__(self, connection: RosConnection, profile: RobotProfile | None) -> Bridge[Any]:
        """Connect. It is called in the engine's loop, before the session begins.

        :param connection: how to connect.
        :param profile: the robot that is reached over this connection; None when there is none, and only other programs
            take part.
        :return: the open connection; whoever called closes it.
        :raises AdapterError: when it cannot be had; also with everything that is wrong in the profile.
        """
        ...


class ParameterReader(Protocol):
    """The callable that an entry point of the group `rise.parameters` names."""

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

        :param arguments: what stands after `--ros-args`, `-p mode:=real` among it.
        :param switches: the flags of options without a value, with the one that says the opposite or nothing
            (`--record`: `--no-record`), ...
        :param single: ... with one value (`--mode`), ...
        :param many: ... and of those that can be given several times (`--fault`).
        :param written: what the command line says itself, which counts more.
        :return: the options, to stand before what is `written`; and the middleware's other arguments.
        :raises AdapterError: with a sentence for what is no parameter.
        """
        ...


class Examiner(Protocol):
    """The callable that an entry point of the group `rise.doctors` names."""

    def __call__(
        self, connection: RosConnection, profile: RobotProfile | None, *, seconds: float, as_json: bool
    ) -> tuple[str, int]:
        """Look at what is installed on this machine, and for the robot. Nothing is changed, and no robot moves. It is
        called outside of any loop, and takes a little longer than `seconds`.

        :param connection: how a session would connect.
        :param profile: the robot to look for; None: none.
        :param seconds: for how long the robot is looked for at most.
        :param as_json: one JSON document (docs/reference/rise-engine.md, "doctor") instead of lines for a person.
        :return: what to print, and an exit status: 0; 1 when something is in the way.
        """
        ...
