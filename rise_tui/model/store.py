"""The console's knowledge: the engine's view, and its own requests without an answer.

A read model without any screen. Panes read it; only `ConsoleSession` and the screens change it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import urandom
from time import monotonic
from typing import Any, Literal, TypeAlias, get_args

from msgspec import Struct

from rise_engine.author.drawing.act_graph import estimate_act_seconds
from rise_engine.author.drawing.study_keys import StudyKeys
from rise_engine.kernel.behaviors import started_rule
from rise_engine.kernel.record_words import words_of
from rise_engine.kernel.records import (
    ENGINE,
    ActionRecord,
    AnyRecord,
    CheckRecord,
    ControlRecord,
    CountdownRecord,
    CueRecord,
    EventRecord,
    FailureRecord,
    KeptRecord,
    MemoryRecord,
    MistakeRecord,
    OpenGoal,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    SessionRecord,
    StopRecord,
    SyncRecord,
    TaskRecord,
)
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import ActView, RuleView, SessionView
from rise_engine.run.protocol.client import AttachReply, ClientUpdate, Heartbeat, JournalStatus, ShadowStatus
from rise_engine.scenario.model import CUE_TOPICS, KeyBinding, Scenario, normal_topic
from rise_engine.scenario.reading.lexicon import RobotWording
from rise_tui.model import control
from rise_tui.model.control import (
    CUE_EVENTS,
    STARTING_FUNCTIONS,
    BlockedReason,
    ExpectedInputs,
    InputMode,
    Intent,
    find_expected_inputs,
)
from rise_tui.model.cue import CueClock, cue_clock
from rise_tui.model.log_rows import BY_RULE, LogRows, is_by_wizard
from rise_tui.model.memory_changes import UndoStack
from rise_tui.model.notice import Notice, completion_message, record_notice, short_name
from rise_tui.model.speech import CurrentSentence, SentenceTracker

StorePart: TypeAlias = Literal["acts", "rules", "memory", "tasks", "status", "stop", "cue", "notice", "flash"]
"""The parts that a batch of records changed. A pane names those that it shows."""

ALL_PARTS: frozenset[StorePart] = frozenset(get_args(StorePart)) - {"flash"}
"""All parts that may differ. A mark is flashed only when it arrives."""

_PARTS_OF_RECORD: dict[type, frozenset[StorePart]] = {
    MemoryRecord: frozenset({"memory"}),
    RuleRecord: frozenset({"rules"}),
    CountdownRecord: frozenset({"rules"}),
    KeptRecord: frozenset({"rules", "tasks"}),
    StopRecord: frozenset({"stop", "status"}),
    **dict.fromkeys((RobotRecord, SessionRecord, CheckRecord, OutcomeRecord), frozenset[StorePart]({"status"})),
    **dict.fromkeys((RecordingRecord, ControlRecord), frozenset[StorePart]({"status"})),
    ActionRecord: frozenset({"acts"}),
    CueRecord: frozenset({"cue"}),
    **dict.fromkeys((MistakeRecord, FailureRecord), frozenset[StorePart]({"tasks", "acts"})),
}
"""`apply` adds the parts of tasks, and of events that no rule took."""
_LIST_PARTS: frozenset[StorePart] = frozenset({"acts", "rules", "memory", "tasks"})
"""The parts that may show a sent request."""
_PARTS_OF_TASK: dict[str, frozenset[StorePart]] = {
    "startCommunicationRobotAct": frozenset({"tasks", "acts"}),
    "say": frozenset({"tasks", "acts"}),
    "startInteractionRule": frozenset({"tasks", "rules"}),
}


def parts_of_sent(function: str) -> frozenset[StorePart]:
    """The parts that show a sent task with this function."""
    return ALL_PARTS if function == "stopAll" else _PARTS_OF_TASK.get(function, _LIST_PARTS)


LATE_FLASH_SECONDS = 1.0
"""Seconds. A console that receives a mark later than this shows nothing, because there was no flash in time."""


class SentTask(Struct, frozen=True):
    """A request, until the engine's record of it arrives (console.md 3.1)."""

    function: str
    behavior: str
    at: float


SILENT_SECONDS = 3.0
"""Seconds without a sign of life of the engine, normally one a second, before the console shows it."""


@dataclass
class Store:
    """One console's knowledge of one session."""

    attach_reply: AttachReply
    wizard: str
    now: Callable[[], float]
    """Session time in seconds."""
    view: SessionView = field(init=False)
    reference_prefix: str = field(default_factory=lambda: f"{urandom(3).hex()}-")
    """The prefix of this console's own references. A second console of the same wizard has another."""
    sent: dict[str, SentTask] = field(default_factory=dict)
    """Requests by the console's own reference."""
    log: LogRows = field(default_factory=LogRows)
    """The rows of the log in order of arrival. The lists are replaced when the view has forgotten some."""
    notice: Notice | None = None
    gone_reason: str = ""
    """Why the session is over or the engine has gone; empty: neither."""
    ended_in_order: bool = False
    """Whether the session ended in order. With `gone_reason` alone, the engine has gone."""
    end_unrecorded: bool = False
    """Whether the session is over, but its record has no end, because the disk failed."""
    cut_since: float | None = None
    """Since when this connection has been cut, on the console's own clock; None: it is intact."""
    stop_unsent: bool = False
    """Whether the stop key was pressed while it could not be sent."""
    journal_status: JournalStatus = field(init=False)
    heartbeat: Heartbeat = field(default_factory=Heartbeat)
    """The last sign of life of the robot and the engine."""
    heard_at: float | None = None
    """The engine's last sign of life, on the console's own clock; None: it gives none, as in a replay."""
    shadow: ShadowStatus | None = None
    """The state of the shadow, while this console plays a session's cues to a second wizard."""
    input_mode: InputMode = "LIVE"
    """Whether this console's keys start anything, as its wizard has chosen."""
    control_lost: control.ControlLost | None = None
    """The loss of control, until the wizard presses a key."""
    reclaims_control: bool = False
    """Whether it had control when the connection was cut, and no other client has it now, except perhaps its own cut
    connection."""
    is_covered: bool = False
    """Whether an overlay takes the keys."""
    armed: control.KeyAction | None = None
    """The start whose first of two presses was seen."""
    newest_speech: int = 0
    """The id of the latest task of free speech."""
    shown_act: str = ""
    """The act that started last, or the one that the wizard has selected since; empty: free speech is the newest."""
    shown_rule: str = ""
    condition_labels: Mapping[str, str] | None = None
    """The study's labels of its conditions, by name; None: not read yet, so no condition is shown."""
    flash: SyncRecord | None = None
    """The latest mark for cameras that arrived in time while this console was attached."""
    last_deletion: tuple[str, Any] | None = None
    """The memory key that the wizard last deleted, and its value."""

    changed_tasks: list[int] = field(default_factory=list)
    """Tasks that have changed after their end since this console attached: a mistake mark was set or removed, or no
    rule took their event."""
    undo_stack: UndoStack = field(default_factory=UndoStack)
    """The memory changes of this console, which it can undo."""

    study_keys: StudyKeys = field(init=False)
    wording: RobotWording = field(init=False)
    sentences: SentenceTracker = field(init=False)
    _scenario_hash: str = field(init=False)
    _estimates: dict[str, float] = field(default_factory=dict)
    """Estimated seconds of acts that have not run yet, with the present memory."""

    def __post_init__(self) -> None:
        self._scenario_hash = self.scenario.hash
        self.wording = RobotWording(self.scenario)
        self.study_keys, self.sentences = StudyKeys(self.scenario), SentenceTracker(self.scenario)
        self._rebuild(self.attach_reply)
        self.shown_act = self.view.tasks[self.view.running[-1]].behavior if self.view.running else ""
        self.shown_rule = next(iter(self.view.running_rules()), "")

    def reattach(self, attach_reply: AttachReply) -> None:
        """Take over the new snapshot, which is right, after the connection was cut."""
        had_control, former_name = self.has_control, self.own_name
        self.cut_since, self.stop_unsent, self.heard_at = None, False, None
        self.sent.clear()
        self._rebuild(attach_reply)
        lost = had_control and not self.has_control
        self.reclaims_control = lost and self.view.control in (None, former_name)
        if lost and not self.reclaims_control:
            self.control_lost = control.ControlLost(self.view.control, None)

    def _rebuild(self, attach_reply: AttachReply) -> None:
        if attach_reply.scenario.hash != self._scenario_hash:  # the session has taken over changed files
            self._scenario_hash = attach_reply.scenario.hash
            self.wording = RobotWording(attach_reply.scenario)
            self.study_keys, self.sentences = StudyKeys(attach_reply.scenario), SentenceTracker(attach_reply.scenario)
        self.attach_reply, self.view, self.journal_status = attach_reply, attach_reply.view, attach_reply.journaling
        self.log.rebuild(self.view)
        self.changed_tasks.clear()
        self._restart_trackers()

    def _restart_trackers(self) -> None:
        """Restart from the view the parts that follow the session record by record."""
        self.newest_speech = next((id for id in reversed(self.view.tasks) if self.view.tasks[id].function == "say"), 0)
        self.undo_stack.clear()
        self._estimates.clear()
        self.sentences.rebuild(self.view)

    @property
    def scenario(self) -> Scenario:
        return self.attach_reply.scenario

    @property
    def memory(self) -> Mapping[str, Any]:
        """The working memory for expressions and templates, including tables."""
        return {**self.scenario.table_memory, **{key: entry.value for key, entry in self.view.memory.items()}}

    @property
    def stopping(self) -> bool:
        """True from the press of the stop key until the engine answers."""
        return any(sent.function == "stopAll" for sent in self.sent.values())

    @property
    def key_state(self) -> InputMode | Literal["STOPPED"]:
        """Whether keys start anything. A stop overrides the wizard's choice."""
        is_stopped = self.view.stop.latched or self.stopping or self.journal_status.stop is not None
        return "STOPPED" if is_stopped else self.input_mode

    @property
    def open_goals(self) -> tuple[OpenGoal, ...]:
        """The robot's open goals that hold a part."""
        robot = self.view.robot
        return tuple(goal for goal in robot.open if goal.holds) if robot is not None else ()

    @property
    def own_name(self) -> str:
        """The session's name for this console."""
        return self.attach_reply.you or f"wizard:{self.wizard}"

    @property
    def person(self) -> str:
        """The person at this console, as the record names them. A second console is not a second person."""
        return self.own_name.partition("#")[0]

    @property
    def is_of_study(self) -> bool:
        """Whether the session belongs to a study."""
        return self.view.session is not None and bool(self.view.session.study)

    @property
    def has_control(self) -> bool:
        """Whether this console may act. In a replay nobody can act."""
        return not self.attach_reply.you or self.view.control == self.attach_reply.you

    @property
    def asker(self) -> str | None:
        """The client that waits for this console's answer about control."""
        return self.view.asked if self.has_control and self.view.asked != self.own_name else None

    @property
    def silent_seconds(self) -> float:
        """Seconds without a sign of life of the engine; 0: it gives them, or the session is over."""
        if self.heard_at is None or self.gone_reason or self.cut_since is not None:
            return 0.0
        silent = monotonic() - self.heard_at
        return silent if silent >= SILENT_SECONDS else 0.0

    def blocked_reason(self, intent: Intent) -> BlockedReason | None:
        """What blocks this intent from this console now; None: nothing."""
        if self.gone_reason:
            return BlockedReason("over" if self.ended_in_order else "gone", self.gone_reason)
        if self.cut_since is not None:
            return BlockedReason("cut")
        if intent != "reach" and self.attach_reply.replay:
            return BlockedReason("replay")
        if intent in ("change", "start") and not self.has_control:
            watches = self.attach_reply.role == "observer"
            return BlockedReason("control", holder=short_name(self.view.control), watches=watches)
        if intent != "reach" and self.shadow is not None and self.shadow.paused:
            return BlockedReason("paused")
        return self._start_blocked() if intent == "start" else None

    def _start_blocked(self) -> BlockedReason | None:
        if self.silent_seconds:
            return BlockedReason("silent")
        if self.journal_status.trouble:
            return BlockedReason("not-recording", self.journal_status.trouble)
        match self.key_state:
            case "STOPPED":
                return BlockedReason("stopped")
            case "SAFE":
                return BlockedReason("safe")
            case "LOCKED":
                return BlockedReason("locked")
            case "LIVE":
                return None

    def task_blocked(self, function: str) -> BlockedReason | None:
        """What blocks a task with this function."""
        starts = function in STARTING_FUNCTIONS or CUE_EVENTS.get(function) in self.scenario.topics
        return self.blocked_reason("start" if starts else "change")

    def current_sentence(self) -> CurrentSentence:
        """The robot's present or last speech."""
        return self.sentences.current(self.view, self.now())

    @property
    def cue_clock(self) -> CueClock | None:
        """The time since the participant's cue, until the answering voice is heard or, without one, the act starts."""
        return cue_clock(self.scenario, self.view)

    def expected_keys(self) -> frozenset[str]:
        """The study's keys that a running rule waits for, in Textual's spelling."""
        busy = [task.behavior for task in (*self.running_tasks, *self.waiting_tasks)]
        return self.study_keys.expected_keys(self._rule_states(), self.memory, busy)

    def expected_inputs(self) -> ExpectedInputs:
        """The inputs that the running rules wait for now."""
        return find_expected_inputs(self.study_keys, self._rule_states(), self.memory)

    def _rule_states(self) -> dict[str, str | None]:
        """The state of each running rule."""
        return {name: rule.state for name, rule in self.view.rules.items() if rule.running}

    @property
    def running_tasks(self) -> list[TaskView]:
        """The running tasks of acts and free speech, the oldest first."""
        return [self.view.tasks[id] for id in self.view.running]

    @property
    def waiting_tasks(self) -> list[TaskView]:
        """The tasks that wait for their turn, the next first."""
        return [self.view.tasks[id] for id in self.view.waiting]

    def act(self, name: str) -> ActView:
        return self.view.acts.get(name) or ActView()

    def typical_seconds(self, name: str) -> float | None:
        """The usual duration of an act: the mean of its runs, or an estimate before the first run."""
        measured = self.act(name).typical
        if measured is None and name in self.scenario.acts:
            if name not in self._estimates:
                self._estimates[name] = estimate_act_seconds(self.scenario, self.scenario.acts[name], self.memory)
            return self._estimates[name]
        return measured

    def rule(self, name: str) -> RuleView:
        return self.view.rules.get(name) or RuleView()

    def key_of(self, function: str, behavior: str) -> KeyBinding | None:
        """The scenario's key that submits this, if any."""
        return self.study_keys.key_of(function, behavior)

    def is_sent(self, functions: Sequence[str], behavior: str) -> bool:
        return any(sent.function in functions and sent.behavior == behavior for sent in self.sent.values())

    def apply(self, updates: Sequence[ClientUpdate]) -> set[StorePart]:
        """Process a batch of updates. Returns the changed parts."""
        changed: set[StorePart] = set()
        noticed = self.notice
        if self.heard_at is not None or any(isinstance(record, Heartbeat) for record in updates):
            self.heard_at = monotonic()
        for record in updates:
            if isinstance(record, JournalStatus):
                changed |= self._apply_journal_status(record)
                continue
            if isinstance(record, Heartbeat):
                self.heartbeat = record  # the clock's next second shows it
                continue
            if isinstance(record, ShadowStatus):
                self.shadow = record
                changed |= ALL_PARTS
                continue
            if isinstance(record, TaskRecord):
                changed |= self._apply_task(record)
            holder, newest_remark = self.view.control, self.view.remarks[-1] if self.view.remarks else None
            forgotten, raised = self.view.forgotten, tuple(self.view.raised)
            self.view.apply(record)
            if self.view.forgotten != forgotten:
                self._trim()
            if self.view.remarks and self.view.remarks[-1] is not newest_remark:
                self.log.add_remark(self.view.remarks[-1])
                changed.add("tasks")
            if not (isinstance(record, TaskRecord) and record.id in self.view.failed):  # its bar shows it
                self.notice = record_notice(record) or self.notice
            if isinstance(record, StopRecord) and record.status == "released":
                live = f": {self.input_mode}" if self.has_control or self.input_mode != "LIVE" else ""
                self.notice = Notice(f"the stop is released{live}")
            if isinstance(record, ControlRecord) and self.attach_reply.you:
                notice, lost = control.control_notice(record, holder, self.attach_reply.you)
                # A notice about the earlier holder of control would now be wrong.
                self.notice = notice or (None if lost else self.notice)
                self.control_lost = lost or (None if self.has_control else self.control_lost)
            if isinstance(record, EventRecord):
                changed |= self._apply_event(record, raised)
            elif isinstance(record, MemoryRecord):
                self._estimates.clear()
                if record.source == self.own_name:
                    self.undo_stack.record_change(record)
            elif isinstance(record, ActionRecord):
                self.sentences.record_action(record, self.view)
            elif isinstance(record, MistakeRecord):
                self.changed_tasks.append(record.task)
            elif isinstance(record, SyncRecord) and record.medium == "flash" and not self.attach_reply.replay:
                if self.now() - record.t > LATE_FLASH_SECONDS:
                    self.notice = Notice(f"mark {record.number} came too late to be shown here", "wait")
                else:
                    self.flash = record
                    changed.add("flash")
            changed |= _PARTS_OF_RECORD.get(type(record), frozenset())
            if self.view.cue is not None and self.view.cue.task in _tasks_of(record):
                changed.add("cue")  # the answer is heard, or never will be
        if self.notice is not noticed:
            changed.add("notice")
        return changed

    @property
    def forgotten_text(self) -> str:
        """A sentence that the oldest tasks are only in the record; empty: all are here."""
        count = self.view.forgotten
        return f"{count:,} older {'task is' if count == 1 else 'tasks are'} only in the record" if count else ""

    def _trim(self) -> None:
        """Forget the tasks that the view has forgotten."""
        tasks = self.view.tasks
        self.changed_tasks[:] = [id for id in self.changed_tasks if id in tasks]
        self.log.rebuild(self.view)

    def _apply_event(self, record: EventRecord, raised: Iterable[int]) -> frozenset[StorePart]:
        """Note that no rule took an event, and which of these tasks raised it."""
        if record.taken_by is not None:
            return frozenset()
        view, source = self.view, record.source
        if source == ENGINE and normal_topic(record.topic) == CUE_TOPICS[0] and view.cue is not None:
            source = view.cue.source
        rule = view.rules.get(source.removeprefix(BY_RULE))
        starter = view.tasks.get(rule.task or 0) if rule is not None else None
        by_wizard = is_by_wizard(source, record.t, starter, view.tasks)
        if by_wizard:
            self.notice = Notice(words_of(record).sentence, "wait")
        missed = [id for id in raised if id not in view.raised and id in view.tasks and view.tasks[id].taken is False]
        self.changed_tasks += missed
        if missed and by_wizard:
            self.log.show_own_row(missed[-1])
        return frozenset({"tasks"}) if missed else frozenset()

    def _apply_journal_status(self, now: JournalStatus) -> frozenset[StorePart]:
        """Take over the state of the record. Invisible changes are not painted."""
        before, self.journal_status = self.journal_status, now
        if before.trouble and not now.trouble:
            self.notice = Notice("the disk accepts records again: the session goes on")
        shown = (before.trouble, before.stop) != (now.trouble, now.stop) or int(before.behind) != int(now.behind)
        return frozenset({"status"}) if shown else frozenset()

    def _apply_task(self, record: TaskRecord) -> frozenset[StorePart]:
        changed = _PARTS_OF_TASK.get(record.function, frozenset({"tasks"}))
        if record.id not in self.view.tasks:
            self.log.add_task(record)
            self.newest_speech = record.id if record.function == "say" else self.newest_speech
        elif record.status in ("REJECTED", "ABORTED"):
            self.log.show_own_row(record.id)
        if record.ref is not None:
            if self.sent.pop(record.ref, None) is not None:
                changed = parts_of_sent(record.function)
            own = record.ref.startswith(self.reference_prefix)
            if own and record.status == "SUCCEEDED" and (text := completion_message(record.function, record.behavior)):
                self.notice = Notice(text)
        if record.status == "ACTIVE" and record.function in ("startCommunicationRobotAct", "say"):
            self.shown_act = "" if record.function == "say" else record.behavior
        elif record.status == "ACTIVE" and record.function == "startInteractionRule" and not self.shown_rule:
            self.shown_rule = started_rule(record.behavior)
        return changed


def _tasks_of(record: AnyRecord) -> tuple[int, ...]:
    """The task that a record is about."""
    match record:
        case TaskRecord(id=task) | ActionRecord(task=task):
            return (task,)
        case _:
            return ()
