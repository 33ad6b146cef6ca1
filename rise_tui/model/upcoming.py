"""What comes next if nobody does anything; and if nothing does, what is waited for. Pure.

Only what the engine's state says for certain: a timer that runs, an act that will end, a task that waits its turn, the
rule that would take the event. Nothing here guesses at what a person will do.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from rise_engine.author.drawing.conditions import is_met
from rise_engine.author.drawing.rule_text import functions_in, wait_text
from rise_engine.author.drawing.study_keys import ACT, transitions_of
from rise_engine.kernel.task_view import TaskView
from rise_engine.scenario.fillers import next_filler
from rise_engine.scenario.model import KeyBinding, Transition
from rise_tui.model.store import Store
from rise_tui.model.task_messages import act_label
from rise_tui.model.wait_explanations import due_at


class UpcomingStep(NamedTuple):
    """One thing that will happen by itself."""

    when: str
    """`timer`, `end` (of the acts that run), `turn` (a task that waits), or `filler`."""
    seconds: float | None
    """Until then: exact for a timer, otherwise probable; None when nobody knows."""
    target: str = ""
    """The state that a rule goes to."""
    starts: tuple[str, ...] = ()
    """Acts that then start for certain."""
    may_start: tuple[str, ...] = ()
    """Acts that may start, by a condition or by chance."""
    rule: str = ""
    ends_rule: bool = False
    """The rule is then over."""
    condition: str = ""
    """A timer's transition is taken only if this holds then."""


class Upcoming(NamedTuple):
    """What comes by itself, the soonest first; and what is waited for, now or after the first step."""

    steps: tuple[UpcomingStep, ...] = ()
    keys: tuple[KeyBinding, ...] = ()
    """By which the wizard can go on: now, or, when the first step enters a state that only waits, then."""
    after_first: bool = False
    """`keys` and `other` are about the state after the first step."""
    waits_for: str = ""
    """What else is waited for, when it is nothing that a key brings about."""
    any_rule_runs: bool = False
    """Whether any rule runs."""


def find_upcoming(store: Store) -> Upcoming:
    """What comes by itself and what is waited for."""
    view, scenario = store.view, store.scenario
    stack = view.running_rules()
    steps = [*_timer_steps(store, stack), *_filler_steps(store), *_steps_after_acts(store, stack)]
    steps = [step for step in steps if not _reenters_state(store, step)]
    # Of what comes at one time the task that waits is first: it was there before anything that a rule starts then.
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
    """Whether a rule only enters anew the state in which it is, as one does that follows somebody with its gaze."""
    return step.when == "end" and step.target == store.view.rules[step.rule].state


def _timer_steps(store: Store, stack: list[str]) -> Iterator[UpcomingStep]:
    for name in stack:
        view = store.view.rules[name]
        for index, transition in enumerate(transitions_of(store.scenario, name, view.state)):
            due = due_at(index, transition, view)
            if due is None:
                continue
            seconds_left = due - store.now()
            if seconds_left > -1.0:  # later than that it was not taken, because its condition did not hold
                condition = transition.condition.text if transition.condition is not None else ""
                yield _rule_step(store, name, transition, "timer", max(0.0, seconds_left))._replace(condition=condition)


def _filler_steps(store: Store) -> Iterator[UpcomingStep]:
    """One that starts by itself after a cue."""
    after, cue = store.scenario.fillers.auto_after, store.view.cue
    if after is None or cue is None or cue.answered is not None or cue.filled is not None or store.view.running:
        return
    acts = store.scenario.acts
    last = store.view.latest_act_of(name for name in acts if store.scenario.settings_of(name).filler)
    filler, seconds_left = next_filler(store.scenario, last), cue.t + after - store.now()
    if filler is not None and seconds_left > -1.0:
        yield UpcomingStep("filler", max(0.0, seconds_left), starts=(filler,))


def _steps_after_acts(store: Store, stack: list[str]) -> Iterator[UpcomingStep]:
    """What a rule does when the act that started last ends as it should, and the task whose turn it then is."""
    seconds_left = _seconds_left(store)
    if (ending := _transition_at_end(store, stack)) is not None:
        yield _rule_step(store, *ending, "end", seconds_left)
    if waiting := store.waiting_tasks:
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
    """As above, for an act that the rule started itself and whose end it waits for as its own."""
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
    """Seconds until all acts that run will probably have ended; None when nobody knows, or none runs."""
    longest = 0.0
    for task in store.running_tasks:
        if task.function == "say":
            left = store.current_sentence().seconds
        else:
            usual = store.typical_seconds(task.behavior)
            left = None if usual is None or task.started is None else usual - (store.now() - task.started)
        if left is None:
            return None
        longest = max(longest, left)
    return longest if store.view.running else None


def _rule_step(store: Store, name: str, transition: Transition, when: str, seconds: float | None) -> UpcomingStep:
    """What a transition of the state in which a rule is brings about."""
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
    """The keys by which the wizard can bring one of these transitions about, each once."""
    memory, busy = store.memory, frozenset(busy)
    keys = (key for transition in transitions for key in store.study_keys.keys_for(transition, memory, busy))
    return tuple({key.key: key for key in keys}.values())


def _other_wait_text(store: Store, transitions: Iterable[Transition]) -> str:
    """The first thing that is waited for and that no key brings about."""
    for transition in transitions:
        if transition.event is not None or transition.ended is not None:
            return wait_text(store.scenario, transition)
        if transition.is_eventless and transition.condition is not None:
            return transition.condition.text
    return ""
