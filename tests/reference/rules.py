"""Rules and events (semantics.md 5, 6)."""

from __future__ import annotations

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
    clocks: list[Clock] = field(default_factory=list)

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
        rule = self.session.scenario.rules.get(task.behavior.strip())
        self.session.stop.refuse_if_stopped()
        if rule is None:
            raise Refused("there is no such rule")
        if any(run.name == rule.name for run in self.stack):
            raise Refused("it is running already")
        tasks = self.session.tasks
        tasks.record(task, "PENDING")
        tasks.record(task, "ACTIVE")
        run = Run(rule, task, rule.priority, rule.states[rule.initial])
        place = 0
        if task.source.startswith("rule:"):
            run.priority = max([rule.priority, *(other.priority for other in self.stack)])
        else:
            while place < len(self.stack) and self.stack[place].priority > rule.priority:
                place += 1
        self.stack.insert(place, run)
        self._record(run, "started", run.state.id, trigger="start")
        self._arrive(run, rule.initial, None, "start", None)
        step = self.circles.about_to_step(run, self.step)
        if step is not None:
            self.circles.count(run)
            self._run_state(run, step)

    def stop_rule(self, task: Task) -> None:
        """Stop a rule by its name."""
        found = [run for run in self.stack if run.name == task.behavior.strip()]
        if not found:
            raise Refused("it is not running")
        self.session.tasks.record(task, "SUCCEEDED")
        self.stop(found[0], f"stopped by {task.source}")

    def stop(self, run: Run, why: str) -> None:
        """A running rule is stopped."""
        self._take_away(run)
        self._record(run, "stopped", run.state.id, reason=why)
        self.session.tasks.record(run.task, "CANCELED", why)
        self.raise_engine_event(f"{run.name}_end")

    def stop_all(self, why: str) -> None:
        """All of them, from the top; that raises nothing, for there is nobody left to take it."""
        for run in list(self.stack):
            self.stop(run, why)
        self.events = []

    def fault(self, run: Run, why: str) -> None:
        """A rule goes round in circles."""
        self._take_away(run)
        self._record(run, "faulted", run.state.id, reason=why)
        self.session.tasks.record(run.task, "ABORTED", why)
        self.raise_engine_event(f"{run.name}_end")

    def run_of(self, task: Task) -> Run | None:
        """The running rule that a task has started."""
        return next((run for run in self.stack if run.task is task), None)

    def _end(self, run: Run) -> None:
        self._take_away(run)
        self._record(run, "ended", run.state.id)
        self.session.tasks.record(run.task, "SUCCEEDED")
        result = f"{run.name}_{run.state.id}"
        told = [normal_topic(f.argument) for f in functions_in(run.state.on_entry) if f.name == "raiseEventTopic"]
        if result not in told:
            self.raise_engine_event(result)
        self.raise_engine_event(f"{run.name}_end")

    def _take_away(self, run: Run) -> None:
        self.stack.remove(run)
        self._forget_clocks(run)

    # --- events ---

    def raise_event(self, topic: str, source: str) -> None:
        """It waits for its turn."""
        self.events.append(Event(topic, source, self.step))

    def raise_engine_event(self, topic: str) -> None:
        """What the engine raises is raised only if any transition of the scenario waits for it."""
        if topic in self.session.scenario.topics:
            self.raise_event(topic, "engine")

    def act_ended(self, task: Task, act: str, outcome: str) -> None:
        """The events of an act's end."""
        for run in self.stack:
            if run.own_acts.get(act) is task:
                del run.own_acts[act]
                event = Event(f"ended {act} {outcome}", "engine", self.step, run.name, act, outcome)
                if any(event.fits(way) for state in run.rule.states.values() for way in state.transitions):
                    self.events.append(event)
        self.raise_engine_event(f"{act}_{outcome}")
        self.raise_engine_event(f"{act}_end")

    def key_changed(self, key: str) -> None:
        """Conditions that read it are to be looked at."""
        for run in self.stack:
            ways = [way for way in run.state.transitions if way.is_eventless and way.condition is not None]
            keys = {each for way in ways if way.condition is not None for each in way.condition.keys}
            if any(key in (each, each.split(".")[0]) for each in keys):
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
        topic = event.topic if event.only is not None else f"/{event.topic}"
        for run in list(self.stack):
            if event.only is not None and run.name != event.only:
                continue
            for index, way in enumerate(run.state.transitions):
                if event.fits(way) and self._guard_holds(run, way):
                    self.session.put("event", topic=topic, source=event.source, taken_by=run.name)
                    self._take(run, index, way_text(way) if event.act else topic, event.cause)
                    return True
        self.session.put("event", topic=topic, source=event.source, taken_by=None)
        return True

    def _time_has_passed(self, run: Run, index: int) -> None:
        way = run.state.transitions[index]
        if self._guard_holds(run, way):
            assert way.after is not None
            self._take(run, index, after_text(way.after), None)

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
        self._forget_clocks(run)
        run.to_look = False
        self._run_block(run, previous.on_exit, step)
        if run in self.stack:
            self._run_block(run, way.block, step)
        if run in self.stack:
            self._move_to_top(run)
            self._arrive(run, way.target, previous.id, trigger, index)
            self._run_state(run, step)

    def _move_to_top(self, run: Run) -> None:
        """The step is taken: the rule has the largest priority that there is, and is above its equals."""
        self.circles.count(run)
        run.priority = max(other.priority for other in self.stack)
        self.stack.remove(run)
        self.stack.insert(0, run)

    def _arrive(self, run: Run, state: str, previous: str | None, trigger: str, index: int | None) -> None:
        run.state = run.rule.states[state]
        run.held, run.clocks, run.to_look = set(), [], False
        self._record(run, "entered", state, previous, trigger, index)

    def _run_state(self, run: Run, step: Step | None) -> None:
        """Its times begin, its functions run, and a state without transitions ends the rule."""
        for number, way in enumerate(run.state.transitions):
            if way.after is not None:
                assert way.after.seconds is not None
                clock = self.session.after(way.after.seconds, lambda number=number: self._time_has_passed(run, number))
                run.clocks.append(clock)
        self._run_block(run, run.state.on_entry, step)
        run.to_look, run.why_look = True, step
        if run in self.stack and not run.state.transitions:
            before, self.step = self.step, step
            self._end(run)
            self.step = before

    def _forget_clocks(self, run: Run) -> None:
        for clock in run.clocks:
            self.session.forget(clock)
        run.clocks = []

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
        self.session.tasks.new(function.name, function.argument, source=f"rule:{run.name}")

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
