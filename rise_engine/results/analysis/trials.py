"""Trials: the time from one question of the robot to the next, as `[trials]` of scenario.toml defines it.
docs/reference/exports.md defines every value."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from typing import Any, Literal, TypeAlias, TypeVar

from msgspec import Struct

from rise_engine.expression import EvaluationError, Expression
from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.kernel.records import AnyRecord, EventRecord, FailureRecord, MemoryRecord, RuleRecord, TaskRecord
from rise_engine.kernel.rules import WITHOUT_ENTRY
from rise_engine.results.analysis.course import STEPPED_BACK, interruption_between, was_stopped_by_wizard, worst
from rise_engine.results.analysis.model import (
    ActPart,
    InterruptionKind,
    PlayedAct,
    SessionData,
    WizardKey,
    seconds_between,
)
from rise_engine.scenario.explore_settings import SPEECH, TrialSettings
from rise_engine.scenario.model import Json, normal_topic

NoNumber: TypeAlias = (
    InterruptionKind | Literal["back", "silent", "cut", "end", "cue", "key", "speech", "unset", "value"]
)
"""Why a trial has no number. back: a wizard stepped back before; silent: the robot did not speak; cut: its speech was
cut off; end: the end of its speech is unknown; cue, key, speech: there was none; unset: no value; value: no number."""
TrialEnd: TypeAlias = Literal["trial", "rule", "key", "record"]
_NO_REACTIONS = frozenset(
    {
        *("markCue", "undoCue", "nextFiller", "stopAll", "releaseStop", "stepBack"),
        *("stopInteractionRule", "stopCommunicationRobotAct", "cancelTask", "moveTask"),
    }
)
"""Requests of wizards that are no reaction to the participant's turn."""
_BACK = ("resumed", STEPPED_BACK)
"""How the triggers begin that return a rule to a state."""
_START_SOURCES = frozenset({"file", "study", "condition"})
"""Sources of the memory values at a session's start."""
_INTERRUPTED = {
    "duration_s": ("interrupted",),
    "participant_s": ("participant_interrupted",),
    "wizard_s": ("wizard_interrupted",),
    "key_s": ("participant_interrupted", "wizard_interrupted"),
    SPEECH: ("speech_interrupted",),
}
"""For each duration of a trial, the fields with its interruptions."""
_ENDS: dict[str, tuple[str, ...]] = {
    "participant_s": ("asked_end", "cue_at"),
    "wizard_s": ("cue_at", "key_at"),
    "key_s": ("asked_end", "key_at"),
    SPEECH: ("asked_end", "speech_at"),
}
"""For each duration that a trial may lack, its two ends."""
_MISSING: dict[str, NoNumber] = {"asked_end": "end", "cue_at": "cue", "key_at": "key", "speech_at": "speech"}
_Each = TypeVar("_Each")


class PlayedTrial(Struct, frozen=True, kw_only=True):
    """One trial."""

    start: float
    end: float
    ended_by: TrialEnd
    """trial: the next trial began; rule: the rule of the first state ended; key: its memory key became null or was
    deleted; record: the record ended."""
    values: dict[str, Json]
    """The values of the declared columns just before the trial's end."""
    robot_said: str = ""
    task: int | None = None
    """The act that spoke first."""
    asked_at: float | None = None
    asked_end: float | None = None
    asked_cut: bool = False
    """Whether that act's speech was stopped or failed before its end."""
    cue_at: float | None = None
    speech_at: float | None = None
    """When the participant first spoke, according to an annotation, or else to a program."""
    key_at: float | None = None
    wizard_key: str = ""
    wizard_asked: str = ""
    robot_next_at: float | None = None
    prompts: int = 0
    repairs: int = 0
    stepped_back: bool = False
    """Whether a wizard stepped back in it."""
    events: tuple[str, ...] = ()
    marks: tuple[str, ...] = ()
    failures: int = 0
    stops: int = 0
    """How often everything was stopped in it."""
    interrupted: InterruptionKind | None = None
    """The interruption of the trial. None: none, as for the next three."""
    participant_interrupted: InterruptionKind | None = None
    """The interruption between the end of the robot's speech and the cue (without a cue: the key)."""
    wizard_interrupted: InterruptionKind | None = None
    """The interruption between the cue and the wizard's key."""
    speech_interrupted: InterruptionKind | None = None
    """The interruption between the end of the robot's speech and the participant's first speech."""

    @property
    def duration_s(self) -> float:
        """Seconds from its start to its end."""
        return round(self.end - self.start, 6)

    @property
    def participant_s(self) -> float | None:
        """Seconds from the end of the robot's speech to the cue. Negative: the cue came while it still spoke."""
        return seconds_between(self.asked_end, self.cue_at)

    @property
    def speech_s(self) -> float | None:
        """Seconds from the end of the robot's speech to the participant's. Negative: the robot still spoke."""
        return seconds_between(self.asked_end, self.speech_at)

    @property
    def wizard_s(self) -> float | None:
        """Seconds from the cue to the wizard's key."""
        return seconds_between(self.cue_at, self.key_at)

    @property
    def key_s(self) -> float | None:
        """Seconds from the end of the robot's speech to the wizard's key."""
        return seconds_between(self.asked_end, self.key_at)

    def number(self, name: str) -> float | None:
        """Return a column as a number, for use as a dependent variable. None: see `why_no_number`."""
        if self.why_no_number(name):
            return None
        value = self.values[name] if name in self.values else getattr(self, name, None)
        return float(value) if isinstance(value, int | float) else None

    def why_no_number(self, name: str) -> NoNumber | None:
        """Return why a column has no number. None: it has one."""
        if name in self.values:
            value = self.values[name]
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            return None if is_number else "unset" if value is None else "value"
        if (why := worst(getattr(self, each) for each in _INTERRUPTED.get(name, ()))) is not None:
            return why
        missing = next((each for each in _ENDS.get(name, ()) if getattr(self, each) is None), None)
        if missing is None:
            return None
        if self.interrupted is not None:
            return self.interrupted
        if missing == "asked_end":
            return "silent" if self.asked_at is None else "cut" if self.asked_cut else "end"
        return "back" if self.stepped_back else _MISSING[missing]


def trials_of(data: SessionData) -> tuple[PlayedTrial, ...]:
    """Return the trials of a session in their order. Empty: its scenario has no `[trials]` or cannot be loaded.

    :param data: the session at any level; values that the level hides are missing.
    """
    settings = data.scenario.trials if data.scenario is not None else None
    if settings is None:
        return ()
    spans = _Spans(data, settings)
    for record in data.records:
        spans.add(record)
    spans.close(data.facts.duration)
    lists = _Lists(data, spans)
    return tuple(lists.trial(*span) for span in spans.found)


class _Spans:
    """Finds the starts and ends of trials. Give it a session's records in their order."""

    def __init__(self, data: SessionData, settings: TrialSettings) -> None:
        assert data.scenario is not None
        self.found: list[tuple[float, float, TrialEnd, dict[str, Json]]] = []
        self.signals: list[float] = []
        """When a program reported that the participant began to speak."""
        self.repeated: list[float] = []
        """When failed acts were repeated."""
        self.asked: dict[int, float] = {}
        """The time of the request of each marked task."""
        self._marked = {point.task for point in data.points if point.kind == "mistake"}
        self._settings = settings
        self._memory: dict[str, Json] = {name: table.records for name, table in data.scenario.tables.items()}
        self._before = dict(self._memory)
        """The memory before the time of the last record."""
        self._changes: list[MemoryRecord] = []
        """The memory records of that time."""
        self._t = 0.0
        self._start: float | None = None
        """The start of the current trial."""
        self._rule = ""
        self._stopped = ""
        """The rule whose stop has ended the last trial."""
        self._key: Json = None

    def add(self, record: AnyRecord) -> None:
        if record.t > self._t:
            self._settle()
            self._t = record.t
        if isinstance(record, MemoryRecord):
            _apply(record, self._memory)
            self._changes.append(record)
            if self._settings.key is not None:
                self._add_value(record, self._settings.key)
        elif isinstance(record, RuleRecord):
            self._add_rule(record)
        elif isinstance(record, TaskRecord):
            if record.id in self._marked:
                self.asked.setdefault(record.id, record.t)
        elif isinstance(record, EventRecord):
            if self._settings.speech and normal_topic(record.topic) == self._settings.speech:
                self.signals.append(record.t)
        elif isinstance(record, FailureRecord) and record.status == "repeated":
            self.repeated.append(record.t)

    def close(self, end: float) -> None:
        self._settle()
        self._end(end, "record")

    def _add_value(self, record: MemoryRecord, key: Expression) -> None:
        value = _value_of(key, self._memory)
        if value == self._key and type(value) is type(self._key):
            return
        self._key = value
        if record.source in _START_SOURCES:
            return
        self._end(record.t, "key" if value is None else "trial")
        if value is not None:
            self._start = record.t

    def _add_rule(self, record: RuleRecord) -> None:
        trigger = record.trigger or ""
        begins = record.status == "entered" and self._settings.begins_at(record.name, record.state or "")
        if begins and not (trigger.startswith(_BACK) and trigger.endswith(WITHOUT_ENTRY)):
            self._end(record.t, "trial")
            self._start, self._rule = record.t, record.name
        elif record.status == "entered" and trigger.startswith(_BACK):
            self._continue(record.name)
        elif record.status in ("ended", "stopped", "faulted") and record.name == self._rule:
            self._end(record.t, "rule")
            self._stopped = record.name if record.status == "stopped" else ""

    def _end(self, end: float, by: TrialEnd) -> None:
        if self._start is not None:
            values = {each.text: _value_of(each, self._before) for each in self._settings.columns}
            self.found.append((self._start, end, by, values))
        self._start, self._rule, self._stopped = None, "", ""

    def _continue(self, rule: str) -> None:
        """Continue the last trial if its rule was stopped and now resumes."""
        if self._start is None and rule == self._stopped and self.found:
            self._start, self._rule = self.found.pop()[0], rule

    def _settle(self) -> None:
        for change in self._changes:
            _apply(change, self._before)
        self._changes.clear()


def _apply(record: MemoryRecord, memory: dict[str, Json]) -> None:
    if record.deleted:
        memory.pop(record.key, None)
    else:
        memory[record.key] = record.value


def _value_of(expression: Expression, memory: dict[str, Json]) -> Json:
    try:
        return expression.value(memory)
    except EvaluationError:  # a part is missing, or hidden by the level
        return None


class _Lists:
    """The events of a session by kind, each list in the order of time."""

    def __init__(self, data: SessionData, spans: _Spans) -> None:
        assert data.scenario is not None
        settings = data.scenario.act_settings
        fillers = {name for name, each in settings.items() if each.filler}
        asides = fillers | {name for name, each in settings.items() if not each.answers}
        acts = [act for act in data.acts if not act.filler and act.act not in asides]
        by_task = {act.task: act for act in data.acts}
        self._data = data
        self._acts = acts
        self._spoken = _sorted((act.voice_at, act) for act in acts)
        self._onsets = _sorted((act.voice_at if act.speaks else act.robot_at, act) for act in acts)
        self._cues = _sorted((cue.at, cue) for cue in data.cues if cue.undone_at is None)
        started_aside = {act.task for act in data.acts if act.filler or act.act in asides}
        self._keys = _sorted(
            (key.at, key) for key in data.keys if key.function not in _NO_REACTIONS and key.task not in started_aside
        )
        self._raised = _sorted(data.raised)
        annotated = [each.begin for each in data.coded if each.speech]
        self._speech = _sorted((at, at) for at in annotated or spans.signals)
        marks = [point for point in data.points if point.kind == "mistake"]
        self._marked_acts = _sorted((by_task[m.task].accepted_at, m.name) for m in marks if m.task in by_task)
        self._marked_keys = _sorted((spans.asked.get(m.task or 0), m.name) for m in marks if m.task not in by_task)
        self._stops = _sorted(
            (point.at, point) for point in data.points if point.kind == "stop" and point.name == "requested"
        )
        self._faults = _sorted((point.at, point) for point in data.points if point.kind == "fault")
        self._steps_back = _sorted((phase.start, None) for phase in data.phases if phase.stepped_back)
        self._repairs = _sorted(
            (at, None)
            for at in (
                *spans.repeated,
                *(at for at, _ in self._steps_back),
                *(cue.undone_at for cue in data.cues),
                *(act.ended_at for act in data.acts if was_stopped_by_wizard(act, by_task, fillers)),
            )
        )
        keys = data.scenario.keys.values()
        self._names = {_asked(each.function, each.task_behavior): each.label for each in keys}

    def trial(self, start: float, end: float, ended_by: TrialEnd, values: dict[str, Json]) -> PlayedTrial:
        """Build one trial from the events at or after its start and before its end."""
        until = end if ended_by != "record" else float("inf")
        begin = bisect_left(self._acts, start, key=lambda act: act.accepted_at)
        behind = bisect_left(self._acts, until, key=lambda act: act.accepted_at)
        spoken = [(act.voice_at, act.task, act) for act in self._acts[begin:behind] if act.voice_at is not None]
        asking = min(spoken)[2] if spoken else None
        asked_at = asking.voice_at if asking is not None else None
        asked_end = _end_of_speech(asking) if asking is not None else None
        since = start if asked_at is None else asked_at
        cue = next((each for each in _until(self._cues, start, until) if each.at >= since), None)
        cue_at = cue.at if cue is not None else None
        speech_at = next((at for at in _until(self._speech, start, until) if at >= since), None)
        answer_from = cue_at if cue_at is not None else asked_at
        key = self._key(answer_from, end)
        asked = _asked(key.function, key.asked) if key is not None else ""
        heard = cue_at if cue_at is not None else key.at if key is not None else None
        interruptions = self._data.interruptions
        prompts_from = asked_end if asked_end is not None else asked_at
        prompts = (
            _within(self._spoken, prompts_from, heard if heard is not None else until)
            if prompts_from is not None
            else ()
        )
        return PlayedTrial(
            start=start,
            end=end,
            ended_by=ended_by,
            values=values,
            robot_said=asking.words if asking is not None else "",
            task=asking.task if asking is not None else None,
            asked_at=asked_at,
            asked_end=asked_end,
            asked_cut=asking is not None and _is_cut(asking),
            cue_at=cue_at,
            speech_at=speech_at,
            key_at=key.at if key is not None else None,
            wizard_key=self._names.get(asked, ""),
            wizard_asked=asked,
            robot_next_at=self._onset_from(heard),
            prompts=sum(act is not asking for act in prompts),
            repairs=len(_until(self._repairs, start, end)),
            stepped_back=bool(_until(self._steps_back, start, end)),
            events=tuple(_until(self._raised, start, end)),
            marks=(*_within(self._marked_acts, start, until), *_until(self._marked_keys, start, end)),
            failures=len(_until(self._faults, start, end)),
            stops=len(_until(self._stops, start, end)),
            interrupted=interruption_between(interruptions, start, end),
            participant_interrupted=interruption_between(interruptions, asked_end, heard),
            wizard_interrupted=interruption_between(interruptions, cue_at, key.at if key is not None else None),
            speech_interrupted=interruption_between(interruptions, asked_end, speech_at),
        )

    def _key(self, start: float | None, end: float) -> WizardKey | None:
        """Return the first key of the trial from a time on, including the key that ends the trial."""
        if start is None:
            return None
        at = bisect_left(self._keys, start, key=_time)
        return self._keys[at][1] if at < len(self._keys) and self._keys[at][0] <= end else None

    def _onset_from(self, start: float | None) -> float | None:
        if start is None:
            return None
        at = bisect_left(self._onsets, start, key=_time)
        return self._onsets[at][0] if at < len(self._onsets) else None


def _asked(function: str, behavior: str) -> str:
    """Describe a task's request for people."""
    return f"{function} {describe_behavior(function, behavior)}".strip()


def _end_of_speech(act: PlayedAct) -> float | None:
    """Return the end of the act's last action with voice. None: some were not spoken to their end, or it is unknown."""
    spoken = _spoken(act)
    ends = [part.ended_at for part in spoken if part.status == "succeeded" and part.ended_at is not None]
    return max(ends) if ends and len(ends) == len(spoken) else None


def _is_cut(act: PlayedAct) -> bool:
    return any(part.status in ("canceled", "failed", "skipped") for part in _spoken(act))


def _spoken(act: PlayedAct) -> list[ActPart]:
    return [part for part in act.parts if "speech" in part.channels]


def _sorted(pairs: Iterable[tuple[float | None, _Each]]) -> list[tuple[float, _Each]]:
    """Return the items that have a time, in the order of time."""
    return sorted(((at, each) for at, each in pairs if at is not None), key=_time)


def _time(pair: tuple[float, Any]) -> float:
    return pair[0]


def _within(pairs: Sequence[tuple[float, _Each]], start: float, end: float) -> list[_Each]:
    """Return the items at or after `start` and before `end`."""
    return [each for _, each in pairs[bisect_left(pairs, start, key=_time) : bisect_left(pairs, end, key=_time)]]


def _until(pairs: Sequence[tuple[float, _Each]], start: float, end: float) -> list[_Each]:
    """Return the items after `start` and at or before `end`, because the event that ends a trial belongs to it."""
    return [each for _, each in pairs[bisect_right(pairs, start, key=_time) : bisect_right(pairs, end, key=_time)]]
