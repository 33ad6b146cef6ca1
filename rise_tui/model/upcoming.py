"""What comes next if nobody does anything; and if nothing does, what is waited for. Pure.

Only what the engine's state says for certain: a timer that runs, an act that will end, a task that waits its turn, the
rule that would take the event. Nothing here guesses at what a person will do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from rise_engine.kernel.view import SessionView, TaskView
from rise_engine.scenario.fillers import next_filler
from rise_engine.scenario.model import KeyBinding, Rule, Scenario, State, Transition
from rise_tui.model.conditions import holds
from rise_tui.model.rule_text import functions_in, wait_text
from rise_tui.model.study_keys import ACT, StudyKeys, transitions_of
from rise_tui.model.task_messages import act_label


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


class UpcomingContext(NamedTuple):
    """What this needs of a console's store."""

    scenario: Scenario
    view: SessionView
    memory: Mapping[str, Any]
    keys: StudyKeys
    now: float


def find_upcoming(context: UpcomingContext, seconds_left: float | None) -> Upcoming:
    """What comes by itself and what is waited for.

    `seconds_left`: until the acts that run will probably have ended; None when nobody knows, or none runs.
    """
    view, scenario = context.view, context.scenario
    stack = view.running_rules()
    steps = [*_timers(context, stack), *_filler(context)]
    running = [view.tasks[id] for id in view.running if id in view.tasks]
    if running and (taken := _after_acts(context, stack, running)) is not None:
        steps.append(taken._replace(seconds=seconds_left))
    waiting = [view.tasks[id] for id in view.waiting if id in view.tasks]
    if waiting:
        names = tuple(act_label(task.function, task.behavior) for task in waiting)
        steps.append(UpcomingStep("turn", seconds_left, starts=names))
    steps = [step for step in steps if not _stays(context, step)]
    # Of what comes at one time the task that waits is first: it was there before anything that a rule starts then.
    steps.sort(key=lambda step: (float("inf") if step.seconds is None else step.seconds, step.when != "turn"))
    first = steps[0] if steps else None
    if first is not None and first.target and not (first.starts or first.may_start or first.ends_rule):
        transitions = transitions_of(scenario, first.rule, first.target)
        keys = _keys(context, transitions, ())
        return Upcoming(tuple(steps), keys, True, "" if keys else _other_wait(context, transitions), bool(stack))
    busy = [task.behavior for task in (*running, *waiting)]
    every = [transition for name in stack for transition in transitions_of(scenario, name, view.rules[name].state)]
    keys = _keys(context, every, (*busy, *stack))
    return Upcoming(tuple(steps), keys, False, "" if keys or steps else _other_wait(context, every), bool(stack))


def _stays(context: UpcomingContext, step: UpcomingStep) -> bool:
    """Whether a rule only enters anew the state in which it is, as one does that follows somebody with its gaze."""
    return step.when == "end" and step.target == context.view.rules[step.rule].state


def _timers(context: UpcomingContext, stack: list[str]) -> Iterator[UpcomingStep]:
    for name in stack:
        view = context.view.rules[name]
        for transition in transitions_of(context.scenario, name, view.state):
            if transition.after is None:
                continue
            seconds_left = view.since + transition.after - context.now
            if seconds_left > -1.0:  # later than that it was not taken, because its condition did not hold
                condition = transition.condition.text if transition.condition is not None else ""
                yield _step(context, name, transition, "timer")._replace(
                    seconds=max(0.0, seconds_left), condition=condition
                )


def _filler(context: UpcomingContext) -> Iterator[UpcomingStep]:
    """One that starts by itself after a cue."""
    after, cue = context.scenario.fillers.auto_after, context.view.cue
    if after is None or cue is None or cue.answered is not None or cue.filled is not None or context.view.running:
        return
    acts = context.scenario.acts
    last = context.view.latest_act_of(name for name in acts if context.scenario.settings_of(name).filler)
    filler, seconds_left = next_filler(context.scenario, last), cue.t + after - context.now
    if filler is not None and seconds_left > -1.0:
        yield UpcomingStep("filler", max(0.0, seconds_left), starts=(filler,))


def _after_acts(context: UpcomingContext, stack: list[str], running: list[TaskView]) -> UpcomingStep | None:
    """What a rule does when the act that started last ends as it should."""
    for task in reversed(running):
        name = "say" if task.function == "say" else task.behavior
        for event in (f"{name}_succeeded", f"{name}_end"):
            for rule in stack:
                for transition in transitions_of(context.scenario, rule, context.view.rules[rule].state):
                    if transition.event == event and holds(transition.condition, context.memory):
                        return _step(context, rule, transition, "end")
    return None


def _step(context: UpcomingContext, rule: str, transition: Transition, when: str) -> UpcomingStep:
    found: Rule | None = context.scenario.rules.get(rule)
    target = found.states.get(transition.target or "") if found is not None else None
    left_state = found.states.get(context.view.rules[rule].state or "") if found is not None else None
    functions = list(functions_in(transition.block))
    if target is not None:
        functions += [
            *functions_in(left_state.on_exit if left_state is not None else ()),
            *functions_in(target.on_entry),
        ]
    acts = [(function.argument, sure) for function, sure in functions if function.name == ACT]
    return UpcomingStep(
        when,
        None,
        target.id if target is not None else "",
        tuple(name for name, sure in acts if sure),
        tuple(dict.fromkeys(name for name, sure in acts if not sure)),
        rule,
        _is_end(target),
    )


def _is_end(state: State | None) -> bool:
    return state is not None and not state.transitions


def _keys(
    context: UpcomingContext, transitions: list[Transition] | tuple[Transition, ...], busy: tuple[str, ...]
) -> tuple[KeyBinding, ...]:
    found = {
        key.key: key for transition in transitions for key in context.keys.keys_for(transition, context.memory, busy)
    }
    return tuple(found.values())


def _other_wait(context: UpcomingContext, transitions: list[Transition] | tuple[Transition, ...]) -> str:
    """The first thing that is waited for and that no key brings about."""
    for transition in transitions:
        if transition.event is not None:
            return wait_text(context.scenario, transition)
        if transition.after is None and transition.condition is not None:
            return transition.condition.text
    return ""
