"""The simulated robot: believable durations, deterministic, and with faults on request (see `faults`).

Options of a profile (`[options]`), all optional: `latency`, seconds until a goal is accepted (0.02); `stopping`,
seconds until a cancel is confirmed (0.05); `variation`, the random variation of durations as a fraction (0, at most
0.5). The same seed and the same goals in the same order give the same durations.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from random import Random
from typing import Any, Literal

from msgspec import Struct

from rise_adapters.simulated.faults import ActionFault, FaultKind, LinkFault, parse_fault
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from rise_engine.kernel.records import OpenGoal, describe_open_goals
from rise_engine.ports.robot import Clock, ReportCallback, Timer
from rise_engine.scenario.model import ActionSpec, RobotProfile

_OPTIONS = {"latency": (0.02, 60.0), "stopping": (0.05, 60.0), "variation": (0.0, 0.5)}
"""Default and largest value by name."""
_TICK = 0.001
"""Seconds between two reports about one goal, so that their order never depends on a tie."""
_CANCEL_SECONDS = 4.0
"""Seconds for a goal to stop. Then its action ends, and the goal is open. A robot on ROS 2 has the same."""
_HELD_SECONDS = 5.0
"""Seconds that a new action waits for a held part. A robot on ROS 2 has the same."""


class _SimulatedGoal(Struct):
    """One running goal."""

    type: str
    fault: ActionFault | None
    timers: list[Timer] = []
    canceling: bool = False
    begun: bool = False
    accepted: bool = False

    def has_fault(self, *kinds: FaultKind) -> bool:
        return self.fault is not None and self.fault.kind in kinds

    def drop_timers(self) -> None:
        for timer in self.timers:
            timer.cancel()
        self.timers.clear()


class SimulatedRobot:
    """Implements `rise_engine.ports.robot.RobotWithOpenGoals`; the class itself is the `Driver`."""

    def __init__(self, profile: RobotProfile, clock: Clock, seed: int, faults: tuple[str, ...] = ()) -> None:
        """Raises ValueError with a sentence for an invalid option or fault."""
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
        self._links_down: list[str] = []
        """Why nothing reaches the robot, one entry for each fault that cut it off."""
        self._inactive = ""
        """Why it accepts nothing; empty: it accepts goals."""
        self._report: ReportCallback = _ignore
        self._timers: list[Timer] = []
        self._last_seen: float | None = None
        self._parts = {
            action: {f"{profile.name}/{channel}" for channel in spec.channels}
            for action, spec in profile.actions.items()
            if spec.supported and not spec.engine and not _carrier_without_stop(spec)
        }
        """The parts of each action that confirm a stop, one for each of its channels: `pepper/speech`."""
        self._open: dict[str, OpenGoal] = {}
        """Open goals by the action's name."""
        self._stop_report: StopReport | None = None
        """The last answer to a stop, while it is not fully confirmed. Another answer follows each change."""

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
        self._report_state()

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
        if self._holding_part(goal.type):
            running.timers.append(self._call_after(_HELD_SECONDS, self._begin_if_free, goal.action, seconds))
        else:
            self._begin(goal.action, running, seconds)

    def _begin_if_free(self, action: str, seconds: float) -> None:
        """Begin a goal whose part was held at its start, if the part is free now."""
        goal = self._goals[action]
        if holding := self._holding_part(goal.type):
            reason = f"held: {describe_open_goals([holding])}"
            self._end(ActionReport(action=action, status="failed", reason=reason))
        else:
            self._begin(action, goal, seconds)

    def _begin(self, action: str, running: _SimulatedGoal, seconds: float) -> None:
        for each in [name for name, goal in self._open.items() if goal.type == running.type and not goal.holds]:
            self._close(each)  # replaces the last publication there
        running.begun = True
        fault = running.fault
        amount = (fault.amount if fault is not None else None) or 0.0
        accepting = self._latency + (amount if running.has_fault("slow-accept", "slow-reject") else 0.0)
        if running.has_fault("die-on-goal"):
            running.timers.append(self._call_after(self._latency, self._die, amount))
            return
        if running.has_fault("reject", "slow-reject") or self._inactive:
            refusal = f"the robot {'is inactive' if self._inactive else 'refused it'} (simulated fault)"
            ending = ActionReport(action=action, status="failed", reason=refusal)
            running.timers.append(self._call_after(accepting, self._end, ending))
            return
        if not running.has_fault("lost-accept"):
            running.timers.append(self._call_after(accepting, self._accept, action))
        if running.has_fault("hang"):
            return
        ending = ActionReport(action=action, status="succeeded")
        if running.has_fault("slow"):
            seconds *= amount
        elif running.has_fault("slow-accept", "late-begin"):
            seconds += amount
        elif running.has_fault("fail", "abort"):
            seconds /= 2
            aborted = running.has_fault("abort")
            mishap = f"{'the robot gave it up' if aborted else 'it went wrong on the robot'} (simulated fault)"
            ending = ActionReport(action=action, status="failed", reason=mishap, aborted=aborted)
        running.timers.append(self._call_after(max(seconds, accepting + _TICK), self._end, ending))

    def cancel(self, action: str) -> None:
        goal = self._goals.get(action)
        if goal is None or goal.canceling:
            return
        if goal.has_fault("hang", "refuse-cancel", "ignore-cancel"):
            goal.canceling = True
            self._timers.append(self._call_after(_CANCEL_SECONDS, self._give_up, action))
            return
        if goal.begun and self._carrier_without_stop(goal.type) == "service":
            goal.canceling = True
            self._leave_open(action, goal, "nothing stops a call", ActionReport(action=action, status="canceled"))
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
        self._stop_report = None
        # After the cancels that it causes or finds in progress, so that the answer is still true.
        self._timers.append(self._call_after(self._stopping + _TICK, self._report_stop))

    def adopt(self, goals: Sequence[StartAction]) -> None:
        """Do nothing: this robot ends with its engine."""

    def cancel_open_goals(self, part: str) -> None:
        """Do nothing: goals that did not stop do not stop now."""

    def release_open_goals(self, part: str) -> None:
        for action in [action for action, goal in self._open.items() if part in ("", goal.part)]:
            if action in self._goals:
                self._goals.pop(action).drop_timers()
            self._close(action)

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

    # --- later events -------------------------------------------------------------------------------------------

    def _call_after(self, seconds: float, callback: Callable[..., None], *args: Any) -> Timer:
        return self._clock.call_at(self._clock.now() + seconds, partial(callback, *args))

    def _accept(self, action: str) -> None:
        if action in self._goals:
            self._goals[action].accepted = True
        self._report(ActionReport(action=action, status="accepted"))

    def _end(self, ending: ActionReport) -> None:
        """End a goal on the robot."""
        goal = self._goals.pop(ending.action, None)
        if ending.action in self._open:
            self._close(ending.action)
        elif goal is not None and goal.accepted and self._carrier_without_stop(goal.type) == "topic":
            self._leave_open(ending.action, goal, "its topic cannot be stopped", ending, holds=False)
        else:
            self._report(ending)
        self._repeat_stop_report()

    def _repeat_stop_report(self) -> None:
        """Report a stop again if anything changed since it was not fully confirmed."""
        if self._stop_report is not None:
            self._report_stop(before=self._stop_report)

    def _report_stop(self, before: StopReport | None = None) -> None:
        parts = set().union(*self._parts.values())
        busy = {part for goal in self._goals.values() if goal.begun for part in self._parts.get(goal.type, ())}
        silent = parts if self._links_down else busy
        by_reset = (its for action, its in self._parts.items() if "reset" in self._profile.actions[action].carrier)
        unanswered = set().union(*by_reset) - silent
        answer = StopReport(
            confirmed=tuple(sorted(parts - silent - unanswered)),
            unconfirmed=tuple(
                sorted([*silent, *(f"{part} (told to stop; a topic gives no answer)" for part in unanswered)])
            ),
            unstoppable=self._parts_without_stop(),
        )
        self._stop_report = answer if silent else None
        if answer != before:
            self._report(answer)

    def _parts_without_stop(self) -> tuple[str, ...]:
        """Topics, and busy services."""
        busy = {goal.type for goal in self._goals.values() if goal.begun}
        kinds = {type: self._carrier_without_stop(type) for type in self._profile.actions}
        found = [type for type, kind in kinds.items() if kind == "topic" or (kind == "service" and type in busy)]
        return tuple(sorted(f"{self._profile.name}/{type}" for type in found))

    def _carrier_without_stop(self, type: str) -> str:
        return _carrier_without_stop(self._profile.actions[type])

    # --- open goals ---------------------------------------------------------------------------------------------

    def _give_up(self, action: str) -> None:
        """End the action of a goal that did not stop in time, and hold its part."""
        goal = self._goals.get(action)
        if goal is None:
            return
        if goal.has_fault("refuse-cancel"):
            ending = ActionReport(action=action, status="failed", reason="cancel-refused: the robot goes on with it")
            self._leave_open(action, goal, "it refused to stop", ending)
        else:
            ending = ActionReport(action=action, status="lost", reason="cancel-unanswered: the robot did not answer")
            self._leave_open(action, goal, "it has not ended yet", ending)

    def _leave_open(
        self, action: str, goal: _SimulatedGoal, reason: str, ending: ActionReport, *, holds: bool = True
    ) -> None:
        """Leave a goal open. This is reported before the end of its action."""
        parts = sorted(self._parts.get(goal.type, ())) or [f"{self._profile.name}/{goal.type}"]
        part = "+".join([parts[0], *(each.rpartition("/")[2] for each in parts[1:])])
        self._open[action] = OpenGoal(part, action, goal.type, reason, holds, goal.accepted)
        self._report_state()
        self._report(ending)

    def _close(self, action: str) -> None:
        del self._open[action]
        self._report_state()

    def _holding_part(self, type: str) -> OpenGoal | None:
        """The open goal that holds a part which such an action needs."""
        needed = self._parts.get(type, set())
        held = (goal for goal in self._open.values() if goal.holds and needed & self._parts.get(goal.type, set()))
        return next(held, None)

    def _report_state(self) -> None:
        status: Literal["connected", "degraded", "lost"]
        if self._links_down:
            status, detail = "lost", self._links_down[-1]
        elif any(goal.holds for goal in self._open.values()):
            status, detail = "degraded", describe_open_goals(self._open.values())
        elif self._inactive:
            status, detail = "degraded", self._inactive
        else:
            status, detail = "connected", self._describe_link()
        self._report(RobotChanged(status=status, detail=detail, open=tuple(self._open.values())))

    def _die(self, seconds: float) -> None:
        """End the robot's program for `seconds`; 0: permanently."""
        self._cut_link("the robot's program ended (simulated fault)")
        if seconds:
            self._timers.append(self._call_after(seconds, self._restore_link))

    def _deactivate(self, why: str) -> None:
        self._inactive = why
        self._report_state()

    def _activate(self) -> None:
        self._inactive = ""
        self._report_state()

    def _cut_link(self, why: str) -> None:
        self._links_down.append(why)
        for goal in self._goals.values():
            goal.drop_timers()
        self._goals.clear()
        self._open.clear()
        self._report_state()

    def _restore_link(self) -> None:
        self._links_down.pop()
        if not self._links_down:
            self._report_state()
            self._repeat_stop_report()

    def _next_fault(self, action: str) -> ActionFault | None:
        count = self._counts[action]
        return next((fault for fault in self._faults if fault.applies_to(action, count)), None)

    def _describe_link(self) -> str:
        return f"simulated {self._profile.title}: nothing leaves this machine"


def _carrier_without_stop(spec: ActionSpec) -> Literal["", "service", "topic"]:
    """The kind of carrier of an action that nothing can stop (docs/reference/robots.md). Empty: something can, the
    profile declares it safe, or the robot does not have the action."""
    carrier = spec.carrier
    if not spec.supported or spec.engine or carrier.get("unstoppable") is True:
        return ""
    if "service" in carrier:
        return "service"
    return "topic" if "topic" in carrier and "reset" not in carrier else ""


def _read_options(profile: RobotProfile) -> dict[str, float]:
    values = {}
    simulated = profile.driver == "simulated"
    for name, (default, largest) in _OPTIONS.items():
        # In debug mode this robot replaces one with another driver, whose options do not apply here.
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
    """Do nothing: no report is possible before `connect` and after `close`."""
