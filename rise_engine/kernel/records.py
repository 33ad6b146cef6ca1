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
"""What was wrong with a wizard's action; `none`: nothing, which takes a mark back."""
FailureStatus: TypeAlias = Literal["asked", "waiting", "repeated", "gone-on", "dropped"]
CheckResult: TypeAlias = Literal["passed", "failed", "skipped"]
OutcomeStatus: TypeAlias = Literal["complete", "aborted", "excluded"]
"""complete: the run counts. aborted: the participant may run it again. excluded: the participant does not count, and
the next participant of the stratum gets their slot."""
Purpose: TypeAlias = Literal["counted", "pilot", "training", "debug"]
"""The purpose of a study's session. Only `counted` takes a slot and counts. Every session in debug mode is `debug`."""
RecordingStatus: TypeAlias = Literal["started", "running", "stalled", "stopped", "failed"]
ENGINE = "engine"
"""The `source` of everything that the engine does itself."""
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
    """ISO 8601 with offset, only for display. Do not compute with it."""


class OpenGoal(Struct, frozen=True, gc=False):
    """An action that has ended for the session but may still run on the robot."""

    part: str
    """The part of the robot, as people read it: `pepper/speech`."""
    action: str
    """The goal id of the action: `<task>/<actionID>`."""
    type: str
    """What the robot does: `Speech`."""
    reason: str
    """Why it is open, as people read it: `it refused to stop`."""
    holds: bool = True
    """The part gets nothing else until this has ended or is released. False: the part cannot be stopped."""
    accepted: bool = True
    """Whether the robot has accepted it. Otherwise it has not answered, and may still begin."""


def describe_open_goal(goal: OpenGoal) -> str:
    """Describe an open goal in a sentence."""
    return f"{goal.part} may still be doing {goal.type} ({goal.reason})"


def describe_open_goals(goals: Iterable[OpenGoal]) -> str:
    """Describe open goals; empty if there are none."""
    return "; ".join(map(describe_open_goal, goals))


def open_goals_warning(goals: Iterable[OpenGoal]) -> str:
    """The warning at the end of a session that left these goals open; empty for none."""
    text = describe_open_goals(goals)
    return f"LOOK AT THE ROBOT: {text}" if text else ""


class SessionIdentity(Struct, frozen=True, kw_only=True):
    """A session's participant and place in its study, as in its first input, its first record and session.toml."""

    participant: str = ""
    """The participant, as the wizard named them; empty: not named."""
    condition: str = ""
    factors: dict[str, Any] = {}
    """The level of each factor. Together they make the condition."""
    study: str = ""
    """The study's id; empty: the session belongs to no study, and the fields below are empty."""
    study_hash: str = ""
    """SHA-256 of its study.toml."""
    slot: int | None = None
    """The row of its plan; null: none is taken."""
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
    """The nine fields from `participant` on are those of `SessionIdentity`."""
    language: str = ""
    """The robot's spoken language (BCP 47); empty: the scenario does not name it."""
    downtime: float | None = None
    """recovered: seconds by the wall clock since the last sign of life of the earlier engine; null: unknown."""
    waits_for_wizard: bool = False
    """recovered: no act and no action begins until a wizard has control."""
    open: tuple[OpenGoal, ...] = ()
    """ended: the robot's open goals."""
    driver: str = ""
    """The driver of the robot. `simulated` moves no robot, whatever the mode. Empty: unknown."""
    injected_faults: tuple[str, ...] = ()
    """The requested faults of the simulated robot, as its driver documents them."""
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
    """The position of a PENDING task among the waiting ones, 0 first."""
    ref: str | None = None
    """The submitter's name for it (a ROS goal id, a console's own number)."""
    cause: int | None = None
    """The task that caused it (semantics.md 4.5); null: a client, a timer or the robot's link did."""
    via: tuple[str, ...] = ()
    """The rules that led from that task to the rule in `source`, without the latter."""
    key_at: float | None = None
    """When its key was pressed, by the console's clock; null: no key was, or this is a later record of the task."""


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
    """The action that the robot performs instead; null: none."""


class RuleRecord(Record, tag="rule"):
    name: str
    status: Literal["started", "entered", "stayed", "ended", "stopped", "faulted"]
    """stayed: it took a transition without target, which does not leave the state."""
    state: str | None
    previous: str | None = None
    trigger: str | None = None
    """The trigger: an event topic, `after 2s`, a condition, `start`, `resumed` after a stop, or `stepped back`. The
    last three may end with `, without onEntry`."""
    transition: int | None = None
    """The index of the transition among those of `previous`, in document order."""
    priority: float = 0
    """Its present priority on the stack. Taking a transition raises it."""
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
    """The keys that it read, with their values. A missing key is null and listed in `missing`."""
    result: bool
    error: str = ""
    missing: tuple[str, ...] = ()
    """Missing keys that no earlier record named."""


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
    """let-go: the emergency stop `source` was released; everything stays stopped."""
    confirmed: tuple[str, ...] = ()
    unconfirmed: tuple[str, ...] = ()
    source: str = ""
    unstoppable: tuple[str, ...] = ()
    held_by: tuple[str, ...] = ()
    """The emergency stops that are pressed. They must be released before the stop can be."""


def stopper_words(source: str) -> str:
    """The source of a stop, for people: an emergency stop by its place, others by name."""
    name = source.removeprefix("estop:")
    return source if name == source else f"the emergency stop at {name}"


class ControlRecord(Record, tag="control"):
    """Control among several consoles."""

    status: Literal["taken", "asked", "given", "released"]
    """asked: a console asks for control; nothing has changed."""
    by: str
    """The console that caused it."""
    holder: str | None
    """The new holder of control; null: nobody."""


class NoteRecord(Record, tag="note"):
    text: str
    source: str
    stood: float | None = None
    """Seconds of the wall clock for which the engine stood still or could not record."""
    suspended: bool = False
    """With `stood`: the computer was suspended, so session time stood still."""


class CueRecord(Record, tag="cue"):
    """The participant's turn has ended. The time until the robot answers counts from `at`."""

    status: Literal["marked", "filled", "answered", "undone"]
    """filled: a filler has started; answered: the first other act has started; undone: the cue was taken back."""
    source: str
    """marked, undone: the person; otherwise the source of the act."""
    text: str = ""
    """The remark of the person who marked it."""
    task: int | None = None
    """The act that started."""
    since: float | None = None
    """Seconds from the cue until that act started."""
    key_at: float | None = None
    """marked: when its key was pressed, by the console's clock; null: no key was."""

    @property
    def at(self) -> float:
        """When it was marked: the time of its key or, without a key, of the engine's input."""
        return self.t if self.key_at is None else self.key_at


class MistakeRecord(Record, tag="mistake"):
    """A wizard marks a task as a mistake. The last mark of a task counts; `none` takes it back."""

    task: int
    act: str
    """The act that the task started, `say` for free speech; empty: another kind of task."""
    mark: Mark
    source: str


class FailureRecord(Record, tag="failure"):
    """The consequence of a failed act, unless the scenario simply goes on (`on_failure`)."""

    task: int
    act: str
    status: FailureStatus
    """asked: the events of its end are held until an answer. waiting: they are held, and the act is repeated after a
    pause unless an answer comes first. gone-on: they are raised. repeated: another task replaces it. dropped: a stop
    ended the question, and they are not raised."""
    source: str
    """The source of the decision; `engine`: none was needed."""
    by: int | None = None
    """repeated: the task that replaces it."""
    reason: str = ""
    """asked, waiting: why the act failed. gone-on: the number of attempts. dropped: what ended the question."""
    seconds: float | None = None
    """waiting: the length of the pause; null: it begins when the robot is back."""


class TimingRecord(Record, tag="timing"):
    """The times of one act in session seconds; null: it did not happen. Follows the act's end."""

    task: int
    act: str
    """`say` for free speech."""
    status: TaskStatus
    cue_at: float | None
    """The time of the participant's cue that it answers: the last one with only fillers since."""
    key_at: float | None
    """When the key was pressed that caused it, by the console's clock."""
    accepted_at: float
    """When the engine accepted the task."""
    started_at: float | None
    robot_at: float | None
    """When the robot confirmed its first action."""
    ended_at: float
    source: str = ""
    """The source of the task."""
    filler: bool = False
    """Whether it was a filler after a cue: the `CueRecord` of this task has the status `filled`."""
    voice_at: float | None = None
    """When the robot first confirmed an action that uses the voice. The sound begins later."""


class CountdownRecord(Record, tag="countdown"):
    """A rule has started or stopped to count a time that depends on more than its state. (For a plain `after`, the
    entry into the state is enough.) The end of the time is a `RuleRecord`."""

    rule: str
    state: str
    transition: int
    """Its index in the state, in document order."""
    status: Literal["began", "broken", "failed"]
    """broken: the condition does not hold any more. failed: the time could not be computed; it is never taken here."""
    seconds: float | None = None
    """The length of the time."""
    reason: str = ""


KeptStatus: TypeAlias = Literal["kept", "taken", "expired", "taken-back"]


class KeptRecord(Record, tag="kept"):
    """An event that no rule waited for is kept. One later record reports its end."""

    task: int
    """The task that raised it."""
    topic: str
    """With its slash."""
    status: KeptStatus
    seconds: float | None = None
    """The remaining time; only for `kept`."""
    rule: str | None = None
    """The rule that took it."""


class CheckRecord(Record, tag="check"):
    """The result of a check before or after the session, or why it was skipped. The last one of an id counts."""

    id: str
    """Its id in study.toml."""
    text: str
    """The subject of the check: the sentence that a person confirmed, or the program's description."""
    result: CheckResult
    value: str
    """The finding: `34.1 GB free`."""
    reason: str
    """Why it failed or was skipped."""
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
    """A mark that recordings contain at this moment: a sound or a flash."""

    number: int
    medium: str
    """The kind of mark: `sound`, `flash`."""
    text: str
    source: str
    at: float | None = None
    """Session time in seconds of its start; null: `t`, as far as known."""
    within: float | None = None
    """The maximum error of `at` in seconds; null: unknown."""


class ScenarioRecord(Record, tag="scenario"):
    """The session continues with changed files of its scenario."""

    hash: str
    """SHA-256 of the new scenario, comparable to `scenario_hash` of the session's first record."""
    was: str
    """SHA-256 of the earlier scenario."""
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
