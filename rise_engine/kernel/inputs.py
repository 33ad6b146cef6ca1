"""Everything that can happen to a session. An input is a fact that arrived, with its time (architecture, "The kernel").

Consoles, adapters, timers and command lines all speak these; there is no other way to change a session's state.
`t` is seconds on the session's monotonic clock; whoever submits from outside leaves it 0 and the engine stamps it.
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
    # Ours, by the same path, so that one log shows everything (docs/decisions):
    "deleteValue",  # behavior: the memory key
    "cancelTask",  # behavior: the id of a running or waiting task
    "moveTask",  # behavior: "<id> <position>", a waiting task's new position, 0 is next
    "stopAll",  # behavior is empty
    "cancelOpenGoals",  # behavior: a part of the robot, or empty for all: stop what it may still be doing
    "releaseOpenGoals",  # behavior: as of cancelOpenGoals: somebody has looked, and the part may be used again
    "releaseStop",  # behavior is empty, or for each rule that goes on {"Table setting": "enter", "Wizard": "wait"}
    "say",  # behavior: the text, as it is to be said
    "markCue",  # behavior is empty, or a word about it: the participant's turn has ended
    "undoCue",  # behavior is empty: the participant has not finished after all
    "nextFiller",  # behavior is empty: the next of the scenario's fillers
    "markMistake",  # behavior: "<id> <wrong|late|early|double|none>", about an act or another task of a wizard
    "goOn",  # behavior: the id of a task whose act has failed: somebody has seen it, and goes on without it
    "repeatAct",  # behavior: the id, or the act, of a failure that somebody is asked about: it is started again
    "stopRuleOfAct",  # behavior: as of repeatAct; the rule that started the act is stopped
]


class Input(Struct, frozen=True, tag_field="input", kw_only=True, gc=False):
    t: float = 0.0


class Submit(Input, frozen=True, tag="submit", kw_only=True, gc=False):
    """A DomainTask: the one path by which anybody asks for anything (semantics.md 1).

    `function` is any text: an unknown one is REJECTED with a reason, as a wrong name is.
    """

    function: str
    behavior: str = ""
    calling_type: str = ""
    """`Blocking`, `None`, `Interrupt` (acts only), or empty for the act's own default."""
    source: str = "engine"
    """`wizard:<name>`, `rule:<name>`, `ros:<node>`, `file` or `engine`."""
    ref: str | None = None
    """The submitter's own name for it, echoed in the task's records."""
    pressed: float | None = None
    """Session time at which a person pressed the key for it, as the console's clock has it; null: nobody did."""


class ActionReport(Input, frozen=True, tag="action", kw_only=True, gc=False):
    """The robot's word about an action that it was given. Reports for actions that have ended are ignored."""

    action: str
    """The goal id of `StartAction`."""
    status: Literal["accepted", "succeeded", "failed", "canceled", "timed-out", "lost"]
    """`canceled` without having been asked for: somebody else has stopped it."""
    reason: str = ""
    aborted: bool = False
    """With `failed`: the robot took it, and has given it up by itself, as after a protective stop."""


class TimerElapsed(Input, frozen=True, tag="timer", kw_only=True, gc=False):
    """A timer that the kernel asked for has run out. One that was cancelled meanwhile is ignored."""

    timer: int


class RobotChanged(Input, frozen=True, tag="robot", kw_only=True, gc=False):
    """The link to the robot changed. On `lost`, every action that it was running is lost."""

    status: Literal["connected", "degraded", "lost"]
    detail: str = ""
    open: tuple[OpenGoal, ...] = ()
    """Everything that the robot may still be doing of actions that have ended for the session."""


class StopReport(Input, frozen=True, tag="stop_report", kw_only=True, gc=False):
    """The robot's answer to stop-all: which of its parts confirmed that they stopped, and which did not. It answers
    again whenever that changes, until the stop is released."""

    confirmed: tuple[str, ...] = ()
    unconfirmed: tuple[str, ...] = ()
    """With the reason in brackets: `pepper/speech (asked, no answer)`."""
    unstoppable: tuple[str, ...] = ()
    """Parts that take no stop at all, and that this session has used."""


class EstopReport(Input, frozen=True, tag="estop", kw_only=True, gc=False):
    """An emergency stop of the laboratory was pressed, or let go; also said again, when that is heard anew."""

    source: str
    """`estop:<where>`, as `estop:/estop_pressed`."""
    pressed: bool


class Note(Input, frozen=True, tag="note", kw_only=True, gc=False):
    """A remark for the record."""

    text: str
    source: str = "engine"


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
    """These are as in `rise_engine.kernel.records.SessionRecord`."""
    memory: dict[str, Any] = {}
    """What the condition sets in the memory, after the scenario's start values and before anything runs."""


class SessionRecovered(Input, frozen=True, tag="session_recovered", kw_only=True, gc=False):
    """The engine that ran this session has gone, and another one goes on with it. What the robot was doing is lost."""

    versions: dict[str, str] = {}
    reason: str = ""
    downtime: float | None = None
    """Seconds by the wall clock since the last line that is known of the engine before; null: not known."""


ControlStatus: TypeAlias = Literal["taken", "asked", "given", "released"]


class ControlChanged(Input, frozen=True, tag="control", kw_only=True, gc=False):
    """Among the consoles of a session, who may act has changed, or somebody asks for it."""

    status: ControlStatus
    by: str
    """Who did it: `wizard:<name>`."""
    holder: str | None
    """Who holds control now; null: nobody."""


class CheckReport(Input, frozen=True, tag="check", kw_only=True, gc=False):
    """What came of something that was looked at before or after the session. Fields as in
    `rise_engine.kernel.records.CheckRecord`."""

    id: str
    text: str = ""
    result: CheckResult
    value: str = ""
    reason: str = ""
    source: str = "engine"


class OutcomeReport(Input, frozen=True, tag="outcome", kw_only=True, gc=False):
    """Somebody says how the session is to count; of several, the last one counts."""

    status: OutcomeStatus
    reason: str = ""
    source: str = "engine"


class RecordingReport(Input, frozen=True, tag="recording", kw_only=True, gc=False):
    """How something stands that records the session. Fields as in `rise_engine.kernel.records.RecordingRecord`."""

    name: str
    status: RecordingStatus
    path: str = ""
    bytes: int | None = None
    reason: str = ""
    source: str = "engine"


class SyncMark(Input, frozen=True, tag="sync", kw_only=True, gc=False):
    """A mark was given that recordings show. Fields as in `rise_engine.kernel.records.SyncRecord`."""

    number: int
    medium: str
    text: str = ""
    source: str = "engine"
    at: float | None = None
    within: float | None = None


class ScenarioChanged(Input, frozen=True, tag="scenario_changed", kw_only=True, gc=False):
    """The session goes on with changed files, which are kept in its folder (semantics.md 12.5)."""

    hash: str
    """Of the scenario from here on, as `Scenario.hash`."""
    was: str
    """Of the one until here."""
    copy: str
    """The folder of its files, in the session's: `scenario.2`."""
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
