"""Every fault at every moment on the real wire: a robot in a process of its own, an engine here, and the truth.

    python -m tests.ros.fault_matrix --robot dds --transport dds --part 1/4

`GOALS` x `MOMENTS`: what the robot does with a goal, and what happens to it. The robot writes with the machine's clock
what it really does. Whatever the session says is compared with that: one ending for each action, no part that is
confirmed while something moves there or begins, no second goal beside one that has ended for the session, and nothing
that goes on after the session without being named. `./dev soak --robots` plays all of it on every transport there is.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import msgspec
from rise_adapters.ros2.actions.client import ABORTED
from rise_adapters.ros2.mapping import read_mappings
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.transport.port import Transport

from rise_engine.kernel.records import RobotRecord
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.engine import Engine
from tests.ros.badrobot import Plan
from tests.ros.bench import SPEECH, TYPES, Records, profile, scenario
from tests.ros.contract.peers import ROOT, environment, fast_dds
from tests.ros.test_faults_dds import Process, until

PART = "pepper/speech"
TOLERANCE = 0.3
"""Seconds between what the robot writes and what it sends."""
START_SECONDS = 120.0
"""Until the robot is there; a machine can be busy."""
AFTER = 4.0
"""Seconds for which the truth is watched after the session's end."""

GOALS = {
    "speaks": Plan(seconds=1.5),
    "decides slowly": Plan(decides_after=3.5, seconds=3),
    "refuses": Plan(accept=False),
    "refuses slowly": Plan(accept=False, decides_after=2.5),
    "gives up": Plan(seconds=0.7, end=ABORTED),
    "refuses to stop": Plan(seconds=5, cancel="refuse"),
    "ignores the stop": Plan(seconds=5, cancel="ignore"),
    "stops slowly": Plan(seconds=8, cancel_seconds=1.5),
    "goes on and on": Plan(seconds=60),
}
"""What the robot does with the first goal; the second one, if it gets any, is an ordinary one."""


class Case(Records):
    """One session with one robot, and everything that was said and done."""

    def __init__(self, transport: Transport, robot: Any) -> None:
        """:param robot: a `Process`, or what has its events, too."""
        self.records = []
        self.clock = RealClock(asyncio.get_running_loop())
        self.began = time.monotonic() - self.clock.now()
        self.transport = transport
        self.process = robot
        self.engine = self.make_engine()

    def make_engine(self) -> Engine:
        whole = profile(server=3.0)
        only = {name: spec for name, spec in whole.actions.items() if name in ("Speech", "Wait")}
        which = msgspec.structs.replace(whole, actions=only)
        robot = Ros2Robot(which, self.clock, self.transport, read_mappings(which, self.transport.fields))
        return Engine(scenario(which), robot, self.clock, 1, sinks=[self.records.append])

    async def begin(self) -> None:
        self.engine.start()
        await until(lambda: self.robot_statuses()[-1:] == ["connected"], START_SECONDS)
        self.act()

    async def begun(self, seconds: float) -> None:
        """So long after the robot has begun, or has had the time to."""
        with suppress(AssertionError):
            await until(lambda: self.process.said("begin") or self.ending("1/1"), 6)
        await asyncio.sleep(seconds)


async def nothing(case: Case) -> None:
    await case.begun(0.5)


async def stop_at_once(case: Case) -> None:
    await asyncio.sleep(0.1)
    case.stop_all()


async def stop_in_the_middle(case: Case) -> None:
    await case.begun(0.4)
    case.stop_all()


async def cancel_at_once(case: Case) -> None:
    await asyncio.sleep(0.1)
    case.stop_act()


async def cancel_and_start_again(case: Case) -> None:
    await case.begun(0.4)
    case.stop_act()
    await asyncio.sleep(4.2)
    case.act()
    await asyncio.sleep(0.5)


async def end_at_once(case: Case) -> None:
    await asyncio.sleep(0.1)


async def freeze(case: Case) -> None:
    case.process.process.send_signal(signal.SIGSTOP)
    await asyncio.sleep(0.3)
    case.stop_all()
    await asyncio.sleep(4)
    case.process.process.send_signal(signal.SIGCONT)


async def freeze_before_the_goal(case: Case) -> None:
    await asyncio.sleep(0.05)
    case.process.process.send_signal(signal.SIGSTOP)
    await asyncio.sleep(2.5)
    case.stop_all()
    await asyncio.sleep(2.8)
    case.process.process.send_signal(signal.SIGCONT)
    await asyncio.sleep(0.5)


async def kill(case: Case) -> None:
    await case.begun(0.4)
    case.process.process.kill()
    await asyncio.sleep(0.2)
    case.stop_all()


MOMENTS: dict[str, Callable[[Case], Awaitable[None]]] = {
    made.__name__: made
    for made in (
        *(nothing, stop_at_once, stop_in_the_middle, cancel_at_once, cancel_and_start_again),
        *(end_at_once, freeze, freeze_before_the_goal, kill),
    )
}


async def play(goal: str, moment: str, robot: str, transport: str) -> list[str]:
    """One case; what was wrong, in sentences."""
    loop = asyncio.get_running_loop()
    opened = open_transport(transport, loop)
    order = {"names": {SPEECH: TYPES[SPEECH]}, "plans": [msgspec.to_builtins(p) for p in (GOALS[goal], Plan())]}
    module = "tests.ros.badrobot" if robot == "dds" else "tests.ros.rclpy_robot"
    process = Process(
        await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", module, msgspec.json.encode(order).decode()),
            stdout=asyncio.subprocess.PIPE,
            cwd=ROOT,
            env=dict(os.environ),
        )
    )
    try:
        await until(lambda: process.said("ready"), START_SECONDS)
        case = Case(opened, process)
        await case.begin()
        await MOMENTS[moment](case)
        case.engine.end("over")
        await until(lambda: case.engine.ended, 30)
        return await find_lies(case, PART)
    finally:
        await process.end()
        opened.close()


async def find_lies(case: Case, part: str) -> list[str]:
    """Where what the session said of that part is not what the robot did. The session has just ended."""
    ended = time.monotonic()
    await asyncio.sleep(AFTER)
    found = []
    events = case.process.events
    spans = []
    for event in events:
        if event["event"] == "begin":
            over = [each["at"] for each in events if each["event"] == "end" and each["id"] == event["id"]]
            spans.append((event["at"], over[0] if over else float("inf")))
    killed = case.process.process.returncode is not None
    asked = [each["at"] for each in events if each["event"] == "goal"]
    for stop in case.stops():
        at = case.began + stop.t
        if part not in stop.confirmed:
            continue
        if any(begin < at - TOLERANCE and at + TOLERANCE < over for begin, over in spans) and not killed:
            found.append(f"confirmed at {stop.t:.2f} s while it moved")
        if any(begin > at + TOLERANCE and any(one < at for one in asked) for begin, _ in spans):
            found.append(f"confirmed at {stop.t:.2f} s, and it began afterwards")
    for (_, over), (begin, _) in pairwise(spans):
        if begin < over - TOLERANCE:
            found.append("a second goal ran beside the first")
    goes_on = any(begin < ended + AFTER and over > ended + TOLERANCE for begin, over in spans) and not killed
    if goes_on and not case.engine.open_goals:
        found.append("it went on after the session, and the session did not say so")
    try:
        case.check()
    except AssertionError as error:
        found.append(f"not one ending each: {error}")
    if not case.of(RobotRecord):
        found.append("the robot was never there")
    return found


def open_transport(kind: str, loop: asyncio.AbstractEventLoop, share: Sequence[Path] = ()) -> Transport:
    if kind == "dds":
        from rise_adapters.ros2.transport.dds import DdsTransport

        return DdsTransport(loop, node="engine", environment=environment(), share=share)
    from rise_adapters.ros2.transport.rclpy import RclpyTransport

    return RclpyTransport(loop, node="engine", arguments=())


async def play_cases(
    cases: list[tuple[str, str]],
    play: Callable[[str, str, str, str], Awaitable[list[str]]],
    arguments: argparse.Namespace,
) -> int:
    """All of them, or the part that was asked for, a line for each; the exit status."""
    os.environ.update(environment())
    if arguments.fast:
        os.environ.update(fast_dds(Path(tempfile.mkdtemp(prefix="rise-matrix-"))))
    number, parts = map(int, arguments.part.split("/"))
    cases = cases[number - 1 :: parts]
    wrong = 0
    for goal, moment in cases:
        try:
            lies = await play(goal, moment, arguments.robot, arguments.transport)
        except AssertionError as error:
            lies = [f"it did not come to its end: {error}"]
        wrong += bool(lies)
        print(f"{'WRONG' if lies else 'ok':5} {goal} / {moment}: {'; '.join(lies)}", flush=True)
    print(f"{len(cases)} cases, {wrong} wrong ({arguments.robot} robot, {arguments.transport} engine)")
    return 1 if wrong else 0


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--robot", choices=("dds", "rclpy"), default="dds")
    parser.add_argument("--transport", choices=("dds", "rclpy"), default="dds")
    parser.add_argument("--fast", action="store_true", help="rclpy on Fast DDS instead of Cyclone DDS, on both sides")
    parser.add_argument("--part", default="1/1", help="the first of four quarters: 1/4")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(asyncio.run(play_cases(list(product(GOALS, MOMENTS)), play, read_arguments())))
