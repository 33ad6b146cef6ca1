"""The next steps without any input, or else the awaited inputs. Pure.

It uses only certain facts of the engine's state: a running timer, an act that will end, a waiting task, the rule that
would take the event. It never guesses what a person will do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from rise_engine.author.drawing.rule_text import functions_in, is_met, wait_text
from rise_engine.author.drawing.study_keys import ACT, transitions_of
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.wizard_marks import next_filler
from rise_engine.scenario.model import KeyBinding, Transition
from rise_tui.model.notice import act_label
from rise_tui.model.store import Store
from rise_tui.model.wait_explanations import due_at


class UpcomingStep(NamedTuple):
    """One step that will happen without any input."""

    when: str
    """`timer`, `end` (of the running acts), `turn` (of a waiting task), or `filler`."""
    seconds: float | None
    """Seconds until then: exact for a timer, otherwise probable; None when unknown."""
    target: str = ""
    """The state that a rule enters."""
    starts: tuple[str, ...] = ()
    """Acts that then certainly start."""
    may_start: tuple[str, ...] = ()
    """Acts that may start, depending on a condition or on chance."""
    rule: str = ""
    ends_rule: bool = False
    """Whether the rule then ends."""
    condition: str = ""
    """The condition that must then hold for a timer's transition."""


class Upcoming(NamedTuple):
    """The steps without any input, the soonest first, and the awaited inputs, now or after the first step."""

    steps: tuple[UpcomingStep, ...] = ()
    keys: tuple[KeyBinding, ...] = ()
    """The keys with which the wizard can continue: now, or after a first step into a state that only waits."""
    after_first: bool = False
    """Whether `keys` and `waits_for` are about the state after the first step."""
    waits_for: str = ""
    """Other awaited input, if no key causes it."""
    any_rule_runs: bool = False
    """Whether any rule runs."""


def find_upcoming(store: Store) -> Upcoming:
    """Find the steps without any input, and the awaited inputs."""
    view, scenario = store.view, store.scenario
    stack = view.running_rules()
    steps = [*_timer_steps(store, stack), *_filler_steps(store), *_steps_after_acts(store, stack)]
    steps = [step for step in steps if not _reenters_state(store, step)]
    # At the same time, the waiting task comes first, before everything that a rule then starts.
    steps.sort(key=lambda step: (float("inf") if step.seconds is None else step.seconds, step.when != "turn"))
    first = steps[0] if steps else None
    if first is not None and first.target and not (first.starts or first.may_start or first.ends_rule):
        transitions = transitions_of(scenario, first.rule, first.target)
        keys = _find_keys(store, transitions, ())
        return Upcoming(tuple(steps), keys, True, "" if keys else _other_wait_text(store, transitions), bool(stack))
    busy = [task.behavior for task in (*store.running_tasks, *store.waiting_tasks)]
    every = [transition for name in stack for transition in transitions_of(scenario, name, view.rules[name].state)]
    keys = _find_keys(store, every, (*busy, *stack))
    return Upcoming(tuple(steps), keys, False, "" if keys or steps else _other_wait_text(store, every), bool(stack))


def _reenters_state(store: Store, step: UpcomingStep) -> bool:
    """Whether a rule only enters its present state again, like a rule that follows a person with its gaze."""
    return step.when == "end" and step.target == store.view.rules[step.rule].state


def _timer_steps(store: Store, stack: list[str]) -> Iterator[UpcomingStep]:
    for name in stack:
        view = store.view.rules[name]
        for index, transition in enumerate(transitions_of(store.scenario, name, view.state)):
            due = due_at(index, transition, view)
            if due is None:
                continue
            seconds_left = due - store.now()
            if seconds_left > -1.0:  # later, its condition did not hold
                condition = transition.condition.text if transition.condition is not None else ""
                condition += "" if is_met(transition.condition, store.memory) else " (false now)"
                yield _rule_step(store, name, transition, "timer", max(0.0, seconds_left))._replace(condition=condition)


def _filler_steps(store: Store) -> Iterator[UpcomingStep]:
    """A filler that starts automatically after a cue."""
    after, cue = store.scenario.fillers.auto_after, store.view.cue
    if after is None or cue is None or cue.answered is not None or cue.filled is not None or store.view.running:
        return
    acts = store.scenario.acts
    last = store.view.latest_act_of(name for name in acts if store.scenario.settings_of(name).filler)
    filler, seconds_left = next_filler(store.scenario, last), cue.t + after - store.now()
    if filler is not None and seconds_left > -1.0:
        yield UpcomingStep("filler", max(0.0, seconds_left), starts=(filler,))


def _steps_after_acts(store: Store, stack: list[str]) -> Iterator[UpcomingStep]:
    """The steps of a rule when the last started act succeeds, and the task whose turn then comes."""
    seconds_left = _seconds_left(store)
    if (ending := _transition_at_end(store, stack)) is not None:
        yield _rule_step(store, *ending, "end", seconds_left)
    if (waiting := store.waiting_tasks) and not store.view.waits_for_wizard:
        names = tuple(act_label(task.function, task.behavior) for task in waiting)
        yield UpcomingStep("turn", seconds_left, starts=names)


def _transition_at_end(store: Store, stack: list[str]) -> tuple[str, Transition] | None:
    """The rule, and its transition, that takes the end of the act that started last."""
    memory = store.memory
    for task in reversed(store.running_tasks):
        name = "say" if task.function == "say" else task.behavior
        if (own := _transition_at_own_end(store, stack, task)) is not None:
            return own
        for event in (f"{name}_succeeded", f"{name}_end"):
            for rule in stack:
                for transition in transitions_of(store.scenario, rule, store.view.rules[rule].state):
                    if transition.event == event and is_met(transition.condition, memory):
                        return rule, transition
    return None


def _transition_at_own_end(store: Store, stack: list[str], task: TaskView) -> tuple[str, Transition] | None:
    """The same for an act that the rule started itself and whose own end it waits for."""
    rule = task.source.removeprefix("rule:")
    for transition in transitions_of(store.scenario, rule, store.view.rules[rule].state) if rule in stack else ():
        if (
            transition.ended == task.behavior
            and "succeeded" in (transition.outcomes or ("succeeded",))
            and is_met(transition.condition, store.memory)
        ):
            return rule, transition
    return None


def _seconds_left(store: Store) -> float | None:
    """Seconds until all running acts will probably have ended; None: unknown, or none runs."""
    longest = 0.0
    for task in store.running_tasks:
        if task.function == "say":
            remaining = store.current_sentence().seconds
        else:
            usual = store.typical_seconds(task.behavior)
            remaining = None if usual is None or task.started is None else usual - (store.now() - task.started)
        if remaining is None:
            return None
        longest = max(longest, remaining)
    return longest if store.view.running else None


def _rule_step(store: Store, name: str, transition: Transition, when: str, seconds: float | None) -> UpcomingStep:
    """The effect of a transition from a rule's present state."""
    states = store.scenario.rules[name].states
    target = states.get(transition.target or "")
    functions = list(functions_in(transition.block))
    if target is not None:
        functions += functions_in(states[store.view.rules[name].state or ""].on_exit)
        functions += functions_in(target.on_entry)
    acts = [(function.argument, sure) for function, sure in functions if function.name == ACT]
    return UpcomingStep(
        when,
        seconds,
        target.id if target is not None else "",
        tuple(act for act, sure in acts if sure),
        tuple(dict.fromkeys(act for act, sure in acts if not sure)),
        name,
        target is not None and not target.transitions,
    )


def _find_keys(store: Store, transitions: Iterable[Transition], busy: Iterable[str]) -> tuple[KeyBinding, ...]:
    """The keys with which the wizard can trigger one of these transitions, each once."""
    memory, busy = store.memory, frozenset(busy)
    keys = (key for transition in transitions for key in store.study_keys.keys_for(transition, memory, busy))
    return tuple({key.key: key for key in keys}.values())


def _other_wait_text(store: Store, transitions: Iterable[Transition]) -> str:
    """The first awaited input that no key causes."""
    for transition in transitions:
        if transition.event is not None or transition.ended is not None:
            return wait_text(store.scenario, transition)
        if transition.is_eventless and transition.condition is not None:
            return transition.condition.text
    return ""


class QueuedTask(NamedTuple):
    """A task, for estimates of waiting times."""

    typical_seconds: float | None
    """Its usual duration; None when unknown."""
    elapsed_seconds: float = 0.0
    """For a running task, in seconds."""
    in_turn: bool = True
    """Whether it takes turns with its kind (Blocking and Interrupt). A None act runs beside others."""

    @property
    def seconds_left(self) -> float | None:
        """Seconds; negative if it is overdue."""
        return None if self.typical_seconds is None else self.typical_seconds - self.elapsed_seconds


def estimate_starts(running: Iterable[QueuedTask], waiting: Iterable[QueuedTask]) -> list[float | None]:
    """Seconds until each waiting task probably starts, in order; None if an earlier task has no typical time.

    An overdue task may end at any moment. A waiting None act starts when the running acts have ended, or before.
    """
    start: float | None = 0.0
    for task in running:
        start = _next_start(start, task)
    starts = []
    for task in waiting:
        starts.append(start)
        start = _next_start(start, task)
    return starts


def _next_start(start: float | None, task: QueuedTask) -> float | None:
    """When the next task starts, if this one starts then or already runs."""
    if not task.in_turn:
        return start
    return None if start is None or task.seconds_left is None else start + max(0.0, task.seconds_left)
