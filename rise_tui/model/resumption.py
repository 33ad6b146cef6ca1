"""The effects of entering a state: at a start, after a stop, or one step back. Pure.

Lines for questions; the answers become the behaviour of a task.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rise_engine.author.drawing.rule_text import functions_in, wait_text
from rise_engine.author.drawing.study_keys import ACT, RULE
from rise_engine.kernel.behaviors import Resumption, describe_behavior
from rise_engine.scenario.model import Function, Rule, Scenario, State, normal_topic
from rise_tui.model.control import KeyAction
from rise_tui.model.notice import task_label
from rise_tui.model.speech import act_texts, action_texts
from rise_tui.model.store import Store
from rise_tui.rendering.text import cell_width, clean, format_value, quoted, shorten

_VERBS = {"stopCommunicationRobotAct": "stops", "stopInteractionRule": "stops the rule", "assignValue": "sets"}
NOTHING = "does nothing but wait"
ENDS = "ends the rule"


def entry_lines(scenario: Scenario, state: State, memory: Mapping[str, Any], width: int, most: int = 6) -> list[str]:
    """The effects of `onEntry`, one line of at most `width` cells for each function; beyond `most`, a count."""
    lines = [
        ("perhaps " if not sure else "") + _function_text(scenario, function, memory)
        for function, sure in functions_in(state.on_entry, memory=memory)
    ]
    lines += [] if state.transitions else [ENDS]
    if len(lines) > most:
        lines = [*lines[: most - 1], f"and {len(lines) - most + 1} more"]
    return [shorten(line, width) for line in lines] or [NOTHING]


def entry_summary(scenario: Scenario, rule: Rule, state: str, memory: Mapping[str, Any]) -> str:
    """The robot's first certain speech, or else its first speech or action, and the number of others."""
    lines = entry_lines(scenario, rule.states[state], memory, 10_000, 10_000)
    spoken = next(
        (line for line in sorted(lines, key=lambda line: line.startswith("perhaps ")) if "“" in line), lines[0]
    )
    return spoken if len(lines) == 1 else f"{spoken}, and {len(lines) - 1} more"


def _function_text(scenario: Scenario, function: Function, memory: Mapping[str, Any]) -> str:
    match function.name:
        case "startCommunicationRobotAct":
            words = _spoken_words(scenario, function.argument, memory)
            return f"says {words}" if words else f"starts {function.argument}"
        case "startInteractionRule":
            return f"starts the rule {describe_behavior(function.name, function.behavior)}"
        case "raiseEventTopic":
            return f"raises {normal_topic(function.argument)}"
        case _:
            return f"{_VERBS[function.name]} {function.argument}"


def _spoken_words(scenario: Scenario, name: str, memory: Mapping[str, Any]) -> str:
    """The sentences of an act, each with the number of its other wordings: `“Great!” or 3 others “Go on.”`."""
    act = scenario.acts.get(name)
    sentences = (action_texts(scenario, action, memory) for action in act.actions) if act is not None else ()
    return " ".join(
        quoted(first) + (f" or {len(others)} other{'s' * (len(others) > 1)}" if others else "")
        for first, *others in filter(None, sentences)
    )


class ActSummary(NamedTuple):
    """An act in a few words: `“Very good!” +3`."""

    first: str
    """Its first text, or else its first action."""
    more: str
    """The number of its other texts: other wordings, and later sentences."""


def act_summary(scenario: Scenario, name: str, texts: Sequence[str]) -> ActSummary:
    """An act in a few words. `texts`: those of `act_texts`."""
    actions = scenario.acts[name].actions
    first = quoted(texts[0]) if texts else actions[0].calls[0].type if actions else "nothing"
    return ActSummary(first, f" +{len(texts) - 1}" if len(texts) > 1 else "")


def start_summary(store: Store, action: KeyAction) -> str:
    """What this start does first: the robot's words, or the rule's first words."""
    scenario, name = store.scenario, describe_behavior(action.function, action.behavior)
    if action.function == ACT and name in scenario.acts:
        return "".join(act_summary(scenario, name, act_texts(scenario, name, store.memory)))
    if action.function == RULE and name in scenario.rules:
        rule = scenario.rules[name]
        return f"{name} {entry_summary(scenario, rule, rule.initial, store.memory)}"
    return task_label(action.function, name)


def armed_text(store: Store, action: KeyAction) -> str:
    """The sentence about a start that needs one more press."""
    again = "enter again" if action.by_enter else f"{action.behavior}: the same key again, or enter"
    return f"{again}: {start_summary(store, action)}"


OPTIONS: tuple[Resumption, ...] = ("leave", "enter", "wait")
"""The first is the default."""
WORDS: dict[str, str] = {"enter": "re-enter", "wait": "wait there", "leave": "leave stopped"}
WORD_WIDTH = max(map(len, WORDS.values()))
MARGIN = 4
"""Cells before the effect."""


class InterruptedRule(NamedTuple):
    """A rule that the stop has ended."""

    name: str
    state: str
    entry: str
    """The robot's immediate actions if the rule enters its state again."""
    waits: str
    """What the rule would wait for."""

    def effect(self, how: str) -> str:
        """The immediate effect, in a line."""
        if how == "enter":
            return self.entry
        return f"waits for {self.waits}" if how == "wait" else f"stays stopped; if re-entered: {self.entry}"


def interrupted_rules(store: Store) -> list[InterruptedRule]:
    """The rules that the stop has ended, the top of the stack first."""
    found = []
    for stood in reversed(store.view.stop.stood):
        rule = store.scenario.rules.get(stood.rule)
        state = rule.states.get(stood.state) if rule is not None else None
        if rule is not None and state is not None:
            waits = " or ".join(
                dict.fromkeys(wait_text(store.scenario, transition) for transition in state.transitions)
            )
            found.append(
                InterruptedRule(rule.name, state.id, entry_summary(store.scenario, rule, state.id, store.memory), waits)
            )
    return found


def resumption_lines(
    rules: Sequence[InterruptedRule], chosen: Mapping[str, str], selected: int, width: int, rows: int
) -> list[str]:
    """For each rule, its last state and its chosen resumption, and below that the robot's immediate actions.

    With more rules than rows, those around the selected one.
    """
    most = max(1, rows // 2)
    first = max(0, min(selected - most // 2, len(rules) - most))  # the selected rule in the middle
    lines = []
    for index, rule in enumerate(rules[first : first + most], first):
        mark = "▸" if index == selected else " "
        word = f"‹{WORDS[chosen[rule.name]]:^{WORD_WIDTH}}›"
        place = shorten(f"{mark} {clean(rule.name)}: {clean(rule.state)}", width - cell_width(word) - 1)
        lines.append(place + " " * (width - cell_width(place) - cell_width(word)) + word)
        lines.append(shorten(" " * MARGIN + clean(rule.effect(chosen[rule.name])), width))
    return lines


BACK, KEEP = "take back", "keep"
GO_ON, STOP = "go on", "stop"
ACTS = ""
"""The key for the rule's started acts, among the memory keys."""
MAX_VALUE = 24
"""Cells of a value."""


class BackStep(NamedTuple):
    """A possible step back."""

    rule: str
    state: str
    """The previous state."""
    keys: dict[str, str]
    """The memory keys that have changed since, each with its present and its previous value."""
    acts: tuple[str, ...]
    """Acts of the rule that run, wait, or have failed and wait for an answer."""


def find_back_step(store: Store, name: str) -> BackStep | None:
    """The step back of a rule; None: it does not run, or no previous state is known."""
    view, rule = store.rule(name), store.scenario.rules.get(name)
    if not view.running or len(view.steps) < 2 or rule is None or view.steps[-2][0] not in rule.states:
        return None
    keys = {}
    for key, before in store.view.changed_since_step(view).items():
        now = _value_text(store.memory[key]) if key in store.memory else "not set"
        keys[key] = f"{now} → {_value_text(before.value) if before.existed else 'not set'}"
    failed = (store.view.tasks[id] for id in store.view.questions if id in store.view.tasks)
    tasks = (*failed, *store.running_tasks, *store.waiting_tasks)
    acts = dict.fromkeys(task.behavior for task in tasks if task.source == f"rule:{name}")
    return BackStep(name, view.steps[-2][0], keys, tuple(acts))


def question_lines(store: Store, step: BackStep, width: int) -> list[str]:
    """The immediate effects on the robot and the rule."""
    state = store.scenario.rules[step.rule].states[step.state]
    now = store.rule(step.rule).state
    return [
        shorten(f"Rule {step.rule} goes from {now} back to {step.state}. Its onEntry:", width),
        *(f"  {line}" for line in entry_lines(store.scenario, state, store.memory, width - 2, 4)),
    ]


def step_lines(
    step: BackStep, chosen: Mapping[str, str], selected: int, first: int, width: int, rows: int
) -> list[str]:
    """The chosen value for each item, from the first visible one."""
    names: Sequence[str] = list(chosen)
    lines = []
    for index, name in enumerate(names[first : first + rows], first):
        mark = "▸" if index == selected else " "
        word = f"‹{chosen[name]:^{len(BACK)}}›"
        text = f"its acts: {', '.join(step.acts)}" if name == ACTS else f"{name}: {step.keys[name]}"
        place = shorten(f"{mark} {clean(text)}", width - cell_width(word) - 1)
        lines.append(place + " " * (width - cell_width(place) - cell_width(word)) + word)
    return lines


def step_behavior(step: BackStep, chosen: Mapping[str, str], *, enter: bool) -> str:
    """The behaviour of the task that makes the step."""
    taken = [key for key in step.keys if chosen[key] == BACK]
    parts = {"rule": step.rule, "take_back": taken, "enter": enter, "stop_acts": chosen.get(ACTS) == STOP}
    return json.dumps(parts, ensure_ascii=False)


def _value_text(value: object) -> str:
    return shorten(format_value(value), MAX_VALUE)
