"""Markers: the events of a session in a few words, for programs that align it with an EEG or a video.

    act/R_Welcome/by-wizard     cue/marked     state/Greeting/Welcome     event/H_arrived     sync/2     stop/latched

They contain names from the scenario and nothing that people said or typed, so they may be sent unencrypted.
docs/reference/markers.md lists them. The live stream (`rise-engine lsl`) and `--format xdf` use the same markers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Literal

import msgspec

from rise_engine.kernel.records import (
    FINAL,
    ActionRecord,
    AnyRecord,
    CueRecord,
    EventRecord,
    MistakeRecord,
    NoteRecord,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    SessionRecord,
    StopRecord,
    SyncRecord,
    TaskRecord,
)
from rise_engine.kernel.speech import SAY
from rise_engine.kernel.task_view import TaskView, add_record
from rise_engine.kernel.view import SessionView
from rise_engine.results.analysis.acts import Request, confirmed_at, first_cause, parts_of, specs_of
from rise_engine.results.analysis.course import records_by_wall_clock
from rise_engine.results.analysis.model import SessionData, SessionFacts, actor_of
from rise_engine.scenario.model import ActionSpec, Scenario

OTHER = "other"
"""Replaces names that are not in the scenario, because a person may have typed them."""
_MOMENTS = {
    "PENDING": "accepted",
    "ACTIVE": "started",
    "SUCCEEDED": "succeeded",
    "ABORTED": "failed",
    "CANCELED": "canceled",
    "REJECTED": "rejected",
}
_TYPED_BY = ("wizard:", "observer:")


class MarkerWords:
    """Converts records to markers. Give it a session's records in their order."""

    def __init__(
        self,
        specs: Mapping[str, ActionSpec],
        is_known: Callable[[Literal["act", "topic"], str], bool] = lambda kind, name: True,
        hide: Callable[[str], str] = str,
    ) -> None:
        """
        :param specs: the actions of the session's robot.
        :param is_known: whether an act or a topic (without its slash) is in the scenario; other names are not shown.
        :param hide: removes private values from other names.
        """
        self._specs = specs
        self._is_known = is_known
        self._hide = hide
        self._tasks: dict[int, TaskView] = {}
        """The acts that have not ended."""
        self._requests: dict[int, Request] = {}
        """All tasks so far, for their causes."""

    def skip_to(self, view: SessionView) -> None:
        """Start in a running session. The events in `view` are past and get no markers."""
        self._tasks = {id: deepcopy(view.tasks[id]) for id in (*view.running, *view.waiting) if id in view.tasks}
        self._requests = dict(view.tasks)

    def words(self, record: AnyRecord) -> tuple[str, ...]:
        """Return the markers of a record. Most kinds have none."""
        if isinstance(record, TaskRecord):
            self._requests.setdefault(record.id, record)
        match record:
            case TaskRecord(function="startCommunicationRobotAct" | "say"):
                return self._task(record)
            case ActionRecord():
                return self._action(record)
            case RuleRecord(status="entered", state=str(state)):
                return (f"state/{record.name}/{state}",)
            case RuleRecord(status="stayed"):
                return ()
            case RuleRecord():
                return (f"rule/{record.name}/{record.status}",)
            case EventRecord():
                return (f"event/{self._name('topic', record.topic.lstrip('/'), record.source)}",)
            case SessionRecord() | StopRecord() | CueRecord() | RobotRecord() | OutcomeRecord():
                return (f"{record.__struct_config__.tag}/{record.status}",)
            case MistakeRecord():
                return (f"mistake/{record.mark}",)
            case SyncRecord():
                return (f"sync/{record.number}",)
            case RecordingRecord(status="started" | "stalled" | "stopped" | "failed"):
                return (f"recording/{record.name}/{record.status}",)
            case NoteRecord():
                return ("note",)
            case _:
                return ()

    def _task(self, record: TaskRecord) -> tuple[str, ...]:
        known = self._tasks.get(record.id)
        before = known.status if known is not None else ""
        add_record(self._tasks, record)
        if record.status in FINAL:
            del self._tasks[record.id]
        elif before == record.status:  # only its place in the queue has changed
            return ()
        name = SAY if record.function == SAY else self._name("act", record.behavior, record.source)
        word = f"act/{name}/{_MOMENTS[record.status]}"
        if record.status != "PENDING":
            return (word,)
        return word, f"act/{name}/by-{actor_of(first_cause(record, self._requests).source)}"

    def _action(self, record: ActionRecord) -> tuple[str, ...]:
        task = self._tasks.get(record.task)
        if task is None:
            return ()
        before = confirmed_at(parts_of(task, self._specs))
        add_record(self._tasks, record)
        after = confirmed_at(parts_of(task, self._specs))
        steps = zip(("robot", "voice"), before, after, strict=True)
        return tuple(f"act/{record.act}/{step}" for step, was, now in steps if was is None and now is not None)

    def _name(self, kind: Literal["act", "topic"], name: str, source: str) -> str:
        if self._is_known(kind, name):
            return name
        return OTHER if source.startswith(_TYPED_BY) else self._hide(name)


def live_words(scenario: Scenario, hide: Callable[[str], str]) -> MarkerWords:
    """Make the converter for a running session of `scenario`. `hide` removes private values from a text."""

    def is_known(kind: Literal["act", "topic"], name: str) -> bool:
        return name in (scenario.acts if kind == "act" else scenario.topics)

    return MarkerWords(specs_of(scenario), is_known, hide)


def recorded_markers(data: SessionData) -> list[tuple[float, str]]:
    """Return the markers of a recorded session in order: wall-clock seconds since its start, and words."""
    words = MarkerWords(specs_of(data.scenario))
    return [(at, each) for at, record in records_by_wall_clock(data) for each in words.words(record)]


def describe_session(facts: SessionFacts) -> dict[str, str]:
    """Return a stream's description of its session, without unknown values."""
    found = {
        "session": facts.session,
        "participant": facts.participant,
        "condition": facts.condition,
        "factors": msgspec.json.encode(facts.factors).decode() if facts.factors else "",
        "study": facts.study,
        "run": str(facts.run or ""),
        "purpose": facts.purpose,
        "outcome": facts.outcome or "",
        "mode": facts.mode,
        "robot": facts.robot,
        "scenario": facts.title,
        "scenario_hash": facts.scenario_hash,
        "version": facts.versions.get("rise-tui", ""),
    }
    return {name: value for name, value in found.items() if value}


def source_id(study: str, session: str) -> str:
    """Return an id of a session's stream that is unique, and the same after a restart of its process."""
    return "/".join(each for each in ("rise", study, session) if each)
