"""Events that no rule waited for and that are kept for a while (semantics.md 6.6)."""

from __future__ import annotations

from collections.abc import Container

from msgspec import Struct

from rise_engine.kernel.core import Cause, Core, EventTopic, Task, TimerTarget
from rise_engine.kernel.records import EventRecord, KeptRecord, KeptStatus, TaskStatus

KEPT_OFFER = EventTopic("kept")
"""Stands in the queue for a kept event that is offered to the rules, together with its task's number."""


class KeptEvent(Struct):
    """An event, and how long it is kept."""

    task: Task
    topic: str
    """Without its slash."""
    timer: int
    """The timer of its expiry."""
    until: float
    """Session time of its expiry."""
    is_offered: bool = True
    """Whether it is in the queue, to be offered to the rules."""
    is_recorded: bool = False
    """Whether a record says that it is kept."""


class KeptEvents(dict[int, KeptEvent]):
    """The kept events by task, oldest first. Each ends once: taken, expired or taken back."""

    def __init__(self, core: Core) -> None:
        super().__init__()
        self._core = core

    def keep(self, task: Task, topic: str, seconds: float) -> None:
        """Raise an event (without slash), and keep it if no rule waits for it. It replaces an older one of its name."""
        core = self._core
        core.record_task(task)  # first, because the first record answers the submitter
        for other in [kept for kept in self.values() if kept.topic == topic]:
            self.take_back(other, "raised again")
        timer = core.set_timer(seconds, TimerTarget("keep", str(task.id)))
        self[task.id] = KeptEvent(task, topic, timer, round(core.t + seconds, 6))
        core.events.append((KEPT_OFFER, str(task.id), core.cause))

    def offer(self, topics: Container[EventTopic | None], cause: Cause) -> None:
        """Raise the kept events again that a rule now waits for, after the events in the queue."""
        core = self._core
        for kept in self.values():
            if not kept.is_offered and core.topics.get(kept.topic) in topics:
                kept.is_offered = True
                core.events.append((KEPT_OFFER, str(kept.task.id), cause))

    def stay(self, kept: KeptEvent) -> None:
        """Keep an event that no rule waits for now."""
        kept.is_offered = False
        if not kept.is_recorded:
            kept.is_recorded = True
            core = self._core
            core.emit(KeptRecord, kept.task.id, "/" + kept.topic, "kept", round(kept.until - core.t, 6))

    def take(self, kept: KeptEvent, rule: str) -> None:
        """Give an event to a rule."""
        self._finish(kept, "taken", "SUCCEEDED", f"taken by {rule}" if kept.is_recorded else "", rule)
        self._core.emit(EventRecord, "/" + kept.topic, kept.task.source, rule)

    def expire(self, kept: KeptEvent, reason: str) -> None:
        """End an event that no rule has taken."""
        self._finish(kept, "expired", "CANCELED", reason)
        self._core.emit(EventRecord, "/" + kept.topic, kept.task.source, None)

    def take_back(self, kept: KeptEvent, reason: str) -> None:
        """Withdraw an event, so that no rule can take it."""
        self._finish(kept, "taken-back", "CANCELED", reason)

    def take_all_back(self, reason: str) -> None:
        for kept in list(self.values()):
            self.take_back(kept, reason)

    def _finish(
        self, kept: KeptEvent, how: KeptStatus, status: TaskStatus, reason: str, rule: str | None = None
    ) -> None:
        core = self._core
        del self[kept.task.id]
        core.cancel_timer(kept.timer)
        if kept.is_recorded:
            core.emit(KeptRecord, kept.task.id, "/" + kept.topic, how, rule=rule)
        kept.task.status = status
        core.record_task(kept.task, reason)
