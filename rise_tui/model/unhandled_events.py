"""Events that nobody was waiting for, and whose doing they were. Knows no screen."""

from __future__ import annotations

from rise_engine.kernel.records import ENGINE, EventRecord, TaskRecord
from rise_engine.kernel.view import SessionView, TaskView
from rise_engine.scenario.model import CUE_TOPICS, normal_topic
from rise_tui.model.notice import Notice

JUST_STARTED_SECONDS = 1.0
"""Seconds after its start in which what a rule does counts as the deed of the wizard who started it."""


class UnhandledEvents:
    """Follows each raised event until its own record tells what became of it."""

    def __init__(self, unhandled: list[int]) -> None:
        """`unhandled` gets the tasks whose event nobody took, in the order in which that comes out."""
        self._unhandled = unhandled
        self._raised: dict[tuple[str, str], list[int]] = {}

    def clear(self) -> None:
        self._raised.clear()

    def expect(self, record: TaskRecord | TaskView) -> None:
        """A task has raised its event, or what it has kept comes to its end."""
        self._raised.setdefault((normal_topic(record.behavior), record.source), []).append(record.id)

    def expect_cue(self, record: TaskRecord) -> None:
        """A task has marked the participant's cue, for which rules of this scenario wait; it is not kept."""
        self._raised.setdefault((CUE_TOPICS[0], ENGINE), []).append(record.id)

    def record_outcome(self, record: EventRecord, view: SessionView) -> Notice | None:
        """An event found its rule, or nobody; what to tell the wizard about it."""
        event = topic, source = normal_topic(record.topic), record.source
        ids = self._raised.get(event, [])
        task = ids.pop(0) if ids else None
        if not ids:
            self._raised.pop(event, None)
        if record.taken_by is not None:
            return None
        if task is not None:
            self._unhandled.append(task)
        if source == ENGINE and topic == CUE_TOPICS[0]:
            is_by_wizard = view.cue is not None and view.cue.source.startswith("wizard:")
        else:
            is_by_wizard = _is_by_wizard(record, view)
        return Notice(f"{record.topic}: nobody was waiting for it", "wait") if is_by_wizard else None


def _is_by_wizard(record: EventRecord, view: SessionView) -> bool:
    """Whether a wizard raised it: directly, or by a rule that a wizard has just started."""
    kind, _, name = record.source.partition(":")
    if kind != "rule":
        return kind == "wizard"
    rule = view.rules.get(name)
    task = view.tasks.get(rule.task or 0) if rule is not None else None
    if task is None or not task.source.startswith("wizard:"):
        return False
    return record.t - (task.started if task.started is not None else task.submitted) <= JUST_STARTED_SECONDS
