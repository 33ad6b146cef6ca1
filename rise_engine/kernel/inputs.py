"""All inputs of a session. An input is a fact that arrived, with its time (architecture, "The kernel").

Only inputs change a session's state, whether they come from consoles, adapters, timers or command lines. `t` is seconds
on the session's monotonic clock. Outside submitters leave it 0, and the engine sets it.
"""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.kernel.records import CheckResult, OpenGoal, OutcomeStatus, Purpose, RecordingStatus

TaskFunction: TypeAlias = Literal[
    "startCommunicationRobotAct",
    "stopCommunicationRobotAct",
    "startInteractionRule",  # behavior: its name, or {"rule": NAME, "state": STATE, "enter": false} (ours)
    "stopInteractionRule",
    "stepBack",  # (ours) behavior: a rule, or {"rule": NAME, "take_back": [KEYS], "enter": true, "stop_acts": false}
    "raiseEventTopic",
    "assignValue",
    # Ours, as tasks, so that one log shows everything (docs/decisions):
    "deleteValue",  # behavior: the memory key
    "cancelTask",  # behavior: the id of a running or waiting task
    "moveTask",  # behavior: "<id> <position>", a waiting task's new position, 0 is next
    "stopAll",  # behavior is empty
    "cancelOpenGoals",  # behavior: a part of the robot, or empty for all: stop its open goals
    "releaseOpenGoals",  # behavior: as for cancelOpenGoals: a person has checked the part, so it may be used again
    "releaseStop",  # behavior is empty, or for each rule that continues {"Table setting": "enter", "Wizard": "wait"}
    "say",  # behavior: the text, which is spoken literally
    "markCue",  # behavior is empty, or a remark: the participant's turn has ended
    "undoCue",  # behavior is empty: the participant has not finished after all
    "nextFiller",  # behavior is empty: the next of the scenario's fillers
    "markMistake",  # behavior: "<id> <wrong|late|early|double|none>", about an act or another task of a wizard
    "goOn",  # behavior: the id of a task whose act has failed: go on without it
    "repeatAct",  # behavior: the task's id, or the act, of a failure with a question: start it again
    "stopRuleOfAct",  # behavior: as for repeatAct; the rule that started the act is stopped
]


class Input(Struct, frozen=True, tag_field="input", kw_only=True, gc=False):
    t: float = 0.0


class Submit(Input, frozen=True, tag="submit", kw_only=True, gc=False):
    """A DomainTask: the only way to request something (semantics.md 1).

    `function` is any text. An unknown one is REJECTED with a reason, like a wrong name.
    """

    function: str
    behavior: str = ""
    calling_type: str = ""
    """`Blocking`, `None`, `Interrupt` (acts only), or empty for the act's default."""
    source: str = "engine"
    """`wizard:<name>`, `rule:<name>`, `ros:<node>`, `file` or `engine`."""
    ref: str | None = None
    """The submitter's own name for it, repeated in the task's records."""
    pressed: float | None = None
    """Session time at which its key was pressed, by the console's clock; null: no key was."""


class ActionReport(Input, frozen=True, tag="action", kw_only=True, gc=False):
    """The robot's report about an action that it received. Reports about ended actions are ignored."""

    action: str
    """The goal id of `StartAction`."""
    status: Literal["accepted", "succeeded", "failed", "canceled", "timed-out", "lost"]
    """`canceled` without a request: another program has stopped it."""
    reason: str = ""
    aborted: bool = False
    """With `failed`: the robot accepted it and then gave it up, for example after a protective stop."""


class TimerElapsed(Input, frozen=True, tag="timer", kw_only=True, gc=False):
    """A timer of the kernel has elapsed. A timer that was cancelled meanwhile is ignored."""

    timer: int


class RobotChanged(Input, frozen=True, tag="robot", kw_only=True, gc=False):
    """The link to the robot changed. On `lost`, all actions on the robot are lost."""

    status: Literal["connected", "degraded", "lost"]
    detail: str = ""
    open: tuple[OpenGoal, ...] = ()
    """The robot's open goals."""


class StopReport(Input, frozen=True, tag="stop_report", kw_only=True, gc=False):
    """The robot's answer to stop-all: which parts confirmed their stop. A new answer follows each change until the
    release."""

    confirmed: tuple[str, ...] = ()
    unconfirmed: tuple[str, ...] = ()
    """With the reason in brackets: `pepper/speech (asked, no answer)`."""
    unstoppable: tuple[str, ...] = ()
    """Parts that cannot be stopped."""


class EstopReport(Input, frozen=True, tag="estop", kw_only=True, gc=False):
    """An emergency stop of the laboratory was pressed or released. Repeated reports are possible."""

    source: str
    """`estop:<where>`, as in `estop:/estop_pressed`."""
    pressed: bool


class Note(Input, frozen=True, tag="note", kw_only=True, gc=False):
    """A remark for the record."""

    text: str
    source: str = "engine"
    stood: float | None = None
    """From the engine: seconds of the wall clock for which it has just stood still, or could not record."""
    suspended: bool = False
    """With `stood`: the computer was suspended, so session time stood still."""


class SessionStarted(Input, frozen=True, tag="session_started", kw_only=True, gc=False):
    """The first input of a session."""

    versions: dict[str, str] = {}
    participant: str = ""
    condition: str = ""
    factors: dict[str, Any] = {}
    study: str = ""
    study_hash: str = ""
    slot: int | None = None
    run: int = 0
    attempt: int = 0
    purpose: Purpose | Literal[""] = ""
    driver: str = ""
    injected_faults: tuple[str, ...] = ()
    speed: float = 1.0
    """The fields above are those of `rise_engine.kernel.records.SessionRecord`."""
    goals: str = ""
    """A random text, the source of the UUIDs of goals on the robot. Empty in older journals, where the folder's name
    and the seed are the source."""
    memory: dict[str, Any] = {}
    """The memory values of the condition, set after the scenario's start values and before anything runs."""


class SessionRecovered(Input, frozen=True, tag="session_recovered", kw_only=True, gc=False):
    """A new engine continues this session because the earlier one has gone. The actions on the robot are lost."""

    versions: dict[str, str] = {}
    reason: str = ""
    downtime: float | None = None
    """Seconds by the wall clock since the last known line of the earlier engine; null: unknown."""
    waits_for_wizard: bool = False
    """No act and no action begins until a wizard has control."""


ControlStatus: TypeAlias = Literal["taken", "asked", "given", "released"]


class ControlChanged(Input, frozen=True, tag="control", kw_only=True, gc=False):
    """The control of a session has changed, or a console asks for it."""

    status: ControlStatus
    by: str
    """The console that caused it: `wizard:<name>`."""
    holder: str | None
    """The new holder of control; null: nobody."""


class CheckReport(Input, frozen=True, tag="check", kw_only=True, gc=False):
    """The result of a check before or after the session. Fields as in `rise_engine.kernel.records.CheckRecord`."""

    id: str
    text: str = ""
    result: CheckResult
    value: str = ""
    reason: str = ""
    source: str = "engine"


class OutcomeReport(Input, frozen=True, tag="outcome", kw_only=True, gc=False):
    """A decision on how the session counts. The last one is valid."""

    status: OutcomeStatus
    reason: str = ""
    source: str = "engine"


class RecordingReport(Input, frozen=True, tag="recording", kw_only=True, gc=False):
    """The state of a recording of the session. Fields as in `rise_engine.kernel.records.RecordingRecord`."""

    name: str
    status: RecordingStatus
    path: str = ""
    bytes: int | None = None
    reason: str = ""
    source: str = "engine"


class SyncMark(Input, frozen=True, tag="sync", kw_only=True, gc=False):
    """A mark for recordings was given. Fields as in `rise_engine.kernel.records.SyncRecord`."""

    number: int
    medium: str
    text: str = ""
    source: str = "engine"
    at: float | None = None
    within: float | None = None


class ScenarioChanged(Input, frozen=True, tag="scenario_changed", kw_only=True, gc=False):
    """The session continues with changed files, which are stored in its folder (semantics.md 12.5)."""

    hash: str
    """The hash of the new scenario, as `Scenario.hash`."""
    was: str
    """The hash of the earlier scenario."""
    copy: str
    """The subfolder of the session's folder with its files: `scenario.2`."""
    source: str = "engine"


class SessionEnded(Input, frozen=True, tag="session_ended", kw_only=True, gc=False):
    """The last input of a session."""

    reason: str = ""


AnyInput: TypeAlias = (
    Submit
    | ActionReport
    | TimerElapsed
    | RobotChanged
    | StopReport
    | EstopReport
    | Note
    | ControlChanged
    | SessionStarted
    | SessionRecovered
    | SessionEnded
    | CheckReport
    | OutcomeReport
    | RecordingReport
    | SyncMark
    | ScenarioChanged
)
