"""The state of a session as seen from outside: a fold over records (architecture, "The kernel").

Consoles, transcripts, tests and the snapshot on the socket use this `SessionView`, never the engine's inner state.
`SessionView.apply(record)` for every record from the first one gives the same value as the snapshot that a late client
gets.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from itertools import islice
from typing import Any

from msgspec import Struct, field

from rise_engine.base.json_codec import json_equal
from rise_engine.kernel.behaviors import describe_behavior, started_rule
from rise_engine.kernel.history import MAX_STEPS, MemoryLog, ValueBefore
from rise_engine.kernel.record_words import words_of
from rise_engine.kernel.records import (
    ENGINE,
    FINAL,
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
    NoteRecord,
    OpenGoal,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    ScenarioRecord,
    SessionRecord,
    StopRecord,
    SyncRecord,
    TaskRecord,
    TimingRecord,
    describe_open_goals,
)
from rise_engine.kernel.reports import REPORT_KINDS, ReportRecord
from rise_engine.kernel.task_view import ACT_FUNCTIONS, TaskView, add_action_record, add_record, add_task_record
from rise_engine.scenario.model import CUE_TOPICS, normal_topic

SET_AT_START = ("condition", "study")
"""The sources of the values that a session gets at its start."""
MAX_ENDED_TASKS = 100_000
"""The number of finished tasks that a view keeps. Older ones are in the journal."""
MAX_REMARKS, MAX_REMARK_CHARACTERS = 500, 1_000
"""The number of notes and similar remarks that it keeps, and the characters of each. The journal has all in full."""
RAISING = ("raiseEventTopic", "markCue")
"""The functions of tasks that raise an event."""
FORGET_AT_ONCE = 10_000
"""The number of additional tasks before the oldest are forgotten together."""


class ActView(Struct):
    """The state of one CRA."""

    running: list[int] = field(default_factory=list)
    """Its ACTIVE tasks, oldest first."""
    waiting: list[int] = field(default_factory=list)
    last: TaskView | None = None
    """Its last task that ended or was rejected."""
    runs: int = 0
    """The number of its successes; `typical` is their mean duration."""
    latest: int = 0
    """The id of the last task that requested it and was not rejected."""
    typical: float | None = None


class RuleView(Struct):
    """The state of one IR."""

    running: bool = False
    state: str | None = None
    since: float = 0.0
    """When it entered its state, or ended."""
    previous: str | None = None
    trigger: str | None = None
    transition: int | None = None
    status: str = ""
    """The status of the last record; empty before the first start."""
    reason: str = ""
    priority: float = 0
    entered: int = 0
    """`seq` of its last move, which orders rules of equal priority on the stack."""
    task: int | None = None
    countdowns: dict[int, CountdownView] = field(default_factory=dict)
    """The times that its state counts, by the index of the transition."""
    steps: list[tuple[str, int]] = field(default_factory=list)
    """Its latest states, the present one last, as `rise_engine.kernel.history.Steps`."""


class CountdownView(Struct):
    """A time that a rule counts, other than a plain `after`."""

    since: float
    seconds: float | None
    """Null: it could not be computed."""
    reason: str = ""
    """Why not."""


class KeptView(Struct):
    """An event that is kept until a rule waits for it."""

    topic: str
    source: str
    until: float


class RaisedView(Struct):
    """An event on its way to the rules."""

    topic: str
    """Without its slash."""
    source: str
    next_seq: int | None = None
    """For an event that was kept: the number of the record that may report it."""


class MemoryView(Struct):
    """One key of the working memory."""

    value: Any
    old: Any
    source: str
    changed: float


class RemarkView(Struct, gc=False):
    """A text to show among the tasks: a note, a report, a change of the robot's link, a rule's fault."""

    kind: str
    """`note`, `robot`, `fault`, `check`, `outcome`, `recording` or `sync`."""
    t: float
    source: str
    """The author of the note or report, `robot`, or the rule."""
    text: str
    status: str = ""
    """For the robot: connected, degraded or lost; for a report, the status of its record."""
    after: int = 0
    """The id of the latest task before it."""


class CueView(Struct):
    """The participant's last cue."""

    t: float
    source: str
    filled: float | None = None
    """When the latest filler after it started."""
    answered: float | None = None
    """When the first act after it started that was no filler."""
    task: int | None = None
    """The task of that act. The robot may speak some time later."""


class StoppedRuleView(Struct):
    """The state of a rule that a stop ended."""

    rule: str
    state: str


class StopView(Struct):
    status: str = "released"
    since: float = 0.0
    confirmed: tuple[str, ...] = ()
    unconfirmed: tuple[str, ...] = ()
    unstoppable: tuple[str, ...] = ()
    """Parts that cannot be stopped."""
    source: str = ""
    stood: list[StoppedRuleView] = field(default_factory=list)
    """The rules that it ended, the bottom of the stack first, until it is released."""
    held_by: tuple[str, ...] = ()
    """The emergency stops that are pressed. They must be released before the stop can be."""
    count: int = 0
    """The number of requested stops, which is the number of the last one."""

    @property
    def latched(self) -> bool:
        """True from the request until the release: nothing starts."""
        return self.status != "released"


def condition_key(key: str, values: Mapping[str, Any]) -> str | None:
    """The key among the condition's `values` that a write to `key` changes; None: none of them.

    It is the key itself, or the key of which it is a part, as `order.first` is a part of `order`.
    """
    if key in values:
        return key
    root = key.partition(".")[0].partition("[")[0]
    return root if root in values else None


def condition_change(record: MemoryRecord, values: Mapping[str, Any]) -> tuple[str, bool] | None:
    """The key among the condition's `values` that a record writes, and whether it has another value now; None: no such
    key."""
    key = condition_key(record.key, values)
    if key is None:
        return None
    return key, key != record.key or record.deleted or not json_equal(record.value, values[key])


class SessionView(Struct):
    """A session as seen from outside: the sum of its records. Times are seconds of session time."""

    seq: int = 0
    t: float = 0.0
    session: SessionRecord | None = None
    """The record of its start or recovery: participant, condition, factors, slot, run, attempt."""
    checks: dict[str, CheckRecord] = field(default_factory=dict)
    """The last result of each check by id, in the order of their first results."""
    outcome: OutcomeRecord | None = None
    """The last decision on how the session counts; None: none yet."""
    recordings: dict[str, RecordingRecord] = field(default_factory=dict)
    """The state of each recording of the session, by name."""
    sync: SyncRecord | None = None
    """The last mark for recordings."""
    ended: bool = False
    end_reason: str = ""
    """Why it ended."""
    left_open: tuple[OpenGoal, ...] = ()
    """The robot's open goals at the end of the session."""
    control: str | None = None
    """The holder of control: `wizard:<name>`; null: nobody."""
    wizard: str = ""
    """The last wizard who held control, even if that console has gone."""
    asked: str | None = None
    """The console that asks for control, until it gets an answer or leaves."""
    waits_for_wizard: bool = False
    """Whether nothing may begin until a wizard takes control, because the session was recovered."""
    robot: RobotRecord | None = None
    stop: StopView = field(default_factory=StopView)
    cue: CueView | None = None
    acts: dict[str, ActView] = field(default_factory=dict)
    rules: dict[str, RuleView] = field(default_factory=dict)
    memory: dict[str, MemoryView] = field(default_factory=dict)
    memory_log: MemoryLog = field(default_factory=MemoryLog)
    """The changes of the memory since earlier steps of the rules."""
    condition_values: dict[str, Any] = field(default_factory=dict)
    """The keys that the condition or the study set at the start, with their values."""
    overridden: dict[str, str] = field(default_factory=dict)
    """Those of them that got another value from a wizard, with the source of the last change."""
    running: list[int] = field(default_factory=list)
    """ACTIVE tasks of acts, oldest first."""
    waiting: list[int] = field(default_factory=list)
    """PENDING tasks in the scheduler's order, next first."""
    failed: list[int] = field(default_factory=list)
    """Failed acts without an answer: the latest task of each, in the order of their first failures."""
    kept: dict[int, KeptView] = field(default_factory=dict)
    """Kept events by the task that raised them, oldest first."""
    questions: list[int] = field(default_factory=list)
    """Failed acts whose events are held until a decision, oldest first. They are not in `failed`."""
    repeats: dict[int, float | None] = field(default_factory=dict)
    """The acts in `questions` that are repeated without a decision: the time; null: after a pause, once the robot is
    back."""
    tasks: dict[int, TaskView] = field(default_factory=dict)
    """Every task of the session by id, in order of arrival; of ended ones, only the latest MAX_ENDED_TASKS."""
    forgotten: int = 0
    """The number of tasks that are no longer in `tasks`."""
    raised: dict[int, RaisedView] = field(default_factory=dict)
    """Events raised at this moment that no record reports as taken or not taken, by task."""
    unhandled: deque[EventRecord] = field(default_factory=lambda: deque(maxlen=100))
    """The latest events that no rule took."""
    remarks: deque[RemarkView] = field(default_factory=lambda: deque(maxlen=MAX_REMARKS))
    """The latest remarks, in order."""

    def apply(self, record: AnyRecord) -> None:
        """Add one record; raises nothing.

        Arguments:
            record: the record after the last one that was added. Records must come in order and without gaps, from the
                first of the session.

        >>> view = SessionView()
        >>> view.apply(MemoryRecord(1, 0.5, "", "mood", "happy", None, "wizard:anna", created=True))
        >>> view.memory["mood"].value, view.memory["mood"].changed, view.seq
        ('happy', 0.5, 1)
        """
        if self.raised and record.t != self.t:
            self.raised = {}
        self.seq, self.t = record.seq, record.t
        apply = _APPLY.get(type(record))
        if apply is not None:
            apply(self, record)

    def running_rules(self) -> list[str]:
        """The running rules, top of the stack first."""
        running = [(rule.priority, rule.entered, name) for name, rule in self.rules.items() if rule.running]
        return [name for _, _, name in sorted(running, reverse=True)]

    def latest_act_of(self, acts: Iterable[str]) -> str | None:
        """The act among these that was requested last; None: none was."""
        latest = max(((self.acts[name].latest, name) for name in acts if name in self.acts), default=(0, None))
        return latest[1] if latest[0] else None

    def _add_remark(self, remark: RemarkView) -> None:
        remark.after = next(reversed(self.tasks), 0)
        if len(remark.text) > MAX_REMARK_CHARACTERS:
            remark.text = f"{remark.text[: MAX_REMARK_CHARACTERS - 1]}…"
        self.remarks.append(remark)

    def _apply_memory(self, record: MemoryRecord) -> None:
        if record.source != ENGINE:
            self.memory_log.note(record.seq, record.key, not record.created, record.old)
        if self.memory_log.is_full:
            self.memory_log.trim((rule.steps for rule in self.rules.values()), 4 * len(self.rules))
        if record.deleted:
            self.memory.pop(record.key, None)
        else:
            self.memory[record.key] = MemoryView(record.value, record.old, record.source, record.t)
        if record.source in SET_AT_START:
            self.condition_values[record.key] = record.value
        elif (change := condition_change(record, self.condition_values)) is not None:
            key, is_other = change
            if not is_other:
                self.overridden.pop(key, None)
            elif record.source.startswith("wizard:"):
                self.overridden[key] = record.source

    def _apply_action(self, record: ActionRecord) -> None:
        add_action_record(self.tasks, record)

    def _apply_to_task(self, record: TimingRecord | MistakeRecord) -> None:
        add_record(self.tasks, record)

    def _apply_robot(self, record: RobotRecord) -> None:
        if self.robot is not None or record.status != "connected":  # a good link at the start needs no remark
            self._add_remark(RemarkView("robot", record.t, "robot", record.detail, record.status))
        self.robot = record

    def _apply_note(self, record: NoteRecord) -> None:
        self._add_remark(RemarkView("note", record.t, record.source, record.text))

    def _apply_scenario(self, record: ScenarioRecord) -> None:
        self._add_remark(RemarkView("note", record.t, record.source, words_of(record).sentence))

    def _apply_stop(self, record: StopRecord) -> None:
        if record.status == "let-go":
            self.stop.held_by = record.held_by
            return
        again = self.stop.status == record.status == "latched"  # another answer of the robot
        self.stop = StopView(
            record.status,
            self.stop.since if again else record.t,
            record.confirmed,
            record.unconfirmed,
            record.unstoppable,
            record.source or self.stop.source,
            self.stop.stood if record.status != "released" else [],
            record.held_by,
            self.stop.count + (record.status == "requested"),
        )

    def _apply_control(self, record: ControlRecord) -> None:
        if record.holder is not None:
            self.waits_for_wizard = False
        if record.status == "asked":
            self.asked = record.by
            return
        self.control, self.asked = record.holder, None
        if record.holder is not None and record.holder.startswith("wizard:"):
            self.wizard = record.holder.removeprefix("wizard:").partition("#")[0]

    def _apply_session(self, record: SessionRecord) -> None:
        if record.status == "ended":
            self.ended = True
            self.left_open = record.open
            self.end_reason = "; ".join(filter(None, (record.reason, describe_open_goals(record.open))))
        else:
            self.session, self.waits_for_wizard = record, record.waits_for_wizard

    def _apply_report(self, record: ReportRecord) -> None:
        match record:
            case CheckRecord():
                self.checks[record.id] = record
            case OutcomeRecord():
                self.outcome = record
            case RecordingRecord():
                before = self.recordings.get(record.name)
                self.recordings[record.name] = record
                if before is not None and before.status == record.status:
                    return  # the status has not changed
            case SyncRecord():
                self.sync = record
        status = record.result if isinstance(record, CheckRecord) else getattr(record, "status", "")
        words = words_of(record)
        text = words.sentence if isinstance(record, SyncRecord) else words.text
        self._add_remark(RemarkView(REPORT_KINDS[type(record)], record.t, record.source, text, status))

    def _apply_cue(self, record: CueRecord) -> None:
        if record.status == "marked":
            self.cue = CueView(record.at, record.source)
        elif self.cue is not None and record.status == "answered":
            self.cue.answered, self.cue.task = record.t, record.task
        elif record.status == "undone":
            self.cue = None
        elif self.cue is not None:
            self.cue.filled = record.t

    def _apply_task(self, record: TaskRecord) -> None:
        known = len(self.tasks)
        task = add_task_record(self.tasks, record)
        is_new = len(self.tasks) > known
        if is_new and known - len(self.waiting) - len(self.running) >= MAX_ENDED_TASKS + FORGET_AT_ONCE:
            self._forget_oldest()
        if record.function in ACT_FUNCTIONS:
            self._apply_act_task(record, task)
            self._apply_failure(record)
        elif record.function == "goOn" and record.status == "SUCCEEDED":
            self.failed = [id for id in self.failed if str(id) != record.behavior]
        elif record.function in RAISING and record.status in ("SUCCEEDED", "CANCELED"):
            self._note_raised(task, is_new=is_new)
        elif record.function == "startInteractionRule" and record.status == "ACTIVE":
            self.rules.setdefault(started_rule(record.behavior), RuleView()).task = record.id

    def _apply_act_task(self, record: TaskRecord, task: TaskView) -> None:
        spoken = record.function == "say"  # free speech is no act of the scenario, and has no typical duration
        act = ActView() if spoken else self.acts.setdefault(record.behavior, ActView())
        for ids in (self.waiting, self.running, act.waiting, act.running):
            if record.id in ids:
                ids.remove(record.id)
        if record.status == "PENDING":
            position = len(self.waiting) if record.position is None else record.position
            self.waiting.insert(position, record.id)
            act.waiting.append(record.id)
            act.latest = max(act.latest, record.id)
        elif record.status == "ACTIVE":
            self.running.append(record.id)
            act.running.append(record.id)
        else:
            act.last = task
            if record.status == "SUCCEEDED" and task.started is not None:
                took = record.t - task.started
                act.typical = took if act.typical is None else act.typical + (took - act.typical) / (act.runs + 1)
                act.runs += 1

    def _apply_failure(self, record: TaskRecord) -> None:
        """Update the failed acts. A failure stays until it is answered, or the act succeeds later."""
        if record.status not in ("ABORTED", "SUCCEEDED"):
            return
        for at, id in enumerate(self.failed):
            task = self.tasks.get(id)
            if task is not None and (task.function, task.behavior) == (record.function, record.behavior):
                self.failed[at : at + 1] = [record.id] if record.status == "ABORTED" else []
                return
        if record.status == "ABORTED":
            self.failed.append(record.id)

    def _apply_question(self, record: FailureRecord) -> None:
        """Update the failed acts that need a decision."""
        is_open = record.status in ("asked", "waiting")
        if not is_open:
            self.questions = [id for id in self.questions if id != record.task]
        elif record.task not in self.questions:
            self.questions.append(record.task)
        self.repeats.pop(record.task, None)
        if record.status == "waiting":
            self.repeats[record.task] = None if record.seconds is None else round(record.t + record.seconds, 6)
        if is_open or record.status == "repeated":
            self.failed = [id for id in self.failed if id != record.task]

    def _note_raised(self, task: TaskView, *, is_new: bool) -> None:
        """Note that a task's event is on its way to the rules. Its record follows those of earlier events. If it was
        kept until now (not `is_new`), its record is the next one, or there is none."""
        by_cue = task.function == "markCue"
        topic = CUE_TOPICS[0] if by_cue else normal_topic(describe_behavior(task.function, task.behavior))
        raised = RaisedView(topic, ENGINE if by_cue else task.source)
        if is_new:
            self.raised[task.id] = raised
        else:
            raised.next_seq = self.seq + 1
            self.raised = {task.id: raised, **self.raised}

    def _apply_event(self, record: EventRecord) -> None:
        if record.taken_by is None:
            self.unhandled.append(record)
        if not self.raised:
            return
        topic = normal_topic(record.topic)
        for id, raised in self.raised.items():
            if raised.topic == topic and raised.source == record.source and raised.next_seq in (None, record.seq):
                del self.raised[id]
                if (task := self.tasks.get(id)) is not None:
                    task.taken = record.taken_by is not None
                return

    def _apply_rule(self, record: RuleRecord) -> None:
        if record.status == "faulted":
            self._add_remark(RemarkView("fault", record.t, f"rule:{record.name}", record.reason))
        if record.status == "stopped" and self.stop.latched:  # the top of the stack is stopped first
            self.stop.stood.insert(0, StoppedRuleView(record.name, record.state or ""))
        rule = self.rules.setdefault(record.name, RuleView())
        self._apply_step(record, rule)
        rule.status, rule.reason = record.status, record.reason
        rule.state, rule.trigger, rule.previous = record.state, record.trigger, record.previous
        rule.transition = record.transition
        if record.status != "stayed":
            rule.since = record.t
        rule.running = record.status in ("started", "entered", "stayed")
        if rule.running:
            rule.priority, rule.entered = record.priority, record.seq

        if record.status == "stayed" and record.transition is not None:
            rule.countdowns.pop(record.transition, None)
        else:
            rule.countdowns.clear()

    def _apply_countdown(self, record: CountdownRecord) -> None:
        countdowns = self.rules.setdefault(record.rule, RuleView()).countdowns
        if record.status == "broken":
            countdowns.pop(record.transition, None)
        else:
            countdowns[record.transition] = CountdownView(record.t, record.seconds, record.reason)

    def _apply_kept(self, record: KeptRecord) -> None:
        if record.status != "kept":
            self.kept.pop(record.task, None)
            return
        task = self.tasks.get(record.task)
        source = task.source if task is not None else ""
        self.kept[record.task] = KeptView(record.topic, source, record.t + (record.seconds or 0.0))

    def _apply_step(self, record: RuleRecord, rule: RuleView) -> None:
        """Note the rule's states, for a step back."""
        trigger, steps = record.trigger or "", rule.steps
        if record.status == "started":
            rule.steps = steps[:-1] if trigger.startswith("resumed") else []
        elif record.status == "entered":
            if trigger.startswith("stepped back"):
                del steps[-2:]
            steps.append((record.state or "", record.seq))
            if len(steps) > MAX_STEPS:
                del steps[0]

    def changed_since_step(self, rule: RuleView) -> dict[str, ValueBefore]:
        """The keys that changed since the previous state was entered, with their values from then."""
        values = {key: entry.value for key, entry in self.memory.items()}
        return self.memory_log.changed_since(rule.steps[-2][1], values) if len(rule.steps) > 1 else {}

    def _forget_oldest(self) -> None:
        ended = (id for id, task in self.tasks.items() if task.status in FINAL)
        oldest = list(islice(ended, len(self.tasks) - MAX_ENDED_TASKS))
        for id in oldest:
            del self.tasks[id]
        self.failed = [id for id in self.failed if id in self.tasks]
        self.questions = [id for id in self.questions if id in self.tasks]
        self.repeats = {id: at for id, at in self.repeats.items() if id in self.tasks}
        self.forgotten += len(oldest)


_APPLY: dict[type, Callable[[SessionView, Any], None]] = {
    TaskRecord: SessionView._apply_task,
    ActionRecord: SessionView._apply_action,
    RuleRecord: SessionView._apply_rule,
    EventRecord: SessionView._apply_event,
    MemoryRecord: SessionView._apply_memory,
    RobotRecord: SessionView._apply_robot,
    StopRecord: SessionView._apply_stop,
    ControlRecord: SessionView._apply_control,
    NoteRecord: SessionView._apply_note,
    CueRecord: SessionView._apply_cue,
    MistakeRecord: SessionView._apply_to_task,
    TimingRecord: SessionView._apply_to_task,
    CountdownRecord: SessionView._apply_countdown,
    KeptRecord: SessionView._apply_kept,
    FailureRecord: SessionView._apply_question,
    CheckRecord: SessionView._apply_report,
    OutcomeRecord: SessionView._apply_report,
    RecordingRecord: SessionView._apply_report,
    SyncRecord: SessionView._apply_report,
    ScenarioRecord: SessionView._apply_scenario,
    SessionRecord: SessionView._apply_session,
}
"""The effect of each kind of record on the view. Conditions have none."""
