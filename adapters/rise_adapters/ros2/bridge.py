"""The session's one connection to ROS 2: its robot, and its interface for other nodes.

It implements `rise_engine.ports.bridge.Bridge`.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from rise_adapters.ros2.mapping import ActionMapping, mapping_problems, read_mappings, read_options
from rise_adapters.ros2.parameters import ParameterOption, ParameterServices, ReadableParameter, parameters_as_options
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.session_node import RosSessionInterface
from rise_adapters.ros2.session_node.neighbours import (
    NeighbourSessions,
    describe_other_session,
    describe_refusal,
)
from rise_adapters.ros2.transport.port import PortError, Transport
from rise_adapters.ros2.transport.selection import open_transport
from rise_engine.base.errors import AdapterError
from rise_engine.kernel.inputs import Note
from rise_engine.ports.bridge import RosConnection
from rise_engine.ports.robot import Clock, Robot
from rise_engine.run.server.hub import SessionHub
from rise_engine.scenario.model import RobotProfile
from rise_engine.session.folder import without_home

_LOG = logging.getLogger(__name__)

WATCH_SECONDS = 0.5
"""Seconds between checks of the connection."""
DEFAULT_NODE_NAME = "rise"
"""The name of the engine's node, unless `__node` sets another."""
INTERFACE_TYPES = (
    "rise_interfaces/action/DomainTask_Goal",
    "rise_interfaces/srv/GetMemory_Request",
    "rise_interfaces/msg/Record",
)
"""Without these types, other nodes see nothing of the session."""


class Ros2Bridge:
    """Implements `rise_engine.ports.bridge.Bridge`."""

    def __init__(
        self,
        transport: Transport,
        profile: RobotProfile | None,
        mappings: Mapping[str, ActionMapping],
        neighbours: NeighbourSessions,
        reconnect: Callable[[], Awaitable[Transport]],
        *,
        rosout: bool = True,
    ) -> None:
        """`reconnect` opens a transport like the lost one, or raises AdapterError. `rosout`: also report on /rosout."""
        self.about = f"ROS 2 by {transport.about}"
        self._transport = transport
        self._profile = profile
        self._mappings = mappings
        self._neighbours = neighbours
        self._reconnect = reconnect
        self._rosout = rosout
        self._robot: Ros2Robot | None = None
        self._hub: SessionHub | None = None
        self._interface: RosSessionInterface | None = None
        self._watcher = asyncio.get_running_loop().create_task(self._watch_connection())

    def robot(self, clock: Clock) -> Robot:
        """The robot of the bridge's profile, on the session's `clock`."""
        assert self._profile is not None, "the bridge was opened without a robot"
        self._robot = Ros2Robot(self._profile, clock, self._transport, self._mappings)
        return self._robot

    def join(self, hub: SessionHub) -> None:
        """Show the session of `hub` to other nodes, and accept their tasks. Raises PortError."""
        self._hub = hub
        self._open_interface(self._neighbours)

    def _open_interface(self, neighbours: NeighbourSessions) -> None:
        assert self._hub is not None
        self._neighbours = neighbours
        self._interface = RosSessionInterface(self._transport, self._hub, neighbours, rosout=self._rosout)
        ParameterServices(self._transport, partial(session_parameters, self._hub))
        neighbours.on_other_session = lambda other: self._record_note(
            describe_other_session(other, neighbours.shared_with(other))
        )
        neighbours.announce_serving(self._hub.engine.scenario.title, Path(self._hub.folder).name)

    async def close(self) -> None:
        """End the goals of other nodes, publish the rest, and leave ROS."""
        self._watcher.cancel()
        self._neighbours.close()
        if self._interface is not None:
            await self._interface.close()
        self._transport.close()

    async def _watch_connection(self) -> None:
        """Restart a middleware that was shut down during the session. The robot notices this itself."""
        reported = ""
        while True:
            await asyncio.sleep(WATCH_SECONDS)
            why = self._transport.failure()
            if not why:
                continue
            if not reported:
                self._record_note(f"the connection to ROS is lost: {why}")
                reported = why
            try:
                fresh = await self._reconnect()
            except AdapterError as error:
                if str(error) != reported:
                    reported = str(error)
                    self._record_note(f"ROS cannot be reached again yet: {reported}")
                continue
            reported = ""
            interface, self._interface = self._interface, None
            if interface is not None:
                await interface.close()
            before, self._transport = self._transport, fresh
            try:
                if self._robot is not None:
                    self._robot.switch_transport(fresh)
                if self._hub is not None and not self._hub.engine.ended:
                    self._open_interface(NeighbourSessions(fresh, self._neighbours.announcement))
                self._record_note("ROS is reached again")
            except PortError as error:  # it may be gone again
                self._record_note(f"the new connection to ROS does not work: {error}")
            before.close()

    def _record_note(self, text: str) -> None:
        _LOG.warning("%s", text)
        if self._hub is not None and not self._hub.engine.ended:
            self._hub.engine.post(Note(text=text))


async def open_bridge(wire: RosConnection, profile: RobotProfile | None) -> Ros2Bridge:
    """Connect (`rise_engine.ports.bridge.BridgeOpener`)."""
    _, arguments = parameters_as_options(wire.arguments, DEFAULT_NODE_NAME, {})  # the command line has read its own
    share: list[Path] = []
    if profile is not None:
        try:
            share = [Path(each) for each in read_options(profile).share]
        except PortError:
            raise AdapterError(*mapping_problems(profile)) from None  # with all other errors in it

    connect = partial(open_transport, wire.transport, arguments, node=DEFAULT_NODE_NAME, share=share)
    transport = await connect()
    with ExitStack() as unless_opened:
        unless_opened.callback(transport.close)
        for type in INTERFACE_TYPES:
            transport.fields(type)
        mappings = read_mappings(profile, transport.fields) if profile is not None else {}
        neighbours = NeighbourSessions(transport, carriers=[mapping.name for mapping in mappings.values()])
        other = await neighbours.find_earlier()
        if other is not None:
            lines = describe_refusal(other, neighbours.shared_with(other), transport)
            neighbours.close()
            raise AdapterError(*lines)
        unless_opened.pop_all()
    rosout = "--disable-rosout-logs" not in arguments
    return Ros2Bridge(transport, profile, mappings, neighbours, connect, rosout=rosout)


def session_parameters(hub: SessionHub) -> dict[str, ReadableParameter]:
    """Return a session's settings as parameters of its node. A real session reveals no login."""
    about = hub.summary()
    path = without_home if about.mode == "real" else str
    return {
        "title": ReadableParameter(about.title, "of the scenario"),
        "scenario": ReadableParameter(path(about.scenario_folder), "its folder"),
        "session": ReadableParameter(path(about.folder), "the session's folder"),
        "mode": ReadableParameter(about.mode, "debug: the robot is simulated; real"),
        "robot": ReadableParameter(about.robot, "the robot's profile"),
        "seed": ReadableParameter(about.seed, "for everything picked at random"),
        "participant": ReadableParameter(about.participant, "who takes part"),
        "condition": ReadableParameter(about.condition, "of the study"),
    }


def read_parameters(
    arguments: tuple[str, ...], *, switches: dict[str, str], single: list[str], many: list[str], written: list[str]
) -> tuple[list[str], tuple[str, ...]]:
    """Return parameters of the session's node as options of `rise-engine serve` (a `ParameterReader`)."""
    options = {
        flag.removeprefix("--").replace("-", "_"): ParameterOption(
            flag, switch=flag in switches, opposite=switches.get(flag, ""), repeatable=flag in many
        )
        for flag in (*switches, *single, *many)
    }
    return parameters_as_options(arguments, DEFAULT_NODE_NAME, options, written)
