"""The rules: run to completion, one taker per event, the stack (semantics, section 3).

Costs follow the takers, not the number of running rules: each topic has its waiting rules in stack order, each memory key
the rules that watch it. All are insertion-ordered dicts whose last entry is the top: a rule that takes a transition
moves to the top, so that appending keeps them sorted; only a start below others has to insert.

Functions run on an explicit list of frames, not on Python's stack: a rule that starts a rule that starts a rule, ten
thousand deep, is no deeper than the first.
"""

from __future__ import annotations

from collections.abc import Callable

from rise_engine.expression import EvaluationError
from rise_engine.kernel.core import Core, Task, TimerTarget
from rise_engine.kernel.memory import WorkingMemory
from rise_engine.kernel.program import (
    ASSIGN,
    CALL,
    IF,
    RAISE,
    Condition,
    Op,
    RuleCode,
    StateCode,
    TransitionCode,
)
from rise_engine.kernel.records import ConditionRecord, RuleRecord

STEP_LIMIT = 1_000
"""Transitions that one rule may take in one go before it counts as running away."""

Rank = tuple[float, int]


class RuleRun:
    """A running rule."""

    __slots__ = ("alive", "code", "held", "name", "priority", "stamp", "state", "steps", "steps_seq", "task", "timers")

    def __init__(self, code: RuleCode, state: StateCode, task: Task) -> None:
        self.code = code
        self.name = code.name
        self.state = state
        self.task = task
        self.priority = code.priority
        self.stamp = 0
        self.alive = True
        self.timers: dict[int, TransitionCode] = {}
        self.held: set[int] = set()
        """Transitions of the state, by index, whose condition was true when last looked at and that were taken for it."""
        self.steps = 0
        self.steps_seq = -1

    @property
    def rank(self) -> Rank:
        """Larger is nearer the top. Unique, because stamps are."""
        return (self.priority, self.stamp)


class _Frame:
    """A block that is being run."""

    __slots__ = ("at", "enter", "entered", "inner", "ops", "run", "trigger")

    def __init__(
        self,
        run: RuleRun,
        ops: tuple[Op, ...],
        inner: bool = False,
        entered: bool = False,
        enter: TransitionCode | None = None,
    ) -> None:
        self.run = run
        self.ops = ops
        self.at = 0
        self.inner = inner
        """An arm of an `if` or `oneOf`: an error ends the block around it too."""
        self.entered = entered
        """Afterwards, the state has been entered."""
        self.enter = enter
        """Afterwards, this transition's target is entered."""


class RuleMachine:
    """All running rules and the routing of events to them."""

    __slots__ = (
        "_codes",
        "_core",
        "_dirty",
        "_frames",
        "_memory",
        "_submit",
        "_waiting",
        "_watching",
        "stack",
        "stamp",
    )

    def __init__(self, core: Core, submit: Callable[[str, str, str], None]) -> None:
        self._core = core
        self._submit = submit
        """(function, behavior, source): the path of every other DomainTask."""
        self._memory = WorkingMemory(core, self.key_changed)
        self._codes = {name: RuleCode(rule) for name, rule in core.scenario.rules.items()}
        self._frames: list[_Frame] = []
        self._dirty: dict[RuleRun, None] = {}
        """Rules whose conditions without event have to be looked at."""
        self._waiting: dict[str, dict[RuleRun, None]] = {topic: {} for topic in core.scenario.topics}
        self._watching: dict[str, dict[RuleRun, None]] = {}
        self.stamp = 0
        self.stack: dict[str, RuleRun] = {}
        """The running rules by name, bottom first."""

    @property
    def memory(self) -> WorkingMemory:
        return self._memory

    # --- start and end ---

    def start(self, name: str, task: Task, on_top: bool) -> None:
        """Start a rule that is not running. `on_top`: a rule started by a rule goes above all others."""
        code = self._codes[name]
        run = RuleRun(code, code.initial, task)
        if on_top and self.stack:
            run.priority = max(run.priority, self._top().priority)
        self.stamp += 1
        run.stamp = self.stamp
        if self.stack and run.rank < self._top().rank:
            self.stack[name] = run
            self.stack = {r.name: r for r in sorted(self.stack.values(), key=lambda r: r.rank)}
        else:
            self.stack[name] = run
        self._record(run, "started", None, "start", None)
        self._enter(run, code.initial, None, "start", None)

    def stop(self, name: str, reason: str) -> None:
        """Stop a running rule where it is; no functions run."""
        self._end(self.stack[name], "stopped", "CANCELED", reason)

    def stop_all(self, reason: str) -> None:
        """End every rule, the top one first, and forget what they had raised."""
        for name in list(reversed(self.stack)):
            self.stop(name, reason)
        self._core.events.clear()
        self._frames.clear()
        self._dirty.clear()

    def _end(self, run: RuleRun, status: str, task_status: str, reason: str = "") -> None:
        core = self._core
        run.alive = False
        self._unlist(run)
        self._dirty.pop(run, None)
        del self.stack[run.name]
        core.seq += 1
        core.records.append(
            RuleRecord(core.seq, core.t, "", run.name, status, run.state.id, None, None, None, run.priority, reason)  # type: ignore[arg-type]
        )
        run.task.status = task_status  # type: ignore[assignment]
        core.task_record(run.task, reason)
        core.raise_if_named(run.name + "_end")

    def resume(
        self, name: str, state: str, task: Task, priority: float, stamp: int, timers: dict[int, int], held: set[int]
    ) -> None:
        """Put a rule of a snapshot back where it was. Bottom of the stack first; nothing runs and nothing is recorded."""
        code = self._codes[name]
        run = RuleRun(code, code.states[state], task)
        run.priority, run.stamp, run.held = priority, stamp, held
        run.timers = {timer: run.state.transitions[index] for timer, index in timers.items()}
        self.stack[name] = run
        self._list(run)

    # --- run to completion ---

    def settle(self) -> None:
        """Handle everything that the current input has set off, until all rules wait again."""
        core = self._core
        events = core.events
        while True:
            if self._frames:
                self._drive()
            if self._dirty:
                self._look_at_conditions()
            elif events:
                self._route(*events.popleft())
            elif not self._frames:
                return

    def _route(self, topic: str, shown: str, source: str) -> None:
        """Give an event to the highest rule that would take it."""
        core = self._core
        runs = self._waiting.get(topic)
        if runs:
            for run in reversed(runs):
                for transition in run.state.by_topic[topic]:
                    if transition.condition is None or self._holds(run, transition.condition):
                        core.event_record(shown, source, run.name)
                        self._take(run, transition)
                        return
        core.event_record(shown, source, None)

    def _look_at_conditions(self) -> None:
        """Let the highest of the rules that have something to look at take a transition without event."""
        run = max(self._dirty, key=lambda r: r.rank) if len(self._dirty) > 1 else next(iter(self._dirty))
        del self._dirty[run]
        for transition in run.state.watching:
            if transition.condition is None or self._holds(run, transition.condition):
                # It is taken when it *becomes* true: one that stays in the state must turn false before it is taken again.
                if transition.index not in run.held:
                    run.held.add(transition.index)
                    self._take(run, transition)
                    return
            else:
                run.held.discard(transition.index)

    def timer_elapsed(self, timer: int, target: TimerTarget) -> None:
        """`after` has passed in a rule's state."""
        run = self.stack[target.owner]
        transition = run.timers.pop(timer)
        if transition.condition is None or self._holds(run, transition.condition):
            self._take(run, transition)

    def key_changed(self, key: str) -> None:
        if runs := self._watching.get(key):
            self._dirty.update(runs)

    # --- transitions ---

    def _take(self, run: RuleRun, transition: TransitionCode) -> None:
        core = self._core
        if run.steps_seq != core.step:
            run.steps_seq = core.step
            run.steps = 0
        run.steps += 1
        if run.steps > STEP_LIMIT:
            self._end(
                run,
                "faulted",
                "ABORTED",
                f"took {STEP_LIMIT} transitions in one go without waiting; two of its states probably lead to each other",
            )
            return
        target = transition.target
        if target is not None and not run.state.exit and not transition.ops:
            self._enter(run, target, run.state.id, transition.trigger, transition)
            return
        if target is None:
            self._to_top(run)
            self._record(run, "entered", run.state.id, transition.trigger, transition.index)
            self._frames.append(_Frame(run, transition.ops, entered=True))
            return
        self._frames.append(_Frame(run, (), enter=transition))
        if transition.ops:
            self._frames.append(_Frame(run, transition.ops))
        if run.state.exit:
            self._frames.append(_Frame(run, run.state.exit))

    def _enter(
        self, run: RuleRun, state: StateCode, previous: str | None, trigger: str, transition: TransitionCode | None
    ) -> None:
        if transition is not None:
            self._unlist(run)
            self._to_top(run, listed=False)
        run.state = state
        if run.held:
            run.held.clear()
        self._list(run)
        core = self._core
        core.seq += 1
        core.records.append(
            RuleRecord(
                core.seq,
                core.t,
                "",
                run.name,
                "entered",
                state.id,
                previous,
                trigger,
                None if transition is None else transition.index,
                run.priority,
            )
        )
        for timed in state.timed:
            timer = core.set_timer(timed.after or 0.0, TimerTarget("after", run.name, str(timed.index)))
            run.timers[timer] = timed
        if state.entry:
            self._frames.append(_Frame(run, state.entry, entered=True))
        else:
            self._entered(run)

    def _entered(self, run: RuleRun) -> None:
        if run.state.final:
            self._end(run, "ended", "SUCCEEDED")
        elif run.state.watching:
            self._dirty[run] = None

    # --- functions ---

    def _drive(self) -> None:
        frames = self._frames
        core = self._core
        while frames:
            frame = frames[-1]
            run = frame.run
            ops = frame.ops
            if not run.alive:
                frames.pop()
                continue
            if frame.at == len(ops):
                frames.pop()
                if frame.entered:
                    self._entered(run)
                elif frame.enter is not None and frame.enter.target is not None:
                    self._enter(run, frame.enter.target, run.state.id, frame.enter.trigger, frame.enter)
                continue
            op = ops[frame.at]
            frame.at += 1
            kind = op.kind
            if kind == RAISE:
                core.settled("raiseEventTopic", op.argument, run.code.source, "SUCCEEDED")
                core.events.append((op.topic, op.shown, run.code.source))
            elif kind == IF:
                for condition, block in op.branches:
                    if condition is None or self._holds(run, condition):
                        if block:
                            frames.append(_Frame(run, block, inner=True))
                        break
            elif kind == ASSIGN:
                self._assign(run, op)
            elif kind == CALL:
                self._submit(op.function, op.argument, run.code.source)
            elif op.choices:
                frames.append(_Frame(run, op.choices[core.chance.below(len(op.choices))], inner=True))

    def _assign(self, run: RuleRun, op: Op) -> None:
        core = self._core
        source = run.code.source
        try:
            written = self._memory.compute(op.assignments)
        except EvaluationError as error:
            core.settled("assignValue", op.argument, source, "ABORTED", str(error))
            self._skip_rest_of_block()
        else:
            core.settled("assignValue", op.argument, source, "SUCCEEDED")
            self._memory.assign(written, source)

    def _skip_rest_of_block(self) -> None:
        """An error in a function skips the rest of that block, whichever arm of an `if` it stands in."""
        while True:
            frame = self._frames[-1]
            frame.at = len(frame.ops)
            if not frame.inner:
                return
            self._frames.pop()

    def _holds(self, run: RuleRun, condition: Condition) -> bool:
        """Evaluate a condition and record how it came out. An error makes it false (semantics, section 4)."""
        core = self._core
        error = ""
        try:
            result = condition.test(core.env)
        except EvaluationError as problem:
            result, error = False, str(problem)
        core.seq += 1
        core.records.append(
            ConditionRecord(
                core.seq,
                core.t,
                "",
                run.name,
                run.state.id,
                condition.text,
                core.values_of(condition.keys),
                result,
                error,
                core.newly_missing() if core.env.missing else (),
            )
        )
        return result

    # --- the stack and the lists ---

    def _top(self) -> RuleRun:
        return self.stack[next(reversed(self.stack))]

    def _to_top(self, run: RuleRun, listed: bool = True) -> None:
        """The most recent rule is the most relevant: it takes the highest priority on the stack (paper, 4.2.2)."""
        self.stamp += 1
        run.stamp = self.stamp
        top = self._top()
        if top is not run:
            run.priority = top.priority
            del self.stack[run.name]
            self.stack[run.name] = run
        if listed:
            self._unlist(run, timers=False)
            self._list(run)

    def _list(self, run: RuleRun) -> None:
        state = run.state
        for topic in state.topics:
            self._insert(self._waiting, topic, run)
        for key in state.watched:
            self._insert(self._watching, key, run)

    def _insert(self, lists: dict[str, dict[RuleRun, None]], name: str, run: RuleRun) -> None:
        runs = lists.get(name)
        if runs is None:
            lists[name] = {run: None}
            return
        below_others = bool(runs) and run.rank < next(reversed(runs)).rank
        runs[run] = None
        if below_others:
            lists[name] = dict.fromkeys(sorted(runs, key=lambda r: r.rank))

    def _unlist(self, run: RuleRun, timers: bool = True) -> None:
        state = run.state
        for topic in state.topics:
            del self._waiting[topic][run]
        for key in state.watched:
            del self._watching[key][run]
        if timers and run.timers:
            for timer in run.timers:
                self._core.cancel_timer(timer)
            run.timers.clear()

    def _record(self, run: RuleRun, status: str, previous: str | None, trigger: str, transition: int | None) -> None:
        core = self._core
        core.seq += 1
        core.records.append(
            RuleRecord(
                core.seq,
                core.t,
                "",
                run.name,
                status,
                run.state.id,
                previous,
                trigger,
                transition,
                run.priority,  # type: ignore[arg-type]
            )
        )
