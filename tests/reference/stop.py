"""Stop-all and its release (semantics.md 9.1)."""

from __future__ import annotations

from rise_engine.kernel.inputs import EstopReport, StopReport

from .session import Clock, Session
from .tasks import Refused, Task

ANSWER = 3.0
"""Seconds that the robot has for its answer."""


class Stop:
    """Whether a stop is in force."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.status = ""
        """Empty, requested or latched."""
        self.clock: Clock | None = None
        self.pressed: list[str] = []
        """The emergency stops that are pressed."""
        self.stops = 0
        """How often everything was stopped."""

    @property
    def in_force(self) -> bool:
        return self.status != ""

    def refuse_if_stopped(self) -> None:
        """Nothing starts until the stop is released."""
        if self.in_force:
            raise Refused("everything is stopped")

    def stop_all(self, task: Task) -> None:
        """Stop everything."""
        session = self.session
        session.tasks.record(task, "SUCCEEDED")
        self.status = "requested"
        self.stops += 1
        self._record("requested", source=task.source)
        session.forget(self.clock)
        self.clock = session.after(ANSWER, self._no_answer)
        why = f"stop-all by {task.source}"
        session.marks.nothing_by_itself()
        session.failures.drop_all()
        session.going_on.stop_all()
        session.rules.stop_all(why)
        for kept in list(session.kept.all):
            session.kept.take_back(kept, why)
        session.scheduler.stop_all(why)
        session.order("stop robot")

    def ask_again(self) -> None:
        """Another engine goes on: the answers went to the one that has gone."""
        if self.status:
            self.session.order("stop robot")
        if self.status == "latched":
            self._no_answer()
        elif self.status:
            self.session.forget(self.clock)
            self.clock = self.session.after(ANSWER, self._no_answer)

    def _no_answer(self) -> None:
        self.clock = None
        self.status = "latched"
        self._record("latched", unconfirmed=[self.session.scenario.robot.name])

    def report(self, input: StopReport) -> None:
        """The robot's answer."""
        if self.status:
            self.session.forget(self.clock)
            self.clock = None
            self.status = "latched"
            self._record(
                "latched",
                confirmed=list(input.confirmed),
                unconfirmed=list(input.unconfirmed),
                unstoppable=list(input.unstoppable),
            )

    def emergency(self, input: EstopReport) -> None:
        """An emergency stop says how it is."""
        if input.pressed and input.source not in self.pressed:
            self.pressed.append(input.source)
            self.session.tasks.new("stopAll", source=input.source)
        elif not input.pressed and input.source in self.pressed:
            self.pressed.remove(input.source)
            self._record("let-go", source=input.source)

    def release(self, task: Task) -> None:
        """Things may start again."""
        if self.status == "":
            raise Refused("nothing is stopped")
        if self.pressed:
            raise Refused("an emergency stop is pressed")
        if self.status == "requested":
            raise Refused("the robot has not answered yet")
        words = self.session.going_on.read_release(task.behavior, self.stops)
        self.session.tasks.record(task, "SUCCEEDED")
        self.status = ""
        self._record("released", source=task.source)
        self.session.going_on.released(words, task)

    def _record(self, status: str, source: str = "", **parts: list[str]) -> None:
        told = {"confirmed": [], "unconfirmed": [], "unstoppable": [], "held_by": list(self.pressed), **parts}
        self.session.put("stop", status=status, source=source, **told)
