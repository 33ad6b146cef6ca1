"""The types for the events of a session. Every export and every report uses only these.

Times are seconds on the session's clock (`t` of a record), or None if the event did not happen. Values that the export
level hides (`rise_engine.privacy.levels`) are absent: the level is applied when a session is read.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

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
"""The kind of requester. program: a ROS node, a client, the command line."""
_COMMAND_LINE = "wizard:command-line"
WaitPart: TypeAlias = Literal["wizard_s", "way_s", "rules_s", "queue_s", "robot_s", "voice_s"]
WAIT_PARTS: tuple[WaitPart, ...] = get_args(WaitPart)
"""The parts of the time until the robot acts, in their order."""
InterruptionKind: TypeAlias = Literal["outage", "standstill", "stop"]
"""outage: no engine, or a suspended computer; standstill: the engine stood still; stop: everything was stopped."""


class SessionFacts(SessionIdentity, frozen=True, kw_only=True):
    """The facts of a whole session, repeated in every row of a table."""

    session: str
    """The folder's name at the level, unique among the sessions of an export."""
    run_as: str = ""
    """The participant under whom it was run, if the study's log has reassigned it. `withdrawn`: they have withdrawn."""
    mode: str = ""
    """debug: the robot was simulated; these are no participant's data."""
    outcome: OutcomeStatus | None = None
    """None: there is no outcome."""
    outcome_reason: str = ""
    title: str = ""
    scenario_hash: str = ""
    changed_to: tuple[str, ...] = ()
    """The hashes of changed files with which it continued (`rise-engine take-over`), in their order."""
    changed_keys: dict[str, float] = field(default_factory=dict)
    """Memory keys of its condition that a wizard changed, with the session times of their first changes."""
    language: str = ""
    """The language of the spoken texts (BCP 47). Empty: the scenario does not set one."""
    robot: str = ""
    driver: str = ""
    """The driver of the robot: `simulated` moves no robot, in any mode. Empty: unknown."""
    injected_faults: tuple[str, ...] = ()
    """The faults that the simulated robot was told to inject."""
    seed: int = 0
    speed: float = 1.0
    started: str = ""
    """ISO 8601 with offset. Empty: the level hides times of day."""
    duration: float = 0.0
    """Seconds until its last record."""
    ended: bool = False
    """Whether the record has an end."""
    downtime: float | None = 0.0
    """Wall-clock seconds without an engine (`Outage`), which session time does not include. None: unknown."""
    recoveries: int = 0
    versions: dict[str, str] = field(default_factory=dict)

    @property
    def is_simulated(self) -> bool:
        """Whether no robot can have moved."""
        return self.mode == "debug" or self.driver == SIMULATED


class ActPart(Struct, frozen=True, kw_only=True):
    """One action of an act on the robot."""

    action: str
    """Its actionID within the act."""
    type: str
    """`Speech`, `LookAt`, ..."""
    channels: tuple[str, ...]
    """The robot's channels that it uses: speech, gaze, face, body, arms. Empty: it only waits, or they are unknown."""
    parameters: dict[str, Any]
    text: str
    """Its spoken text, or its most informative parameter, in a few words. Empty: none."""
    accepted_at: float | None
    """When the robot confirmed it."""
    ended_at: float | None
    status: ActionStatus
    """The final status; `started` or `accepted` if the record ends before that."""
    started_at: float | None = None
    """When it was sent to the robot, or began to wait. None: it ended before that (`skipped`, `failed`)."""

    @property
    def known_end(self) -> float | None:
        """When it ended on the robot. None: it had not ended, or its end is unknown (`lost`, `timed-out`)."""
        return None if self.status in ("lost", "timed-out") else self.ended_at


class PlayedAct(Struct, frozen=True, kw_only=True):
    """One act (or free speech) from its request to its end, with the parts of its latency.

    Requests that were rejected or whose turn never came are included.
    """

    task: int
    act: str
    """`say` for free speech."""
    source: str
    """The requester as in the record: `wizard:anna`, `rule:Greeting`."""
    by: str
    """The source of its cause, through any number of rules (`causes`). `rule:NAME`: the rule acted by itself."""
    origin: int | None = None
    """The task of its cause."""
    via: tuple[str, ...] = ()
    """The rules between `by` and this act, in their order."""
    actor: ActorKind
    """The kind of `by`."""
    status: TaskStatus
    reason: str = ""
    filler: bool
    """Whether it bridged the time after a cue instead of answering it."""
    cue: int | None = None
    """The number of the cue that it answers or bridges, from 1."""
    cue_at: float | None
    """The end of the participant's turn that it answers or bridges."""
    key_at: float | None
    """When the key that caused it was pressed."""
    taken_at: float | None = None
    """When the engine accepted that key's own request, which may have been for a rule or an event."""
    accepted_at: float
    """When the engine accepted it."""
    started_at: float | None
    """When its turn in the queue came."""
    robot_at: float | None
    """When the robot confirmed its first action. This is not the time of the first sound."""
    voice_at: float | None
    """When the robot confirmed its first action that uses the voice. The first sound comes later."""
    ended_at: float | None
    response_outage_s: float | None = None
    """Seconds without an engine between its cue and its answer. None: none."""
    response_interrupted: InterruptionKind | None = None
    """The interruption between its cue and its answer. None: none."""
    mark: Mark | None = None
    """The mistake that a wizard marked on it, or on the key that first led to it. None: none."""
    parts: tuple[ActPart, ...] = ()
    speaks: bool = False
    """Whether one of its actions uses the voice."""

    @property
    def words(self) -> str:
        """Its spoken words."""
        return " ".join(part.text for part in self.parts if "speech" in part.channels and part.text)

    @property
    def before_cue(self) -> bool:
        """Whether it was requested before the cue and had its turn after it. Then it is no reaction to the cue:
        `wizard_s`, `way_s` and `rules_s` are None, and `queue_s` begins at the cue."""
        asked = self.key_at if self.key_at is not None else self.accepted_at
        return self.cue_at is not None and asked < self.cue_at

    @property
    def answer_s(self) -> float | None:
        """Seconds from cue to answer; None for fillers, acts requested before the cue, and interrupted waits."""
        return None if self.filler or self.before_cue or self.response_interrupted else self.response_s

    def ends_of(self, part: WaitPart) -> tuple[float | None, float | None]:
        """Return the start and the end of a part of the wait for it. The parts follow one another."""
        if self.before_cue and part in ("wizard_s", "way_s", "rules_s"):
            return None, None
        match part:
            case "wizard_s":
                return self.cue_at, self.key_at
            case "way_s":
                return self.key_at, self.taken_at
            case "rules_s":
                return self.cue_at if self.key_at is None else self.taken_at, self.accepted_at
            case "queue_s":
                return self.cue_at if self.before_cue else self.accepted_at, self.started_at
            case "robot_s":
                return self.started_at, self.robot_at
            case "voice_s":
                return self.robot_at, self.voice_at

    @property
    def wait_ends(self) -> tuple[float | None, float | None]:
        """The start of its first known part and the end of its last."""
        known = [ends for ends in map(self.ends_of, WAIT_PARTS) if None not in ends]
        return (known[0][0], known[-1][1]) if known else (None, None)

    @property
    def wizard_s(self) -> float | None:
        """Seconds from cue to key: the wizard's part."""
        return seconds_between(*self.ends_of("wizard_s"))

    @property
    def way_s(self) -> float | None:
        """Seconds from the key until the engine accepted the key's own request."""
        return seconds_between(*self.ends_of("way_s"))

    @property
    def rules_s(self) -> float | None:
        """Seconds from there (or from the cue, without a key) until the act was requested: work and waits of rules, and
        failed attempts. 0 if the key requests the act."""
        return seconds_between(*self.ends_of("rules_s"))

    @property
    def queue_s(self) -> float | None:
        """Seconds in the queue, counted from the cue if the cue came later."""
        return seconds_between(*self.ends_of("queue_s"))

    @property
    def robot_s(self) -> float | None:
        """Seconds from its turn to the robot's confirmation."""
        return seconds_between(*self.ends_of("robot_s"))

    @property
    def voice_s(self) -> float | None:
        """Seconds from the first confirmed action to the first that uses the voice."""
        return seconds_between(*self.ends_of("voice_s"))

    @property
    def answered_at(self) -> float | None:
        """When the robot confirmed the answer: its voice, or its first action if it does not speak."""
        return self.voice_at if self.speaks else self.robot_at

    @property
    def response_s(self) -> float | None:
        """Seconds from cue to answer, the sum of the parts."""
        return seconds_between(self.cue_at, self.answered_at)


class WizardKey(Struct, frozen=True, kw_only=True):
    """A wizard's request by a key: an act, a rule, an event, a value, a cue, speech, a stop."""

    task: int
    at: float
    """When the key was pressed. Without a key: when the engine accepted the request."""
    source: str
    function: str
    asked: str = ""
    """The act, rule, topic, assignment or words as in the record."""
    act: int | None = None
    """The first act that it caused."""
    mark: Mark | None = None
    """The mistake marked on it, or on an act that it caused. None: none."""


CueState: TypeAlias = Literal["answered", "unheard", "undone", "open"]
"""unheard: an act began to answer it, but ended before the robot confirmed its answer; open: it was not answered."""


class Cue(Struct, frozen=True, kw_only=True):
    """The end of a participant's turn, as a person or program marked it."""

    at: float
    """When the cue's key was pressed. Without a key: when the engine accepted the cue."""
    source: str
    text: str = ""
    filled_at: float | None = None
    """When the robot confirmed the first filler."""
    answered_at: float | None = None
    """When the robot began to answer (`PlayedAct.response_s` later). None: no answer, or the cue was undone."""
    task: int | None = None
    """The act that answered."""
    answer_s: float | None = None
    """`PlayedAct.answer_s` of that act."""
    undone_at: float | None = None

    @property
    def state(self) -> CueState:
        """The state of the cue."""
        if self.undone_at is not None:
            return "undone"
        if self.answered_at is not None:
            return "answered"
        return "open" if self.task is None else "unheard"


class CodedAnnotation(Struct, frozen=True, kw_only=True):
    """An annotation from ELAN or BORIS (`rise_engine.session.coded`)."""

    tier: str
    annotator: str = ""
    begin: float
    end: float
    """Equal to `begin` for a moment."""
    value: str
    modifiers: str = ""
    comment: str = ""
    file: str = ""
    speech: bool = False
    """Whether its tier holds the participant's speech."""
    outage_s: float | None = None
    """Seconds without an engine meanwhile, in which session time stood still. None: none."""
    robot_overlap_s: float | None = None
    """Seconds in which the robot spoke meanwhile. None: not the participant's speech, or with `outage_s`."""
    gap_s: float | None = None
    """Seconds from the end of the robot's previous speech to its start. Negative: the robot still spoke. None: no such
    speech, its end is unknown, an outage in between, or not the participant's speech."""


class Outage(Struct, frozen=True, kw_only=True):
    """A time between two engines, or while the computer was suspended. Session time stood still."""

    at: float
    """The session time of the outage."""
    seconds: float
    """Its length by the wall clock; between two engines, from the first one's last sign of life to the recovery."""


class Interruption(Struct, frozen=True, kw_only=True):
    """A time in which the session could not react. Durations across it measure neither wizard nor participant."""

    kind: InterruptionKind
    at: float
    until: float
    """Equal to `at` for an outage. Infinite for a stop that was not released."""
    seconds: float = 0.0
    """standstill: its length by the wall clock."""


class Phase(Struct, frozen=True, kw_only=True):
    """A time during which a rule was in a state."""

    rule: str
    state: str
    start: float
    end: float
    """For states that were active at the end of the record: the end of the session."""
    trigger: str
    """The trigger that led to the state."""
    source: str = ""
    """The source that started the rule, for its first state only."""
    ended_by: str = ""
    """`ended`, `stopped` or `faulted` for the last state of a run of the rule, else empty."""
    stepped_back: bool = False
    """Whether a wizard stepped back into it."""


PointKind: TypeAlias = Literal[
    "note",
    "mistake",
    "stop",
    "sync",
    "event",
    "memory",
    "control",
    "robot",
    "fault",
    "check",
    "recovery",
    "scenario",
]


class Point(Struct, frozen=True, kw_only=True):
    """An event without duration."""

    at: float
    kind: PointKind
    name: str
    """The subject: an event's topic, a memory key, a mark, `latched`."""
    value: str = ""
    """The detail to show."""
    source: str = ""
    task: int | None = None
    outage_s: float | None = None
    """recovery: seconds without an engine before it. None: unknown, or another kind."""


class Repairs(Struct, frozen=True):
    """Counts of repairs during the session."""

    repeated: int = 0
    """Failed acts that were repeated."""
    stepped_back: int = 0
    """Rules that a wizard moved back to an earlier state."""
    cues_undone: int = 0
    canceled: int = 0
    """Acts that a wizard stopped or interrupted after their start, without stops of everything."""
    released: int = 0
    """Stops that were released."""

    @property
    def total(self) -> int:
        """The sum without stops, because stopping everything does not repair anything yet."""
        return self.repeated + self.stepped_back + self.cues_undone + self.canceled


class SessionData(Struct, frozen=True, kw_only=True):
    """Everything about one session at one level."""

    facts: SessionFacts
    level: ExportLevel
    folder: Path
    """The session's folder, for other files in it. Exports must not show it."""
    records: Iterable[AnyRecord]
    """All records at the level (`wall` is empty if it hides times of day). Each iteration reads them from the journal,
    because there may be a million."""
    acts: tuple[PlayedAct, ...] = ()
    """In the order in which the engine accepted them."""
    cues: tuple[Cue, ...] = ()
    keys: tuple[WizardKey, ...] = ()
    """The requests of wizards in their order."""
    raised: tuple[tuple[float, str], ...] = ()
    """Events raised by a wizard, or by a rule at the time when a wizard's key started it, with times."""
    phases: tuple[Phase, ...] = ()
    """All phases, also those without length."""
    outages: tuple[Outage, ...] = ()
    """Outages of known length."""
    interruptions: tuple[Interruption, ...] = ()
    """Outages, standstills and stops."""
    points: tuple[Point, ...] = ()
    """In the order of the record."""
    checks: tuple[CheckRecord, ...] = ()
    """The last record of each id."""
    recordings: tuple[RecordingRecord, ...] = ()
    """The last record of each name."""
    syncs: tuple[SyncRecord, ...] = ()
    media: tuple[MediaFile, ...] = ()
    """The session's files, only at the level `full`."""
    coded: tuple[CodedAnnotation, ...] = ()
    """Added annotations in the order in which they begin."""
    repairs: Repairs = Repairs()
    scenario: Scenario | None = None
    """The scenario that it ran. None: it cannot be loaded."""
    problems: tuple[str, ...] = ()
    """Sentences about unreadable parts."""

    def marked_acts(self) -> dict[int, int]:
        """Return the first act that each marked key caused, by the key's task. A marked act maps to itself."""
        return {key.task: key.act for key in self.keys if key.mark is not None and key.act is not None}


def seconds_between(earlier: float | None, later: float | None) -> float | None:
    """Return the seconds between two times, to the microsecond. None: one of them is unknown."""
    if earlier is None or later is None:
        return None
    return round(later - earlier, 6)


def actor_of(source: str) -> ActorKind:
    """Return the kind of a record's source.

    >>> actor_of("wizard:anna"), actor_of("rule:Greeting"), actor_of("engine"), actor_of("ros:/node")
    ('wizard', 'rule', 'engine', 'program')
    """
    kind = source.partition(":")[0]
    if kind == "wizard" and source != _COMMAND_LINE:
        return "wizard"
    return "rule" if kind == "rule" else "engine" if kind == "engine" else "program"
