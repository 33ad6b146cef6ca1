"""The simulated robot: believable durations, deterministic, and wrong on request (see `faults`).

Options of a profile (`[options]`), all optional: `latency` seconds until a goal is accepted (0.02), `stopping` seconds
until a cancel is confirmed (0.05), `variation` how much durations vary at random, as a part of them (0, at most 0.5).
The same seed and the same goals in the same order give the same durations.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from random import Random
from typing import Any

from msgspec import Struct

from rise_adapters.simulated.faults import ActionFault, FaultKind, LinkFault, parse_fault
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from rise_engine.ports.robot import Clock, ReportCallback, Timer
from rise_engine.scenario.model import RobotProfile

_OPTIONS = {"latency": (0.02, 60.0), "stopping": (0.05, 60.0), "variation": (0.0, 0.5)}
"""Name -> default, largest value."""
_TICK = 0.001
"""Seconds that keep two reports about one goal apart, so that their order never depends on a tie."""


class _SimulatedGoal(Struct):
    """One goal that runs."""

    type: str
    fault: ActionFault | None
    timers: list[Timer] = []
    canceling: bool = False

    def has_fault(self, *kinds: FaultKind) -> bool:
        return self.fault is not None and self.fault.kind in kinds

    def drop_timers(self) -> None:
        for timer in self.timers:
            timer.cancel()
        self.timers.clear()


class SimulatedRobot:
    """Implements `rise_engine.ports.robot.Robot`; the class itself is the `Driver`."""

    def __init__(self, profile: RobotProfile, clock: Clock, seed: int, faults: tuple[str, ...] = ()) -> None:
        """Raises ValueError with a sentence when an option or a fault cannot be understood."""
        options = _read_options(profile)
        self._latency, self._stopping = options["latency"], options["stopping"]
        self._variation = options["variation"]
        self._profile = profile
        self._clock = clock
        self._random = Random(seed)
        parsed = [parse_fault(text, profile) for text in faults]
        self._faults = [fault for fault in parsed if isinstance(fault, ActionFault)]
        self._vanishes = [fault for fault in parsed if isinstance(fault, LinkFault)]
        self._goals: dict[str, _SimulatedGoal] = {}
        self._counts: Counter[str] = Counter()
        self._links_down = 0
        self._inactive = False
        self._report: ReportCallback = _ignore
        self._timers: list[Timer] = []
        self._last_seen: float | None = None
        self._parts = {
            action: {f"{profile.name}/{channel}" for channel in spec.channels}
            for action, spec in profile.actions.items()
            if spec.supported and not spec.engine
        }
        """By action, what confirms a stop, one part for each channel that it uses: `pepper/speech`."""

    # --- the port -----------------------------------------------------------------------------------------------

    def connect(self, report: ReportCallback) -> None:
        self._report = report
        for vanish in self._vanishes:
            is_cut = vanish.kind == "vanish"
            why = f"{'the link was cut' if is_cut else 'the robot became inactive'} at {vanish.at:g} s"
            down, up = (self._cut_link, self._restore_link) if is_cut else (self._deactivate, self._activate)
            self._timers.append(self._clock.call_at(vanish.at, partial(down, f"{why} (simulated fault)")))
            if vanish.back is not None:
                self._timers.append(self._clock.call_at(vanish.back, up))
        report(RobotChanged(status="connected", detail=self._describe_link()))

    def start(self, goal: StartAction) -> None:
        self._counts[goal.type] += 1
        fault = self._next_fault(goal.type)
        seconds = goal.expected
        if self._variation:
            seconds *= 1 + self._random.uniform(-self._variation, self._variation)
        if self._links_down:
            failure = ActionReport(action=goal.action, status="failed", reason="the robot cannot be reached")
            self._call_after(self._latency, self._end, failure)
            return
        running = self._goals[goal.action] = _SimulatedGoal(goal.type, fault)
        amount = (fault.amount if fault is not None else None) or 0.0
        accepting = self._latency + (amount if running.has_fault("slow-accept", "slow-reject") else 0.0)
        if running.has_fault("die-on-goal"):
            running.timers.append(self._call_after(self._latency, self._die, amount))
            return
        if running.has_fault("reject", "slow-reject") or self._inactive:
            refusal = f"the robot {'is inactive' if self._inactive else 'refused it'} (simulated fault)"
            ending = ActionReport(action=goal.action, status="failed", reason=refusal)
            running.timers.append(self._call_after(accepting, self._end, ending))
            return
        if not running.has_fault("lost-accept"):
            running.timers.append(self._call_after(accepting, self._accept, goal.action))
        if running.has_fault("hang"):
            return
        ending = ActionReport(action=goal.action, status="succeeded")
        if running.has_fault("slow"):
            seconds *= amount
        elif running.has_fault("slow-accept", "late-begin"):
            seconds += amount
        elif running.has_fault("fail", "abort"):
            seconds /= 2
            aborted = running.has_fault("abort")
            mishap = f"{'the robot gave it up' if aborted else 'it went wrong on the robot'} (simulated fault)"
            ending = ActionReport(action=goal.action, status="failed", reason=mishap, aborted=aborted)
        running.timers.append(self._call_after(max(seconds, accepting + _TICK), self._end, ending))

    def cancel(self, action: str) -> None:
        goal = self._goals.get(action)
        if goal is None or goal.canceling or goal.has_fault("hang", "refuse-cancel", "ignore-cancel"):
            return
        amount = (goal.fault.amount if goal.fault is not None else None) or 0.0
        if goal.has_fault("die-on-cancel"):
            goal.canceling = True
            goal.timers.append(self._call_after(self._latency, self._die, amount))
            return
        goal.canceling = True
        goal.drop_timers()
        stopping = self._stopping + (amount if goal.has_fault("slow-cancel") else 0.0)
        goal.timers.append(self._call_after(stopping, self._end, ActionReport(action=action, status="canceled")))

    def stop_all(self) -> None:
        for action in tuple(self._goals):
            self.cancel(action)
        # After the cancels that it causes or finds under way, so that the answer is true when it is given.
        self._timers.append(self._call_after(self._stopping + _TICK, self._report_stop))

    def last_seen(self) -> float | None:
        if not self._links_down:
            self._last_seen = self._clock.now()
        return self._last_seen

    def close(self) -> None:
        self._report = _ignore
        for goal in self._goals.values():
            goal.drop_timers()
        self._goals.clear()
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()

    # --- what happens later -------------------------------------------------------------------------------------

    def _call_after(self, seconds: float, callback: Callable[..., None], *args: Any) -> Timer:
        return self._clock.call_at(self._clock.now() + seconds, partial(callback, *args))

    def _accept(self, action: str) -> None:
        self._report(ActionReport(action=action, status="accepted"))

    def _end(self, ending: ActionReport) -> None:
        self._goals.pop(ending.action, None)
        self._report(ending)

    def _report_stop(self) -> None:
        parts = set().union(*self._parts.values())
        busy = set().union(*(self._parts.get(goal.type, ()) for goal in self._goals.values()))
        silent = parts if self._links_down else busy
        self._report(StopReport(confirmed=tuple(sorted(parts - silent)), unconfirmed=tuple(sorted(silent))))

    def _die(self, seconds: float) -> None:
        """The robot's program ends, for so many seconds; 0: for good."""
        self._cut_link("the robot's program ended (simulated fault)")
        if seconds:
            self._timers.append(self._call_after(seconds, self._restore_link))

    def _deactivate(self, why: str) -> None:
        self._inactive = True
        self._report(RobotChanged(status="degraded", detail=why))

    def _activate(self) -> None:
        self._inactive = False
        self._report(RobotChanged(status="connected", detail=self._describe_link()))

    def _cut_link(self, why: str) -> None:
        self._links_down += 1
        for goal in self._goals.values():
            goal.drop_timers()
        self._goals.clear()
        self._report(RobotChanged(status="lost", detail=why))

    def _restore_link(self) -> None:
        self._links_down -= 1
        if not self._links_down:
            self._report(RobotChanged(status="connected", detail=self._describe_link()))

    def _next_fault(self, action: str) -> ActionFault | None:
        count = self._counts[action]
        return next((fault for fault in self._faults if fault.applies_to(action, count)), None)

    def _describe_link(self) -> str:
        return f"simulated {self._profile.title}: nothing leaves this machine"


def _read_options(profile: RobotProfile) -> dict[str, float]:
    values = {}
    simulated = profile.driver == "simulated"
    for name, (default, largest) in _OPTIONS.items():
        # In debug mode this robot stands in for one with another driver, whose options are none of ours.
        value = profile.options.get(name, default) if simulated else default
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= largest:
            raise ValueError(f"the robot profile {profile.name!r}: {name} must be a number from 0 to {largest:g}")
        values[name] = float(value)
    unknown = [name for name in profile.options if name not in _OPTIONS] if simulated else []
    if unknown:
        raise ValueError(
            f"the robot profile {profile.name!r}: the simulated driver has no option {unknown[0]!r}; "
            f"it has {', '.join(_OPTIONS)}"
        )
    return values


def _ignore(report: object) -> None:
    """Nobody listens before `connect` and after `close`."""
