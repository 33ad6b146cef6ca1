"""The kernel: inputs in, records and commands out (architecture, "The kernel").

    records, commands = kernel.handle(input)

The state of a session changes only here. The same scenario, seed and inputs give the same outputs, byte for byte. The
first task record of a `Submit` is that of its own task.
"""

from __future__ import annotations

from itertools import count
from typing import ClassVar, Literal

from rise_engine.base.errors import RiseError
from rise_engine.kernel.act_runner import ActRunner
from rise_engine.kernel.commands import Command, StartAction
from rise_engine.kernel.core import Core, parse_task_id
from rise_engine.kernel.failures import FailedActs
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    CheckReport,
    ControlChanged,
    EstopReport,
    Note,
    OutcomeReport,
    RecordingReport,
    RobotChanged,
    ScenarioChanged,
    SessionEnded,
    SessionRecovered,
    SessionStarted,
    StopReport,
    Submit,
    SyncMark,
    TimerElapsed,
)
from rise_engine.kernel.records import (
    ENGINE,
    AnyRecord,
    ControlRecord,
    OpenGoal,
    RobotRecord,
    ScenarioRecord,
    SessionRecord,
    TaskRecord,
    identity_of,
)
from rise_engine.kernel.reports import record_report
from rise_engine.kernel.scenario_change import carry_over, changes_in_words, why_not_take_over
from rise_engine.kernel.scheduler import Scheduler
from rise_engine.kernel.snapshot import Snapshot
from rise_engine.kernel.stop import StopLatch
from rise_engine.kernel.task_handlers import TaskHandlers
from rise_engine.kernel.wizard_marks import WizardMarks
from rise_engine.scenario.model import Scenario


class Kernel:
    """A session's state and its only way to change. Pure: it uses no clock, disk, robot, thread or screen.

    From outside, a session is a `rise_engine.kernel.view.SessionView`, made from its records:

        >>> from rise_engine.kernel.inputs import SessionStarted, Submit
        >>> from rise_engine.kernel.view import SessionView
        >>> from rise_engine.scenario.loader import load
        >>> kernel, view = Kernel(load("scenarios/greeting").scenario, seed=1), SessionView()
        >>> for input in (SessionStarted(), Submit(t=2.5, function="startCommunicationRobotAct", behavior="R_Nod")):
        ...     records, commands = kernel.handle(input)
        ...     for record in records:
        ...         view.apply(record)
        >>> view.tasks[view.running[0]].behavior, kernel.is_busy
        ('R_Nod', True)
        >>> type(commands[0]).__name__, commands[0].type
        ('StartAction', 'Animation')
    """

    act_runner: ClassVar[type[ActRunner]] = ActRunner
    """The class that runs acts. Exploring replaces it by one for whole acts (`author.explore.act_traits.WholeActs`)."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        """A session that has not begun; raises nothing.

        Arguments:
            scenario: checked, as returned by `rise_engine.scenario.loader.load`.
            seed: any whole number, the source of all randomness: the same seed and inputs give the same records.
        """
        self.scenario = scenario
        self.seed = seed
        self.seq = 0
        """The number of the last record."""
        self.offered: Scenario | None = None
        """The changed scenario that a `ScenarioChanged` with its hash takes over."""
        self.begun = SessionStarted()
        """The first input, once it has arrived: participant, condition and so on."""
        self._make_parts(scenario, seed)

    def _make_parts(self, scenario: Scenario, seed: int) -> None:
        self.core = Core(scenario, seed)
        self.stop = StopLatch(self.core)
        self.wizard_marks = WizardMarks(self.core)
        self.failures = FailedActs(self.core)
        self.scheduler = Scheduler(self.core, self.wizard_marks, self.failures, self.act_runner)
        self._handlers = TaskHandlers(self.core, self.scheduler, self.stop, self.wizard_marks, self.failures)
        self.rules = self._handlers.rules
        self._session_keys = self._handlers.session_keys if scenario.reads_session else None

    @property
    def is_busy(self) -> bool:
        """True while an act runs, waits or will soon be repeated, or a stop is unconfirmed. Rules do not count."""
        acts = self.scheduler.runner.runs or self.scheduler.waiting or self.failures.pausing
        return bool(acts) or self.stop.status == "requested"

    @property
    def holding_goals(self) -> tuple[OpenGoal, ...]:
        """The open goals that the robot can be asked to stop."""
        return tuple(goal for goal in self.core.open_goals if goal.holds)

    def unfinished_goals(self) -> list[StartAction]:
        """All actions, running or ended, that the robot may be doing, for an engine that continues the session."""
        running = self.scheduler.runner.running_goals()
        ended = [StartAction(goal.action, goal.type, {}, 0.0, accepted=goal.accepted) for goal in self.core.open_goals]
        return running + ended

    def handle(self, input: AnyInput) -> tuple[list[AnyRecord], list[Command]]:
        """Handle one input and everything that it causes, to completion (SCXML's macrostep).

        Arguments:
            input: one of `rise_engine.kernel.inputs`, with `t` in seconds of session time. An input before the kernel's
                own time counts as now. The first input of a session is a `SessionStarted`.

        Returns the records and the commands (`rise_engine.kernel.commands`), to be executed in order after the records.
        Records are numbered without gaps in the order of events; `wall` is empty, because the kernel has no clock. The
        first `TaskRecord` of a `Submit` is that of its own task. An impossible task is REJECTED there with the reason,
        so requests raise nothing. An exception is an error of this program; do not use the kernel after it.

            >>> from rise_engine.kernel import Kernel
            >>> from rise_engine.kernel.inputs import SessionStarted, Submit
            >>> from rise_engine.scenario.model import RobotProfile, Scenario
            >>> robot = RobotProfile("none", "none", "none", {})
            >>> kernel = Kernel(Scenario("a study", "/", "debug", robot, {}, {}, {}), seed=1)
            >>> records, commands = kernel.handle(SessionStarted())
            >>> records, commands = kernel.handle(Submit(t=2.5, function="assignValue", behavior="task = 2"))
            >>> [(record.seq, record.t, type(record).__name__) for record in records]
            [(2, 2.5, 'TaskRecord'), (3, 2.5, 'MemoryRecord')]
        """
        core = self.core
        if input.t > core.t:
            core.t = input.t
            core.macrostep += 1
        elif type(input) is TimerElapsed:  # timers of one moment share one, to detect loops of empty waits
            core.continued_macrostep = core.macrostep
        else:
            core.macrostep += 1
        core.cause = None
        records = core.records = []
        commands = core.commands = []
        if type(input) is Submit:
            pressed = input.pressed
            core.key_at = None if pressed is None else round(min(pressed, core.t), 6)  # two clocks never agree exactly
            core.origin = core.next_task
            handlers = self._handlers
            (handlers.by_name.get(input.function) or handlers.reject_unknown)(input)
            if input.source.startswith("wizard:"):
                self.wizard_marks.note_task(next(record for record in records if isinstance(record, TaskRecord)))
        else:
            core.key_at = core.origin = None
            self._handle_other_input(input)
        if self._session_keys is not None:
            self._session_keys.update()
        self.rules.run_to_completion()
        while self._session_keys is not None and self._session_keys.update():  # until a rule in a loop has ended
            self.rules.run_to_completion()
        if records:
            self.seq = records[-1].seq
        return records, commands

    # --- snapshot ---

    def snapshot(self) -> Snapshot:
        """The kernel's whole state as an independent value that can be sent.

        Only between inputs; raises nothing. A kernel that is restored from it returns the same records and commands for
        the same inputs as this one.

            >>> from rise_engine.kernel.inputs import SessionStarted, Submit
            >>> from rise_engine.scenario.loader import load
            >>> scenario = load("scenarios/greeting").scenario
            >>> kernel = Kernel(scenario, seed=1)
            >>> records, commands = kernel.handle(SessionStarted())
            >>> restored = Kernel.restore(scenario, kernel.snapshot())
            >>> input = Submit(t=2.5, function="startCommunicationRobotAct", behavior="R_Nod")
            >>> restored.handle(input) == kernel.handle(input)
            True
        """
        core, runner = self.core, self.scheduler.runner
        return Snapshot(
            scenario=core.scenario.hash,
            seed=self.seed,
            t=core.t,
            seq=self.seq,
            rng=core.rng.state,
            next_task=core.next_task,
            next_timer=core.next_timer,
            timers=core.timers,
            reported_missing=sorted(core.reported_missing),
            memory={key: value for key, value in core.memory.items() if key not in core.tables},
            memory_log=core.memory_log,
            rules=self.rules.snapshot(),
            waiting=self.scheduler.waiting,
            acts=list(runner.runs.values()),
            last_pick=runner.last_pick,
            robot_lost=runner.robot_lost,
            stop=self.stop.status,
            stop_timer=self.stop.timer,
            stopped_rules=self.stop.stopped_rules,
            held_by=self.stop.held_by,
            stops=self.stop.count,
            wizard_marks=self.wizard_marks.state,
            failures=self.failures.state,
            open_cue_at=core.open_cue_at,
            open_goals=core.open_goals,
            waits_for_wizard=core.waits_for_wizard,
            begun=self.begun,
        ).copy()

    @classmethod
    def restore(cls, scenario: Scenario, snapshot: Snapshot) -> Kernel:
        """Return a kernel that continues exactly from the snapshot.

        Arguments:
            scenario: the scenario of the snapshot, read from the same files.
            snapshot: a value of `snapshot`; it is copied.

        Raises RiseError for another scenario.
        """
        if snapshot.scenario != scenario.hash:
            raise RiseError("the scenario's files are not those that the snapshot was taken with")
        kernel = cls(scenario, snapshot.seed)
        try:
            kernel._restore(snapshot.copy())
        except LookupError as error:  # the hash of a scenario without files does not identify it
            raise RiseError(f"the snapshot was taken of another scenario: it has no {error}") from error
        return kernel

    def _restore(self, snapshot: Snapshot) -> None:
        core, runner = self.core, self.scheduler.runner
        core.t = snapshot.t
        self.seq = snapshot.seq
        core.numbers = count(self.seq + 1)
        core.rng.state = snapshot.rng
        core.next_task, core.next_timer = snapshot.next_task, snapshot.next_timer
        core.timers = snapshot.timers
        core.reported_missing = set(snapshot.reported_missing)
        core.memory.update(snapshot.memory)
        core.memory_log = snapshot.memory_log
        self.rules.restore(snapshot.rules)
        self.scheduler.waiting = snapshot.waiting
        runner.runs = {run.task.id: run for run in snapshot.acts}
        runner.last_pick = snapshot.last_pick
        runner.robot_lost = snapshot.robot_lost
        self.stop.status, self.stop.timer, self.stop.stopped_rules = (
            snapshot.stop,
            snapshot.stop_timer,
            snapshot.stopped_rules,
        )
        self.stop.held_by, self.stop.count = snapshot.held_by, snapshot.stops
        self.wizard_marks.state, core.open_cue_at = snapshot.wizard_marks, snapshot.open_cue_at
        self.failures.state = snapshot.failures
        core.open_goals = snapshot.open_goals
        core.waits_for_wizard = snapshot.waits_for_wizard
        self.begun = snapshot.begun

    # --- a changed scenario ---

    def why_not_take_over(self, scenario: Scenario) -> list[str]:
        """Why the session cannot continue with this scenario now: sentences; empty: it can. Only between inputs."""
        return why_not_take_over(self.scenario, scenario, self.snapshot(), is_busy=self.is_busy)

    def _take_over(self, input: ScenarioChanged) -> None:
        """Continue with the offered scenario. Memory, randomness, numbers and rules stay unchanged."""
        after, before, core = self.offered, self.scenario, self.core
        if after is None or after.hash != input.hash or before.hash != input.was:
            raise RiseError(f"the scenario {input.hash[:12]} is not the one that was offered")
        if problems := self.why_not_take_over(after):
            raise RiseError("; ".join(problems))
        snapshot = carry_over(before, after, self.snapshot()).copy()
        records, commands, numbers = core.records, core.commands, core.numbers
        self.scenario, self.offered = after, None
        self._make_parts(after, self.seed)
        self._restore(snapshot)
        self.core.records, self.core.commands, self.core.numbers = records, commands, numbers
        if after.reads_session and not before.reads_session:
            begun = self.begun
            self._handlers.session_keys.begin(begun.participant, begun.condition, begun.factors)
        self.core.emit(ScenarioRecord, input.hash, input.was, changes_in_words(before, after), input.source)

    # --- inputs other than tasks ---

    def _handle_other_input(self, input: AnyInput) -> None:
        core, runner = self.core, self.scheduler.runner
        match input:
            case ActionReport():
                core.origin = parse_task_id(input.action.partition("/")[0]) or None
                runner.report(input.action, input.status, input.reason, aborted=input.aborted)
            case TimerElapsed():
                self._timer_elapsed(input.timer)
            case RobotChanged():
                core.open_goals = input.open
                core.emit(RobotRecord, input.status, input.detail, input.open)
                if input.status == "lost":
                    runner.lose_robot(input.detail or "the link is lost")
                elif runner.robot_lost is not None:
                    runner.robot_lost = None
                    self.failures.robot_back()
            case StopReport():
                self.stop.record_answer(input)
            case EstopReport():
                self._handlers.take_estop(input)
            case Note():
                stood = input.stood if input.source == ENGINE else None
                core.record_note(input.text, input.source, stood, suspended=stood is not None and input.suspended)
            case ControlChanged():
                core.emit(ControlRecord, input.status, input.by, input.holder)
                if input.holder is not None:
                    self.scheduler.resume_waiting()
            case SessionStarted():
                self._begin_session(input)
            case ScenarioChanged():
                self._take_over(input)
            case SessionRecovered():
                self._resume_session(input)
            case SessionEnded():
                self._record_session("ended", {}, input.reason, open=core.open_goals)
            case CheckReport() | OutcomeReport() | RecordingReport() | SyncMark():
                record_report(core, input)

    def _timer_elapsed(self, timer: int) -> None:
        target, runner = self.core.timers.pop(timer, None), self.scheduler.runner
        if target is None:
            return  # it was cancelled
        if target.purpose in ("wait", "limit", "cancel", "repeat", "keep"):
            self.core.origin = int(target.owner)
        if target.purpose == "after":
            self.rules.timer_elapsed(timer, target)
        elif target.purpose == "keep":
            self.rules.kept.expire(self.rules.kept[int(target.owner)], "no rule waited for it in time")
        elif target.purpose == "stop":
            self.stop.time_out()
        elif target.purpose == "repeat":
            self.failures.pause_elapsed(int(target.owner), runner.robot_lost)
        elif target.purpose == "filler":
            self._start_due_filler()
        else:
            runner.timer_elapsed(target)

    def _start_due_filler(self) -> None:
        """Start a due filler, because nothing has answered the cue, unless something else is running."""
        self.wizard_marks.state.filler_timer = None
        name = self.wizard_marks.next_filler()
        if name is not None and not (self.is_busy or self.stop.latched or self.core.waits_for_wizard):
            self._handlers.start_filler(name, "engine")

    def _begin_session(self, input: SessionStarted) -> None:
        """Set the memory of the condition, before anything else happens."""
        self.begun = input
        self._record_session("started", input.versions)
        memory = self.rules.memory
        memory.load_start_values()
        source = "study" if input.study else "condition"
        for key, value in input.memory.items():
            if problem := memory.why_not_write(key):
                self.core.record_note(f"the {source} could not set {key!r}: {problem}")
            else:
                memory.write(key, value, source)
        self._handlers.session_keys.begin(input.participant, input.condition, input.factors)

    def _resume_session(self, input: SessionRecovered) -> None:
        """Continue rules and timers, and keep the latch. No action of the robot is repeated automatically."""
        self.core.waits_for_wizard |= input.waits_for_wizard
        self._record_session("recovered", input.versions, input.reason, input.downtime)
        self.scheduler.runner.lose_earlier_goals()
        self.wizard_marks.cancel_filler()
        self.stop.ask_again()

    def _record_session(
        self,
        status: Literal["started", "recovered", "ended"],
        versions: dict[str, str],
        reason: str = "",
        downtime: float | None = None,
        open: tuple[OpenGoal, ...] = (),
    ) -> None:
        scenario, begun = self.scenario, self.begun
        self.core.emit(
            SessionRecord,
            status=status,
            scenario=scenario.title,
            scenario_hash=scenario.hash,
            mode=scenario.mode,
            robot=scenario.robot.name,
            seed=self.seed,
            versions=versions,
            reason=reason,
            **identity_of(begun),
            language=scenario.language,
            downtime=downtime,
            waits_for_wizard=status == "recovered" and self.core.waits_for_wizard,
            open=open,
            driver=begun.driver,
            injected_faults=begun.injected_faults,
            speed=begun.speed,
        )
