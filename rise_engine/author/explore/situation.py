"""A situation: everything that affects how a session can continue, and nothing else (no time, numbers, words, marks).

`SituationKernel.put` brings a kernel into a situation, and `SituationKernel.read` returns its present one. In between,
the kernel itself handles one input, so exploring cannot differ from sessions.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Container, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias, cast

import msgspec

from rise_engine.author.explore.act_traits import FAILED, ActTraits, Decisions, Phase, WholeActRun, WholeActs
from rise_engine.author.explore.influence import parts_of_session_read
from rise_engine.expression import Environment
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import SetTimer
from rise_engine.kernel.core import Task, TimerTarget
from rise_engine.kernel.failures import first_task
from rise_engine.kernel.kept_events import KeptEvent
from rise_engine.kernel.rule_stack import RuleRun, append_to_lists, remove_from_lists
from rise_engine.kernel.stop import StoppedRule, StopStatus
from rise_engine.scenario.model import SESSION, SESSION_STATES, Scenario

ActPhase: TypeAlias = Phase | Literal["", "pausing", "without robot"]
PERSON = "engine"
"""The source of all requests except those of rules: exploring does not distinguish people and programs."""


class RuleInState(NamedTuple):
    """A running rule."""

    name: str
    state: str
    priority: float
    latched: tuple[int, ...]
    """Like `RuleSnapshot.latched`."""
    own_acts: tuple[tuple[str, int], ...]
    """The acts whose ends it may wait for: name and index among the waiting, running and failed acts; -1: ended."""


class ActTask(NamedTuple):
    """An act that waits, runs, or has failed and waits for an answer."""

    name: str
    calling_type: str
    source: str
    """`rule:NAME`, or PERSON."""
    attempt: int
    """The number of the attempt, as far as it affects a repetition."""
    is_own: bool
    """Whether the present run of the rule has started it, not an earlier one."""
    phase: ActPhase = ""
    """A running act's phase; for a failed one, whether it pauses before an automatic repetition, or waits for the robot
    before that."""
    speaking: bool = False
    interfered: bool = False
    """Whether it cannot be repeated automatically, because of who ended one of its actions."""


class Countdown(NamedTuple):
    """A running timer."""

    purpose: str
    """Like `TimerTarget.purpose`: after, keep, filler or repeat."""
    owner: str
    """The rule, the kept event's topic, or the failed act."""
    transition: int
    """Index of the transition for `after`; index among the failed acts for `repeat`."""
    length: int
    """Milliseconds from its beginning to its end."""


class Situation(NamedTuple):
    """One situation, as a value that can be compared."""

    rules: tuple[RuleInState, ...]
    """The bottom of the stack first."""
    waiting: tuple[ActTask, ...]
    running: tuple[ActTask, ...]
    asked: tuple[ActTask, ...]
    countdowns: tuple[Countdown, ...]
    """In the order in which they were set, if it matters; otherwise in a fixed order."""
    kept: tuple[str, ...]
    """The topics of kept events, the oldest first."""
    memory: tuple[bytes | None, ...]
    """The values of the keys that matter, as JSON; None: no value."""
    faults_left: int
    """The remaining number of faults: an act fails, the robot is lost, everything is stopped."""
    stop: StopStatus
    robot_lost: bool
    cue_open: bool
    last_filler: str | None
    stopped_rules: tuple[tuple[str, str, float, tuple[int, ...]], ...]
    """The rules that a stop has ended: name, state, priority, latched."""


class _SituationKernel(Kernel):
    act_runner = WholeActs


class SituationKernel:
    """A kernel that is put into one situation after the other."""

    def __init__(
        self,
        scenario: Scenario,
        keys: Sequence[str],
        traits: dict[str, ActTraits],
        follows_failures: Container[str],
        *,
        in_order: bool,
    ) -> None:
        """Make a kernel that is in no situation yet.

        Arguments:
            scenario: what the kernel runs.
            keys: the memory keys that matter (`keys_that_matter`).
            traits: the traits of each act.
            follows_failures: the acts whose failure may need an answer; for others it does not matter which run of a
                rule has started them.
            in_order: whether the order in which timers were set matters, because there are no clocks.
        """
        self.scenario = scenario
        self.keys = tuple(keys)
        self.traits = traits
        self.decisions = Decisions()
        self.kernel = kernel = _SituationKernel(scenario, 0)
        core = kernel.core
        core.rng = self.decisions
        core.env = Environment(core.memory, self.decisions.fraction, set(), self.decisions.integer_below)
        self.runner = cast(WholeActs, kernel.scheduler.runner)
        self.runner.traits = traits
        self.runner.decisions = self.decisions
        self.core = core
        self._compiled = kernel.rules.compiled
        self._decoded: dict[bytes, Any] = {}
        self._lengths: dict[int, int] = {}
        self._in_order = in_order
        self._follows_failures = follows_failures
        self._last_attempt = {name: scenario.failure_policy(name).times + 1 for name in scenario.acts}
        self._session_parts = parts_of_session_read(scenario) | set(SESSION_STATES) if scenario.reads_session else None
        """The relevant parts of `session`; None: the memory has no `session`."""
        self._follows_fillers = scenario.fillers.auto_after is not None

    # --- put ---

    def put(self, situation: Situation) -> None:
        """Bring the kernel into a situation. It contains no clocks: all timers begin now."""
        core, kernel = self.core, self.kernel
        core.t = 0.0
        core.macrostep += 1
        core.reported_missing.clear()
        core.timers.clear()
        core.memory_log.changes.clear()
        self._put_memory(situation.memory)
        runs = self._put_rules(situation)
        timers = self._put_countdowns(situation, runs)
        self._put_acts(situation, runs)
        self._put_kept(situation.kept, timers)
        stop = kernel.stop
        stop.status, stop.timer = situation.stop, None
        stop.stopped_rules = [
            StoppedRule(name, state, priority, [*latched], [])
            for name, state, priority, latched in situation.stopped_rules
        ]
        self.runner.robot_lost = "lost" if situation.robot_lost else None
        core.open_cue_at = 0.0 if situation.cue_open else None
        marks = kernel.wizard_marks.state
        marks.act_tasks.clear()
        marks.other_tasks.clear()
        marks.failed_acts.clear()
        marks.last_filler = situation.last_filler

    def _put_memory(self, values: Sequence[bytes | None]) -> None:
        memory, decoded = self.core.memory, self._decoded
        for key, value in zip(self.keys, values, strict=True):
            if value is None:
                memory.pop(key, None)
            else:
                if value not in decoded:
                    decoded[value] = msgspec.json.decode(value)
                memory[key] = decoded[value]

    def _put_rules(self, situation: Situation) -> dict[str, RuleRun]:
        """Put all rules, without their timers and acts."""
        stack = self.kernel.rules.stack
        for run in stack.values():
            remove_from_lists(run, run.state.watch_lists)
            if run is not stack.top:
                remove_from_lists(run, run.state.wait_lists)
        stack.clear()
        stack.top = None
        number = self._first_rule_task(situation)
        for rank, rule in enumerate(situation.rules):
            task = Task(number + rank, "startInteractionRule", rule.name, "None", PERSON, status="ACTIVE")
            run = RuleRun(rule.name, self._compiled[rule.name].states[rule.state], task, rule.priority, rank + 1)
            if rule.latched:
                run.latched.update(rule.latched)
            if stack.top is not None:
                append_to_lists(stack.top, stack.top.state.wait_lists)
            stack[rule.name] = stack.top = run
            append_to_lists(run, run.state.watch_lists)
        stack.recency = len(situation.rules)
        return stack

    @staticmethod
    def _first_rule_task(situation: Situation) -> int:
        """Return the number of the first rule's task: a rule's own tasks come after it, all others before the rules."""
        return 1 + len(situation.waiting) + len(situation.running) + len(situation.asked)

    def _put_countdowns(self, situation: Situation, runs: dict[str, RuleRun]) -> dict[str, int]:
        core = self.core
        kept: dict[str, int] = {}
        marks = self.kernel.wizard_marks.state
        marks.filler_timer = None
        self._lengths = lengths = {}
        number = 0
        for number, countdown in enumerate(situation.countdowns, 1):
            lengths[number] = countdown.length
            if countdown.purpose == "after":
                run = runs[countdown.owner]
                run.timers[number] = run.state.transitions[countdown.transition]
                core.timers[number] = TimerTarget("after", countdown.owner, str(countdown.transition))
            elif countdown.purpose == "keep":
                kept[countdown.owner] = number
            elif countdown.purpose == "filler":
                core.timers[number] = TimerTarget("filler")
                marks.filler_timer = number
        core.next_timer = number + 1
        return kept

    def _put_acts(self, situation: Situation, runs: dict[str, RuleRun]) -> None:
        scheduler, failures = self.kernel.scheduler, self.kernel.failures
        foreign = 1
        own = first_own = self._first_rule_task(situation) + len(situation.rules)
        tasks: list[Task] = []
        for act in (*situation.waiting, *situation.running, *situation.asked):
            if act.is_own:
                number, own = own, own + 1
            else:
                number, foreign = foreign, foreign + 1
            task = Task(number, "startCommunicationRobotAct", act.name, act.calling_type, act.source)
            task.attempt = act.attempt
            if act.attempt > 1:
                task.first = number
            tasks.append(task)
        waiting, running = len(situation.waiting), len(situation.running)
        scheduler.waiting = tasks[:waiting]
        self.runner.runs = runs_of_acts = {}
        for act, task in zip(situation.running, tasks[waiting : waiting + running], strict=True):
            task.status = "ACTIVE"
            run = WholeActRun(task, {})
            if act.phase != "running":
                run.doomed = act.phase == "doomed"
                run.failure = FAILED if "failing" in act.phase else None
                run.cancel_reason = "cancelled" if "canceling" in act.phase else None
            run.interfered = act.interfered
            run.speaking = act.speaking
            runs_of_acts[task.id] = run
        for task in tasks[waiting + running :]:
            task.status = "ABORTED"
        asked = tasks[waiting + running :]
        failures.state.asked = {task.id: task for task in asked}
        without_robot = zip(asked, situation.asked, strict=True)
        failures.state.pauses = {task.id: None for task, act in without_robot if act.phase == "without robot"}
        for number, countdown in enumerate(situation.countdowns, 1):
            if countdown.purpose == "repeat":
                id = asked[countdown.transition].id
                failures.state.pauses[id] = number
                self.core.timers[number] = TimerTarget("repeat", str(id))
        for rule in situation.rules:
            if rule.own_acts:
                runs[rule.name].own_acts = {name: tasks[at].id if at >= 0 else 0 for name, at in rule.own_acts}
        self.last_task = first_own + len(tasks) + len(situation.kept)
        self.core.next_task = self.last_task + 1

    def _put_kept(self, topics: Sequence[str], timers: dict[str, int]) -> None:
        kept = self.kernel.rules.kept
        kept.clear()
        number = self.last_task - len(topics)
        for topic in topics:
            number += 1
            task = Task(number, "raiseEventTopic", topic, "None", PERSON)
            kept[number] = KeptEvent(task, topic, timers[topic], 0.0, is_offered=False, is_recorded=True)
            self.core.timers[timers[topic]] = TimerTarget("keep", str(number))

    # --- read ---

    def read(self, faults_left: int) -> tuple[Situation, tuple[int, ...], tuple[int, ...]]:
        """Return the kernel's present situation, between inputs.

        Also return the owners of its clocks: the tasks of the running acts and the numbers of the timers, each in the
        order of the situation.
        """
        kernel, core = self.kernel, self.core
        stack = kernel.rules.stack
        waiting, runs = kernel.scheduler.waiting, self.runner.runs
        asked, marks, stop = kernel.failures.state.asked, kernel.wizard_marks.state, kernel.stop
        timers, countdowns = self._read_countdowns()
        places: dict[int, int] | None = None
        rules = []
        for run in stack.values():
            own: tuple[tuple[str, int], ...] = ()
            if run.own_acts:
                if places is None:
                    tasks = (*(t.id for t in waiting), *runs, *asked)
                    places = {id: at for at, id in enumerate(tasks)}
                own = tuple(sorted((name, places.get(id, -1)) for name, id in run.own_acts.items()))
            latched = tuple(sorted(run.latched)) if run.latched else ()
            rules.append(RuleInState(run.name, run.state.id, run.priority, latched, own))
        memory = core.memory
        encode = msgspec.json.encode
        situation = Situation(
            tuple(rules),
            tuple([self._act(task) for task in waiting]) if waiting else (),
            tuple([self._running_act(cast(WholeActRun, run)) for run in runs.values()]) if runs else (),
            tuple([self._asked_act(task) for task in asked.values()]) if asked else (),
            countdowns,
            tuple([kept.topic for kept in kernel.rules.kept.values()]) if kernel.rules.kept else (),
            tuple([encode(memory[key]) if key in memory else None for key in self.keys])
            if self._session_parts is None
            else self._read_memory(self._session_parts),
            faults_left,
            stop.status,
            self.runner.robot_lost is not None,
            core.open_cue_at is not None,
            marks.last_filler if self._follows_fillers else None,
            tuple([(rule.name, rule.state, rule.priority, tuple(rule.latched)) for rule in stop.stopped_rules])
            if stop.stopped_rules
            else (),
        )
        return situation, tuple(runs), timers

    def _read_memory(self, session_parts: frozenset[str]) -> tuple[bytes | None, ...]:
        """Read the memory's values, and only the relevant parts of `session`."""
        memory, encode = self.core.memory, msgspec.json.encode
        session = {name: value for name, value in memory[SESSION].items() if name in session_parts}
        seen = ChainMap({SESSION: session}, memory)
        return tuple([encode(seen[key]) if key in seen else None for key in self.keys])

    def _read_countdowns(self) -> tuple[tuple[int, ...], tuple[Countdown, ...]]:
        core = self.core
        if not core.timers:
            return (), ()
        lengths = self._lengths
        for command in core.commands:
            if type(command) is SetTimer:
                lengths[command.timer] = round(1000 * (command.at - core.t))
        numbers, countdowns = [], []
        for number, target in sorted(core.timers.items()):
            if target.purpose == "stop":
                continue  # everything is stopped afterwards, even if the robot does not confirm in time
            owner, item = target.owner, 0
            if target.purpose == "after":
                item = int(target.item)
            elif target.purpose == "keep":
                owner = self.kernel.rules.kept[int(owner)].topic
            elif target.purpose == "repeat":
                asked = self.kernel.failures.state.asked
                item, owner = [*asked].index(int(owner)), asked[int(owner)].behavior
            numbers.append(number)
            countdowns.append(Countdown(target.purpose, owner, item, lengths[number]))
        if not self._in_order and len(countdowns) > 1:
            ordered = sorted(zip(countdowns, numbers, strict=True))
            return tuple([number for _, number in ordered]), tuple([countdown for countdown, _ in ordered])
        return tuple(numbers), tuple(countdowns)

    def _act(self, task: Task, phase: ActPhase = "", speaking: bool = False, interfered: bool = False) -> ActTask:
        source = task.source
        is_own = False
        if source.startswith("rule:"):
            if task.behavior in self._follows_failures:
                run = self.kernel.rules.stack.get(source[5:])
                is_own = run is not None and run.task.id < first_task(task)
        else:
            source = PERSON
        attempt = min(task.attempt, self._last_attempt[task.behavior]) if task.attempt > 1 else 1
        return ActTask(task.behavior, task.calling_type, source, attempt, is_own, phase, speaking, interfered)

    def _asked_act(self, task: Task) -> ActTask:
        pauses = self.kernel.failures.state.pauses
        if task.id not in pauses:
            return self._act(task)
        return self._act(task, "pausing" if pauses[task.id] is not None else "without robot")

    def _running_act(self, run: WholeActRun) -> ActTask:
        interfered = run.interfered and run.cancel_reason is None
        return self._act(run.task, run.phase, run.speaking and self._session_parts is not None, interfered)
