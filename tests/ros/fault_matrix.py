"""Every fault at every moment on the real wire: a robot in a process of its own, an engine here, and the truth.

    python -m tests.ros.fault_matrix --robot dds --transport dds --part 1/4

`GOALS` x `MOMENTS`: what the robot does with a goal, and what happens to it. The robot writes with the machine's clock
what it really does. Whatever the session says is compared with that, at every moment: one ending for each action, no
part that is confirmed while something moves there, no movement that the session neither runs nor names as open, also
after its end, and no second goal beside one that has ended for the session. `./dev soak --robots` plays all of it on
every transport there is.
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
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from typing import Any, TypeAlias

import msgspec
from rise_adapters.ros2.actions.client import ABORTED
from rise_adapters.ros2.mapping import read_mappings
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.transport.port import Transport

from rise_engine.kernel import Kernel
from rise_engine.kernel.records import ENDINGS, ActionRecord, RobotRecord, StopRecord
from rise_engine.kernel.view import SessionView
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.model import Scenario
from rise_engine.session.recovery import RecoveredSession
from tests.ros.badrobot import Plan
from tests.ros.bench import SPEECH, TYPES, Records, profile, scenario
from tests.ros.contract.peers import ROOT, environment, fast_dds
from tests.ros.test_faults_dds import Process, until

PART = "pepper/speech"
Span: TypeAlias = tuple[float, float]
"""From and until, in seconds of session time."""
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

    def __init__(self, open_transport: Callable[[], Transport], robot: Any) -> None:
        """:param robot: a `Process`, or what has its events, too."""
        self.records = []
        self.clock = RealClock(asyncio.get_running_loop())
        self.began = time.monotonic() - self.clock.now()
        self.open_transport = open_transport
        self.transport = open_transport()
        self.process = robot
        self.engine = self.make_engine()

    def make_engine(self, recovered: RecoveredSession | None = None) -> Engine:
        which = self.make_scenario()
        profile = which.robot
        self.robot = Ros2Robot(profile, self.clock, self.transport, read_mappings(profile, self.transport.fields))
        sinks = [self.records.append]
        return Engine(which, self.robot, self.clock, 1, sinks=sinks, recovered=recovered, session_id="matrix")

    def make_scenario(self) -> Scenario:
        whole = profile(server=3.0)
        only = {name: spec for name, spec in whole.actions.items() if name in ("Speech", "Wait")}
        return scenario(msgspec.structs.replace(whole, actions=only))

    def replace_engine(self) -> None:
        """Its engine is gone without a word, and another one continues the session."""
        old, now, loop_now = self.engine, self.clock.now(), asyncio.get_running_loop().time()
        timers = {timer: handle.when() - loop_now + now for timer, handle in old._commands._timers.items()}
        kernel = Kernel.restore(old.scenario, old.kernel.snapshot())
        old._sinks.clear()
        self.transport.close()  # so that nothing it still says reaches anybody
        self.robot._closed = True
        old.abandon()
        self.transport = self.open_transport()
        unused: Any = None
        view = SessionView()
        for record in self.records:
            view.apply(record)
        recovered = RecoveredSession(
            *(old.scenario, unused, kernel, view, now, timers, old.inputs, 0, b"", []),
            last_wall=self.clock.wall_label(now),
            last_t=now,
        )
        self.engine = self.make_engine(recovered)
        self.engine.resume()

    async def begin(self) -> None:
        self.engine.start()
        await until(lambda: self.robot_statuses()[-1:] == ["connected"], START_SECONDS)
        self.act()

    # --- what the session said ---

    def stop_records(self) -> list[StopRecord]:
        return self.of(StopRecord)

    def said_spans(self, part: str, until: float) -> list[Span]:
        """When the session said that something ran, or may have run, at a part, or that it had not confirmed a stop."""
        spans, began = [], {}
        for record in self.of(ActionRecord):
            key = f"{record.task}/{record.action}"
            if record.status in ENDINGS and key in began:
                spans.append((began.pop(key), record.t))
            elif record.status == "started":
                began[key] = record.t
        spans += [(t, until) for t in began.values()]
        for robot, following in pairwise([*self.of(RobotRecord), None]):
            if any(goal.part == part for goal in robot.open):
                spans.append((robot.t, until if following is None else following.t))
        for stop, then in pairwise([*self.stop_records(), None]):
            assert stop is not None
            if stop.status == "requested" or any(each.startswith(f"{part} (") for each in stop.unconfirmed):
                spans.append((stop.t, until if then is None else then.t))
        if self.engine.ended and any(goal.part == part for goal in self.engine.open_goals):
            spans.append((self.records[-1].t, until))
        return spans

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


async def freeze_for_long(case: Case) -> None:
    """The middleware takes it for gone, and it is not."""
    await case.begun(0.4)
    case.process.process.send_signal(signal.SIGSTOP)
    await asyncio.sleep(13)
    case.process.process.send_signal(signal.SIGCONT)
    await asyncio.sleep(4)


async def kill(case: Case) -> None:
    await case.begun(0.4)
    case.process.process.kill()
    await asyncio.sleep(0.2)
    case.stop_all()


async def kill_the_engine_at_once(case: Case) -> None:
    await asyncio.sleep(0.1)
    case.replace_engine()
    await asyncio.sleep(1.5)
    case.stop_all()
    await asyncio.sleep(1.5)


async def kill_the_engine_in_the_middle(case: Case) -> None:
    await case.begun(0.4)
    case.replace_engine()
    await asyncio.sleep(1.5)
    case.stop_all()
    await asyncio.sleep(1.5)


async def kill_the_stopped_engine(case: Case) -> None:
    await case.begun(0.4)
    case.stop_all()
    await asyncio.sleep(0.3)
    case.replace_engine()
    await asyncio.sleep(3)


MOMENTS: dict[str, Callable[[Case], Awaitable[None]]] = {
    made.__name__: made
    for made in (
        *(nothing, stop_at_once, stop_in_the_middle, cancel_at_once, cancel_and_start_again),
        *(end_at_once, freeze, freeze_before_the_goal, freeze_for_long, kill),
        *(kill_the_engine_at_once, kill_the_engine_in_the_middle, kill_the_stopped_engine),
    )
}


async def play(goal: str, moment: str, robot: str, transport: str) -> list[str]:
    """One case; what was wrong, in sentences."""
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
        return await play_to_end(Case(partial(open_transport, transport), process), moment, PART)
    finally:
        await process.end()


async def play_to_end(case: Case, moment: str, part: str) -> list[str]:
    """A whole session, and the lies that it told of that part."""
    try:
        await case.begin()
        await MOMENTS[moment](case)
        case.engine.end("over")
        await until(lambda: case.engine.ended, 30)
        return await find_lies(case, part)
    finally:
        case.transport.close()


async def find_lies(case: Case, part: str) -> list[str]:
    """Where what the session said of that part is not what the robot did. The session has just ended."""
    ended = case.clock.now()
    await asyncio.sleep(AFTER)
    found = []
    moved = movements(case, until=ended + AFTER)
    for begin, over in moved:
        for stop, until_then in pairwise([*case.stop_records(), None]):
            assert stop is not None
            last = ended + AFTER if until_then is None else until_then.t
            if part in stop.confirmed and min(over, last) - max(begin, stop.t) > TOLERANCE:
                found.append(f"confirmed at {stop.t:.2f} s, and it moved from {begin:.2f} s to {over:.2f} s")
        if unsaid := longest_rest((begin, over), case.said_spans(part, until=ended + AFTER)):
            found.append(f"it moved from {begin:.2f} s to {over:.2f} s, and {unsaid:.2f} s of that were not said")
    for (_, over), (begin, _) in pairwise(moved):
        if begin < over - TOLERANCE:
            found.append("a second goal ran beside the first")
    try:
        case.check()
    except AssertionError as error:
        found.append(f"not one ending each: {error}")
    if (code := case.process.process.returncode) is not None and code < 0 and code != -signal.SIGKILL:
        found.append(f"the robot's program ended by signal {-code}")
    if not case.of(RobotRecord):
        found.append("the robot was never there")
    return found


def movements(case: Case, until: float) -> list[tuple[float, float]]:
    """When the robot really moved, by its own log, in session time."""
    events = case.process.events
    killed = case.process.process.returncode is not None  # nobody knows when exactly
    moved = []
    for each in (each for each in events if each["event"] == "begin"):
        ends = [its["at"] for its in events if its["event"] == "end" and its["id"] == each["id"]]
        over = next((at - case.began for at in ends if at >= each["at"]), None if killed else until)
        if over is not None:
            moved.append((each["at"] - case.began, over))
    return moved


def longest_rest(span: Span, said: Sequence[Span]) -> float:
    """The longest part of a span, in seconds, that none of the others covers; 0 if it is within the tolerance."""
    begin, over = span
    longest = 0.0
    for one, other in [*sorted(said), (over, over)]:
        if one > begin:
            longest = max(longest, min(one, over) - begin)
        begin = max(begin, other)
    return longest if longest > TOLERANCE else 0.0


def open_transport(kind: str, share: Sequence[Path] = ()) -> Transport:
    loop = asyncio.get_running_loop()
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
