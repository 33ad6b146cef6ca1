"""The rules: run to completion, one taker per event (semantics.md 5, semantics.md 6).

In SCXML's words (https://www.w3.org/TR/scxml/, appendix D): everything that one input causes is a macrostep. Each
transition taken in it is a microstep, here a *step*. The functions in `onEntry` and `onExit` are executable content,
here *blocks* of ops. A transition without event or time is eventless. Unlike in SCXML, several machines (the rules)
share one queue of events, and at most one of them takes an event.

Functions run on an explicit list of frames instead of Python's stack. So rules can start rules ten thousand deep.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeAlias

from rise_engine.expression import EvaluationError
from rise_engine.kernel.compiled_rules import (
    ASSIGN,
    CALL,
    RAISE,
    TEST,
    CompiledCondition,
    CompiledRule,
    CompiledTransition,
    Op,
)
from rise_engine.kernel.core import Cause, Core, EventTopic, RuleList, Task, TimerTarget
from rise_engine.kernel.history import ValueBefore, step_before
from rise_engine.kernel.kept_events import KEPT_OFFER, KeptEvents
from rise_engine.kernel.memory import WorkingMemory
from rise_engine.kernel.records import ConditionRecord, EventRecord, RuleRecord, TaskRecord, TaskStatus
from rise_engine.kernel.rule_stack import (
    MAX_VAIN_SEARCHES,
    MULTIPLIED,
    STEP_LIMIT,
    STOPPED_FOR_LOOP,
    RuleRun,
    RuleStack,
    append_to_lists,
    find_multiplier,
    find_runaway_rule,
    rank,
    remove_from_lists,
)
from rise_engine.kernel.snapshot import RuleSnapshot, RulesSnapshot
from rise_engine.kernel.stop import StoppedRule
from rise_engine.kernel.waits import OwnActs, begin_countdown, break_countdown

Frame: TypeAlias = tuple[RuleRun, Op | None, bool, CompiledTransition | None, Cause]
"""The rest of a block: the rule, the next step, whether the end of the block completes a state's entry, the transition
that then enters its target, and the cause."""

WITHOUT_ENTRY = ", without onEntry"
"""The end of the trigger of a rule that enters a state without running its onEntry."""


class RuleMachine:
    """All running rules, and the routing of events to them."""

    def __init__(self, core: Core, submit: Callable[[str, str, str], None]) -> None:
        self._core = core
        self._submit = submit
        """(function, behavior, source): submits all other DomainTasks."""
        self.memory = WorkingMemory(core, self._reevaluate_watchers)
        self._watchers: dict[str, RuleList] = {}
        self.compiled = {
            name: CompiledRule(rule, core.topics, self._watchers) for name, rule in core.scenario.rules.items()
        }
        """All rules of the scenario, compiled."""
        self.on_stopped: Callable[[RuleRun], None] = lambda run: None
        self.on_loop_ended: Callable[[], object] = lambda: None
        """Called after a runaway rule was stopped: this may have started acts that waited."""
        """Called with each rule that a task or a fault stops."""
        self._has_tables = bool(core.tables)
        self._frames: list[Frame] = []
        self._to_reevaluate: dict[RuleRun, Cause] = {}
        """Rules whose eventless transitions must be evaluated, with the cause."""
        self.stack = RuleStack()
        self.step_counts: dict[str, tuple[int, int]] = {}
        """The macrostep and number of the last steps of ended rules, or STOPPED_FOR_LOOP: a rule that is started again
        within it continues to count."""
        self.kept = KeptEvents(core)
        self.own_acts = OwnActs(core, self.stack, self.compiled)
        self._vain_searches = (-1, 0)
        """The last macrostep in which a search found no runaway rule, and the number of such searches in it."""

    # --- start and end ---

    def start(self, name: str, task: Task, on_top: bool, state: str | None = None, enter: bool = True) -> None:
        """Start a rule that is not running.

        :param on_top: put it above all others: a rule started it.
        :param state: its first state; None: the initial one.
        :param enter: run `onEntry` there; otherwise it only waits.
        """
        rule = self.compiled[name]
        run = RuleRun(name, rule.initial if state is None else rule.states[state], task, rule.priority)
        self.stack.start(run, on_top)
        self._begin(run, "start", enter)

    def resume(self, stopped: StoppedRule, task: Task, enter: bool) -> None:
        """Start a rule in the state where everything was stopped, above all others of its old priority. Without
        `enter`, it only waits there, and conditions that were already taken stay taken."""
        run = RuleRun(stopped.name, self.compiled[stopped.name].states[stopped.state], task, stopped.priority)
        run.remember(stopped.steps[:-1])
        if not enter:
            run.latched = set(stopped.latched)
        self.stack.start(run, on_top=False)
        self._begin(run, "resumed", enter)

    def rule_states(self) -> list[StoppedRule]:
        """The states of the rules, the bottom of the stack first."""
        return [
            StoppedRule(run.name, run.state.id, run.priority, _taken_conditions(run), run.steps)
            for run in self.stack.values()
        ]

    # --- a step back ---

    def changed_since_step(self, run: RuleRun) -> dict[str, ValueBefore]:
        """The keys that changed since the previous state was entered, with their values from then."""
        before = step_before(run.steps)
        log = self._core.memory_log
        return log.changed_since(before[1], self._core.memory) if before is not None else {}

    def step_back(self, run: RuleRun, enter: bool) -> None:
        """Return a rule to its known previous state without onExit. Without `enter`, it only waits there."""
        core, previous = self._core, run.state
        run.entries.pop()
        id = run.entries.pop().state or ""
        self._on_left(run)
        self.stack.promote(run)
        run.state = self.compiled[run.name].states[id]
        run.macrostep, run.step_count = core.macrostep, 1
        trigger = "stepped back" + ("" if enter else WITHOUT_ENTRY)
        core.emit(RuleRecord, run.name, "entered", id, previous.id, trigger, priority=run.priority)
        self._note_step(run)
        if self.kept:
            self.kept.offer(run.state.by_topic, (run.name, core.cause))
        append_to_lists(run, run.state.watch_lists)
        self._to_reevaluate.pop(run, None)
        self._on_entered(run, (run.name, core.cause), enter)

    def _note_step(self, run: RuleRun) -> None:
        """Note that a rule entered its state, by the last record."""
        record = self._core.records[-1]
        assert isinstance(record, RuleRecord)
        run.entries.append(record)

    def _trim_log(self) -> None:
        """Keep earlier values of the memory only for steps that a rule can still undo."""
        self._core.memory_log.trim((run.steps for run in self.stack.values()), 4 * len(self.stack))

    def _begin(self, run: RuleRun, trigger: str, enter: bool) -> None:
        """Let a rule that has just joined the stack enter its first state."""
        name = run.name
        trigger += "" if enter else WITHOUT_ENTRY
        append_to_lists(run, run.state.watch_lists)
        self._core.emit(RuleRecord, name, "started", run.state.id, trigger=trigger, priority=run.priority)
        self._core.emit(RuleRecord, name, "entered", run.state.id, trigger=trigger, priority=run.priority)
        self._note_step(run)
        if self.kept:
            self.kept.offer(run.state.by_topic, (name, self._core.cause))
        step = self._core.macrostep
        last, steps = self.step_counts.get(name, (-1, 0))
        run.macrostep, run.step_count = step, steps + 1 if last == step else 1
        if run.step_count <= STEP_LIMIT or self._stop_runaway(run):
            self._on_entered(run, (name, self._core.cause), enter)

    def stop(self, name: str, reason: str) -> None:
        """Stop a running rule in its state, without running functions."""
        self._end(self.stack[name], "stopped", "CANCELED", reason)

    def stop_all(self, reason: str) -> None:
        """End every rule, the top one first, and drop the events that they raised."""
        for name in list(reversed(self.stack)):
            self.stop(name, reason)
        self.kept.take_all_back(reason)
        self._core.events.clear()
        self._frames.clear()
        self._to_reevaluate.clear()

    def _end(
        self, run: RuleRun, status: Literal["ended", "stopped", "faulted"], task_status: TaskStatus, reason: str = ""
    ) -> None:
        core = self._core
        run.alive = False
        self._on_left(run)
        self._to_reevaluate.pop(run, None)
        self.stack.remove(run)
        self.step_counts[run.name] = (run.macrostep, run.step_count)
        core.emit(RuleRecord, run.name, status, run.state.id, priority=run.priority, reason=reason)
        if status != "ended":
            self.on_stopped(run)
        run.task.status = task_status
        core.record_task(run.task, reason)
        if status == "ended" and (result := self.compiled[run.name].results.get(run.state.id)) is not None:
            core.raise_event_if_named(result)
        core.raise_event_if_named(run.name + "_end")

    # --- snapshot ---

    def snapshot(self) -> RulesSnapshot:
        """The state of the rules between inputs, which shares its parts with them."""
        step = self._core.macrostep
        running = [
            RuleSnapshot(
                name=run.name,
                state=run.state.id,
                task=run.task,
                priority=run.priority,
                recency=run.recency,
                timers={timer: transition.index for timer, transition in run.timers.items()},
                latched=sorted(run.latched),
                own_acts=run.own_acts,
                history=run.steps,
                steps=run.step_count if run.macrostep == step else 0,
            )
            for run in self.stack.values()
        ]
        ended = {name: steps for name, (last, steps) in self.step_counts.items() if last == step}
        return RulesSnapshot(running, ended, self.stack.recency, list(self.kept.values()))

    def restore(self, snapshot: RulesSnapshot) -> None:
        """Restore the rules without running anything. Raises LookupError for a rule or state that the scenario
        lacks."""
        step = self._core.macrostep
        for rule in snapshot.running:
            compiled = self.compiled[rule.name]
            run = RuleRun(rule.name, compiled.states[rule.state], rule.task, rule.priority, rule.recency)
            run.timers = {timer: run.state.transitions[index] for timer, index in rule.timers.items()}
            if any(transition.after is None for transition in run.timers.values()):
                raise LookupError(f"`after` in the state {rule.state} of {rule.name}")
            run.latched = set(rule.latched)
            run.own_acts = dict(rule.own_acts)
            run.remember(rule.history)
            run.macrostep, run.step_count = step, rule.steps
            self.stack.add(run)
            append_to_lists(run, run.state.watch_lists)
        self.step_counts = {name: (step, steps) for name, steps in snapshot.step_counts.items()}
        self.stack.recency = snapshot.recency
        self.kept.update((kept.task.id, kept) for kept in snapshot.kept)

    # --- run to completion ---

    def run_to_completion(self) -> None:
        """Run everything that the current input causes, until all rules wait again: the rest of the macrostep.

        Each round runs pending functions first, then eventless transitions, then the next event.
        """
        core = self._core
        events = core.events
        frames = self._frames
        stack = self.stack
        to_reevaluate = self._to_reevaluate
        records, numbers, t = core.records, core.numbers, core.t
        while True:
            if frames:
                self._run_actions()
            if to_reevaluate:
                self._take_eventless()
            elif events:
                topic, source, core.cause = events.popleft()
                run = stack.top
                transition = run.state.by_topic.get(topic) if run is not None else None
                # Usually the top rule takes it without a condition, so nothing needs to be searched.
                if transition is None or transition.condition is not None:
                    run, transition = self._find_taker(topic)
                if run is not None and transition is not None:
                    records.append(EventRecord(next(numbers), t, "", topic.with_slash, source, run.name))
                    self._take_transition(run, transition)
                elif topic is KEPT_OFFER:
                    self._route_kept(int(source))
                else:
                    records.append(EventRecord(next(numbers), t, "", topic.with_slash, source, None))
            elif not frames:
                return

    def _find_taker(self, topic: EventTopic) -> tuple[RuleRun, CompiledTransition] | tuple[None, None]:
        """The highest rule that takes an event, and its transition."""
        top = self.stack.top
        if top is not None and (transition := self._find_transition(top, topic)) is not None:
            return top, transition
        for run in reversed(topic.wait_list):
            if (transition := self._find_transition(run, topic)) is not None:
                return run, transition
        return None, None

    def _find_transition(self, run: RuleRun, topic: EventTopic) -> CompiledTransition | None:
        """The first transition of a rule, in document order, that takes an event."""
        transition = run.state.by_topic.get(topic)
        while transition is not None and transition.condition is not None:
            if self._evaluate(run, transition.condition):
                break
            transition = transition.next
        return transition

    def _route_kept(self, task: int) -> None:
        """Give a kept event to a rule that takes it now, or keep it."""
        kept = self.kept.get(task)
        if kept is None:
            return
        topic = self._core.topics.get(kept.topic)
        if topic is None or kept.topic not in self._core.scenario.topics:
            self.kept.expire(kept, "no rule of this scenario waits for it")
            return
        run, transition = self._find_taker(topic)
        if run is None or transition is None:
            self.kept.stay(kept)
        else:
            self.kept.take(kept, run.name)
            self._core.cause = (task, self._core.cause)
            self._take_transition(run, transition)

    def _take_eventless(self) -> None:
        """Let the highest rule in `_to_reevaluate` take an eventless transition."""
        run = max(self._to_reevaluate, key=rank) if len(self._to_reevaluate) > 1 else next(iter(self._to_reevaluate))
        self._core.cause = self._to_reevaluate.pop(run)
        for transition in run.state.eventless:
            held = transition.held is not None
            condition = transition.held or transition.condition
            if condition is None or self._evaluate(run, condition):
                if held and transition.index not in run.latched:
                    run.latched.add(transition.index)
                    begin_countdown(self._core, run, transition)
                    continue
                # It is taken when it *becomes* true. If the rule stays in the state, it must become false first.
                if not held and transition.index not in run.latched:
                    run.latched.add(transition.index)
                    self._take_transition(run, transition)
                    return
            elif transition.index in run.latched:
                run.latched.discard(transition.index)
                if held:
                    break_countdown(self._core, run, transition)

    def timer_elapsed(self, timer: int, target: TimerTarget) -> None:
        """Handle the end of an `after` in a rule's state."""
        run = self.stack[target.owner]
        transition = run.timers.pop(timer)
        if transition.condition is None or self._evaluate(run, transition.condition):
            self._take_transition(run, transition)

    def _reevaluate_watchers(self, key: str) -> None:
        """Mark the rules that watch a key for evaluation of their eventless transitions."""
        if self._core.memory_log.is_full and self.stack:  # stopped rules may still be resumed
            self._trim_log()
        if runs := self._watchers.get(key):
            self._to_reevaluate.update(dict.fromkeys(runs, self._core.cause))

    # --- transitions ---

    def _take_transition(self, run: RuleRun, transition: CompiledTransition) -> None:
        """Take a transition (a microstep), immediately if no functions come first. Inlined: it dominates the cost of an
        event."""
        core = self._core
        step = core.macrostep
        steps = run.step_count + 1 if run.macrostep == step else 1
        if steps > STEP_LIMIT:
            run.macrostep = step
            run.step_count = steps
            if not self._stop_runaway(run):
                return
            steps = run.step_count
            run.step_count = 0  # the present step is the first that counts again
        state = transition.entered_at_once
        if state is None:
            self._push_functions(run, transition, steps)
            return
        run.macrostep = step
        run.step_count = steps
        previous = run.state
        if not previous.trivial:
            self._on_left(run)
        if self.stack.top is not run:
            self.stack.promote(run)
        run.state = state
        record = RuleRecord(
            next(core.numbers),
            core.t,
            "",
            run.name,
            "entered",
            state.id,
            previous.id,
            transition.trigger,
            transition.index,
            run.priority,
        )
        core.records.append(record)
        run.entries.append(record)
        if self.kept:
            self.kept.offer(state.by_topic, (run.name, core.cause))
        if not state.trivial:
            append_to_lists(run, state.watch_lists)
            self._on_entered(run, (run.name, core.cause))
        elif state.entry is not None:
            self._frames.append((run, state.entry, False, None, (run.name, core.cause)))

    def _push_functions(self, run: RuleRun, transition: CompiledTransition, steps: int) -> None:
        """Schedule the functions of a transition that cannot enter its target immediately: onExit, its own, the move,
        onEntry."""
        frames = self._frames
        before = self._core.cause
        cause = (run.name, before)
        if transition.entry_after_actions is not None:
            # The last frame runs first: onExit, the transition's own functions, then the move, which is the step.
            frames.append((run, None, False, transition.entry_after_actions, before))
            frames.append((run, transition.block, False, None, cause))
            frames.append((run, run.state.exit, False, None, cause))
        else:
            run.macrostep = self._core.macrostep
            run.step_count = steps
            self.stack.promote(run)
            state, trigger, index = run.state.id, transition.trigger, transition.index
            self._core.emit(RuleRecord, run.name, "stayed", state, state, trigger, index, run.priority)
            frames.append((run, transition.block, True, None, cause))

    def _on_entered(self, run: RuleRun, cause: Cause, enter: bool = True) -> None:
        """Start the timers of an entered state and, with `enter`, its onEntry."""
        state = run.state
        for timed in state.delayed:
            begin_countdown(self._core, run, timed)
        if state.entry is not None and enter:
            self._frames.append((run, state.entry, True, None, cause))
        else:
            self._after_onentry(run, cause)

    def _after_onentry(self, run: RuleRun, cause: Cause) -> None:
        """Handle the end of a state's onEntry: a final state ends the rule; any other is evaluated."""
        if run.state.final:
            self._core.cause = cause
            self._end(run, "ended", "SUCCEEDED")
        elif run.state.eventless:
            self._to_reevaluate[run] = cause

    # --- runaways ---

    def _stop_runaway(self, run: RuleRun) -> bool:
        """Handle a rule with more than STEP_LIMIT steps in one macrostep: stop the runaway rule, which the chain of
        causes shows (semantics.md 6.4). Returns whether the step is still taken."""
        core = self._core
        resumed = core.continued_macrostep == core.macrostep  # whether the chain began in an earlier input
        runaway = find_runaway_rule(
            (run.name, core.cause), self.stack, (run.name, run.step_count - 1) if resumed else None
        )
        if runaway is None:
            self._stop_multiplier()
        else:
            reason = runaway.reason(runaway.steps - (runaway.name == run.name))  # its last step was not taken
            self._stop_for_loop(runaway.name, reason)
        run.step_count = 1
        return run.alive

    def _stop_multiplier(self) -> None:
        """Stop the rule that raised most of the waiting events, if a macrostep without a loop is practically endless:
        thirty rules that each answer an event with two events for the next rule take a billion steps."""
        core = self._core
        macrostep, times = self._vain_searches
        self._vain_searches = (core.macrostep, times + 1 if macrostep == core.macrostep else 1)
        if self._vain_searches[1] > MAX_VAIN_SEARCHES:
            name = find_multiplier(core.events, self.stack)
            if name is not None:
                self._stop_for_loop(name, MULTIPLIED)

    def _stop_for_loop(self, name: str, reason: str) -> None:
        self._end(self.stack[name], "faulted", "ABORTED", reason)
        self.step_counts[name] = (self._core.macrostep, STOPPED_FOR_LOOP)
        self.on_loop_ended()

    def was_stopped_for_loop(self, name: str) -> bool:
        """Whether a rule cannot start again in this macrostep, because it was stopped in it as a runaway. Two rules
        that restart each other would never end it."""
        return self.step_counts.get(name) == (self._core.macrostep, STOPPED_FOR_LOOP)

    # --- functions ---

    def _run_actions(self) -> None:
        """Run executable content, the innermost block first, until none is left."""
        frames = self._frames
        core = self._core
        while frames:
            run, op, entered, entering, cause = frames.pop()
            if not run.alive:
                continue
            core.cause = cause
            while op is not None:
                kind = op.kind
                if kind == TEST:
                    op = op.next if self._evaluate(run, op.condition) else op.otherwise
                elif kind == RAISE:
                    id = core.next_task
                    core.next_task = id + 1
                    core.records.append(
                        TaskRecord(
                            next(core.numbers),
                            core.t,
                            "",
                            id,
                            "raiseEventTopic",
                            op.argument,
                            "None",
                            op.source,
                            "SUCCEEDED",
                        )
                    )
                    core.events.append((op.topic, op.source, cause))
                    op = op.next
                elif kind == ASSIGN:
                    op = op.next if self._assign(run, op) else None  # an error skips the rest of the block
                elif kind == CALL:
                    frames.append((run, op.next, entered, entering, cause))
                    self._submit(op.function, op.argument, op.source)
                    break  # the started functions run first, and may stop this rule
                else:
                    op = op.choices[core.rng.integer_below(len(op.choices))]
            else:
                if entered:
                    self._after_onentry(run, cause)
                elif entering is not None:
                    self._take_transition(run, entering)

    def _assign(self, run: RuleRun, op: Op) -> bool:
        """Assign values. Returns False if they could not be computed."""
        core = self._core
        source = op.source
        try:
            written = self.memory.compute(op.assignments)
        except EvaluationError as error:
            core.record_finished_task("assignValue", op.argument, source, "ABORTED", str(error))
            return False
        core.record_finished_task("assignValue", op.argument, source, "SUCCEEDED")
        self.memory.assign(written, source)
        return True

    def _evaluate(self, run: RuleRun, condition: CompiledCondition) -> bool:
        """Evaluate a condition and record the result. An error makes it false (semantics.md 8.2)."""
        core = self._core
        env = core.env
        error = ""
        try:
            result = condition.evaluate(env)
        except EvaluationError as problem:
            result, error = False, str(problem)
        memory = core.memory
        key = condition.only_key
        values = {key: memory[key]} if key in memory else core.read_values(condition.keys)
        if self._has_tables:
            self._abridge_tables(values)
        missing = core.newly_missing() if env.missing else ()
        core.records.append(
            ConditionRecord(
                next(core.numbers), core.t, "", run.name, run.state.id, condition.text, values, result, error, missing
            )
        )
        return result

    def _abridge_tables(self, values: dict[str, Any]) -> None:
        """Record only the size of a table that a condition read as a whole."""
        tables = self._core.scenario.tables
        for key in tables.keys() & values:
            values[key] = tables[key].size_text

    def _on_left(self, run: RuleRun) -> None:
        """Stop watching keys and cancel timers, because the state is left or the rule ends."""
        remove_from_lists(run, run.state.watch_lists)
        for timer in run.timers:
            self._core.cancel_timer(timer)
        run.timers.clear()
        run.latched.clear()


def _taken_conditions(run: RuleRun) -> list[int]:
    """The transitions whose condition was taken and has held since. Times that still run end with the rule, so their
    transitions are omitted."""
    return sorted(run.latched - {timed.index for timed in run.timers.values()})
