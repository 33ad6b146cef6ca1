"""The record: one vocabulary for the journal, `run --json`, the socket and ROS (semantics.md 11).

A record says what changed. The stream of records alone rebuilds every view (see `rise_engine.kernel.view`). The kernel
numbers them and gives them session time; `wall` is put on by the engine, because the kernel knows no clock.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal, TypeAlias

from msgspec import Struct, field

TaskStatus: TypeAlias = Literal["PENDING", "ACTIVE", "SUCCEEDED", "ABORTED", "CANCELED", "REJECTED"]
ActionStatus: TypeAlias = Literal[
    "started", "accepted", "succeeded", "failed", "canceled", "timed-out", "lost", "skipped"
]
Mark: TypeAlias = Literal["wrong", "late", "early", "double", "none"]
"""What was wrong about something that a wizard did; `none`: nothing after all."""
FailureStatus: TypeAlias = Literal["asked", "waiting", "repeated", "gone-on", "dropped"]
CheckResult: TypeAlias = Literal["passed", "failed", "skipped"]
OutcomeStatus: TypeAlias = Literal["complete", "aborted", "excluded"]
"""complete: the run counts. aborted: it was broken off, and the participant may run it again. excluded: the participant
does not count, and their slot is given to the next of the same stratum."""
Purpose: TypeAlias = Literal["counted", "pilot", "training", "debug"]
"""Why a session of a study is run. Only `counted` takes a slot and counts; `debug` is every session in debug mode."""
RecordingStatus: TypeAlias = Literal["started", "running", "stalled", "stopped", "failed"]
ENGINE = "engine"
"""The `source` of what the engine does by itself."""
ENDINGS: frozenset[str] = frozenset({"succeeded", "failed", "canceled", "timed-out", "lost", "skipped"})
"""Every action has exactly one record with one of these."""
FINAL: frozenset[str] = frozenset({"SUCCEEDED", "ABORTED", "CANCELED", "REJECTED"})
"""Every task ends in exactly one of these."""


class Record(Struct, tag_field="kind", gc=False):
    """What every record has."""

    seq: int
    """1, 2, 3, ... without gaps within a session."""
    t: float
    """Seconds on the session's monotonic clock."""
    wall: str
    """ISO 8601 with offset: a label, never used for reckoning."""


class OpenGoal(Struct, frozen=True, gc=False):
    """Something that the robot may still be doing, although its action has ended for the session."""

    part: str
    """Of the robot, for a person: `pepper/speech`."""
    action: str
    """The goal id of the action: `<task>/<actionID>`."""
    type: str
    """What the robot does: `Speech`."""
    reason: str
    """Why it is open, for a person: `it refused to stop`."""
    holds: bool = True
    """The part gets nothing else until this has ended or somebody releases it. False: the part takes no stop."""
    accepted: bool = True
    """The robot has taken it; false: it has not answered, and may still begin."""


def describe_open_goals(goals: Iterable[OpenGoal]) -> str:
    """One text for a person about what the robot may still be doing; empty when it is doing nothing."""
    return "; ".join(f"{goal.part} may still be doing {goal.type} ({goal.reason})" for goal in goals)


class SessionIdentity(Struct, frozen=True, kw_only=True):
    """Whose session it is, and which of its study. Its first input, its first record and session.toml say it, too."""

    participant: str = ""
    """Who takes part, as the wizard named them; empty: nobody was named."""
    condition: str = ""
    factors: dict[str, Any] = {}
    """What the condition is made of: the level of each factor."""
    study: str = ""
    """The study's id; empty: the session is of no study, and what follows is empty."""
    study_hash: str = ""
    """SHA-256 of its study.toml."""
    slot: int | None = None
    """The row of its plan; null: the session takes none."""
    run: int = 0
    """Which of the participant's runs it is, from 1 on."""
    attempt: int = 0
    """The number of this session among those of the same run, from 1 on."""
    purpose: Purpose | Literal[""] = ""


IDENTITY = SessionIdentity.__struct_fields__


def identity_of(session: Any) -> dict[str, Any]:
    """The fields of `SessionIdentity`, by their names, of anything that has them."""
    return {name: getattr(session, name) for name in IDENTITY}


class SessionRecord(Record, tag="session", kw_only=True):
    status: Literal["started", "recovered", "ended"]
    scenario: str = ""
    scenario_hash: str = ""
    mode: str = ""
    robot: str = ""
    seed: int = 0
    versions: dict[str, str] = field(default_factory=dict)
    reason: str = ""
    participant: str = ""
    condition: str = ""
    study: str = ""
    study_hash: str = ""
    slot: int | None = None
    run: int = 0
    attempt: int = 0
    purpose: Purpose | Literal[""] = ""
    factors: dict[str, Any] = field(default_factory=dict)
    """These nine are as in `SessionIdentity`."""
    language: str = ""
    """The language in which everything is said, by BCP 47; empty: the scenario does not say."""
    downtime: float | None = None
    """recovered: seconds without an engine, by the wall clock, from the last sign of life of the one before; null: not
    known."""
    open: tuple[OpenGoal, ...] = ()
    """ended: what the robot may still be doing."""
    driver: str = ""
    """What reached the robot: `simulated` moves none, whatever the mode. Empty: not known."""
    injected_faults: tuple[str, ...] = ()
    """What the simulated robot was told to do wrong, as its driver documents it."""


class TaskRecord(Record, tag="task"):
    id: int
    function: str
    behavior: str
    calling_type: str
    source: str
    status: TaskStatus
    reason: str = ""
    position: int | None = None
    """For a PENDING task: its position among the waiting ones, 0 first."""
    ref: str | None = None
    """What the submitter called it (a ROS goal id, a console's own number)."""
    cause: int | None = None
    """What a rule asks for: the task that led to it (semantics.md 4.5); null: a timer or the robot's link did."""
    via: tuple[str, ...] = ()
    """The rules that the way from there led through before the one in `source`."""


class ActionRecord(Record, tag="action"):
    task: int
    act: str
    action: str
    """Its actionID within the act."""
    type: str
    parameters: dict[str, Any]
    status: ActionStatus
    reason: str = ""
    sent_as: str | None = None
    """The action that the robot does instead, when it substitutes one."""


class RuleRecord(Record, tag="rule"):
    name: str
    status: Literal["started", "entered", "stayed", "ended", "stopped", "faulted"]
    """stayed: took a transition without target, which does not leave the state."""
    state: str | None
    previous: str | None = None
    trigger: str | None = None
    """What led here: an event topic, `after 2s`, a condition, `start`, `resumed` after a stop, or `stepped back`;
    the last three perhaps with `, without onEntry`."""
    transition: int | None = None
    """Index of the transition taken, among those of `previous` in document order."""
    priority: float = 0
    """On the stack, at this moment (taking a transition raises it)."""
    reason: str = ""


class EventRecord(Record, tag="event"):
    topic: str
    source: str
    taken_by: str | None


class ConditionRecord(Record, tag="condition"):
    rule: str
    state: str
    expression: str
    values: dict[str, Any]
    """The keys that it read, with their values; a key that does not exist is null and listed in `missing`."""
    result: bool
    error: str = ""
    missing: tuple[str, ...] = ()
    """Keys that do not exist, the first time that this is noticed."""


class MemoryRecord(Record, tag="memory"):
    key: str
    value: Any
    old: Any
    source: str
    deleted: bool = False
    created: bool = False


class RobotRecord(Record, tag="robot"):
    status: Literal["connected", "degraded", "lost"]
    detail: str = ""
    open: tuple[OpenGoal, ...] = ()


class StopRecord(Record, tag="stop"):
    status: Literal["requested", "latched", "let-go", "released"]
    """let-go: the emergency stop `source` is not pressed any more; everything stays stopped."""
    confirmed: tuple[str, ...] = ()
    unconfirmed: tuple[str, ...] = ()
    source: str = ""
    unstoppable: tuple[str, ...] = ()
    held_by: tuple[str, ...] = ()
    """The emergency stops that are pressed: it is not released before they are let go."""


def stopper_words(source: str) -> str:
    """Who stopped everything, for a person: an emergency stop by where it is, anybody else by the source."""
    name = source.removeprefix("estop:")
    return source if name == source else f"the emergency stop at {name}"


class ControlRecord(Record, tag="control"):
    """Who of several consoles may act."""

    status: Literal["taken", "asked", "given", "released"]
    """asked: somebody without control would like to have it; nothing has changed."""
    by: str
    """Who did it."""
    holder: str | None
    """Who holds control now; null: nobody."""


class NoteRecord(Record, tag="note"):
    text: str
    source: str


class CueRecord(Record, tag="cue"):
    """The participant's turn has ended; from here the time until the robot answers is counted."""

    status: Literal["marked", "filled", "answered", "undone"]
    """filled: a filler has started; answered: the first other act has, and the cue is over; undone: it was taken
    back."""
    source: str
    """Who marked it or took it back; for the other two: who asked for the act."""
    text: str = ""
    """What the one who marked it says about it."""
    task: int | None = None
    """The act that started."""
    since: float | None = None
    """Seconds from the mark until that act started."""


class MistakeRecord(Record, tag="mistake"):
    """A wizard says that something was a mistake. The last one about a task counts; `none` takes it back."""

    task: int
    act: str
    """The act that the task started, `say` for free speech; empty when the task did something else."""
    mark: Mark
    source: str


class FailureRecord(Record, tag="failure"):
    """What becomes of an act that failed, where the scenario says that it does not simply go on (`on_failure`)."""

    task: int
    act: str
    status: FailureStatus
    """asked: the events of its end are held until somebody answers; waiting: they are held, too, and it is repeated
    after a pause unless somebody answers before; gone-on: they are raised; repeated: another task takes its place;
    dropped: a stop has made the question void, and they are not raised."""
    source: str
    """Who decided it: `engine`, when nobody had to."""
    by: int | None = None
    """repeated: the task that takes its place."""
    reason: str = ""
    """asked, waiting: why the act failed; gone-on: how often, when it was repeated in vain; dropped: what made it
    void."""
    seconds: float | None = None
    """waiting: how long the pause is; null: it begins when the robot is back."""


class TimingRecord(Record, tag="timing"):
    """When everything about one act happened, in session seconds; null: it did not happen. Follows the act's end."""

    task: int
    act: str
    """`say` for free speech."""
    status: TaskStatus
    cue_at: float | None
    """The participant's cue that it answers: the last one that no other act but fillers had answered."""
    key_at: float | None
    """A key was pressed that led to it, on the console's clock."""
    accepted_at: float
    """The engine took the task."""
    started_at: float | None
    robot_at: float | None
    """The robot confirmed its first action."""
    ended_at: float
    source: str = ""
    """Who asked for it."""
    filler: bool = False
    """It bridged the time of a cue: a `CueRecord` says `filled` of this task."""
    voice_at: float | None = None
    """The robot first confirmed an action of it that takes the voice. The first sound comes later."""


class CountdownRecord(Record, tag="countdown"):
    """A rule has begun to count for a transition whose time only this moment gives, or has broken off. (What a plain
    `after` counts, the rule's entry into the state tells.) That it came to its end is a `RuleRecord`."""

    rule: str
    state: str
    transition: int
    """Its index in the state, in document order."""
    status: Literal["began", "broken", "failed"]
    """broken: what must hold does not hold any more. failed: its time could not be computed; it is never taken here."""
    seconds: float | None = None
    """How long it counts."""
    reason: str = ""


KeptStatus: TypeAlias = Literal["kept", "taken", "expired", "taken-back"]


class KeptRecord(Record, tag="kept"):
    """An event that no rule waited for is kept; and then what became of it, once."""

    task: int
    """The task that raised it."""
    topic: str
    """With its slash."""
    status: KeptStatus
    seconds: float | None = None
    """How much longer it will be kept; only of `kept`."""
    rule: str | None = None
    """Which rule has taken it."""


class CheckRecord(Record, tag="check"):
    """Something was looked at before or after the session, or not, with the reason. The last one of an id counts."""

    id: str
    """As study.toml names it."""
    text: str
    """What was looked at: the sentence that somebody confirmed, or what the program says that it does."""
    result: CheckResult
    value: str
    """What was found: `34.1 GB free`."""
    reason: str
    """Why it failed, or why somebody skipped it."""
    source: str


class OutcomeRecord(Record, tag="outcome"):
    """How the session is to count. The last one counts."""

    status: OutcomeStatus
    reason: str
    source: str


class RecordingRecord(Record, tag="recording"):
    """How something stands that records the session: a camera, a microphone, a bag."""

    name: str
    status: RecordingStatus
    """stalled: it says that it records, and its file does not grow."""
    path: str
    """Of its file, as whoever records it knows it; empty: not known."""
    bytes: int | None
    """How large it is; null: not known."""
    reason: str
    source: str


class SyncRecord(Record, tag="sync"):
    """A mark that recordings show at this moment: a sound, a flash."""

    number: int
    medium: str
    """By what it is seen or heard: `sound`, `flash`."""
    text: str
    source: str
    at: float | None = None
    """Session time in seconds at which it began; null: at `t`, as far as anybody knows."""
    within: float | None = None
    """Seconds by which `at` is wrong at most; null: not known."""


class ScenarioRecord(Record, tag="scenario"):
    """The session goes on with changed files of its scenario."""

    hash: str
    """SHA-256 of the scenario from here on, as `scenario_hash` of the session's record is of that at its beginning."""
    was: str
    """Of the one until here."""
    changes: tuple[str, ...]
    """What is otherwise, in words: `act R_Yes changed`."""
    source: str


AnyRecord: TypeAlias = (
    SessionRecord
    | TaskRecord
    | ActionRecord
    | RuleRecord
    | EventRecord
    | ConditionRecord
    | MemoryRecord
    | RobotRecord
    | StopRecord
    | ControlRecord
    | NoteRecord
    | CueRecord
    | MistakeRecord
    | TimingRecord
    | CountdownRecord
    | KeptRecord
    | FailureRecord
    | CheckRecord
    | OutcomeRecord
    | RecordingRecord
    | SyncRecord
    | ScenarioRecord
)
