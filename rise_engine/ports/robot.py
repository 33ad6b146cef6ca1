"""The port for every robot, simulated or real (architecture, "The engine").

An adapter implements `Robot`. The engine finds its class by the entry-point group `rise.drivers` and calls it only from
its own loop. An adapter with threads of its own passes its reports through the loop. Nothing here may block: each call
starts something and returns, and its result arrives through `report`.

docs/how-to/add-a-robot.md, section 5, has a whole, tested driver. `rise_adapters.simulated` comes with the program.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias, runtime_checkable

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, EstopReport, Note, RobotChanged, StopReport
from rise_engine.scenario.model import RobotProfile

RobotReport: TypeAlias = ActionReport | RobotChanged | StopReport | EstopReport | Note
"""A robot's report. `EstopReport`: an emergency stop that the profile names. Pressing it stops everything, and nobody
can release that stop before the button is released. `Note`: for the record, such as a late or duplicate message."""
ReportCallback: TypeAlias = Callable[[RobotReport], None]
"""Takes one report. It belongs to the thread of the engine's loop; other threads call it with
`loop.call_soon_threadsafe(report, ...)`. It may be called within `connect`, `start`, `cancel` and `stop_all`."""


class Timer(Protocol):
    """A pending call of a clock."""

    def cancel(self) -> None:
        """Cancel the call. Does nothing if it was made or cancelled before."""
        ...


class Clock(Protocol):
    """The session's clock: real (optionally faster) or virtual. Adapters must measure and wait only with it, so that a
    study can be rehearsed ten times faster, and tested without delay."""

    def now(self) -> float:
        """Session time: seconds since the session began. Never goes back."""
        ...

    def call_at(self, when: float, callback: Callable[[], None]) -> Timer:
        """Run `callback` on the engine's loop.

        :param when: session time in seconds; a past time means immediately, but never inside this call.
        :param callback: called once, without arguments.
        :return: the timer, which can cancel the call.
        """
        ...


class Robot(Protocol):
    """The interface of a robot adapter.

    The engine calls it from the thread of its loop, in this order: `connect` once, then the others in any order, then
    `close` once. No method may block, and none should raise: problems are reported. (An exception is an error of the
    adapter. The engine logs it, and the call has failed: the action fails, or the stop stays unconfirmed.)

    Every started action has exactly one ending. Reports about an action that has ended are ignored.

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
        """Start to connect to the robot.

        Reports `RobotChanged(status="connected")` when goals can be sent, immediately or later, and again whenever that
        changes: `degraded` when some of its parts cannot be used, `lost` when none can. On `lost`, the engine itself
        ends every action as lost.

        :param report: takes all reports of the robot, until `close`.
        """
        ...

    def start(self, goal: StartAction) -> None:
        """Begin an action.

        Reports `ActionReport(status="accepted")` when the robot accepts it, then exactly one ending: `succeeded`,
        `failed` (also if it is refused), `canceled`, `timed-out` or `lost`, with a reason in words unless it succeeded.
        `accepted` may be omitted. `failed` has `aborted=True` if the robot had accepted the action and gave it up
        itself, for example after a protective stop. `canceled` without `cancel` means that another program stopped it.
        Neither is repeated automatically (semantics.md 12.2).

        :param goal: `goal.action` is its name in reports, `<task>/<actionID>`, unique in the session. `goal.type` is
            one of the profile's actions. `goal.parameters` are the author's, by name, typed, without omitted ones, and
            with a `message` in the words that this robot should say (semantics.md 2.5, 2.6). `goal.expected` is how
            many seconds it probably takes. `goal.goal` is a UUID, which stays the same if another engine continues the
            session.
        """
        ...

    def cancel(self, action: str) -> None:
        """Stop one action, even one that was just started. It then reports its ending: `canceled`, or another one that
        came first. The engine waits 5 s (`kernel.act_runner.CANCEL_LIMIT`), and then gives it up.

        The engine also cancels actions that it has ended itself as timed out or lost. One that was not sent must never
        be sent, and one that may still run is stopped.

        :param action: as in `goal.action`. Nothing happens for an action that has ended, or was never started.
        """
        ...

    def stop_all(self) -> None:
        """Stop everything that moves, also actions of others, and report one `StopReport`.

        It names the parts of the robot (`pepper/speech`) that have stopped, and those that may not have, with the
        reason in brackets. The engine waits 3 s (`kernel.stop.STOP_LIMIT`). A repeated call asks the robot again.

        A part counts as confirmed only if the robot has confirmed it. Running actions report their endings as usual.
        Each later change is reported by another `StopReport`.
        """
        ...

    def last_seen(self) -> float | None:
        """When the robot gave its last sign of life.

        :return: session time in seconds; None if that is unknown.
        """
        ...

    def close(self) -> None:
        """Cancel running actions without waiting, and release everything. No reports follow. It may be called
        twice, and without `connect`."""
        ...


@runtime_checkable
class RobotWithOpenGoals(Robot, Protocol):
    """A robot whose adapter knows *open goals*: actions that have ended for the session but may continue, because the
    robot did not answer or refused to stop. `RobotChanged.open` lists them, and their part gets nothing else."""

    def adopt(self, goals: Sequence[StartAction]) -> None:
        """Find out what happened to the goals of an earlier engine. Called once, before `connect`, if a session is
        continued. Goals that may still run are open, and are cancelled only on request.

        :param goals: `goal.goal` is their id from when they were started.
        """
        ...

    def cancel_open_goals(self, part: str) -> None:
        """Ask the robot again to stop the open goals of a part, even if it refused.

        :param part: as `OpenGoal.part`; empty for all.
        """
        ...

    def release_open_goals(self, part: str) -> None:
        """Allow the use of a part again, because a person has checked the robot.

        :param part: as `OpenGoal.part`; empty for all.
        """
        ...


@runtime_checkable
class RobotAmongOthers(Robot, Protocol):
    """A robot that other programs may use and stop, too. What they begin during a stop is stopped until the release."""

    def end_stop(self) -> None:
        """End the stop, because it was released."""
        ...


@runtime_checkable
class RobotWithEstop(Robot, Protocol):
    """A robot whose adapter hears an emergency stop. Without this method, a pressed one stays pressed for the engine
    that continues the session, until the adapter reports its release."""

    def adopt_estop(self, held_by: Sequence[str]) -> None:
        """Treat these emergency stops as pressed until they are released. Called once, before `connect`, if a session
        is continued.

        :param held_by: as `EstopReport.source`.
        """
        ...


class Driver(Protocol):
    """The callable of an entry point in the group `rise.drivers`, usually the adapter's class. Its name in the group is
    the `driver` of a profile.

        [project.entry-points."rise.drivers"]
        lamp = "my_package:make_lamp"

    A function works too. This one refuses options, and otherwise makes the robot that comes with the program:

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

        :param profile: the robot's: `profile.options` is the table `[options]` of its file, `profile.actions` are its
            actions.
        :param clock: the session's, which may run faster than real time.
        :param seed: for all random choices, so that a session can be repeated.
        :param faults: simulated faults, in a form that the driver documents. Only simulated robots take any.
        :return: the robot, not connected yet.
        :raises ValueError: the profile's options or a fault are invalid; with a sentence for people.
        """
        ...
