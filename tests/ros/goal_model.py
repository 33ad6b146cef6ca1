"""A model of what a goal can be on a robot, and of what can happen to it, explored against `Ros2Robot`.

    asked --taken--> running --ends, is stopped--> over
      |                |
      +-- refused -----+-- its program ends ------> over

`World` is one action server and one session, on a wire in memory and in virtual time. The server does nothing alone:
each *event* is one thing that it, the network, the wizard, somebody else or the engine can do
(docs/explanation/ros2.md). What the robot really does is known here, so that whatever the session says about it can be
compared with the truth.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from functools import cache, partial
from typing import Literal
from uuid import NAMESPACE_OID, uuid5

import msgspec
from msgspec import Struct
from rise_adapters.ros2.actions.client import ABORTED, CANCELED, CANCELING, EXECUTING, FINAL_STATUSES, SUCCEEDED
from rise_adapters.ros2.mapping import ActionMapping, read_mappings
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.transport.port import (
    CANCEL_GOAL,
    GET_RESULT,
    SEND_GOAL,
    STATUS,
    STATUS_TOPIC,
    Message,
    SendReply,
    action_topic,
    action_types,
)

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from rise_engine.kernel.records import OpenGoal
from rise_engine.ports.robot import RobotReport
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.scenario.model import RobotProfile
from tests.ros import exploration
from tests.ros.bench import SPEECH, TYPES, profile
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire

PART = "pepper/speech"
ENOUGH = 100
"""More events than any state of one goal is away."""
EARLIER = bytes([100] * 16)
"""The id of a goal that has ended long ago."""
OTHER = bytes([200] * 16)
"""The id of a goal of somebody else."""
SETTLE = 0.6
"""Seconds after an event in which what follows from it by itself has happened: messages, and the next look at the
servers."""
FOUND = 5.5
"""Seconds after which a server that was found has said what it was doing."""


def goal_id(action: str) -> bytes:
    """As the engine makes it, also an engine that continues after another one."""
    return uuid5(NAMESPACE_OID, f"a session {action}").bytes


class RobotGoal(Struct):
    """One goal as it really stands on the robot."""

    id: bytes
    replies: list[SendReply]
    """To requests that it begins."""
    status: int = 0
    """As in action_msgs/GoalStatus; 0: asked for, and neither taken nor refused yet."""
    askers: list[SendReply] = []

    @property
    def can_move(self) -> bool:
        """It moves the robot, or may still begin to."""
        return self.status not in FINAL_STATUSES


class Program:
    """The robot's program: one action server in a process."""

    def __init__(self, world: World, node: str = "/robot") -> None:
        self.transport = MemoryTransport(world.wire, world.loop, node)
        self.goals: dict[bytes, RobotGoal] = {}
        self.cancels: list[tuple[bytes, SendReply]] = []
        """Requests to cancel that are not answered yet."""
        self.moved_together = False
        """Two goals of the session ran here at one time, one of which had ended for it."""
        self._world = world
        types = action_types(TYPES[SPEECH])
        full = self.transport.resolve(SPEECH)
        self._status = self.transport.publisher(action_topic(full, STATUS_TOPIC), types[STATUS_TOPIC], STATUS)
        for part, take in ((SEND_GOAL, self._ask), (CANCEL_GOAL, self._cancel), (GET_RESULT, self._result)):
            self.transport.serve(action_topic(full, part), types[part], take)

    # --- requests ---

    def _ask(self, request: Message, reply: SendReply) -> None:
        id = bytes(request["goal_id"]["uuid"])
        ended = self._world.ended_for_session() - self._world.released
        self.moved_together |= any(goal.can_move and goal.id in ended for goal in self.goals.values())
        self.goals.setdefault(id, RobotGoal(id, [])).replies.append(reply)

    def _cancel(self, request: Message, reply: SendReply) -> None:
        id = bytes(request["goal_info"]["goal_id"]["uuid"])
        known = self.goals.get(id)
        if any(goal.status == EXECUTING and id in (goal.id, bytes(16)) for goal in self.goals.values()):
            self.cancels.append((id, reply))
        elif not any(id):
            reply({"return_code": 0})
        else:  # as rcl: "terminated" also means one that is being stopped, and what it has not taken it does not know
            reply({"return_code": 3 if known is not None and known.status else 2})

    def _result(self, request: Message, reply: SendReply) -> None:
        goal = self.goals.get(bytes(request["goal_id"]["uuid"]))
        if goal is None or goal.status == 0:
            reply({"status": 0})
        elif goal.status in FINAL_STATUSES:
            reply({"status": goal.status})
        else:
            goal.askers.append(reply)

    # --- what it does when it is told to ---

    def take(self) -> None:
        for goal in self._asked()[:1]:
            goal.status = EXECUTING
            self._tell()
            for reply in goal.replies:
                reply({"accepted": reply is goal.replies[0]})

    def refuse(self) -> None:
        for goal in self._asked()[:1]:
            goal.status = ABORTED
            for reply in goal.replies:
                reply({"accepted": False})

    def end(self, status: int) -> None:
        for goal in [goal for goal in self.goals.values() if goal.status in (EXECUTING, CANCELING)][:1]:
            goal.status = status
            self._tell()
            for reply in goal.askers:
                reply({"status": status})

    def answer_cancels(self, *, stops: bool) -> None:
        asked, self.cancels = self.cancels, []
        for id, reply in asked:
            moving = [each for each in self.goals.values() if each.status in (EXECUTING, CANCELING)]
            meant = [each for each in moving if id in (each.id, bytes(16))] if stops else []
            reply({"return_code": 0, "goals_canceling": [{"goal_id": {"uuid": each.id}} for each in meant]})
            for each in meant:
                each.status = CANCELING
            if meant:
                self._tell()

    def is_asked_to_stop(self, goal: bytes) -> bool:
        """Whether a request to cancel this goal is not answered yet."""
        return any(id in (goal, bytes(16)) for id, _ in self.cancels)

    def _asked(self) -> list[RobotGoal]:
        return [goal for goal in self.goals.values() if goal.status == 0]

    def _tell(self) -> None:
        shown = [goal for goal in self.goals.values() if goal.status]
        self._status.publish(
            {"status_list": [{"goal_info": {"goal_id": {"uuid": goal.id}}, "status": goal.status} for goal in shown]}
        )


@cache
def _robot() -> tuple[RobotProfile, Mapping[str, ActionMapping]]:
    """A robot with one action."""
    whole = profile()
    actions = {name: spec for name, spec in whole.actions.items() if name == "Speech"}
    which = msgspec.structs.replace(whole, actions=actions)
    wire = MemoryWire()
    return which, read_mappings(which, MemoryTransport(wire, ClockLoop(VirtualClock())).fields)


class World:
    """One robot, one session, and everything that can happen to them."""

    def __init__(self, goals: int = 2, without: Collection[str] = ()) -> None:
        """`goals`: the most that the wizard starts; two are enough for one beside another. `without`: events that do
        not happen."""
        self.goals = goals
        self._without = without
        self.clock = VirtualClock()
        self.loop = ClockLoop(self.clock)
        self.wire = MemoryWire()
        self.near = MemoryTransport(self.wire, self.loop, "/engine")
        self.graph = 0
        """As `Transport.graph_version`."""
        self.reports: list[RobotReport] = []
        self.started: list[StartAction] = []
        self.program: Program | None = None
        self.twin: Program | None = None
        """Somebody has started the robot's program twice."""
        self.programs: list[Program] = []
        self.is_cut = False
        self.is_stopped = False
        """F9 was pressed, and nothing was started since."""
        self.released: set[bytes] = set()
        """Goals that a person has released."""
        self.other: Literal["none", "found", "later"] = "none"
        """Whether somebody else has begun a goal, and whether it ran when the session found the server."""
        self.new_program()
        self._connect([])
        self.settle()

    def _connect(self, adopted: list[StartAction]) -> None:
        self.near.graph_version = lambda: self.graph  # type: ignore[method-assign, assignment]
        which, mappings = _robot()
        self.robot = Ros2Robot(which, self.clock, self.near, mappings)
        if adopted:
            self.robot.adopt(adopted)
        self.robot.connect(self.reports.append)

    def settle(self, seconds: float = SETTLE) -> None:
        self.loop.run_until(self.clock.now() + seconds)

    # --- the truth, and what the session says ---

    def moving(self) -> set[bytes]:
        """Goals that move the robot, or may still begin to."""
        return {goal.id for program in self.programs for goal in program.goals.values() if goal.can_move}

    def ended_for_session(self) -> set[bytes]:
        ended = {each.action for each in self.reports if isinstance(each, ActionReport) and each.status != "accepted"}
        return {bytes.fromhex(goal.goal) for goal in self.started if goal.action in ended}

    def open(self) -> tuple[OpenGoal, ...]:
        """What the session says that may still be going on."""
        said = [each.open for each in self.reports if isinstance(each, RobotChanged)]
        return said[-1] if said else ()

    def stop_said(self) -> StopReport | None:
        said = [each for each in self.reports if isinstance(each, StopReport)]
        return said[-1] if said and self.is_stopped else None

    # --- what can happen ---

    def start(self) -> None:
        """The wizard starts an action, as often as there are `goals`."""
        if len(self.started) < self.goals:
            number = len(self.started) + 1
            goal = StartAction(f"{number}/a", "Speech", {"message": "Hello"}, 2.0, goal_id(f"{number}/a").hex())
            self.started.append(goal)
            self.is_stopped = False
            self.robot.start(goal)

    def cancel(self) -> None:
        for goal in self.started:
            self.robot.cancel(goal.action)

    def stop(self) -> None:
        """The session knows nothing of the robot until it answers."""
        self.is_stopped = True
        self.reports[:] = [each for each in self.reports if not isinstance(each, StopReport)]
        self.robot.stop_all()

    def release(self) -> None:
        """A person has looked at the robot: what is open counts as over."""
        self.released |= self.moving() & {*self.ended_for_session(), OTHER}
        self.robot.release_open_goals(PART)

    def take(self) -> None:
        for program in self._live():
            program.take()

    def take_unheard(self) -> None:
        """It begins, and its answer is lost."""
        lost = self.wire.drop("*/send_goal", what="reply")
        self.take()
        lost.stop()

    def refuse(self) -> None:
        for program in self._live():
            program.refuse()

    def finish(self) -> None:
        for program in self._live():
            program.end(SUCCEEDED)

    def other_begins(self) -> None:
        """A goal of somebody else begins, one at most, after the session has found what is there."""
        self.settle(max(self._found_at + FOUND - self.clock.now(), 0.0))
        for program in self._live() if self.other == "none" else ():
            program.goals[OTHER] = RobotGoal(OTHER, [], EXECUTING)
            program._tell()
            self.other = "later"

    def is_stopped_by_robot(self) -> None:
        """What is being stopped ends."""
        for program in self._live():
            program.answer_cancels(stops=True)
            program.end(CANCELED)

    def refuses_to_stop(self) -> None:
        for program in self._live():
            program.answer_cancels(stops=False)

    def program_ends(self) -> None:
        if self.program is not None:
            self.graph += 1
            self.program.transport.close()
            self.programs.remove(self.program)
            self.program = None

    def new_program(self) -> None:
        if self.program is None:
            self.graph += 1
            self.program = Program(self)
            self.programs.append(self.program)
            if self.is_cut:
                self.wire.forget("/robot")
            if self.twin is None:
                self._find()

    def twin_comes(self) -> None:
        """It has had a goal once, and its last status is latched."""
        if self.twin is None and self.program is not None:
            self.graph += 1
            self.twin = Program(self, "/twin")
            self.twin.goals[EARLIER] = RobotGoal(EARLIER, [], SUCCEEDED)
            self.twin._tell()
            self.programs.append(self.twin)

    def twin_goes(self) -> None:
        if self.twin is not None:
            self.graph += 1
            self.twin.transport.close()
            self.programs.remove(self.twin)
            self.twin = None

    def cut(self) -> None:
        """The link is gone, and both sides have noticed; the robot goes on."""
        self.is_cut = True
        self.graph += 1
        self.wire.forget("/robot")

    def heal(self) -> None:
        if self.is_cut:
            self.is_cut = False
            self.graph += 1
            self.wire.heal("/robot")
            self._find()

    def wait(self) -> None:
        self.settle(5.5)

    def engine_dies(self) -> None:
        """It is killed, and another one goes on with the session."""
        heard = [each for each in self.reports if isinstance(each, ActionReport)]
        accepted = {each.action for each in heard if each.status == "accepted"}
        ended = self.ended_for_session()
        known = {goal.action: goal.accepted for goal in self.open()}
        self.robot._report, self.robot._closed = lambda report: None, True  # it says and asks nothing any more
        if self.robot._stop is not None:
            self.robot._stop.abandon()
        self.near.close()
        running = [goal.action for goal in self.started if bytes.fromhex(goal.goal) not in ended]
        unfinished = [
            StartAction(name, "Speech", {}, 0.0, goal_id(name).hex(), accepted=known.get(name, name in accepted))
            for name in (*running, *known)
        ]
        self.reports += [ActionReport(action=name, status="lost") for name in running]  # the kernel's word
        self.near = MemoryTransport(self.wire, self.loop, "/engine")
        if self.is_cut:
            self.wire.forget("/robot")
        self.released.discard(OTHER)
        self._find()
        self._connect(unfinished)
        if self.is_stopped:  # as the kernel does for a stop that is in force
            self.stop()

    def possible(self) -> Iterator[str]:
        """The events that would change something, or make time pass. (Nobody cancels what is over, or releases what
        nobody sees.)"""
        goals = [goal for program in self.programs for goal in program.goals.values()]
        is_asked = any(goal.status == 0 for goal in goals)
        moves = any(goal.status in (EXECUTING, CANCELING) for goal in goals)
        is_to_stop = any(program.cancels for program in self.programs)
        ended, is_open = self.ended_for_session(), self.open() != ()
        happens = {
            "start": len(self.started) < self.goals,
            "cancel": is_open or len(ended) < len(self.started),
            "release": is_open or not self.moving().isdisjoint({*ended, OTHER}),
            **dict.fromkeys(("take", "take_unheard", "refuse"), is_asked),
            "finish": moves,
            "other_begins": self.other == "none" and self.program is not None,
            "is_stopped_by_robot": moves,
            "refuses_to_stop": is_to_stop,
            "program_ends": self.program is not None,
            "new_program": self.program is None,
            "twin_comes": self.twin is None and self.program is not None,
            "twin_goes": self.twin is not None,
            "cut": not self.is_cut,
            "heal": self.is_cut,
        }
        return (name for name in EVENTS if name not in self._without and happens.get(name, True))

    def _find(self) -> None:
        """The session finds what offers the action, again or for the first time. What runs there holds its part."""
        self._found_at = self.clock.now()
        if OTHER in self.moving():
            self.other = "found"

    def _live(self) -> Iterator[Program]:
        yield from self.programs

    # --- for the exploration ---

    def do(self, event: str) -> None:
        """One of EVENTS happens, and what follows from it by itself; what the session says then must be true."""
        EVENTS[event](self)
        self.settle()
        check(self)

    def state(self) -> str:
        """Everything that decides what can come of it; two worlds of one state are explored once."""
        robot = self.robot
        goals = [
            (
                goal.phase,
                goal.may_be_running,
                goal.is_accepted,
                goal.why_open(),
                goal.cancellation.wanted,  # type: ignore[union-attr]
                goal.cancellation.confirmed,  # type: ignore[union-attr]
                goal.cancellation.refused_at is not None,  # type: ignore[union-attr]
            )
            for goal in robot._goals.values()
        ]
        truth = [  # how a goal has ended decides nothing
            (goal.id, goal.can_move and (goal.status, len(goal.replies) > 1, program.is_asked_to_stop(goal.id)))
            for program in self.programs
            for goal in program.goals.values()
        ]
        said = self.stop_said()
        return repr((
            goals,
            truth,
            self.is_cut,
            self.program is None,
            self.twin is None,
            len(self.started),
            None if said is None else (said.confirmed, said.unconfirmed),
            {goal.action for goal in self.open()} == set(),
            sorted(self.moving() & self.released),
            self.other,
        ))  # fmt: skip


EVENTS: dict[str, Callable[[World], None]] = {
    name: getattr(World, name)
    for name in (
        *("start", "cancel", "stop", "wait", "release"),
        *("take", "take_unheard", "refuse", "finish", "other_begins", "is_stopped_by_robot", "refuses_to_stop"),
        *("program_ends", "new_program", "twin_comes", "twin_goes", "cut", "heal", "engine_dies"),
    )
}


TWIN = ("twin_comes", "twin_goes")
"""Left out unless asked for: one that is cut off beside a twin cannot be told from one that was started again."""


def play(names: tuple[str, ...], goals: int = 2) -> World:
    """What has come of these events, one after the other."""
    return exploration.play(World(goals), names)


def check(world: World) -> None:
    """What the session says must be true."""
    moving, ended = world.moving(), world.ended_for_session()
    if world.is_cut:  # of these nobody hears while the robot is lost
        moving -= {OTHER, *world.released}
    reports = [each for each in world.reports if isinstance(each, ActionReport) and each.status != "accepted"]
    assert len({each.action for each in reports}) == len(reports), "an action has two endings"
    said = world.stop_said()
    if said is not None and PART in said.confirmed:
        begun = {id for program in world.programs for id, goal in program.goals.items() if goal.status}
        assert not moving - (world.released - begun), "the stop is confirmed, and something moves or may still begin"
    told = {goal.action for goal in world.open()}
    for goal in world.started:
        id = bytes.fromhex(goal.goal)
        if id in moving - world.released and id in ended:
            assert goal.action in told, f"{goal.action} may be going on, and the session does not say so"
    if OTHER in moving - world.released and world.robot._reported is not None:
        is_told = f"unknown/{OTHER.hex()}" in told
        assert is_told == (world.other == "found"), "what others run is open only if it ran when the robot was found"
    assert not any(program.moved_together for program in world.programs), "one began beside another that was to end"


def check_that_nothing_is_held_for_ever(world: World) -> None:
    """When the robot answers and ends everything, nothing is open any more, a stop is confirmed, and the next action
    begins."""
    world.heal()
    world.new_program()
    world.settle()
    world.twin_goes()
    world.settle()
    for _ in (*world.started, "of others"):
        world.take()
        world.settle()
        world.robot.cancel_open_goals("")
        world.settle()
        world.is_stopped_by_robot()
        world.finish()
        world.settle(6.0)
    check(world)
    if all(not goal.accepted and "may have begun" in goal.reason for goal in world.open()):
        world.robot.release_open_goals("")  # whom it was sent to, only the engine knew that has gone
    assert not world.moving() and world.open() == (), world.open()
    if (said := world.stop_said()) is not None:
        moved = f"{PART} (something was begun there after the stop)"
        assert said.confirmed == (PART,) or said.unconfirmed == (moved,), said
    world.goals = len(world.started) + 1
    world.start()
    world.settle()
    world.take()
    world.settle()
    assert world.reports[-1] == ActionReport(action=world.started[-1].action, status="accepted"), world.reports[-1]


def explore(depth: int, *, goals: int = 2, without: Collection[str] = TWIN) -> exploration.Exploration:
    """Play every sequence of up to `depth` events, but for those that lead to the same state as one before."""
    begin = partial(World, goals, without)
    return exploration.explore(begin, [(), ("start",)], depth, check_that_nothing_is_held_for_ever)


def walk(seed: int, events: int = 30) -> None:
    """Play a random sequence: of states that `World.state` takes for one, `explore` plays what follows only once, and
    how long ago something happened may make a difference."""
    draw = random.Random(seed)
    world = World()
    for name in ("start", *draw.choices([name for name in EVENTS if name not in TWIN], k=events)):
        world.do(name)
    check_that_nothing_is_held_for_ever(world)


if __name__ == "__main__":
    for goals, depth in ((0, ENOUGH), (1, ENOUGH), (2, int(sys.argv[1]))):
        found = explore(depth, goals=goals)
        whole = ", and there is no other" if found.is_whole else f" within {depth} events"
        print(f"{goals} goal(s): {found.states} states{whole}; what was said of them was so", flush=True)
