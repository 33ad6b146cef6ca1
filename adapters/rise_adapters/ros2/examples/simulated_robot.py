"""A robot that is not there: an action server for each action of a robot's profile, and a subscriber for each topic. It
takes believable time, says what a person would see, and does wrong on request. A whole study runs over the wire with
it, on one computer.

    python -m rise_adapters.ros2.examples.simulated_robot --robot pepper
    python -m rise_adapters.ros2.examples.simulated_robot --config scenarios/greeting --fault Speech=fail@2

Faults are those of the simulated driver (rise_adapters.simulated.faults): ACTION=reject, =fail, =slow:FACTOR, =hang,
each also with @N, and vanish@SECONDS[-SECONDS], counted from the node's start. While it has vanished it offers nothing,
and when it comes back it knows of no earlier goal.
"""

from __future__ import annotations

import asyncio
from argparse import Namespace
from collections import Counter
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from math import inf
from pathlib import Path

from rise_adapters.ros2.examples.goal_reader import GoalReader
from rise_adapters.ros2.examples.run_node import NodeError, node_parser, run_node, wait_forever
from rise_adapters.ros2.examples.simulated_action import PrintLine, SimulatedAction, WhenBusy, describe_action
from rise_adapters.ros2.mapping import MappingError, read_mappings, with_all_carriers
from rise_adapters.ros2.transport.port import Message, Subscription, Transport
from rise_adapters.simulated.faults import ActionFault, LinkFault, parse_fault
from rise_engine.engine.clock import RealClock
from rise_engine.ports.robot import Clock, Timer
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import RobotProfile, SourceLocation
from rise_engine.scenario.robot_profiles import find_profile, read_profile, read_robot
from rise_engine.scenario.source_files import FileReader


class RobotOnWire:
    """All methods belong to the transport's loop."""

    def __init__(
        self,
        transport: Transport,
        profile: RobotProfile,
        clock: Clock,
        print_line: PrintLine,
        *,
        faults: Sequence[str] = (),
        busy: WhenBusy = "wait",
    ) -> None:
        """Raises ValueError for a fault that cannot be understood, MappingError for what ROS cannot carry."""
        parsed = [parse_fault(text, profile) for text in faults]
        self._faults = [fault for fault in parsed if isinstance(fault, ActionFault)]
        self._transport, self._profile, self._clock = transport, with_all_carriers(profile), clock
        self._print, self._busy = print_line, busy
        self._counts: Counter[str] = Counter()
        self._mappings = read_mappings(profile, transport.fields)
        self._is_there = False
        self._actions: list[SimulatedAction] = []
        self._subscriptions: list[Subscription] = []
        self._timers: list[Timer] = []
        self.appear()
        for vanish in parsed:
            if isinstance(vanish, LinkFault):
                self._timers.append(clock.call_at(vanish.at, self.vanish))
                if vanish.back is not None:
                    self._timers.append(clock.call_at(vanish.back, self.appear))

    def appear(self) -> None:
        """Offer everything."""
        if self._is_there:
            return
        self._is_there = True
        shared: dict[tuple[str, str, str], list[str]] = {}
        for name, mapping in self._mappings.items():
            shared.setdefault(mapping.route, []).append(name)
        for (kind, name, type), actions in shared.items():
            self._print(f"{kind} {self._transport.resolve(name)} ({type}) for {', '.join(actions)}")
            specs = [self._profile.actions[action] for action in actions]
            if kind == "topic":
                take = partial(self._take_message, GoalReader(specs))
                self._subscriptions.append(self._transport.subscribe(name, type, take))
            else:
                self._actions.append(
                    SimulatedAction(
                        self._transport,
                        self._mappings[actions[0]],
                        specs,
                        self._clock,
                        self._print,
                        self._next_fault,
                        self._busy,
                    )
                )

    def vanish(self) -> None:
        """Be gone, without a word about what was running."""
        if self._is_there:
            for action in self._actions:
                action.vanish()
            self._withdraw()
            self._print("the robot has vanished (simulated fault)")

    def close(self) -> None:
        """Abort what runs, and offer nothing any more."""
        for timer in self._timers:
            timer.cancel()
        for action in self._actions:
            action.close()
        self._withdraw()

    def _withdraw(self) -> None:
        self._actions.clear()
        for subscription in self._subscriptions:
            subscription.close()
        self._subscriptions.clear()
        self._is_there = False

    def _next_fault(self, action: str) -> ActionFault | None:
        self._counts[action] += 1
        return next((fault for fault in self._faults if fault.applies_to(action, self._counts[action])), None)

    def _take_message(self, reader: GoalReader, message: Message) -> None:
        self._print(describe_action(*reader.read(message)))


def find_robot(robot: str | None, scenario: Path | None) -> RobotProfile:
    """The profile of a robot: by its name or its file, or that of a scenario with what the scenario changes about it.

    Raises NodeError with everything that is wrong with it.
    """
    folder = Path() if scenario is None else scenario.parent if scenario.is_file() else scenario
    findings = Diagnostics()
    if robot is None or (scenario is not None and find_profile(robot, folder) is not None):
        if scenario is None:
            raise NodeError("which robot? say --robot NAME, or --config DIR for that of a scenario")
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

    profile = find_robot(options.robot, options.config)
    print(f"{profile.title}, simulated, on {transport.about}")
    clock = RealClock(asyncio.get_running_loop(), options.speed)
    try:
        robot = RobotOnWire(transport, profile, clock, print_line, faults=options.fault, busy=options.busy)
    except MappingError as errors:
        raise NodeError(str(errors)) from None
    except ValueError as error:
        raise NodeError(str(error)) from None
    try:
        await wait_forever()
    finally:
        robot.close()


def _parse_speed(text: str) -> float:
    speed = float(text)
    if not 0 < speed < inf:
        raise ValueError
    return speed


def main() -> None:
    parser = node_parser("simulated_robot", "A robot that is not there, on the wire.")
    parser.add_argument("--robot", metavar="NAME|FILE", help="which robot: a profile's name, or a profile")
    parser.add_argument("--config", type=Path, metavar="DIR", help="a scenario: its robot, and its own actions")
    parser.add_argument("--speed", type=_parse_speed, default=1.0, metavar="N", help="how many times faster than real")
    parser.add_argument("--fault", action="append", default=[], metavar="SPEC", help="what it does wrong; repeatable")
    parser.add_argument(
        "--busy",
        choices=("wait", "reject"),
        default="wait",
        help="what becomes of a goal that comes while another of its action runs (default: %(default)s)",
    )
    run_node(parser, work)


if __name__ == "__main__":
    main()
