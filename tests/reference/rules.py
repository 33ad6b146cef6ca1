"""Rules and events (semantics.md 5, 6)."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

from rise_engine.scenario.model import (
    Block,
    Delay,
    Function,
    If,
    OneOf,
    Rule,
    State,
    Statement,
    Transition,
    functions_in,
    normal_topic,
)

from .circles import Circles, Step
from .kept import Kept
from .session import Clock, Session
from .tasks import Failed, Refused, Task


@dataclass(eq=False)
class Run:
    """A rule that runs."""

    rule: Rule
    task: Task
    priority: float
    state: State
    own_acts: dict[str, Task] = field(default_factory=dict)
    """For `ended`: the last act of each name that it has started and that has not ended."""
    to_look: bool = False
    """Whether its transitions without event are to be looked at."""
    why_look: Step | None = None
    """The step that is the cause."""
    held: set[int] = field(default_factory=set)
    """Those of them without target that held when they were looked at last."""
    clocks: dict[int, Clock] = field(default_factory=dict)
    """By transition, the times that run."""

    @property
    def name(self) -> str:
        return self.rule.name


@dataclass
class Event:
    """Something that rules may wait for."""

    topic: str
    source: str
    cause: Step | None
    only: str | None = None
    """With `ended`: the name of the one rule that may take it."""
    act: str = ""
    outcome: str = ""
    kept: Kept | None = None
    """With `keep`."""

    def fits(self, way: Transition) -> bool:
        """Whether a transition waits for it."""
        if self.only is not None:
            return way.ended == self.act and (not way.outcomes or self.outcome in way.outcomes)
        return way.event == self.topic


class Rules:
    """The stack of running rules, and the events that wait to be handled."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.stack: list[Run] = []
        """The top first."""
        self.events: list[Event] = []
        self.circles = Circles(self)
        self.step: Step | None = None
        """The step whose functions run."""

    # --- starting and ending ---

    def start_rule(self, task: Task) -> None:
        """Start a rule: its first state's functions run at once."""
        self.session.stop.refuse_if_stopped()
        name, state, enter = read_start(task.behavior)
        rule = self.session.scenario.rules.get(name)
        if rule is None:
            raise Refused("there is no such rule")
        state = rule.initial if state is None else state
        if state not in rule.states:
            raise Refused("it has no such state")
        if any(run.name == rule.name for run in self.stack):
            raise Refused("it is running already")
        if name in self.circles.stopped:
            raise Refused("it has just been stopped, because it goes round in circles")
        tasks = self.session.tasks
        tasks.record(task, "PENDING")
        tasks.record(task, "ACTIVE")
        run = Run(rule, task, rule.priority, rule.states[state])
        place = 0
        if task.source.startswith("rule:"):
            run.priority = max([rule.priority, *(other.priority for other in self.stack)])
        else:
            while place < len(self.stack) and self.stack[place].priority > rule.priority:
                place += 1
        self.stack.insert(place, run)
        trigger = "start" if enter else "start, without onEntry"
        self._record(run, "started", state, trigger=trigger)
        self._arrive(run, state, None, trigger, None, Step(run.name, self.step))
        step = self.circles.about_to_step(run, self.step)
        if step is not None:
            self.circles.count(run)
            self._run_state(run, step, enter)

    def resume(self, run: Run, enter: bool, held: set[int]) -> None:
        """A rule that a stop has ended begins where it stood; its functions run later."""
        trigger = "resumed" if enter else "resumed, without onEntry"
        tasks = self.session.tasks
        tasks.record(run.task, "PENDING")
        tasks.record(run.task, "ACTIVE")
        self.stack.insert(0, run)
        self._record(run, "started", run.state.id, trigger=trigger)
        self._arrive(run, run.state.id, None, trigger, None, Step(run.name, None))
        self.circles.count(run)
        run.held |= held
        self.session.times.state_entered(run)

    def run_functions(self, run: Run, enter: bool) -> None:
        """What a state does after it was entered, but for its times."""
        self._run_functions(run, Step(run.name, None), enter)

    def go_back(self, run: Run, state: str, enter: bool) -> None:
        """A rule enters the state before."""
        self.session.times.state_left(run)
        step, previous = Step(run.name, None), run.state.id
        self._move_to_top(run)
        self._arrive(run, state, previous, "stepped back" if enter else "stepped back, without onEntry", None, step)
        self.session.times.state_entered(run)
        self.session.standing.update()
        self._run_functions(run, step, enter)

    def stop_rule(self, task: Task) -> None:
        """Stop a rule by its name."""
        found = [run for run in self.stack if run.name == task.behavior.strip()]
        if not found:
            raise Refused("it is not running")
        self.session.tasks.record(task, "SUCCEEDED")
        self.stop(found[0], f"stopped by {task.source}")

    def stop(self, run: Run, why: str) -> None:
        """A running rule is stopped."""
        self._remove_replaced(run)
        self._record(run, "stopped", run.state.id, reason=why)
        self.session.failures.rule_stopped(run)
        self.session.tasks.record(run.task, "CANCELED", why)
        self.raise_engine_event(f"{run.name}_end")

    def stop_all(self, why: str) -> None:
        """All of them, from the top; that raises nothing, for there is nobody left to take it."""
        for run in list(self.stack):
            self.stop(run, why)
        self.events = []

    def fault(self, run: Run, why: str) -> None:
        """A rule goes round in circles."""
        self._remove_replaced(run)
        self._record(run, "faulted", run.state.id, reason=why)
        self.session.failures.rule_stopped(run)
        self.session.tasks.record(run.task, "ABORTED", why)
        self.raise_engine_event(f"{run.name}_end")

    def run_of(self, task: Task) -> Run | None:
        """The running rule that a task has started."""
        return next((run for run in self.stack if run.task is task), None)

    def _end(self, run: Run) -> None:
        self._remove_replaced(run)
        self._record(run, "ended", run.state.id)
        self.session.tasks.record(run.task, "SUCCEEDED")
        result = f"{run.name}_{run.state.id}"
        told = [normal_topic(f.argument) for f in functions_in(run.state.on_entry) if f.name == "raiseEventTopic"]
        if result not in told:
            self.raise_engine_event(result)
        self.raise_engine_event(f"{run.name}_end")

    def _remove_replaced(self, run: Run) -> None:
        self.stack.remove(run)
        self.session.times.state_left(run)

    # --- events ---

    def raise_event(self, topic: str, source: str, kept: Kept | None = None) -> None:
        """It waits for its turn."""
        self.events.append(Event(topic, source, self.step, kept=kept))

    def raise_engine_event(self, topic: str) -> None:
        """What the engine raises is raised only if any transition of the scenario waits for it."""
        if topic in self.session.scenario.topics:
            self.raise_event(topic, "engine")

    def act_ended(self, task: Task, act: str, outcome: str) -> None:
        """The events of an act's end."""
        before = self.step
        if self.session.origin is None:
            self.step = Step("", before, task.id)
        for run in self.stack:
            if run.own_acts.get(act) is task:
                del run.own_acts[act]
                event = Event(f"ended {act} {outcome}", "engine", self.step, run.name, act, outcome)
                if any(event.fits(way) for state in run.rule.states.values() for way in state.transitions):
                    self.events.append(event)
        self.raise_engine_event(f"{act}_{outcome}")
        self.raise_engine_event(f"{act}_end")
        self.step = before

    def key_changed(self, key: str) -> None:
        """Conditions that read it are to be looked at."""
        for run in self.stack:
            looked_at = [way.condition if way.is_eventless else way.held for way in run.state.transitions]
            keys = {each for condition in looked_at if condition is not None for each in condition.keys}
            if any(is_part(key, each) for each in keys):
                run.to_look, run.why_look = True, self.step

    # --- one thing after the other ---

    def go(self) -> None:
        """Until nothing moves: conditions first, then the next event."""
        while self._look_at_conditions() or self._handle_event():
            pass

    def _look_at_conditions(self) -> bool:
        for run in list(self.stack):
            if not run.to_look:
                continue
            run.to_look, cause = False, run.why_look
            for index, way in enumerate(run.state.transitions):
                if way.held is not None:
                    self.step = cause
                    self.session.times.look(run, index, way)
                    self.step = None
                if not way.is_eventless or way.condition is None:
                    continue
                if not self.session.memory.holds(way.condition, run.name, run.state.id):
                    run.held.discard(index)
                elif way.target is not None or index not in run.held:
                    run.held.add(index)
                    self._take(run, index, way.condition.text, cause)
                    return True
        return False

    def _handle_event(self) -> bool:
        if not self.events:
            return False
        event = self.events.pop(0)
        if event.kept is not None and event.kept not in self.session.kept.all:
            return True
        topic = event.topic if event.only is not None else f"/{event.topic}"
        for run in list(self.stack):
            if event.only is not None and run.name != event.only:
                continue
            for index, way in enumerate(run.state.transitions):
                if event.fits(way) and self._guard_holds(run, way):
                    if event.kept is not None:
                        self.session.kept.taken(event.kept, run.name)
                    self.session.put("event", topic=topic, source=event.source, taken_by=run.name)
                    cause = event.cause if event.kept is None else Step("", event.cause, event.kept.task.id)
                    self._take(run, index, way_text(way) if event.act else topic, cause)
                    return True
        if event.kept is not None:
            self.session.kept.not_taken(event.kept)
        else:
            self.session.put("event", topic=topic, source=event.source, taken_by=None)
        return True

    def time_has_passed(self, run: Run, index: int) -> None:
        """The time of a transition is up."""
        way = run.state.transitions[index]
        if self._guard_holds(run, way):
            assert way.after is not None
            held = f"while {way.held.text} " if way.held is not None else ""
            self._take(run, index, held + after_text(way.after), None)

    def _guard_holds(self, run: Run, way: Transition) -> bool:
        return way.condition is None or self.session.memory.holds(way.condition, run.name, run.state.id)

    # --- a step ---

    def _take(self, run: Run, index: int, trigger: str, cause: Step | None) -> None:
        """A rule takes a transition."""
        way, previous = run.state.transitions[index], run.state
        step = self.circles.about_to_step(run, cause)
        if step is None:
            return
        if way.target is None:
            self._move_to_top(run)
            self._record(run, "stayed", previous.id, previous.id, trigger, index)
            self._run_block(run, way.block, step)
            run.to_look, run.why_look = True, step
            return
        self.session.times.state_left(run)
        run.to_look = False
        self._run_block(run, previous.on_exit, step)
        if run in self.stack:
            self._run_block(run, way.block, step)
        if run in self.stack:
            self._move_to_top(run)
            self._arrive(run, way.target, previous.id, trigger, index, step)
            self._run_state(run, step)

    def _move_to_top(self, run: Run) -> None:
        """The step is taken: the rule has the largest priority that there is, and is above its equals."""
        self.circles.count(run)
        run.priority = max(other.priority for other in self.stack)
        self.stack.remove(run)
        self.stack.insert(0, run)

    def _arrive(
        self, run: Run, state: str, previous: str | None, trigger: str, index: int | None, step: Step | None
    ) -> None:
        run.state = run.rule.states[state]
        run.held, run.clocks, run.to_look = set(), {}, False
        self._record(run, "entered", state, previous, trigger, index)
        self.session.going_on.entered(run)
        before, self.step = self.step, step
        self.session.kept.state_entered(run)
        self.step = before

    def _run_state(self, run: Run, step: Step | None, enter: bool = True) -> None:
        """Its times begin, its functions run, and a state without transitions ends the rule."""
        self.session.times.state_entered(run)
        self._run_functions(run, step, enter)

    def _run_functions(self, run: Run, step: Step | None, enter: bool) -> None:
        self._run_block(run, run.state.on_entry if enter else (), step)
        run.to_look, run.why_look = True, step
        if run in self.stack and not run.state.transitions:
            before, self.step = self.step, step
            self._end(run)
            self.step = before

    # --- functions ---

    def _run_block(self, run: Run, block: Block, step: Step | None) -> None:
        """Run functions in order. One that fails ends its block; a rule that has ended does no more."""
        before, self.step = self.step, step
        try:
            self._run_statements(run, block)
        except Failed:
            pass
        finally:
            self.step = before

    def _run_statements(self, run: Run, block: Block) -> None:
        for statement in block:
            if run not in self.stack:
                return
            self._run_statement(run, statement)

    def _run_statement(self, run: Run, statement: Statement) -> None:
        if isinstance(statement, If):
            for branch in statement.branches:
                if branch.condition is None or self.session.memory.holds(branch.condition, run.name, run.state.id):
                    self._run_statements(run, branch.block)
                    return
        elif isinstance(statement, OneOf):
            self._run_statement(run, statement.choices[self.session.chance.one_of(len(statement.choices))])
        else:
            self._call(run, statement)

    def _call(self, run: Run, function: Function) -> None:
        try:
            self.session.tasks.new(function.name, function.behavior, source=f"rule:{run.name}")
        finally:
            self.session.standing.update()

    def remember_act(self, task: Task, act: str) -> None:
        """A rule remembers the acts that it starts, if it waits for their ends."""
        kind, _, name = task.source.partition(":")
        for run in self.stack:
            if kind == "rule" and run.name == name:
                ways = [way for state in run.rule.states.values() for way in state.transitions]
                if any(way.ended == act for way in ways):
                    run.own_acts[act] = task

    # --- the record ---

    def _record(
        self,
        run: Run,
        status: str,
        state: str,
        previous: str | None = None,
        trigger: str | None = None,
        index: int | None = None,
        reason: str = "",
    ) -> None:
        self.session.put(
            "rule",
            name=run.name,
            status=status,
            state=state,
            previous=previous,
            trigger=trigger,
            transition=index,
            priority=run.priority,
            reason=reason,
        )


def way_text(way: Transition) -> str:
    """What a transition waits for: an act's end."""
    return " ".join(["ended", way.ended or "", *way.outcomes])


def after_text(after: Delay) -> str:
    """A time as the record has it: `after 0.5s`, or `after {pause}`."""
    return f"after {after.seconds:g}s" if after.seconds is not None else f"after {after.text}"


def is_part(changed: str, read: str) -> bool:
    """Whether a condition that reads one key is looked at when another was written: `a.b.c` for `a`, `a.b`, `a.b.c`.
    Of the engine's own key also a part is written."""
    return f"{read}.".startswith(f"{changed}.") or (changed.startswith("session.") and read == "session")


def read_start(behavior: str) -> tuple[str, str | None, bool]:
    """The rule that a task starts, in which state, and whether its `onEntry` runs."""
    if not behavior.strip().startswith("{"):
        return behavior.strip(), None, True
    try:
        written = json.loads(behavior)
    except ValueError:
        raise Refused("this is no JSON") from None
    rule, state, enter = written.get("rule"), written.get("state"), written.get("enter", True)
    if set(written) - {"rule", "state", "enter"} or not isinstance(rule, str) or not isinstance(enter, bool):
        raise Refused("write rule, state and enter")
    return rule, state, enter
