"""The port behind which every robot stands, simulated or real (architecture, "The engine").

An adapter implements `Robot`; the engine finds its class by the entry-point group `rise.drivers` and calls it from its
own loop only. An adapter with threads of its own hands its reports over through the loop. Nothing here may block: each
call starts something and returns, and what came of it arrives through `report`.

A whole driver, as an example that is tested, is in docs/how-to/add-a-robot.md, section 5. `rise_adapters.simulated` is
one that comes with the program.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, EstopReport, Note, RobotChanged, StopReport
from rise_engine.scenario.model import RobotProfile

RobotReport: TypeAlias = ActionReport | RobotChanged | StopReport | EstopReport | Note
"""What a robot says. An `EstopReport` tells of an emergency stop that the robot's profile names: pressed, it stops
everything, and nobody releases that before it is let go. A note is for the record only: what came too late to count, or
twice."""
ReportCallback: TypeAlias = Callable[[RobotReport], None]
"""Takes one report. It belongs to the thread of the engine's loop; whoever has another one calls it by
`loop.call_soon_threadsafe(report, ...)`. It may be called within `connect`, `start`, `cancel` and `stop_all`."""


class Timer(Protocol):
    """One call that a clock has still to make."""

    def cancel(self) -> None:
        """Do not make it. Nothing happens when it was made, or cancelled, before."""
        ...


class Clock(Protocol):
    """The session's clock: real (optionally faster) or virtual. An adapter measures and waits by nothing else, so that
    a study can be rehearsed at ten times its speed, and tested in no time at all."""

    def now(self) -> float:
        """Session time: seconds since the session began. Never goes back."""
        ...

    def call_at(self, when: float, callback: Callable[[], None]) -> Timer:
        """Run `callback` on the engine's loop.

        :param when: session time in seconds; in the past means at once, but never inside this call.
        :param callback: called once, without arguments.
        :return: what takes it back.
        """
        ...


class Robot(Protocol):
    """What a robot adapter must be able to do.

    The engine calls it from the thread of its loop, in this order: `connect` once, then the others in any order, then
    `close` once. No method may block, and none should raise: what goes wrong is reported. (An exception is a mistake of
    the adapter. The engine logs it and takes the call for failed: the action has failed, nothing has confirmed a stop.)

    Every action that is started gets exactly one ending. What is reported about an action that has ended is ignored.

    A robot whose actions take a second each:

    >>> class Lamp:
    ...     def __init__(self, clock: Clock) -> None:
    ...         self.clock, self.timers = clock, {}
    ...     def connect(self, report: ReportCallback) -> None:
    ...         self.report = report
    ...         report(RobotChanged(status="connected", detail="a lamp"))
    ...     def start(self, goal: StartAction) -> None:
    ...         self.report(ActionReport(action=goal.action, status="accepted"))
    ...         end = partial(self.end, goal.action, "succeeded")
    ...         self.timers[goal.action] = self.clock.call_at(self.clock.now() + 1.0, end)
    ...     def end(self, action: str, status: str) -> None:
    ...         if (timer := self.timers.pop(action, None)) is not None:
    ...             timer.cancel()
    ...             self.report(ActionReport(action=action, status=status))
    ...     def cancel(self, action: str) -> None:
    ...         self.end(action, "canceled")
    ...     def stop_all(self) -> None:
    ...         for action in list(self.timers):
    ...             self.cancel(action)
    ...         self.report(StopReport(confirmed=("lamp",)))
    ...     def last_seen(self) -> float | None:
    ...         return None
    ...     def close(self) -> None:
    ...         self.timers.clear()

    As the engine calls it, in virtual time:

    >>> from functools import partial
    >>> from rise_engine.run.engine.clock import VirtualClock
    >>> clock, reports = VirtualClock(), []
    >>> robot: Robot = Lamp(clock)
    >>> robot.connect(reports.append)
    >>> robot.start(StartAction("1/1", "Emotion", {"value": "happy"}, expected=1.0))
    >>> clock.advance(), clock.now()
    (True, 1.0)
    >>> robot.start(StartAction("2/1", "Emotion", {"value": "sad"}, expected=1.0))
    >>> robot.stop_all()
    >>> [report.status for report in reports if isinstance(report, ActionReport)]
    ['accepted', 'succeeded', 'accepted', 'canceled']
    >>> reports[-1].confirmed
    ('lamp',)
    """

    def connect(self, report: ReportCallback) -> None:
        """Begin to reach the robot.

        Reports `RobotChanged(status="connected")` when goals can be sent, at once or later, and again whenever that
        changes: `degraded` when some of its parts cannot be used, `lost` when none can. With `lost`, the engine ends
        every action as lost by itself.

        :param report: takes everything that the robot says, until `close`.
        """
        ...

    def start(self, goal: StartAction) -> None:
        """Begin an action.

        Reports `ActionReport(status="accepted")` when the robot takes it, then exactly one ending: `succeeded`,
        `failed` (also when it is refused), `canceled`, `timed-out` or `lost`, with a reason in words wherever it did
        not succeed. An ending without `accepted` before it is allowed. `failed` is `aborted=True` when the robot had
        taken it and gave it up by itself, as after a protective stop; `canceled` without `cancel` says that somebody
        else stopped it. Neither is repeated by itself (semantics.md 12.2).

        :param goal: `goal.action` is the name to report it under, `<task>/<actionID>`, unique in the session;
            `goal.type` one of the profile's actions; `goal.parameters` what the author gave, by name, typed, without
            what was left out, a `message` in the words in which this robot is to say it (semantics.md 2.5, 2.6);
            `goal.expected` how many seconds it will probably take; `goal.goal` a UUID of its own, which an engine that
            goes on with the session gives it again.
        """
        ...

    def cancel(self, action: str) -> None:
        """Stop one action, also one that has only just been started. It then reports its ending: `canceled`, or what
        else became of it meanwhile. The engine waits 5 s (`kernel.act_runner.CANCEL_LIMIT`), and then gives it up.

        :param action: as in `goal.action`. One that has ended, or was never started, is no mistake: nothing happens.
        """
        ...

    def stop_all(self) -> None:
        """Stop everything that moves, also what others have asked for, and report one `StopReport`: which parts of the
        robot have stopped, and which may not have, each by a name for a person (`pepper/speech`), with the reason in
        brackets where it has not. The engine waits 3 s (`kernel.stop.STOP_LIMIT`). Asked again meanwhile, it asks the
        robot again.

        A part is called confirmed only when the robot has said so. What was running reports its ending as ever.
        Whenever the answer changes after that, another `StopReport` says so.
        """
        ...

    def last_seen(self) -> float | None:
        """When the robot gave its last sign of life, for people who watch the link.

        :return: session time in seconds; None when that is not known.
        """
        ...

    def close(self) -> None:
        """Let go of everything: what runs is cancelled without waiting for it. No reports after this. It may be called
        twice, and without `connect` before it."""
        ...


@runtime_checkable
class RobotWithOpenGoals(Robot, Protocol):
    """A robot whose adapter knows what may still be going on after an action has ended for the session: the robot did
    not answer, or refused to stop. Such goals are listed in `RobotChanged.open`, and their part gets nothing else."""

    def adopt(self, goals: Sequence[StartAction]) -> None:
        """Find out what has become of goals that an engine before this one gave the robot. Called once, before
        `connect`, in a session that is gone on with. Those that may still be going on are open; they are not
        cancelled until somebody asks for that.

        :param goals: `goal.goal` is their id, as it was when they were started.
        """
        ...

    def cancel_open_goals(self, part: str) -> None:
        """Ask once more to stop what may be going on at a part, also on a robot that refused.

        :param part: as `OpenGoal.part`; empty for all.
        """
        ...

    def release_open_goals(self, part: str) -> None:
        """A person has looked at the robot: the part may be used again.

        :param part: as `OpenGoal.part`; empty for all.
        """
        ...


class Driver(Protocol):
    """The callable that an entry point of the group `rise.drivers` names; usually the adapter's class. Its name in that
    group is what a profile's `driver` says.

        [project.entry-points."rise.drivers"]
        lamp = "my_package:make_lamp"

    A function does as well; here one that refuses options, and otherwise makes the robot that comes with the program:

    >>> from rise_adapters.simulated import SimulatedRobot
    >>> def make_lamp(profile: RobotProfile, clock: Clock, seed: int, faults: tuple[str, ...] = ()) -> Robot:
    ...     if unknown := sorted(set(profile.options) - {"port"}):
    ...         raise ValueError(f"robots/{profile.name}.toml: there is no option {unknown[0]}")
    ...     return SimulatedRobot(profile, clock, seed, faults)
    >>> from rise_engine.run.engine.clock import VirtualClock
    >>> driver: Driver = make_lamp
    >>> driver(RobotProfile("lamp", "Lamp", "lamp", {}, {"prot": 9}), VirtualClock(), seed=1)
    Traceback (most recent call last):
    ValueError: robots/lamp.toml: there is no option prot
    """

    def __call__(self, profile: RobotProfile, clock: Clock, seed: int, faults: tuple[str, ...] = ()) -> Robot:
        """Make a robot for one session; nothing is sent to it before `connect`.

        :param profile: the robot's: `profile.options` is the table `[options]` of its file, `profile.actions` what it
            can do.
        :param clock: the session's, which may run faster than real time.
        :param seed: for whatever is picked at random, so that a session can be repeated.
        :param faults: what is to go wrong, in a form that the driver documents. Only simulated robots take any.
        :return: the robot, not connected yet.
        :raises ValueError: with a sentence for a person, when the profile's options or a fault cannot be understood.
        """
        ...
