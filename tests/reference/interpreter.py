"""The interpreter as a whole: one input after the other (semantics.md 6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    CheckReport,
    ControlChanged,
    EstopReport,
    Note,
    OutcomeReport,
    RecordingReport,
    RobotChanged,
    SessionEnded,
    SessionRecovered,
    SessionStarted,
    StopReport,
    Submit,
    SyncMark,
)
from rise_engine.scenario.model import Scenario

from .acts import Acts
from .failures import Failures
from .going_on import GoingOn
from .kept import KeptEvents
from .marks import Marks
from .memory import Memory
from .rules import Rules
from .scheduler import Scheduler
from .session import Row, Session
from .standing import Standing
from .stop import Stop
from .tasks import Tasks
from .times import Times


class Interpreter:
    """Runs a scenario."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.session = session = Session(scenario, seed)
        session.tasks = Tasks(session)
        session.acts = Acts(session)
        session.scheduler = Scheduler(session)
        session.rules = Rules(session)
        session.memory = Memory(session)
        session.marks = Marks(session)
        session.stop = Stop(session)
        session.times = Times(session)
        session.kept = KeptEvents(session)
        session.standing = Standing(session)
        session.failures = Failures(session)
        session.going_on = GoingOn(session)

    @property
    def due(self) -> list[float]:
        """When the times that run are over."""
        return sorted(clock.due for clock in self.session.clocks)

    def take(self, input: AnyInput) -> tuple[list[Row], list[tuple[Any, ...]]]:
        """Handle one input with all that it sets off; gives the records and the commands."""
        self._begin(input.t, timer=False)
        session = self.session
        match input:
            case Submit():
                session.origin = len(session.tasks.all) + 1
                session.tasks.submit(input)
            case ActionReport():
                number = input.action.partition("/")[0]
                session.origin = int(number) if number.isascii() and number.isdigit() else None
                session.acts.report(input)
            case RobotChanged():
                session.acts.robot_changed(input)
            case StopReport():
                session.stop.report(input)
            case EstopReport():
                session.stop.emergency(input)
            case SessionStarted():
                self._start(input)
            case ControlChanged():
                session.put("control", status=input.status, by=input.by, holder=input.holder)
                if input.holder is not None:
                    session.scheduler.somebody_has_control()
            case Note():
                session.put("note", text=input.text, source=input.source, stood=None, suspended=False)
            case SessionEnded():
                self._session_record("ended", reason=input.reason, open=session.acts.open)
            case SessionRecovered():
                self._go_on(input)
            case CheckReport() | OutcomeReport() | RecordingReport() | SyncMark():
                self._report(input)
            case _:
                raise NotImplementedError(type(input).__name__)
        return self._finish()

    def let_time_run_out(self, now: float) -> tuple[list[Row], list[tuple[Any, ...]]]:
        """The first of the times that run is over: of several of one moment, the one that began first."""
        clock = min(self.session.clocks, key=lambda each: each.due)
        self._begin(now, timer=True)
        self.session.forget(clock)
        self.session.origin = clock.task
        clock.what()
        return self._finish()

    def _begin(self, now: float, timer: bool) -> None:
        session = self.session
        session.rules.circles.begin(same_go=timer and now == session.now)
        session.now = now
        session.records, session.orders = [], []
        session.pressed = session.origin = None

    def _finish(self) -> tuple[list[Row], list[tuple[Any, ...]]]:
        self.session.standing.update()
        self.session.rules.go()
        while self.session.standing.update():
            self.session.rules.go()
        return self.session.records, self.session.orders

    def _start(self, input: SessionStarted) -> None:
        told = ("participant", "condition", "study", "study_hash", "slot", "run", "attempt", "purpose", "factors")
        self.told = {name: getattr(input, name) for name in (*told, "driver")}
        self.told["injected_faults"] = list(input.injected_faults)
        self.told["speed"] = input.speed
        self._session_record("started")
        self.session.memory.begin()
        self.session.memory.set_by_condition(input.memory, "study" if input.study else "condition")
        self.session.standing.begin(input)

    def _go_on(self, input: SessionRecovered) -> None:
        """Another engine goes on (semantics.md 0.3)."""
        session = self.session
        session.scheduler.waits_for_wizard |= input.waits_for_wizard
        self._session_record("recovered", input.reason, input.downtime)
        session.acts.give_up()
        session.marks.nothing_by_itself()
        session.stop.ask_again()

    def _report(self, input: CheckReport | OutcomeReport | RecordingReport | SyncMark) -> None:
        """Reports leave their one record as they are given."""
        fields = msgspec.to_builtins(input)
        del fields["t"]
        self.session.put(fields.pop("input"), **fields)

    def _session_record(
        self, status: str, reason: str = "", downtime: float | None = None, open: Sequence[Any] = ()
    ) -> None:
        scenario = self.session.scenario
        self.session.put(
            "session",
            status=status,
            scenario=scenario.title,
            scenario_hash=scenario.hash,
            mode=scenario.mode,
            robot=scenario.robot.name,
            seed=self.session.seed,
            versions={},
            reason=reason,
            downtime=downtime,
            waits_for_wizard=status == "recovered" and self.session.scheduler.waits_for_wizard,
            open=list(open),
            language=scenario.language,
            **self.told,
        )
