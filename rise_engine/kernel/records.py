"""The records: one vocabulary for the journal, `run --json`, the socket and ROS (semantics.md 11).

A record says what changed, and the stream of records alone rebuilds every view (see `rise_engine.kernel.view`). The
kernel sets their numbers and session time. The engine adds `wall`, because the kernel knows no clock.
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
"""What was wrong with something that a wizard did; `none`: nothing after all."""
FailureStatus: TypeAlias = Literal["asked", "waiting", "repeated", "gone-on", "dropped"]
CheckResult: TypeAlias = Literal["passed", "failed", "skipped"]
OutcomeStatus: TypeAlias = Literal["complete", "aborted", "excluded"]
"""complete: the run counts. aborted: it was broken off, and the participant may run it again. excluded: the participant
does not count, and their slot goes to the next participant of the same stratum."""
Purpose: TypeAlias = Literal["counted", "pilot", "training", "debug"]
"""The purpose of a study's session. Only `counted` takes a slot and counts. Every session in debug mode is `debug`."""
RecordingStatus: TypeAlias = Literal["started", "running", "stalled", "stopped", "failed"]
ENGINE = "engine"
"""The `source` of everything that the engine does by itself."""
ENDINGS: frozenset[str] = frozenset({"succeeded", "failed", "canceled", "timed-out", "lost", "skipped"})
"""Every action has exactly one record with one of these."""
FINAL: frozenset[str] = frozenset({"SUCCEEDED", "ABORTED", "CANCELED", "REJECTED"})
"""Every task ends in exactly one of these."""


class Record(Struct, tag_field="kind", gc=False):
    """The fields of every record."""

    seq: int
    """1, 2, 3, ... without gaps within a session."""
    t: float
    """Seconds on the session's monotonic clock."""
    wall: str
    """ISO 8601 with offset, for display only. Do not compute with it."""


class OpenGoal(Struct, frozen=True, gc=False):
    """Something that the robot may still be doing, although its action has ended for the session."""

    part: str
    """The part of the robot, for people: `pepper/speech`."""
    action: str
    """The goal id of the action: `<task>/<actionID>`."""
    type: str
    """What the robot does: `Speech`."""
    reason: str
    """Why it is open, for people: `it refused to stop`."""
    holds: bool = True
    """The part gets nothing else until this has ended or somebody releases it. False: the part cannot be stopped."""
    accepted: bool = True
    """The robot has accepted it; false: it has not answered, and may still begin."""


def describe_open_goal(goal: OpenGoal) -> str:
    """A sentence for people about something that the robot may still be doing."""
    return f"{goal.part} may still be doing {goal.type} ({goal.reason})"


def describe_open_goals(goals: Iterable[OpenGoal]) -> str:
    """A text for people about what the robot may still be doing; empty if it is doing nothing."""
    return "; ".join(map(describe_open_goal, goals))


def look_at_robot_text(goals: Iterable[OpenGoal]) -> str:
    """What people are told after the end of a session that has left these goals open; empty for none."""
    told = describe_open_goals(goals)
    return f"LOOK AT THE ROBOT: {told}" if told else ""


class SessionIdentity(Struct, frozen=True, kw_only=True):
    """A session's participant and place in its study, as in its first input, its first record and session.toml."""

    participant: str = ""
    """The participant, as the wizard named them; empty: nobody was named."""
    condition: str = ""
    factors: dict[str, Any] = {}
    """The level of each factor, which together make the condition."""
    study: str = ""
    """The study's id; empty: the session belongs to no study, and the fields below are empty."""
    study_hash: str = ""
    """SHA-256 of its study.toml."""
    slot: int | None = None
    """The row of its plan; null: the session takes none."""
    run: int = 0
    """The number of this run among the participant's runs, from 1."""
    attempt: int = 0
    """The number of this session among the sessions of the same run, from 1."""
    purpose: Purpose | Literal[""] = ""


IDENTITY = SessionIdentity.__struct_fields__


def identity_of(session: Any) -> dict[str, Any]:
    """The fields of `SessionIdentity`, by name, from any object that has them."""
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
    """The nine fields from `participant` on are as in `SessionIdentity`."""
    language: str = ""
    """The language in which the robot speaks, as a BCP 47 tag; empty: the scenario does not name it."""
    downtime: float | None = None
    """recovered: seconds by the wall clock since the last sign of life of the earlier engine; null: unknown."""
    waits_for_wizard: bool = False
    """recovered: no act and no action begins until a wizard has control."""
    open: tuple[OpenGoal, ...] = ()
    """ended: what the robot may still be doing."""
    driver: str = ""
    """The driver of the robot: `simulated` moves none, whatever the mode. Empty: unknown."""
    injected_faults: tuple[str, ...] = ()
    """The faults that the simulated robot was told to make, as its driver documents them."""
    speed: float = 1.0
    """Session seconds in a second of the wall clock."""


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
    """The submitter's name for it (a ROS goal id, a console's own number)."""
    cause: int | None = None
    """The task that led to it (semantics.md 4.5). Null: somebody submitted it, or a timer or the robot's link did."""
    via: tuple[str, ...] = ()
    """The rules that led from that task to the rule in `source`, without the latter."""
    key_at: float | None = None
    """When the key that requested it was pressed, by the console's clock. Null: no key did; or a later record of it."""


class ActionRecord(Record, tag="action"):
    task: int
    act: str
    action: str
    """Its actionID in the act."""
    type: str
    parameters: dict[str, Any]
    status: ActionStatus
    reason: str = ""
    sent_as: str | None = None
    """The action that the robot performs instead, if it substitutes one."""


class RuleRecord(Record, tag="rule"):
    name: str
    status: Literal["started", "entered", "stayed", "ended", "stopped", "faulted"]
    """stayed: it took a transition without target, which does not leave the state."""
    state: str | None
    previous: str | None = None
    trigger: str | None = None
    """What led here: an event topic, `after 2s`, a condition, `start`, `resumed` after a stop, or `stepped back`. The
    last three may end with `, without onEntry`."""
    transition: int | None = None
    """The index of the transition among those of `previous`, in document order."""
    priority: float = 0
    """Its present priority on the stack (taking a transition raises it)."""
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
    """The keys that it read, with their values. A missing key is null and is listed in `missing`."""
    result: bool
    error: str = ""
    missing: tuple[str, ...] = ()
    """Missing keys, the first time that each is noticed."""


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
    """The emergency stops that are pressed. The stop cannot be released before they are let go."""


def stopper_words(source: str) -> str:
    """Who stopped everything, for people: an emergency stop by its place, anybody else by the source."""
    name = source.removeprefix("estop:")
    return source if name == source else f"the emergency stop at {name}"


class ControlRecord(Record, tag="control"):
    """Control among several consoles."""

    status: Literal["taken", "asked", "given", "released"]
    """asked: somebody without control asks for it; nothing has changed."""
    by: str
    """Who did it."""
    holder: str | None
    """Who holds control now; null: nobody."""


class NoteRecord(Record, tag="note"):
    text: str
    source: str
    stood: float | None = None
    """The engine has just stood still or could record nothing, for so many seconds of the wall clock."""
    suspended: bool = False
    """With `stood`: the computer was suspended, so session time stood still."""


class CueRecord(Record, tag="cue"):
    """The participant's turn has ended. The time until the robot answers counts from `at`."""

    status: Literal["marked", "filled", "answered", "undone"]
    """filled: a filler has started; answered: the first other act has started, and the cue is over; undone: the cue was
    taken back."""
    source: str
    """Who marked it or took it back; for the other two: who asked for the act."""
    text: str = ""
    """The remark of the person who marked it."""
    task: int | None = None
    """The act that started."""
    since: float | None = None
    """Seconds from the cue until that act started."""
    key_at: float | None = None
    """marked: when its key was pressed, by the console's clock. Null: no key marked it."""

    @property
    def at(self) -> float:
        """When it was marked: when its key was pressed or, without a key, when the engine took it."""
        return self.t if self.key_at is None else self.key_at


class MistakeRecord(Record, tag="mistake"):
    """A wizard marks something as a mistake. The last mark of a task counts; `none` takes it back."""

    task: int
    act: str
    """The act that the task started, `say` for free speech; empty if the task did something else."""
    mark: Mark
    source: str


class FailureRecord(Record, tag="failure"):
    """What happens after an act has failed, unless the scenario simply goes on (`on_failure`)."""

    task: int
    act: str
    status: FailureStatus
    """asked: the events of its end are held until somebody answers. waiting: they are held, and the act is repeated
    after a pause unless somebody answers before. gone-on: they are raised. repeated: another task replaces it. dropped:
    a stop ended the question, and they are not raised."""
    source: str
    """Who decided it; `engine` if nobody had to."""
    by: int | None = None
    """repeated: the task that replaces it."""
    reason: str = ""
    """asked, waiting: why the act failed. gone-on: how often, if it was repeated. dropped: what ended the question."""
    seconds: float | None = None
    """waiting: how long the pause is; null: it begins when the robot is back."""


class TimingRecord(Record, tag="timing"):
    """The times of one act in session seconds; null: it did not happen. Follows the act's end."""

    task: int
    act: str
    """`say` for free speech."""
    status: TaskStatus
    cue_at: float | None
    """The participant's cue that it answers: the last one that only fillers had answered before."""
    key_at: float | None
    """The key that led to it was pressed, by the console's clock."""
    accepted_at: float
    """The engine accepted the task."""
    started_at: float | None
    robot_at: float | None
    """The robot confirmed its first action."""
    ended_at: float
    source: str = ""
    """Who asked for it."""
    filler: bool = False
    """It was a filler after a cue: the `CueRecord` of this task has the status `filled`."""
    voice_at: float | None = None
    """The robot first confirmed one of its actions that uses the voice. The first sound comes later."""


class CountdownRecord(Record, tag="countdown"):
    """A rule has started or stopped counting a time that its state alone does not tell. (For a plain `after`, the entry
    into the state is enough.) The end of the time is a `RuleRecord`."""

    rule: str
    state: str
    transition: int
    """Its index in the state, in document order."""
    status: Literal["began", "broken", "failed"]
    """broken: the condition does not hold any more. failed: the time could not be computed; it is never taken here."""
    seconds: float | None = None
    """How long it counts."""
    reason: str = ""


KeptStatus: TypeAlias = Literal["kept", "taken", "expired", "taken-back"]


class KeptRecord(Record, tag="kept"):
    """An event that no rule waited for is kept. One further record says how it ended."""

    task: int
    """The task that raised it."""
    topic: str
    """With its slash."""
    status: KeptStatus
    seconds: float | None = None
    """How much longer it is kept; only for `kept`."""
    rule: str | None = None
    """The rule that has taken it."""


class CheckRecord(Record, tag="check"):
    """The result of a check before or after the session, or why it was skipped. The last one of an id counts."""

    id: str
    """As study.toml names it."""
    text: str
    """What was checked: the sentence that somebody confirmed, or the program's description."""
    result: CheckResult
    value: str
    """What was found: `34.1 GB free`."""
    reason: str
    """Why it failed, or why somebody skipped it."""
    source: str


class OutcomeRecord(Record, tag="outcome"):
    """How the session counts. The last record is valid."""

    status: OutcomeStatus
    reason: str
    source: str


class RecordingRecord(Record, tag="recording"):
    """The state of a recording of the session: a camera, a microphone, a bag."""

    name: str
    status: RecordingStatus
    """stalled: the recorder reports that it records, but its file does not grow."""
    path: str
    """The path of its file, as the recorder knows it; empty: unknown."""
    bytes: int | None
    """The size of its file; null: unknown."""
    reason: str
    source: str


class SyncRecord(Record, tag="sync"):
    """A mark that recordings contain at this moment: a sound, a flash."""

    number: int
    medium: str
    """How it can be perceived: `sound`, `flash`."""
    text: str
    source: str
    at: float | None = None
    """Session time in seconds at which it began; null: at `t`, as far as is known."""
    within: float | None = None
    """The largest error of `at` in seconds; null: unknown."""


class ScenarioRecord(Record, tag="scenario"):
    """The session continues with changed files of its scenario."""

    hash: str
    """SHA-256 of the new scenario, comparable to `scenario_hash` of the session's first record."""
    was: str
    """SHA-256 of the scenario before."""
    changes: tuple[str, ...]
    """The changes in words: `act R_Yes changed`."""
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
