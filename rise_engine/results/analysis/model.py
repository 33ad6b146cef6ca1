"""What happened in a session, in types. Every export and every report is made from these and from nothing else.

Times are seconds on the session's clock (`t` of a record), None where something did not happen. What an export level
does not tell (`rise_engine.privacy.levels`) is not in here at all: a level is applied once, when a session is read.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.kernel.records import (
    ActionStatus,
    AnyRecord,
    CheckRecord,
    Mark,
    OutcomeStatus,
    RecordingRecord,
    SessionIdentity,
    SyncRecord,
    TaskStatus,
)
from rise_engine.privacy.levels import ExportLevel
from rise_engine.scenario.model import SIMULATED, Scenario
from rise_engine.session.media import MediaFile

ActorKind: TypeAlias = Literal["wizard", "rule", "program", "engine"]
"""Who asked for something. program: a node, a client, the command line."""


class SessionFacts(SessionIdentity, frozen=True, kw_only=True):
    """What is true of a whole session; it stands in every row of a table."""

    session: str
    """The folder's name, as the level tells it: unique among the sessions that are exported together."""
    mode: str = ""
    """debug: the robot was simulated; this is no data of a participant."""
    outcome: OutcomeStatus | None = None
    """None: nobody has said it."""
    outcome_reason: str = ""
    title: str = ""
    scenario_hash: str = ""
    language: str = ""
    """In which everything was said, by BCP 47; empty: the scenario does not say."""
    robot: str = ""
    driver: str = ""
    """What reached the robot: `simulated` moves none, whatever the mode. Empty: not known."""
    injected_faults: tuple[str, ...] = ()
    """What the simulated robot was told to do wrong."""
    seed: int = 0
    speed: float = 1.0
    started: str = ""
    """ISO 8601 with offset; empty where the level tells no times of day."""
    duration: float = 0.0
    """Seconds until its last record."""
    ended: bool = False
    """Whether the record has an end."""
    downtime: float = 0.0
    """Seconds by the wall clock without an engine (`Outage`): session time does not count them."""
    recoveries: int = 0
    versions: dict[str, str] = field(default_factory=dict)

    @property
    def is_simulated(self) -> bool:
        """Whether no robot can have moved."""
        return self.mode == "debug" or self.driver == SIMULATED


class ActPart(Struct, frozen=True, kw_only=True):
    """One action of an act, as the robot did it."""

    action: str
    """Its actionID within the act."""
    type: str
    """`Speech`, `LookAt`, ..."""
    channels: tuple[str, ...]
    """Of the robot, that it takes: speech, gaze, face, body, arms; empty: it only waits, or nobody knows."""
    parameters: dict[str, Any]
    text: str
    """What it says, or its most telling parameter, in a few words; empty: nothing to tell."""
    accepted_at: float | None
    """The robot confirmed it."""
    ended_at: float | None
    status: ActionStatus
    """Its ending; `started` or `accepted` where the record ends before that."""
    started_at: float | None = None
    """It was sent to the robot, or began to wait; None: it ended before that (`skipped`, `failed`)."""


class PlayedAct(Struct, frozen=True, kw_only=True):
    """One act (or free speech) from whoever asked for it to its end, with the parts of its latency.

    Every task that started an act is one, also one that was rejected or never had its turn.
    """

    task: int
    act: str
    """`say` for free speech."""
    source: str
    """Who asked for it, as the record has it: `wizard:anna`, `rule:Greeting`."""
    by: str
    """Whose doing it is: the source of what caused it, through any number of rules (`causes`).
    `rule:NAME`: the rule acted by itself, as after a time."""
    via: tuple[str, ...] = ()
    """The rules between `by` and this act, the first one first."""
    actor: ActorKind
    """What kind of source `by` is."""
    status: TaskStatus
    reason: str = ""
    filler: bool
    """It bridged the time of a cue, and is no answer to it."""
    cue_at: float | None
    """When the participant's turn ended that it answers or bridges."""
    key_at: float | None
    """When the key was pressed that caused it."""
    accepted_at: float
    """When the engine took it."""
    started_at: float | None
    """When its turn came."""
    robot_at: float | None
    """When the robot confirmed its first action. It is not the time of the first sound."""
    voice_at: float | None
    """When the robot confirmed its first action that takes the voice; the first sound comes later."""
    ended_at: float | None
    mark: Mark | None = None
    """What a wizard said was wrong about it, or about the key of which it came first; None: nothing."""
    parts: tuple[ActPart, ...] = ()
    speaks: bool = False
    """Whether one of its actions takes the voice."""

    @property
    def words(self) -> str:
        """What it says."""
        return " ".join(part.text for part in self.parts if "speech" in part.channels and part.text)

    @property
    def before_cue(self) -> bool:
        """Whether it was asked for before the cue came, and only had its turn after it. Nobody reacted to the cue then:
        the time of the wizard and of the way is not told, and the queue is counted from the cue."""
        asked = self.key_at if self.key_at is not None else self.accepted_at
        return self.cue_at is not None and asked < self.cue_at

    @property
    def answer_s(self) -> float | None:
        """Cue to answer, where somebody answered the cue: no filler, and nothing that was asked for before it. What
        medians and shares are of."""
        return None if self.filler or self.before_cue else self.response_s

    @property
    def wizard_s(self) -> float | None:
        """Cue to key: the wizard."""
        return None if self.before_cue else seconds_between(self.cue_at, self.key_at)

    @property
    def way_s(self) -> float | None:
        """Key to the engine (from the cue, where no key was pressed)."""
        return (
            None
            if self.before_cue
            else seconds_between(self.key_at if self.key_at is not None else self.cue_at, self.accepted_at)
        )

    @property
    def queue_s(self) -> float | None:
        """In the queue; after the cue, if it was in there when that came."""
        return seconds_between(self.cue_at if self.before_cue else self.accepted_at, self.started_at)

    @property
    def robot_s(self) -> float | None:
        """From its turn until the robot confirms."""
        return seconds_between(self.started_at, self.robot_at)

    @property
    def voice_s(self) -> float | None:
        """From the first confirmed action to the first that takes the voice."""
        return seconds_between(self.robot_at, self.voice_at)

    @property
    def response_s(self) -> float | None:
        """Cue to answer: to the voice, of an act that speaks, else to the first action. The parts add up to it."""
        return seconds_between(self.cue_at, self.voice_at if self.speaks else self.robot_at)


class WizardKey(Struct, frozen=True, kw_only=True):
    """Something that a wizard asked for by a key: an act, a rule, an event, a value, a cue, speech, a stop."""

    task: int
    at: float
    """When the key was pressed, as far as the record holds that; else when the engine took it."""
    source: str
    function: str
    asked: str = ""
    """The act, rule, topic, assignment or words, as the record has it."""
    act: int | None = None
    """The first act that it caused."""
    mark: Mark | None = None
    """What was said to be wrong about it, or about an act that came of it; None: nothing."""


class Cue(Struct, frozen=True, kw_only=True):
    """The participant's turn ended, and somebody marked it."""

    at: float
    source: str
    text: str = ""
    filled_at: float | None = None
    """When the first filler was confirmed by the robot."""
    answered_at: float | None = None
    """When the robot began to answer (`PlayedAct.response_s` later); None: nothing did, or it was undone."""
    task: int | None = None
    """The act that answered."""
    undone_at: float | None = None


class CodedAnnotation(Struct, frozen=True, kw_only=True):
    """Something that people have annotated of the session, in ELAN or BORIS (`rise_engine.session.coded`)."""

    tier: str
    annotator: str = ""
    begin: float
    end: float
    """As `begin`: it was a moment."""
    value: str
    modifiers: str = ""
    comment: str = ""
    file: str = ""
    speech: bool = False
    """Whether its tier holds what the participant said."""
    robot_overlap_s: float | None = None
    """Seconds of it in which the robot spoke; None: its tier is not the participant's speech."""
    gap_s: float | None = None
    """Seconds from the end of what the robot last began to say before it, to its begin; negative: the robot still
    spoke. None: the robot had said nothing, the session had no engine in between, or the tier is another one."""


class Outage(Struct, frozen=True, kw_only=True):
    """From one engine to the next the session had none, and its time stood still."""

    at: float
    """Session time at which it stood still."""
    seconds: float
    """For how long, by the wall clock: from the first engine's last sign of life to the recovery."""


class Phase(Struct, frozen=True, kw_only=True):
    """A rule was in a state."""

    rule: str
    state: str
    start: float
    end: float
    """Of the session, for the state in which it was when the record ended."""
    trigger: str
    """What led to it."""
    source: str = ""
    """Who started the rule; only of its first state."""
    ended_by: str = ""
    """`ended`, `stopped`, `faulted` for the last one of a run of the rule; else empty."""
    stepped_back: bool = False
    """Whether a wizard stepped back into it."""


PointKind: TypeAlias = Literal[
    "note", "mistake", "stop", "sync", "event", "memory", "control", "robot", "fault", "check", "recovery"
]


class Point(Struct, frozen=True, kw_only=True):
    """Something that happened at one moment."""

    at: float
    kind: PointKind
    name: str
    """What it is about: an event's topic, a memory key, a mark, `latched`."""
    value: str = ""
    """What is told of it."""
    source: str = ""
    task: int | None = None


class Repairs(Struct, frozen=True):
    """How often something was mended while it ran."""

    repeated: int = 0
    """Acts that were done again after they had failed."""
    stepped_back: int = 0
    """Rules that a wizard put back into an earlier state."""
    cues_undone: int = 0
    canceled: int = 0
    """Acts that a wizard stopped or interrupted after they had begun; not by stopping everything."""
    released: int = 0
    """Stops that were released."""

    @property
    def total(self) -> int:
        """Without stops: who stops everything repairs nothing yet."""
        return self.repeated + self.stepped_back + self.cues_undone + self.canceled


class SessionData(Struct, frozen=True, kw_only=True):
    """Everything about one session, at one level."""

    facts: SessionFacts
    level: ExportLevel
    folder: Path
    """Where it lies; for what is read from there besides. Never to be told in an export."""
    records: Iterable[AnyRecord]
    """All of them, as the level tells them (`wall` is empty where that tells no times of day). A session may have a
    million, so they are read from its journal each time that somebody goes through them."""
    acts: tuple[PlayedAct, ...] = ()
    """By when the engine took them."""
    cues: tuple[Cue, ...] = ()
    keys: tuple[WizardKey, ...] = ()
    """What wizards asked for, in its order."""
    raised: tuple[tuple[float, str], ...] = ()
    """When which event was raised by a wizard, or by a rule at the moment at which a wizard's key started it."""
    phases: tuple[Phase, ...] = ()
    """Also those of no length."""
    outages: tuple[Outage, ...] = ()
    points: tuple[Point, ...] = ()
    """In the order of the record."""
    checks: tuple[CheckRecord, ...] = ()
    """The last one of each id."""
    recordings: tuple[RecordingRecord, ...] = ()
    """The last one of each name."""
    syncs: tuple[SyncRecord, ...] = ()
    media: tuple[MediaFile, ...] = ()
    """Files that belong to the session; only at the level `full`."""
    coded: tuple[CodedAnnotation, ...] = ()
    """What people have annotated and given back, by its begin."""
    repairs: Repairs = Repairs()
    scenario: Scenario | None = None
    """The one that it ran; None: it cannot be loaded."""
    problems: tuple[str, ...] = ()
    """What could not be read, in sentences."""


def seconds_between(earlier: float | None, later: float | None) -> float | None:
    """From one moment to another, to the microsecond; None: one of them is not known."""
    if earlier is None or later is None:
        return None
    return round(later - earlier, 6)
