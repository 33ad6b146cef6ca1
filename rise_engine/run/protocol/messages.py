"""The messages on a session's socket: one JSON object per line (docs/reference/link.md).

A client attaches and gets the session's state in pieces (`hello`, `tasks`, `ready`). Then it gets every record, and the
replies to its messages. Readers ignore unknown fields.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from functools import cache
from typing import Annotated, Any, TypeAlias

import msgspec
from msgspec import Meta, Struct, field

from rise_engine.base.json_codec import encode
from rise_engine.kernel.history import MemoryLog
from rise_engine.kernel.records import (
    AnyRecord,
    CheckRecord,
    EventRecord,
    OpenGoal,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    SessionRecord,
    SyncRecord,
)
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import (
    ActView,
    CueView,
    KeptView,
    MemoryView,
    RaisedView,
    RemarkView,
    RuleView,
    SessionView,
    StopView,
)
from rise_engine.run.protocol.client import ClientInput, ControlVerb, Heartbeat, JournalStatus, Role

VERSION = 4
"""Raised with every change of a message, also for an additional field, which an older console would not show."""
MAX_LINE_BYTES = 1_048_576
"""Maximum bytes of a client's line. A longer line ends its connection."""
MAX_MESSAGE_BYTES = 65_536
"""Maximum bytes of a `send`; a longer one is rejected. Its texts are repeated in records to every client."""

Number: TypeAlias = Annotated[int, Meta(ge=0, le=2**53)]


# --- from a client --------------------------------------------------------------------------------------------------


class AttachMessage(Struct, tag_field="type", tag="attach", frozen=True):
    """The first line of a client, unless it is `about`."""

    version: int
    name: str
    role: Role = "wizard"
    scenario: bool = False
    """Whether the client wants the scenario with the state."""


class AskSummaryMessage(Struct, tag_field="type", tag="about", frozen=True):
    """A question about the session, without attaching. It gets a reply, and the connection ends."""


class SendMessage(Struct, tag_field="type", tag="send", frozen=True):
    id: Number
    """The client's own number; the `reply` has the same one."""
    message: ClientInput


class ControlMessage(Struct, tag_field="type", tag="control", frozen=True):
    id: Number
    verb: ControlVerb


class EndMessage(Struct, tag_field="type", tag="end", frozen=True):
    """A request to stop the robot and end the session."""

    id: Number
    reason: str = ""


class TakeOverMessage(Struct, tag_field="type", tag="take_over", frozen=True):
    """A request to continue with the scenario's present files (semantics.md 12.5). All clients then attach again."""

    id: Number


ClientMessage: TypeAlias = (
    AttachMessage | AskSummaryMessage | SendMessage | ControlMessage | EndMessage | TakeOverMessage
)


# --- to a client ----------------------------------------------------------------------------------------------------


class ViewWithoutTasks(Struct, frozen=True):
    """A `SessionView` without its tasks, which follow in pieces."""

    seq: int
    t: float
    session: SessionRecord | None
    ended: bool
    end_reason: str
    left_open: tuple[OpenGoal, ...]
    control: str | None
    asked: str | None
    robot: RobotRecord | None
    stop: StopView
    cue: CueView | None
    acts: dict[str, ActView]
    rules: dict[str, RuleView]
    memory: dict[str, MemoryView]
    running: list[int]
    waiting: list[int]
    unhandled: list[EventRecord]
    failed: list[int] = field(default_factory=list)
    questions: list[int] = field(default_factory=list)
    repeats: dict[int, float | None] = field(default_factory=dict)
    kept: dict[int, KeptView] = field(default_factory=dict)
    memory_log: MemoryLog = field(default_factory=MemoryLog)
    condition_values: dict[str, Any] = field(default_factory=dict)
    overridden: dict[str, str] = field(default_factory=dict)
    wizard: str = ""
    remarks: list[RemarkView] = []
    forgotten: int = 0
    checks: dict[str, CheckRecord] = field(default_factory=dict)
    outcome: OutcomeRecord | None = None
    recordings: dict[str, RecordingRecord] = field(default_factory=dict)
    sync: SyncRecord | None = None
    raised: dict[int, RaisedView] = field(default_factory=dict)
    waits_for_wizard: bool = False


class HelloMessage(Struct, tag_field="type", tag="hello", frozen=True):
    version: int
    you: str
    role: Role
    mode: str
    robot: str
    seed: int
    scenario_hash: str
    folder: str
    """The session's absolute folder, which has a copy of the scenario."""
    replay: bool
    journaling: JournalStatus
    t: float
    """The session's present time."""
    speed: float
    """Session seconds in a second."""
    state: ViewWithoutTasks
    tasks: int = 0
    """The number of tasks in the state."""
    origin: float | None = None
    """This computer's monotonic clock at session time 0, in seconds: at `t` it shows `origin + t / speed`. For a
    recovered session it is valid from the recovery on. Null: the session's time is virtual."""


class ScenarioMessage(Struct, tag_field="type", tag="scenario", frozen=True):
    """The session's scenario, for a client that wants it. It comes before `ready`, or not at all."""

    scenario: msgspec.Raw
    """In the encoding of `rise_engine.scenario.serialization`."""


class TasksMessage(Struct, tag_field="type", tag="tasks", frozen=True):
    """Some of the view's tasks: first the unfinished ones, then the others by id."""

    tasks: list[TaskView]


class ReadyMessage(Struct, tag_field="type", tag="ready", frozen=True):
    """The end of the state. Later changes follow as they happen."""


class RecordsMessage(Struct, tag_field="type", tag="records", frozen=True):
    records: list[AnyRecord]


class JournalStatusMessage(Struct, tag_field="type", tag="journaling", frozen=True):
    journaling: JournalStatus


class HeartbeatMessage(Struct, tag_field="type", tag="pulse", frozen=True):
    """A sign of life, about once a second. Not a record."""

    pulse: Heartbeat


class ReplyMessage(Struct, tag_field="type", tag="reply", frozen=True):
    """The reply to `send`, `control` and `end`. An accepted `send` is on the disk, and its records have come before."""

    id: int
    accepted: bool
    reason: str = ""
    task: int | None = None


class RefusedMessage(Struct, tag_field="type", tag="refused", frozen=True):
    """The end of the connection; the session continues."""

    reason: str


class EndedMessage(Struct, tag_field="type", tag="ended", frozen=True):
    """The end of the session, the last line."""

    reason: str
    failed: bool = False
    """Whether the engine itself failed."""


class SessionSummary(Struct, tag_field="type", tag="about", frozen=True, kw_only=True):
    """A summary of a session, for lists of sessions."""

    version: int
    title: str
    mode: str
    robot: str
    seed: int
    scenario_folder: str
    scenario_hash: str
    folder: str
    """The session's folder."""
    t: float
    """Its time in seconds."""
    seq: int
    """The number of records so far."""
    busy: bool
    """Whether an act runs or waits."""
    stopped: bool
    """Whether everything is stopped until the stop is released."""
    control: str | None
    clients: list[str]
    participant: str = ""
    """The participant's name in the record."""
    condition: str = ""
    wizard: str = ""
    """The last wizard who had control, even if their console has gone."""
    replay: bool = False
    trouble: str = ""
    """Why nothing can be recorded. While this is set, the session is paused."""
    pid: int = 0
    program: str = ""
    lag: float = 0.0
    """Maximum delay of the engine's loop within the last five seconds, in seconds."""
    lag_max: float = 0.0
    """The same since the session began."""
    versions: dict[str, str] = field(default_factory=dict)


ServerMessage: TypeAlias = (
    HelloMessage
    | ScenarioMessage
    | TasksMessage
    | ReadyMessage
    | RecordsMessage
    | JournalStatusMessage
    | HeartbeatMessage
    | ReplyMessage
    | RefusedMessage
    | EndedMessage
    | SessionSummary
)


@cache
def _decoder(kind: Any) -> msgspec.json.Decoder[Any]:
    """Make a decoder at its first use, because that takes milliseconds, and each side uses only some."""
    return msgspec.json.Decoder(kind)


def encode_line(message: ClientMessage | ServerMessage) -> bytes:
    """Encode a message with its line end. Lone surrogates, as in a broken file name, are written as `\\udcff`."""
    return encode(message) + b"\n"


def decode_client_message(data: bytes) -> ClientMessage:
    """Decode a client's message. Raises ValueError with a sentence."""
    try:
        return _decoder(ClientMessage).decode(data)  # type: ignore[no-any-return]
    except (ValueError, RecursionError, OverflowError) as error:
        raise ValueError(f"this line is not a message of the protocol: {error}") from None


def decode_server_message(data: bytes) -> ServerMessage:
    """Decode the server's message. Raises ValueError with a sentence."""
    try:
        return _decoder(ServerMessage).decode(data)  # type: ignore[no-any-return]
    except (ValueError, RecursionError, OverflowError) as error:
        raise ValueError(f"the engine sent something that this version does not know: {error}") from None


def without_tasks(view: SessionView) -> ViewWithoutTasks:
    values: dict[str, Any] = {name: getattr(view, name) for name in ViewWithoutTasks.__struct_fields__}
    return ViewWithoutTasks(**{**values, "unhandled": list(view.unhandled), "remarks": list(view.remarks)})


def with_tasks(state: ViewWithoutTasks, tasks: Iterable[TaskView]) -> SessionView:
    """Restore the view from `without_tasks`. An act's last task becomes the same object as among the tasks."""
    view = SessionView(tasks={task.id: task for task in sorted(tasks, key=lambda task: task.id)})
    for name in ViewWithoutTasks.__struct_fields__:
        setattr(view, name, getattr(state, name))
    view.unhandled = deque(state.unhandled, SessionView().unhandled.maxlen)
    view.remarks = deque(state.remarks, SessionView().remarks.maxlen)
    for act in view.acts.values():
        if act.last is not None:
            act.last = view.tasks.get(act.last.id, act.last)
    return view
