"""A simulated robot: an action server or a service for each action of a robot's profile, and a subscriber for each
topic, as in the profile (quality of service, definitions, feedback). It takes believable time, prints its visible
behaviour, and has faults on request. With it, a whole study runs over the wire on one computer.

    python -m rise_ros.examples.simulated_robot --robot pepper
    python -m rise_ros.examples.simulated_robot --config scenarios/greeting --fault Speech=fail@2

Faults are those of the simulated driver (rise_adapters.simulated.faults): ACTION=reject, =fail, =slow:FACTOR, =hang,
=slow-accept:SECONDS and so on, each also with @N, and vanish@SECONDS[-SECONDS], counted from the node's start. While it
has vanished it offers nothing, and when it returns it knows no earlier goal. `--log FILE` writes its real behaviour
(rise_ros.examples.robot_log).
"""

from __future__ import annotations

import asyncio
from argparse import Namespace
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from datetime import datetime
from functools import partial
from math import inf
from pathlib import Path

from rise_adapters.ros2.mapping import ActionMapping, read_mappings, read_options, with_all_carriers
from rise_adapters.ros2.robot.lifecycle import EVENT_TYPE, STATE_TYPE
from rise_adapters.ros2.transport.port import Closable, Message, PortError, SendReply, Subscription, Transport
from rise_adapters.simulated.faults import CANCEL_FAULTS, ActionFault, LinkFault, parse_fault

from rise_engine.ports.robot import Clock, Timer
from rise_engine.run.engine.clock import RealClock
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import RobotProfile, SourceLocation
from rise_engine.scenario.reading.robot_profiles import find_profile, read_profile, read_robot
from rise_ros.examples.goal_reader import GoalReader
from rise_ros.examples.robot_log import RobotLog
from rise_ros.examples.run_node import NodeError, node_parser, run_node, wait_forever
from rise_ros.examples.simulated_action import PrintLine, SimulatedAction, WhenBusy, describe_action
from rise_ros.examples.simulated_messages import is_same


class RobotOnWire:
    """The robot. All methods belong to the transport's loop."""

    def __init__(
        self,
        transport: Transport,
        profile: RobotProfile,
        clock: Clock,
        print_line: PrintLine,
        *,
        faults: Sequence[str] = (),
        busy: WhenBusy = "wait",
        log: RobotLog | None = None,
    ) -> None:
        """Raises ValueError for an invalid fault, PortError for anything that ROS cannot carry."""
        parsed = [parse_fault(text, profile) for text in faults]
        self._faults = [fault for fault in parsed if isinstance(fault, ActionFault)]
        self._transport, self._profile, self._clock = transport, with_all_carriers(profile), clock
        self._print, self._busy = print_line, busy
        self._counts: Counter[str] = Counter()
        self._mappings = read_mappings(profile, transport.fields)
        self._check_faults()
        self._log = log or RobotLog()
        self._is_there = False
        self._is_active = True
        self._actions: list[SimulatedAction] = []
        self._subscriptions: list[Subscription] = []
        self._timers: list[Timer] = []
        self._has_lifecycle = any(isinstance(fault, LinkFault) and fault.kind == "inactive" for fault in parsed)
        self._lifecycle: list[Closable] = []
        self.appear()
        for vanish in parsed:
            if isinstance(vanish, LinkFault):
                away, back = (self.vanish, self.appear) if vanish.kind == "vanish" else (self.deactivate, self.activate)
                self._timers.append(clock.call_at(vanish.at, away))
                if vanish.back is not None:
                    self._timers.append(clock.call_at(vanish.back, back))

    def _check_faults(self) -> None:
        """Check that each fault is possible for the carrier of its action. Raises ValueError."""
        for fault in self._faults:
            mapping = self._mappings.get(fault.action)
            if mapping is not None and (
                mapping.kind == "topic" or (mapping.kind == "service" and fault.kind in CANCEL_FAULTS)
            ):
                what = "nobody answers on a topic" if mapping.kind == "topic" else "nobody stops a call of a service"
                raise ValueError(f"the fault {fault.action}={fault.kind} cannot happen: {what} ({mapping.name})")

    def appear(self) -> None:
        """Offer everything."""
        if self._is_there:
            return
        self._is_there = True
        self._log.note("appeared")
        if self._has_lifecycle:  # only for a lifecycle node
            self._lifecycle.append(self._transport.serve("~/get_state", STATE_TYPE, self._answer_state))
            self._events = self._transport.publisher("~/transition_event", EVENT_TYPE)
            self._lifecycle.append(self._events)
        shared: dict[tuple[str, str, str], list[str]] = {}
        for name, mapping in self._mappings.items():
            shared.setdefault(mapping.route, []).append(name)
        for (kind, name, type), actions in shared.items():
            self._print(f"{kind} {self._transport.resolve(name)} ({type}) for {', '.join(actions)}")
            specs = [self._profile.actions[action] for action in actions]
            if kind == "topic":
                mappings = [self._mappings[action] for action in actions]
                take = partial(self._take_message, GoalReader(specs, self._profile.places), mappings, _LastMessage())
                self._subscriptions.append(self._transport.subscribe(name, type, take, mappings[0].topic_qos))
            else:
                self._actions.append(
                    SimulatedAction(
                        self._transport,
                        self._mappings[actions[0]],
                        specs,
                        self._profile.places,
                        self._clock,
                        self._print,
                        self._next_fault,
                        self._busy,
                        self._log,
                        self._die,
                        lambda: self._is_active,
                    )
                )

    def vanish(self) -> None:
        """Disappear without reporting running goals."""
        if self._is_there:
            for action in self._actions:
                action.vanish()
            self._withdraw()
            self._log.note("vanished")
            self._print("the robot has vanished (simulated fault)")

    def deactivate(self) -> None:
        """Finish running goals, and accept no more, like an inactive lifecycle node."""
        self._is_active = False
        self._publish_transition()
        self._log.note("inactive")
        self._print("the robot is inactive (simulated fault)")

    def activate(self) -> None:
        """Accept goals again."""
        self._is_active = True
        self._publish_transition()
        self._log.note("active")
        self._print("the robot is active")

    def _answer_state(self, request: Message, reply: SendReply) -> None:
        reply({"current_state": self._state()})

    def _publish_transition(self) -> None:
        if self._is_there:
            self._events.publish({"goal_state": self._state()})

    def _state(self) -> Message:
        return {"id": 3, "label": "active"} if self._is_active else {"id": 2, "label": "inactive"}

    def _die(self, seconds: float | None) -> None:
        """Vanish for `seconds`; None: permanently. (Not within a request, because that would close its server.)"""
        now = self._clock.now()
        self._timers.append(self._clock.call_at(now, self.vanish))
        if seconds is not None:
            self._timers.append(self._clock.call_at(now + seconds, self.appear))

    def close(self) -> None:
        """Abort running goals, and stop offering everything."""
        for timer in self._timers:
            timer.cancel()
        for action in self._actions:
            action.close()
        self._withdraw()

    def _withdraw(self) -> None:
        self._actions.clear()
        for handle in (*self._subscriptions, *self._lifecycle):
            handle.close()
        self._subscriptions.clear()
        self._lifecycle.clear()
        self._is_there = False

    def _next_fault(self, action: str) -> ActionFault | None:
        self._counts[action] += 1
        return next((fault for fault in self._faults if fault.applies_to(action, self._counts[action])), None)

    def _take_message(
        self, reader: GoalReader, mappings: Sequence[ActionMapping], last: _LastMessage, message: Message
    ) -> None:
        if any(each.rate for each in mappings) and last.message is not None and is_same(message, last.message):
            return  # a repetition
        last.message = message
        resets = [mapping.make_reset() for mapping in mappings]
        if any(reset is not None and is_same(message, reset) for reset in resets):
            self._log.note("ended", last.action, how="reset")
            self._print(f"{last.action or mappings[0].name}: reset")
            return
        spec, parameters = reader.read(message)
        last.action = spec.name
        self._log.note("begun", spec.name)
        self._print(describe_action(spec, parameters))


class _LastMessage:
    """The last message on a topic."""

    def __init__(self) -> None:
        self.message: Message | None = None
        self.action = ""


def find_robot(robot: str | None, scenario: Path | None) -> RobotProfile:
    """Return the profile of a robot, by its name or its file, or from a scenario with the scenario's changes.

    Raises NodeError with all errors in it.
    """
    folder = Path() if scenario is None else scenario.parent if scenario.is_file() else scenario
    findings = Diagnostics()
    if robot is None or (scenario is not None and find_profile(robot, folder) is not None):
        if scenario is None:
            raise NodeError("which robot? use --robot NAME, or --config DIR for that of a scenario")
        loaded = load(scenario, robot=robot)
        if loaded.scenario is not None:
            return loaded.scenario.robot
        raise NodeError("\n".join(map(str, loaded.diagnostics)))
    files = FileReader(folder, findings)
    if robot.endswith(".toml"):
        profile = read_profile(Path(robot), Path(robot).stem, files)
    else:
        profile = read_robot(robot, files, SourceLocation("command line"), asked=True)
    if findings.errors:
        raise NodeError("\n".join(map(str, findings.sorted())))
    return profile


async def work(transport: Transport, options: Namespace) -> None:
    def print_line(text: str) -> None:
        print(f"{datetime.now():%H:%M:%S.%f}"[:-3], text)

    profile: RobotProfile = options.profile
    print(f"{profile.title}, simulated, on {transport.about}")
    clock = RealClock(asyncio.get_running_loop(), options.speed)
    with ExitStack() as files:
        try:
            log = RobotLog(files.enter_context(options.log.open("a", encoding="utf-8")) if options.log else None)
            robot = RobotOnWire(transport, profile, clock, print_line, faults=options.fault, busy=options.busy, log=log)
        except (PortError, OSError, ValueError) as error:
            raise NodeError(str(error)) from None
        try:
            await wait_forever()
        finally:
            robot.close()


def _find_profile(options: Namespace) -> None:
    """Find the profile before the connection is opened, which needs the profile's definitions."""
    options.profile = find_robot(options.robot, options.config)
    with suppress(PortError):  # reported with all other errors in the profile
        options.share = [*options.share, *map(Path, read_options(options.profile).share)]


def _parse_speed(text: str) -> float:
    speed = float(text)
    if not 0 < speed < inf:
        raise ValueError
    return speed


def main() -> None:
    parser = node_parser("simulated_robot", "A simulated robot on ROS 2.")
    parser.add_argument("--robot", metavar="NAME|FILE", help="which robot: a profile's name, or a profile")
    parser.add_argument("--config", type=Path, metavar="DIR", help="a scenario: its robot, and its own actions")
    parser.add_argument("--speed", type=_parse_speed, default=1.0, metavar="N", help="how many times faster than real")
    parser.add_argument("--fault", action="append", default=[], metavar="SPEC", help="what it does wrong; repeatable")
    parser.add_argument(
        "--busy",
        choices=("wait", "reject"),
        default="wait",
        help="what happens to a goal that arrives while another one of its action runs (default: %(default)s)",
    )
    parser.add_argument("--log", type=Path, metavar="FILE", help="write what it really does there, as JSON lines")
    run_node(parser, work, prepare=_find_profile)


if __name__ == "__main__":
    main()
