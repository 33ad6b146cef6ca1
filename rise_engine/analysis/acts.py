"""Acts and cues of a session, with the parts of every latency.

What old journals do not say is worked out from their other records: who asked for an act from its task, whether it
bridged a cue from the cue, when it was to be heard from its actions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.analysis.causes import CauseCollector, actor_of
from rise_engine.analysis.model import ActPart, Cue, PlayedAct, WizardKey
from rise_engine.kernel.records import (
    ENDINGS,
    FINAL,
    ActionRecord,
    AnyRecord,
    CueRecord,
    Mark,
    TaskRecord,
    TimingRecord,
)
from rise_engine.kernel.speech import SAY, SPEECH
from rise_engine.scenario.action_declarations import core_actions
from rise_engine.scenario.model import ActionSpec, Scenario
from rise_engine.scenario.spoken import MESSAGE, SPEECH_CHANNEL
from rise_engine.scenario.ssml import plain_words
from rise_engine.scenario.template import spoken_text

ACT_FUNCTIONS = frozenset({"startCommunicationRobotAct", "say"})
_TELLING = ("value", "duration")
"""Parameters, the most telling first."""


class _Act(Struct):
    """An act while its records are gone through."""

    first: TaskRecord
    last: TaskRecord
    started_at: float | None = None
    timing: TimingRecord | None = None
    parts: dict[str, ActPart] = field(default_factory=dict)
    robot_at: float | None = None
    voice_at: float | None = None


class ActCollector:
    """Takes in the records of a session in their order, and says which acts and cues they tell of."""

    def __init__(self, scenario: Scenario | None) -> None:
        """
        :param scenario: the session's; None: it cannot be loaded, and channels are those of the core actions.
        """
        self._scenario = scenario
        self._specs: Mapping[str, ActionSpec] = scenario.robot.actions if scenario is not None else core_actions()
        self._acts: dict[int, _Act] = {}
        self._cues: list[Cue] = []
        self._answers: dict[int, int] = {}
        """By task, the cue in the list that it answered."""
        self._bridges: dict[int, int] = {}
        self._causes = CauseCollector()

    def add(self, record: AnyRecord) -> None:
        """Take in the next record."""
        self._causes.add(record)
        match record:
            case TaskRecord():
                if record.function in ACT_FUNCTIONS:
                    self._add_task(record)
            case ActionRecord():
                if (act := self._acts.get(record.task)) is not None:
                    self._add_action(act, record)
            case TimingRecord():
                if (act := self._acts.get(record.task)) is not None:
                    act.timing = record
            case CueRecord():
                self._add_cue(record)
            case _:
                pass

    def acts(self) -> tuple[PlayedAct, ...]:
        """Every act, by when the engine took it."""
        marks = self._causes.marks(tuple(self._acts))
        played = [self._played(number, act, marks.get(number)) for number, act in self._acts.items()]
        return tuple(sorted(played, key=lambda each: (each.accepted_at, each.task)))

    def keys(self) -> tuple[WizardKey, ...]:
        """What wizards asked for."""
        return self._causes.keys(tuple(self._acts))

    def raised(self) -> tuple[tuple[float, str], ...]:
        """Which events wizards raised, and when."""
        return self._causes.raised()

    def cues(self, acts: Iterable[PlayedAct]) -> tuple[Cue, ...]:
        """Every cue, with what `acts` answered and bridged it."""
        by_task = {act.task: act for act in acts}
        cues = list(self._cues)
        for task, index in self._bridges.items():
            act = by_task.get(task)
            if act is not None and act.robot_at is not None and cues[index].filled_at is None:
                cues[index] = replace(cues[index], filled_at=act.robot_at)
        for task, index in self._answers.items():
            act = by_task.get(task)
            began = None if act is None else act.voice_at if act.speaks else act.robot_at
            cues[index] = replace(cues[index], answered_at=began, task=task)
        return tuple(cues)

    # --- taking in ---

    def _add_task(self, record: TaskRecord) -> None:
        act = self._acts.get(record.id)
        if act is None:
            act = self._acts[record.id] = _Act(record, record)
        act.last = record
        if record.status == "ACTIVE" and act.started_at is None:
            act.started_at = record.t

    def _add_action(self, act: _Act, record: ActionRecord) -> None:
        spec = self._specs.get(record.sent_as or record.type)
        waits = spec is not None and spec.engine
        channels = spec.channels if spec is not None and not spec.engine else ()
        part = act.parts.get(record.action)
        confirmed = record.status in ("accepted", "succeeded") and not waits
        if confirmed and act.robot_at is None:
            act.robot_at = record.t
        if confirmed and act.voice_at is None and SPEECH_CHANNEL in channels:
            act.voice_at = record.t
        act.parts[record.action] = ActPart(
            action=record.action,
            type=record.type,
            channels=channels,
            parameters=record.parameters,
            text=telling_text(record.parameters),
            accepted_at=_first(part.accepted_at if part is not None else None, record.t if confirmed else None),
            ended_at=record.t if record.status in ENDINGS else None,
            status=record.status,
            started_at=part.started_at if part is not None else record.t if record.status == "started" else None,
        )

    def _add_cue(self, record: CueRecord) -> None:
        if record.status == "marked":
            self._cues.append(Cue(at=record.t, source=record.source, text=record.text))
            return
        if not self._cues:
            return  # what marked it cannot be read
        index = len(self._cues) - 1
        if record.status == "undone":
            self._cues[index] = replace(self._cues[index], undone_at=record.t)
        elif record.task is not None:
            (self._answers if record.status == "answered" else self._bridges).setdefault(record.task, index)

    # --- what came of it ---

    def _played(self, number: int, act: _Act, mark: Mark | None) -> PlayedAct:
        first, last, timing = act.first, act.last, act.timing
        cue = self._answers.get(number, self._bridges.get(number))
        origin = self._causes.origin_of(number)
        name = SAY if first.function == "say" else first.behavior
        return PlayedAct(
            task=number,
            act=name,
            source=first.source,
            by=origin.by,
            via=origin.via,
            actor=actor_of(origin.by),
            status=last.status,
            reason=last.reason,
            filler=number in self._bridges or (timing is not None and timing.filler),
            cue_at=None if cue is None else self._cues[cue].at,
            key_at=origin.key_at,
            accepted_at=timing.accepted_at if timing is not None else first.t,
            started_at=act.started_at,
            robot_at=_first(timing.robot_at if timing is not None else None, act.robot_at),
            voice_at=_first(timing.voice_at if timing is not None else None, act.voice_at),
            ended_at=last.t if last.status in FINAL and last.status != "REJECTED" else None,
            mark=mark,
            parts=tuple(act.parts.values()),
            speaks=self._speaks(name, act),
        )

    def _speaks(self, name: str, act: _Act) -> bool:
        if act.voice_at is not None or any(SPEECH_CHANNEL in part.channels for part in act.parts.values()):
            return True
        if act.parts and act.last.status in FINAL:
            return False
        if name == SAY:
            return SPEECH_CHANNEL in self._specs[SPEECH].channels if SPEECH in self._specs else True
        found = self._scenario.acts.get(name) if self._scenario is not None else None
        return found is not None and SPEECH_CHANNEL in found.channels


def telling_text(parameters: Mapping[str, Any]) -> str:
    """What an action says, or its most telling parameter, in a few words.

    >>> telling_text({"message": "<speak>Hello<break time='1s'/>you</speak>"}), telling_text({"value": "nod"})
    ('Hello you', 'nod')
    >>> telling_text({"pointx": 1.0, "pointy": 0, "pointz": 0.5}), telling_text({})
    ('(1, 0, 0.5)', '')
    """
    message = parameters.get(MESSAGE)
    if message is not None:
        return plain_words(message) if isinstance(message, str) else spoken_text(message)
    if all(axis in parameters for axis in ("pointx", "pointy", "pointz")):
        return "(" + ", ".join(spoken_text(parameters[axis]) for axis in ("pointx", "pointy", "pointz")) + ")"
    told = next((name for name in _TELLING if name in parameters), None)
    if told == "duration":
        return f"{spoken_text(parameters[told])} ms"
    if told is not None:
        return spoken_text(parameters[told])
    return next((spoken_text(value) for value in parameters.values()), "")


def _first(*times: float | None) -> float | None:
    return next((each for each in times if each is not None), None)
