"""What can become of an order on a topic and of a call of a service, explored against `Ros2Robot`: every sequence of a
few events, on a wire in memory and in virtual time. What each of the robot's programs has really heard is known here.

`goal_model` is the same for action servers.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache, partial
from typing import Any, Literal, TypeAlias

from msgspec.structs import replace
from rise_adapters.ros2.mapping import ActionMapping, read_mappings
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.robot.listeners import LEASE_SECONDS, Listeners
from rise_adapters.ros2.transport.port import Message, SendReply

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from rise_engine.kernel.records import OpenGoal
from rise_engine.ports.robot import RobotReport
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.scenario.model import RobotProfile
from tests.ros import exploration
from tests.ros.bench import profile
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire

NAME = "/pepper/part"
SETTLE = 1.7
"""Seconds in which whoever listens has been told: two looks at the listeners, and the time that a new one needs."""
SECONDS = 8.0
"""The time of an action on a topic."""
Kind: TypeAlias = Literal["topic", "rate", "service"]
STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"
CARRIERS: dict[str, dict[str, Any]] = {
    "topic": {"topic": NAME, "type": STRING, "message": {"data": "{value}"}, "reset": {"data": "reset"}},
    "service": {"service": NAME, "type": TRIGGER, "unstoppable": True},
}
CARRIERS["rate"] = {**CARRIERS["topic"], "rate": 5}


class Program:
    """One that listens to the topic, or offers the service. It does what it was told last until it hears otherwise."""

    def __init__(self, world: World, node: str) -> None:
        self.transport = MemoryTransport(world.wire, world.loop, node)
        self.born = world.clock.now()
        self.is_cut = False
        self.order = ""
        """What it does; empty: nothing."""
        self.calls: dict[str, SendReply] = {}
        """What it is doing for whom called it."""
        self._world = world
        if world.kind == "service":
            self.transport.serve(NAME, TRIGGER, self._call)
        else:
            self.transport.subscribe(NAME, STRING, self._hear)

    def _hear(self, message: Message) -> None:
        self.order = message["data"] if message["data"] != "reset" else ""
        if self.order not in ("", "other") and self._world.kind == "rate":
            begun = self._world.begun.setdefault(self.order, self._world.clock.now())
            assert self.born <= begun, "an order went to a program that was not there at its start"

    def _call(self, request: Message, reply: SendReply) -> None:
        ended = self._world.ended()
        assert not any(ended & each.calls.keys() for each in self._world.programs), "it was called beside what goes on"
        self.order = self._world.started[-1].action
        self.calls[self.order] = reply


@cache
def _robot(kind: str) -> tuple[RobotProfile, Mapping[str, ActionMapping]]:
    """A robot with one action."""
    whole = profile()
    emotion = replace(whole.actions["Emotion"], carrier=CARRIERS[kind], supported=True)
    which = replace(whole, actions={"Emotion": emotion})
    return which, read_mappings(which, MemoryTransport(MemoryWire(), ClockLoop(VirtualClock())).fields)


class World:
    """One part of a robot, one session, and everything that can happen to them."""

    def __init__(self, kind: Kind, *, with_bag: bool = False) -> None:
        self.kind = kind
        self.clock = VirtualClock()
        self.loop = ClockLoop(self.clock)
        self.wire = MemoryWire()
        self.programs: list[Program] = []
        """Those that live."""
        self.sent_before = 0
        self.base: Program | None = None
        self.bag: Program | None = None
        self.is_vague = False
        """Nobody knows any more who had an order: the engine that did has gone, or a person has released it."""
        self.needs_person = False
        """What is open may stay so until somebody releases it: a bag is gone with an order, or an answer was lost."""
        self.started: list[StartAction] = []
        self.begun: dict[str, float] = {}
        self.reports: list[RobotReport] = []
        self.is_stopped = False
        self.begin()
        if with_bag:
            self.join()
        self._connect([])
        self.settle()

    def _connect(self, adopted: list[StartAction]) -> None:
        self.near = MemoryTransport(self.wire, self.loop, "/engine")
        which, mappings = _robot(self.kind)
        self.robot = Ros2Robot(which, self.clock, self.near, mappings)
        if adopted:
            self.robot.adopt(adopted)
        self.robot.connect(self.reports.append)

    def settle(self, seconds: float = SETTLE) -> None:
        self.loop.run_until(self.clock.now() + seconds)

    # --- what the session says ---

    def ended(self) -> set[str]:
        return {each.action for each in self.reports if isinstance(each, ActionReport) and each.status != "accepted"}

    def unfinished(self) -> list[StartAction]:
        ended = self.ended()
        return [goal for goal in self.started if goal.action not in ended]

    def open(self) -> tuple[OpenGoal, ...]:
        return next((each.open for each in reversed(self.reports) if isinstance(each, RobotChanged)), ())

    def stop_said(self) -> StopReport | None:
        return next((each for each in reversed(self.reports) if isinstance(each, StopReport) and self.is_stopped), None)

    # --- what can happen: the session ---

    def start(self) -> None:
        """Two at most: one beside another."""
        if len(self.started) < 2:
            self.is_stopped = False
            name = f"{len(self.started) + 1}/a"
            self.started.append(StartAction(name, "Emotion", {"value": name}, SECONDS))
            self.robot.start(self.started[-1])

    def cancel(self) -> None:
        for goal in self.started:
            self.robot.cancel(goal.action)

    def stop(self) -> None:
        self.is_stopped = True
        self.robot.stop_all()

    def stop_open(self) -> None:
        self.robot.cancel_open_goals("")

    def release(self) -> None:
        """A person has looked at the robot, and made it stand."""
        unfinished = {goal.action for goal in self.unfinished()}
        for program in self.programs if self.open() else ():
            program.order = program.order if program.order in unfinished else ""
            program.calls = {action: reply for action, reply in program.calls.items() if action in unfinished}
        self.is_vague = True
        self.robot.release_open_goals("")

    def wait(self) -> None:
        self.settle(SECONDS + 1)

    def wait_long(self) -> None:
        self.settle(LEASE_SECONDS + SECONDS)

    def recover(self) -> None:
        """The engine is killed, and another one goes on."""
        known = {goal.action for goal in self.open()}
        self.robot._report, self.robot._closed = lambda report: None, True
        if self.robot._stop is not None:
            self.robot._stop.abandon()
        self.near.close()
        lost = self.unfinished()
        self.reports += [ActionReport(action=goal.action, status="lost") for goal in lost]
        left = [goal for goal in self.started if goal in lost or goal.action in known]
        for program in self.programs:
            if program.order not in {goal.action for goal in left}:
                program.order = ""  # it had ended, and been taken back, and nobody knew that this was not heard
        self.is_vague = self.needs_person = True
        self._connect(left)
        if self.is_stopped:
            self.stop()

    def switch(self) -> None:
        """The connection to ROS is made anew."""
        self.needs_person |= self.kind == "service"
        self.near.break_down("the context was shut down")
        self.near = MemoryTransport(self.wire, self.loop, "/engine")
        self.robot.switch_transport(self.near)

    # --- what can happen: the robot ---

    def other(self) -> None:
        """Another program publishes an order. A stop takes back that, too."""
        if not self.is_stopped:
            MemoryTransport(self.wire, self.loop, "/other").publisher(NAME, STRING).publish({"data": "other"})

    def answer(self) -> None:
        for program in self.programs:
            self.needs_person |= program.is_cut and bool(program.calls)
            calls, program.calls, program.order = program.calls, {}, ""
            for reply in calls.values():
                reply({"success": True})

    def cut(self) -> None:
        """The link of the base is gone. (On topics nobody has noticed.)"""
        if self.base is not None and not self.base.is_cut:
            self.base.is_cut, self.sent_before = True, len(self.wire.messages(NAME))
            self._kill(self.base.transport)
            if self.kind == "service":
                self.notice()

    def notice(self) -> None:
        """The leases of those that are cut off or dead run out. (After 20 s, they do so by themselves.)"""
        for transport in tuple(self.wire.killed):
            self.wire.forget(transport)

    def _kill(self, transport: MemoryTransport) -> None:
        self.wire.kill(transport)

        def expire() -> None:
            if transport in self.wire.killed:
                self.wire.forget(transport)

        self.loop.call_later(20.0, expire)

    def heal(self) -> None:
        base = self.base
        if base is not None and base.is_cut:
            base.is_cut = False
            is_same = base.transport not in self.wire.forgotten
            self.wire.heal(base.transport)
            for message in self.wire.messages(NAME)[self.sent_before :] if is_same else ():
                base._hear(message)  # the middleware, which has not noticed, repeats it

    def respawn(self) -> None:
        """The base's program is killed, which nobody has noticed, and another one is there."""
        if self.base is not None:
            self._kill(self.base.transport)
            self._leave(self.base)
        self.begin()

    def end(self) -> None:
        if self.base is not None:
            self.base.transport.close()
            self._leave(self.base)

    def begin(self) -> None:
        if self.base is None:
            self.base = self._appear("base")

    def replace(self) -> None:
        """Somebody starts the base's program on another computer."""
        self._appear("base")

    def join(self) -> None:
        """A bag listens, or no longer."""
        if self.bag is not None:
            self.bag.transport.close()
            self._leave(self.bag)
            self.needs_person = True
        elif self.kind != "service":
            self.bag = self._appear("bag")

    def _appear(self, what: str) -> Program:
        self.programs.append(Program(self, f"/{what}"))
        return self.programs[-1]

    def _leave(self, program: Program) -> None:
        self.programs.remove(program)
        self.base = None if program is self.base else self.base
        self.bag = None if program is self.bag else self.bag

    # --- for the exploration ---

    def possible(self) -> Iterator[str]:
        """The events that would change something, or make time pass."""
        is_cut = self.base is not None and self.base.is_cut
        happens = {
            "start": len(self.started) < 2,
            "cancel": self.open() != () or self.unfinished() != [],
            "stop_open": self.open() != (),
            "other": not self.is_stopped,
            "answer": any(program.calls for program in self.programs),
            "cut": self.base is not None and not is_cut,
            "notice": bool(self.wire.killed),
            "heal": is_cut,
            "end": self.base is not None,
            "begin": self.base is None,
        }
        return (name for name in EVENTS[self.kind] if happens.get(name, True))

    def do(self, event: str) -> None:
        """One of EVENTS happens, and what follows from it by itself; what the session says then must be true."""
        getattr(self, event)()
        self.settle()
        check(self)

    def state(self) -> str:
        """What decides what can come of it. Of the programs only their order counts, not their numbers."""
        (endpoint,) = self.robot._endpoints
        listeners = getattr(endpoint, "_listeners", None) or Listeners(self.clock.now)
        groups = (listeners.present, listeners._ordered, listeners._reset_at, listeners._away)
        numbers = {program: n for n, program in enumerate(sorted(self._programs_in(groups)))}
        programs = [(numbers[each.transport.program], each) for each in self.programs]
        return repr((
            [(goal.phase, goal.may_be_running, goal.why_open()) for goal in self.robot._goals.values()],
            [(number, each.is_cut, each.order, sorted(each.calls)) for number, each in programs],
            [sorted(str(numbers.get(program, program)) for program in group) for group in groups],
            (endpoint.presence.count, self.base is None, self.bag is None, self.is_vague),
            (len(self.started), len(self.open()), self.is_stopped),
        ))  # fmt: skip

    def _programs_in(self, groups: Iterable[Iterable[bytes]]) -> set[bytes]:
        known = {program for group in groups for program in group if program.startswith(b"program")}
        return known | {each.transport.program for each in self.programs}


OF_SESSION = ("start", "cancel", "stop", "stop_open", "release", "wait", "recover", "switch")
EVENTS: dict[Kind, tuple[str, ...]] = {
    "topic": (*OF_SESSION, "other", "cut", "notice", "heal", "respawn", "end", "begin", "join", "wait_long"),
    "service": (*OF_SESSION, "answer", "cut", "notice", "heal", "respawn", "end", "begin", "wait_long"),
}
EVENTS["rate"] = EVENTS["topic"]


def check(world: World) -> None:
    """Whoever has an order and should not is told as soon as it listens, or the session says that it may go on."""
    said = world.stop_said()
    names = " ".join((*said.unconfirmed, *said.unstoppable)) if said is not None else ""
    is_named = world.open() != () or "may not have heard" in names
    unfinished = {goal.action for goal in world.unfinished()}
    if world.kind == "service":
        late = [each for each in world.programs if each.calls.keys() - unfinished]
        assert not late or is_named, "a call goes on, and the session does not say so"
        return
    adopted = any("an engine that has gone" in goal.reason for goal in world.open())
    if unfinished or adopted:
        return  # an order stands
    late = [each for each in world.programs if each.order and (each.order != "other" or world.is_stopped)]
    assert all(each.is_cut for each in late), "it listens, and was not told to stop"
    shown = world.robot._endpoints[0].others[1]  # type: ignore[index]
    away = [each for each in late if each.order != "other" and each.transport.program not in shown]
    since = max(world.begun.values(), default=0.0)
    instead = [each for each in world.programs if each.born > since and each.transport.program in shown]
    owed = Counter(each.transport.node for each in away) - Counter(each.transport.node for each in instead)
    if owed and not world.is_vague:
        assert is_named, "it is away with an order, and the session does not say so"


def play(kind: Kind, names: Collection[str], *, with_bag: bool = False) -> World:
    return exploration.play(World(kind, with_bag=with_bag), names)


def check_the_end(world: World) -> None:
    """When all are there again, all are told, and nothing is held for ever."""
    for event in ("heal", "begin", "notice", "settle", "cancel", "answer", "stop_open"):
        getattr(world, event)()
    world.settle(9.0)  # a part that comes and goes gets nothing for 8 s
    check(world)
    assert all(each.order in ("", "other") for each in world.programs), "it was never told to stop"
    if world.needs_person:
        world.release()
    assert world.open() == (), world.open()


def explore(kind: Kind, depth: int, *, with_bag: bool = False) -> int:
    """How many states there are after a start and up to `depth` events; what was said in each of them was so."""
    return exploration.explore(partial(World, kind, with_bag=with_bag), [("start",)], depth, check_the_end).states


def walk(kind: Kind, seed: int, events: int = 20) -> None:
    draw = random.Random(seed)
    check_the_end(play(kind, ("start", *draw.choices(EVENTS[kind], k=events)), with_bag=draw.random() < 0.5))
