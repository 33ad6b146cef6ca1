"""The session's one connection to ROS 2: its robot, and what it shows to other nodes (`rise_engine.bridge.Bridge`)."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

from rise_adapters.ros2.carriers.fields import Fields
from rise_adapters.ros2.choose import available, open_transport
from rise_adapters.ros2.mapping import Carrier, CarrierErrors, profile_findings, read_carriers, read_options
from rise_adapters.ros2.neighbours import Neighbours, Session, meeting, refusal
from rise_adapters.ros2.parameters import Option, ParameterServices, Setting, as_options
from rise_adapters.ros2.port import PortError, Transport
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.session_node import RosSessionInterface
from rise_adapters.ros2.transport.rclpy.types import InstalledTypes
from rise_engine.bridge import BridgeError, Wire
from rise_engine.kernel.inputs import Note
from rise_engine.link.room import Room
from rise_engine.robot import Clock, Robot
from rise_engine.scenario.model import RobotProfile

_LOG = logging.getLogger(__name__)

WATCH_SECONDS = 0.5
"""How often it is looked whether the connection still stands."""
NODE = "rise"
"""What the engine's node is called, unless `__node` says otherwise."""
INTERFACE_TYPES = (
    "rise_interfaces/action/DomainTask_Goal",
    "rise_interfaces/srv/GetMemory_Request",
    "rise_interfaces/msg/Record",
)
"""Without these there is nothing that other nodes could see."""


class Ros2Bridge:
    """Implements `rise_engine.bridge.Bridge`."""

    def __init__(
        self,
        transport: Transport,
        profile: RobotProfile | None,
        mappings: Mapping[str, Carrier],
        neighbours: Neighbours,
        reconnect: Callable[[], Awaitable[Transport]],
        *,
        rosout: bool = True,
    ) -> None:
        """`reconnect` opens another transport like the first, after that was lost; it may raise BridgeError. `rosout`:
        whether what happens is told on /rosout, too."""
        self.about = f"ROS 2 by {transport.about}"
        self._transport = transport
        self._profile = profile
        self._mappings = mappings
        self._neighbours = neighbours
        self._reconnect = reconnect
        self._rosout = rosout
        self._robot: Ros2Robot | None = None
        self._room: Room | None = None
        self._interface: RosSessionInterface | None = None
        self._watching = asyncio.get_running_loop().create_task(self._watch_connection())

    def robot(self, clock: Clock) -> Robot:
        assert self._profile is not None, "the bridge was opened without a robot"
        self._robot = Ros2Robot(self._profile, clock, self._transport, self._mappings)
        return self._robot

    def join(self, room: Room) -> None:
        self._room = room
        self._open_interface(self._neighbours)

    def _open_interface(self, neighbours: Neighbours) -> None:
        assert self._room is not None
        self._neighbours = neighbours
        self._interface = RosSessionInterface(self._transport, self._room, neighbours, rosout=self._rosout)
        ParameterServices(self._transport, partial(settings_of, self._room))
        neighbours.met = self._note_other_session
        neighbours.serve(self._room.engine.scenario.title, Path(self._room.folder).name)

    def _note_other_session(self, other: Session) -> None:
        self._note(meeting(other))

    async def close(self) -> None:
        self._watching.cancel()
        self._neighbours.close()
        if self._interface is not None:
            await self._interface.close()
        self._transport.close()

    async def _watch_connection(self) -> None:
        """A middleware that was shut down under the session is started again; the robot has noticed by itself."""
        said = ""
        while True:
            await asyncio.sleep(WATCH_SECONDS)
            why = self._transport.lost()
            if not why:
                continue
            if not said:
                self._note(f"the connection to ROS is lost: {why}")
                said = why
            try:
                fresh = await self._reconnect()
            except BridgeError as error:
                if str(error) != said:
                    said = str(error)
                    self._note(f"the connection to ROS cannot be made anew yet: {said}")
                continue
            said = ""
            interface, self._interface = self._interface, None
            if interface is not None:
                await interface.close()
            before, self._transport = self._transport, fresh
            try:
                if self._robot is not None:
                    self._robot.use(fresh)
                if self._room is not None and not self._room.engine.ended:
                    self._open_interface(Neighbours(fresh, self._neighbours.me))
                self._note("the connection to ROS was made anew")
            except PortError as error:  # it may have gone again already
                self._note(f"the new connection to ROS cannot be used: {error}")
            before.close()

    def _note(self, text: str) -> None:
        _LOG.warning("%s", text)
        if self._room is not None and not self._room.engine.ended:
            self._room.engine.post(Note(text=text))


async def open_bridge(wire: Wire, profile: RobotProfile | None) -> Ros2Bridge:
    """Connect (`rise_engine.bridge.BridgeOpener`)."""
    try:
        _, arguments = as_options(wire.arguments, NODE, {})  # the command line has taken its own
    except PortError as error:
        raise BridgeError([str(error)]) from None
    try:
        share = [Path(each) for each in read_options(profile).share] if profile is not None else []
    except CarrierErrors:
        assert profile is not None
        raise BridgeError(profile_findings(profile)) from None  # also what is wrong elsewhere in it

    def connect() -> Awaitable[Transport]:
        return open_transport(wire.transport, arguments, node=NODE, share=share)

    transport = await connect()
    try:
        neighbours = Neighbours(transport)
        for type in INTERFACE_TYPES:
            transport.fields(type)
        mappings = read_carriers(profile, transport.fields) if profile is not None else {}
        other = await neighbours.ask()
        if other is not None:
            neighbours.close()
            raise BridgeError(refusal(other, transport))
    except CarrierErrors as errors:
        transport.close()
        raise BridgeError(errors.findings) from None
    except PortError as error:
        transport.close()
        raise BridgeError([str(error)]) from None
    except BaseException:
        transport.close()
        raise
    rosout = "--disable-rosout-logs" not in arguments
    return Ros2Bridge(transport, profile, mappings, neighbours, connect, rosout=rosout)


def settings_of(room: Room) -> dict[str, Setting]:
    """A session's settings as parameters of its node."""
    about = room.about()
    return {
        "title": Setting(about.title, "of the scenario"),
        "scenario": Setting(about.scenario_folder, "its folder"),
        "session": Setting(about.folder, "the session's folder"),
        "mode": Setting(about.mode, "debug: the robot is simulated; real"),
        "robot": Setting(about.robot, "the robot's profile"),
        "seed": Setting(about.seed, "for everything picked at random"),
        "participant": Setting(about.participant, "who takes part"),
        "condition": Setting(about.condition, "of the study"),
    }


def read_parameters(
    arguments: tuple[str, ...], *, switches: list[str], single: list[str], many: list[str], written: list[str]
) -> tuple[list[str], tuple[str, ...]]:
    """Parameters of the session's node as options of `rise-engine serve` (`rise_engine.bridge.ParameterReader`)."""
    options = {
        flag.removeprefix("--").replace("-", "_"): Option(flag, switch=flag in switches, many=flag in many)
        for flag in (*switches, *single, *many)
    }
    try:
        return as_options(arguments, NODE, options, written)
    except PortError as error:
        raise BridgeError([str(error)]) from None


def check_profile(profile: RobotProfile) -> list[str]:
    """What is wrong with a profile, as far as that shows without a connection (`rise-engine check` in real mode): the
    same that a session, which takes the types from where the check takes them, is refused for."""
    try:
        fields = _field_reader(read_options(profile).share)
    except CarrierErrors:
        return profile_findings(profile)
    except PortError as error:
        return [str(error)]
    return profile_findings(profile, fields)


def _field_reader(share: Sequence[str]) -> Fields | None:
    """The types as the transport has them that a session would use here; None: there is none."""
    missing = available()
    if not missing["rclpy"]:
        return InstalledTypes().fields
    if missing["dds"]:
        return None
    from rise_adapters.ros2.types import Types  # needs rosbags, which is an extra

    return Types(share).fields
