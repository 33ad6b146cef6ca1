"""Events that are kept (semantics.md 6.6)."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rise_engine.scenario.model import normal_topic

from .session import Clock, Session
from .tasks import Refused, Task

if TYPE_CHECKING:
    from .rules import Run

UNITS = {"ms": 0.001, "s": 1.0, "min": 60.0}


@dataclass(eq=False)
class Kept:
    """An event that was raised with `keep`."""

    task: Task
    topic: str
    until: float
    clock: Clock | None = None
    is_raised: bool = True
    """Whether its turn is still to come."""
    is_kept: bool = False
    """Whether it was said that it is."""


def read_event(behavior: str) -> tuple[str, float | None]:
    """The name in a task's behaviour, and for how long the event is kept."""
    if not behavior.strip().startswith("{"):
        return normal_topic(behavior), None
    try:
        written = json.loads(behavior)
    except ValueError:
        raise Refused("this is no JSON") from None
    if set(written) - {"event", "keep"} or not isinstance(written.get("event"), str):
        raise Refused("write event and keep")
    if "keep" not in written:
        return normal_topic(written["event"]), None
    time = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(ms|s|min)\s*", str(written["keep"]), re.ASCII)
    if time is None or not 0.001 <= float(time[1]) * UNITS[time[2]] <= 86_400:
        raise Refused("keep is no time")
    return normal_topic(written["event"]), float(time[1]) * UNITS[time[2]]


class KeptEvents:
    """All that wait to be taken."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.all: list[Kept] = []

    def read(self, behavior: str) -> tuple[str, float | None]:
        """The name in a task's behaviour, and for how long the event is kept."""
        return read_event(behavior)

    def raise_event(self, task: Task, topic: str, seconds: float) -> None:
        """Raise an event that is to be kept; an older one of its name ends."""
        session = self.session
        session.tasks.find_cause(task)
        session.tasks.record(task, "PENDING")
        for other in list(self.all):
            if other.topic == topic:
                self.take_back(other, "raised again")
        kept = Kept(task, topic, round(session.now + seconds, 6))
        kept.clock = session.after(seconds, lambda: self._expire(kept), task.id)
        self.all.append(kept)
        session.rules.raise_event(topic, task.source, kept)

    def state_entered(self, run: Run) -> None:
        """A rule has come into a state: what it waits for is raised anew."""
        for kept in list(self.all):
            if not kept.is_raised and any(way.event == kept.topic for way in run.state.transitions):
                kept.is_raised = True
                self.session.rules.raise_event(kept.topic, kept.task.source, kept)

    def taken(self, kept: Kept, rule: str) -> None:
        """A rule takes it."""
        self._end(kept, "taken", "SUCCEEDED", rule, f"taken by {rule}" if kept.is_kept else "")

    def not_taken(self, kept: Kept) -> None:
        """Its turn has come, and nobody has taken it."""
        kept.is_raised = False
        if kept.topic not in self.session.scenario.topics:
            self._expire(kept)
        elif not kept.is_kept:
            kept.is_kept = True
            seconds = round(kept.until - self.session.now, 6)
            self._record(kept, "kept", seconds=seconds)

    def take_back(self, kept: Kept, why: str) -> None:
        """Somebody has taken it back."""
        self._end(kept, "taken-back", "CANCELED", None, why)

    def of(self, task: Task) -> Kept | None:
        """The event that a task has raised."""
        return next((kept for kept in self.all if kept.task is task), None)

    def _expire(self, kept: Kept) -> None:
        self._end(kept, "expired", "CANCELED", None, "nobody waited for it")
        self.session.put("event", topic=f"/{kept.topic}", source=kept.task.source, taken_by=None)

    def _end(self, kept: Kept, status: str, task: str, rule: str | None, why: str = "") -> None:
        self.all.remove(kept)
        self.session.forget(kept.clock)
        if kept.is_kept:
            self._record(kept, status, rule=rule)
        self.session.tasks.record(kept.task, task, why)

    def _record(self, kept: Kept, status: str, seconds: float | None = None, rule: str | None = None) -> None:
        self.session.put("kept", task=kept.task.id, topic=f"/{kept.topic}", status=status, seconds=seconds, rule=rule)
