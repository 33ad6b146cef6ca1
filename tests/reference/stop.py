"""Stop-all and its release (semantics.md 9.1)."""

from __future__ import annotations

from rise_engine.kernel.inputs import StopReport

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
        self._record(source=task.source)
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
        """Another engine goes on: the answer went to the one that has gone."""
        if self.status == "requested":
            self.session.order("stop robot")
            self.session.forget(self.clock)
            self.clock = self.session.after(ANSWER, self._no_answer)

    def _no_answer(self) -> None:
        self.clock = None
        self.status = "latched"
        self._record(unconfirmed=[self.session.scenario.robot.name])

    def report(self, input: StopReport) -> None:
        """The robot's answer."""
        if self.status:
            self.session.forget(self.clock)
            self.clock = None
            self.status = "latched"
            self._record(
                confirmed=list(input.confirmed),
                unconfirmed=list(input.unconfirmed),
                unstoppable=list(input.unstoppable),
            )

    def release(self, task: Task) -> None:
        """Things may start again."""
        if self.status == "":
            raise Refused("nothing is stopped")
        if self.status == "requested":
            raise Refused("the robot has not answered yet")
        words = self.session.going_on.read_release(task.behavior)
        self.session.tasks.record(task, "SUCCEEDED")
        self.status = ""
        self.session.put("stop", status="released", confirmed=[], unconfirmed=[], source=task.source, unstoppable=[])
        self.session.going_on.released(words, task.source)

    def _record(self, source: str = "", **parts: list[str]) -> None:
        told = {"confirmed": [], "unconfirmed": [], "unstoppable": [], **parts}
        self.session.put("stop", status=self.status, source=source, **told)
