"""The present state of a trial: its rules, their transitions, the effects of the keys, and its memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import ceil
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.author.drawing.act_graph import estimate_act_seconds
from rise_engine.author.drawing.rule_text import (
    Joint,
    Truth,
    find_awaited_act,
    is_met,
    split_condition,
    transition_label,
    truth_of,
    wait_text,
)
from rise_engine.author.drawing.study_keys import ACT, StudyKeys, key_title
from rise_engine.author.trial.trial import Trial
from rise_engine.author.trial.trial_history import words_of_action
from rise_engine.expression import Expression, lookup
from rise_engine.kernel.view import RuleView
from rise_engine.scenario.model import (
    ActionCall,
    KeyBinding,
    Scenario,
    State,
    Transition,
    conditions_in,
    functions_in,
    normal_topic,
)

Trigger: TypeAlias = Literal["event", "ended", "after", "condition"]


class ConditionReading(Struct, frozen=True):
    """The present value of a condition and of its parts."""

    word: Literal["if", "while"]
    joint: Joint
    """The operator between the parts: `and`, `or`; empty: there is one part."""
    parts: tuple[Truth, ...]
    holds: bool


class TransitionOption(Struct, frozen=True):
    """A transition of a rule's present state."""

    rule: str
    index: int
    """Index among the state's transitions, in the file's order."""
    trigger: Trigger
    target: str | None
    """None: it stays in the state."""
    label: str
    """A short name: its event, its time or its condition."""
    waits_for: str
    """The trigger in words."""
    now: str
    """The progress: `2.1 of 6.7 s`, `4 s left`, `not now`; empty: none."""
    readings: tuple[ConditionReading, ...]
    """`while` and `if`, in this order, if they exist."""
    keys: tuple[KeyBinding, ...]
    """The study's keys with which the rule would take it now."""
    event: str = ""
    """The topic, without slash, of an event that a person can raise."""


class RunningRule(Struct, frozen=True):
    """A running rule."""

    name: str
    state: str
    previous: str | None
    trigger: str
    """The trigger that led to the state."""
    transition: int | None
    """The index of that transition among those of `previous`."""
    since: float
    transitions: tuple[TransitionOption, ...]


class RunningAct(Struct, frozen=True):
    """An act that the robot performs or will perform."""

    act: str
    """`say` for free speech."""
    waits: bool
    """Whether it still waits for its turn."""
    seconds: float
    """Seconds for which it has run."""
    expected: float
    """Expected seconds."""
    says: str
    """Its present words."""


class KeyChoice(Struct, frozen=True):
    """A key of the study with its present effect."""

    key: KeyBinding
    title: str
    does: str
    """`/next`, `rule Next`, `R_Yes`, `step = 2`."""
    now: str
    """The rule that would take it, or why it would have no effect; empty: its usual effect."""
    is_awaited: bool
    """Whether a running rule waits for it."""


class MemoryLine(Struct, frozen=True):
    """A memory key that a rule's state uses."""

    key: str
    exists: bool
    value: Any
    source: str
    """`start value`, `condition`, `rule Table setting`, `you`; empty: it is not set."""
    changed: float
    """When it was set, in seconds; 0: at the start."""


def running_rules(trial: Trial) -> list[RunningRule]:
    """List the running rules; the first one gets events first."""
    keys = StudyKeys(trial.scenario)
    return [_running_rule(trial, keys, name, trial.view.rules[name]) for name in trial.view.running_rules()]


def _running_rule(trial: Trial, keys: StudyKeys, name: str, view: RuleView) -> RunningRule:
    state = trial.scenario.rules[name].states[view.state or ""]
    memory = trial.memory
    transitions = tuple(
        _transition_option(trial, keys, name, view, memory, index, each) for index, each in enumerate(state.transitions)
    )
    return RunningRule(name, state.id, view.previous, view.trigger or "", view.transition, view.since, transitions)


def _transition_option(
    trial: Trial,
    keys: StudyKeys,
    rule: str,
    view: RuleView,
    memory: Mapping[str, Any],
    index: int,
    transition: Transition,
) -> TransitionOption:
    trigger: Trigger = (
        "event" if transition.event is not None
        else "ended" if transition.ended is not None
        else "after" if transition.after is not None
        else "condition"
    )  # fmt: skip
    readings = []
    if transition.held is not None:
        readings.append(read_condition("while", transition.held, memory))
    if transition.condition is not None:
        readings.append(read_condition("if", transition.condition, memory))
    topic = normal_topic(transition.event) if transition.event is not None else ""
    can_raise = topic and find_awaited_act(trial.scenario, transition) is None
    return TransitionOption(
        rule,
        index,
        trigger,
        transition.target,
        transition_label(transition),
        wait_text(trial.scenario, transition),
        _progress(trial, view, index, transition, readings),
        tuple(readings),
        tuple(dict.fromkeys(keys.keys_for(transition, memory, _busy(trial)))),
        topic if can_raise else "",
    )


def _busy(trial: Trial) -> set[str]:
    """Return the acts and rules that run or wait."""
    view = trial.view
    acts = {view.tasks[id].behavior for id in (*view.running, *view.waiting)}
    return acts | set(view.running_rules())


def read_condition(word: Literal["if", "while"], condition: Expression, memory: Mapping[str, Any]) -> ConditionReading:
    """Evaluate a condition with these values, part by part."""
    joint, parts = split_condition(condition)
    return ConditionReading(
        word, joint, tuple(truth_of(part, memory) for part in parts), truth_of(condition, memory).holds
    )


def _progress(
    trial: Trial, view: RuleView, index: int, transition: Transition, readings: Iterable[ConditionReading]
) -> str:
    if transition.after is not None:
        return _time_left(trial, view, index, transition, readings)
    blocked = any(not reading.holds for reading in readings)
    name = find_awaited_act(trial.scenario, transition)
    if name is None:
        return "not now" if blocked and transition.event is not None else ""
    act = next((each for each in running_acts(trial) if each.act == name), None)
    if act is None:
        rule = trial.view.rules.get(name)
        return f"in {rule.state}" if rule is not None and rule.running else "is not running"
    return "waits its turn" if act.waits else f"{act.seconds:.1f} of {act.expected:.1f} s"


def _time_left(
    trial: Trial, view: RuleView, index: int, transition: Transition, readings: Iterable[ConditionReading]
) -> str:
    assert transition.after is not None
    countdown = view.countdowns.get(index)
    if countdown is not None and countdown.seconds is None:
        return f"never: {countdown.reason}"
    if countdown is not None:
        due = countdown.since + (countdown.seconds or 0.0)
    elif transition.after.seconds is not None and transition.held is None:
        due = view.since + transition.after.seconds
    else:
        held_up = (part.values for reading in readings for part in reading.parts if not part.holds)
        return f"held up: {next(held_up, '')}".removesuffix(": ")
    left = ceil(due - trial.now)
    return f"{left} s left" if left > 0 else "the time is up"


def running_acts(trial: Trial) -> list[RunningAct]:
    """List the robot's running acts, then the waiting ones."""
    view, found = trial.view, []
    for id in (*view.running, *view.waiting):
        task = view.tasks[id]
        is_waiting = task.started is None
        saying = [
            words
            for action in task.actions.values()
            if action.ended is None and (words := words_of_action(action.parameters))
        ]
        act = trial.scenario.acts.get(task.behavior) if task.function != "say" else None
        expected = estimate_act_seconds(trial.scenario, act, trial.memory) if act is not None else 0.0
        name = "say" if act is None else act.name
        seconds = 0.0 if task.started is None else trial.now - task.started
        found.append(RunningAct(name, is_waiting, seconds, expected, " ".join(saying)))
    return found


# --- possible actions -------------------------------------------------------------------------------------------------


def key_choices(trial: Trial) -> list[KeyChoice]:
    """List all keys of the study: first those that a running rule waits for, each group in the file's order."""
    keys = StudyKeys(trial.scenario)
    states = {name: trial.view.rules[name].state for name in trial.view.running_rules()}
    awaited = keys.expected_keys(states, trial.memory, _busy(trial))
    choices = [_choice(trial, keys, key, key.key in awaited) for key in trial.scenario.keys.values()]
    return sorted(choices, key=lambda choice: not choice.is_awaited)


def _choice(trial: Trial, keys: StudyKeys, key: KeyBinding, is_awaited: bool) -> KeyChoice:
    name = key.behavior.strip()
    does, now = name, ""
    match key.function:
        case "raiseEventTopic":
            does, now = f"/{normal_topic(name)}", _taker_text(trial, [normal_topic(name)])
        case "startInteractionRule":
            does = f"rule {name}"
            topics = sorted(keys.events_of_rule.get(name, ()))
            now = "runs already" if name in trial.view.running_rules() else ""
            if not now and topics:
                now = _taker_text(trial, topics)
                does += f", /{' /'.join(topics)}" if len(topics) == 1 else ""
        case "startCommunicationRobotAct":
            now = "waits its turn" if trial.view.running else ""
        case "stopCommunicationRobotAct":
            does, now = f"stops {name}", "" if name in _busy(trial) else "it does not run"
        case "stopInteractionRule":
            does, now = f"stops rule {name}", "" if name in _busy(trial) else "it does not run"
        case "assignValue":
            pass
    return KeyChoice(key, key_title(key), does, now, is_awaited)


def _taker_text(trial: Trial, topics: Iterable[str]) -> str:
    """Return which rule would take one of these events now."""
    wanted = set(topics)
    for name in trial.view.running_rules():
        state = _state(trial.scenario, name, trial.view.rules[name].state)
        for transition in state.transitions if state is not None else ():
            is_wanted = transition.event is not None and normal_topic(transition.event) in wanted
            if is_wanted and is_met(transition.condition, trial.memory):
                return f"{name} takes it"
    return "no rule waits for it now"


def _state(scenario: Scenario, rule: str, state: str | None) -> State | None:
    return scenario.rules[rule].states.get(state or "") if rule in scenario.rules else None


def events_to_raise(trial: Trial) -> list[str]:
    """List the events, without slash, that running rules wait for and that no key of the study raises."""
    keys = StudyKeys(trial.scenario)
    found = (transition.event for rule in running_rules(trial) for transition in rule.transitions if transition.event)
    return [topic for topic in dict.fromkeys(found) if not keys.keys_raising(topic)]


# --- the memory -------------------------------------------------------------------------------------------------------


def relevant_memory(trial: Trial, rule: str) -> list[MemoryLine]:
    """List the memory keys that a rule reads or sets in its present state, in alphabetical order.

    :param rule: the name of a rule; one that does not run counts with its initial state.
    """
    found = trial.scenario.rules[rule]
    view = trial.view.rules.get(rule)
    state = found.states[view.state if view is not None and view.running and view.state else found.initial]
    memory = trial.memory
    return [_memory_line(trial, memory, key) for key in sorted(set(_keys_of(trial.scenario, state)))]


def _keys_of(scenario: Scenario, state: State) -> Iterator[str]:
    for transition in state.transitions:
        yield from (key for expression in transition.expressions for key in expression.keys)
    for block in state.blocks:
        for function in functions_in(block):
            if function.assignment is not None:
                yield function.assignment.key
                yield from function.assignment.keys
            elif function.name == ACT and (act := scenario.acts.get(function.argument)) is not None:
                yield from (key for action in act.actions for call in action.calls for key in _keys_read_by(call))
        yield from (key for condition in conditions_in(block) for key in condition.keys)


def _keys_read_by(call: ActionCall) -> Iterator[str]:
    for template in call.parameters.values():
        for slot in template.slots:
            yield from (slot.key,) if slot.part is None else slot.part.keys


def _memory_line(trial: Trial, memory: Mapping[str, Any], key: str) -> MemoryLine:
    exists, value = lookup(memory, key)
    entry = trial.view.memory.get(key) or trial.view.memory.get(key.partition(".")[0])
    if not exists:
        return MemoryLine(key, False, None, "", 0.0)
    if entry is None:
        return MemoryLine(key, True, value, "table", 0.0)
    source = {"file": "start value", "wizard:trial": "you"}.get(entry.source, entry.source.replace("rule:", "rule ", 1))
    return MemoryLine(key, True, value, source, entry.changed)
