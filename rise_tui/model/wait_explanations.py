"""Why a rule stays in its state: the trigger of each transition, the truth of its parts, and the possible inputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import takewhile
from math import ceil
from typing import Any

from rich.cells import cell_len

from rise_engine.author.drawing.rule_text import Truth, find_awaited_act, is_met, split_condition, truth_of, wait_text
from rise_engine.author.drawing.study_keys import ACT, RULE, transitions_of
from rise_engine.expression import Expression
from rise_engine.kernel.view import RuleView
from rise_engine.scenario.model import Rule, State, Transition, normal_topic
from rise_tui.model.states import act_state, newest_task, rule_state
from rise_tui.model.store import Store
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    align_at_both_ends,
    clean,
    crop,
    format_duration,
    format_seconds,
    line_width,
)

PART = 8
"""Cells before a part of a condition."""
READABLE = 84
"""Cells beyond which a row's two ends would be too far apart to read together."""


def key_owner(store: Store) -> str:
    """Who can press a named key: `you`, or the holder of control (`key`)."""
    return "key" if store.blocked_reason("change") else "you"


class WaitExplanations:
    """Makes the rows for the present state of a rule."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def rows(self, rule: Rule, state: State, view: RuleView, width: int) -> list[ListRow]:
        """One row for each transition in the file's order, in which the engine also examines them."""
        if not state.transitions:
            return [ListRow("", crop(((" no transition: the rule ends here", "muted"),), width), selectable=False)]
        memory = self._store.memory
        width = min(width, READABLE)
        rows = []
        for index, transition in enumerate(state.transitions):
            rows += self._transition_rows(index, transition, view, memory, width)
            if transition.held is not None:
                rows += self._condition_rows(f"while:{index}", "while", transition.held, memory, width)
            if transition.condition is not None:
                rows += self._condition_rows(f"if:{index}", "if", transition.condition, memory, width)
            if other := self._preempted_text(rule, state, index, memory):
                rows.append(ListRow("", crop(((" " * 4, "plain"), (other, "wait")), width), selectable=False))
        return rows

    def kept_rows(self, width: int) -> list[ListRow]:
        """Events that are kept until any rule waits for them."""
        store = self._store
        rows = []
        for kept in store.view.kept.values():
            event = normal_topic(kept.topic)
            left = f"  {max(0, ceil(kept.until - store.now()))} s"
            line: StyledLine = ((" kept ", "muted"), (clean(event), "accent"), (left, "plain"))
            keys = [key.label for key in store.study_keys.keys_raising(event) if key.keep is not None]
            if keys:
                line = (
                    *line,
                    (f"  {key_owner(store)}: ", "muted"),
                    (" ".join(keys), "key"),
                    (" undoes", "muted"),
                )
            rows.append(ListRow("", crop(line, min(width, READABLE)), selectable=False))
        return rows

    def changes_with_time(self, state: State) -> bool:
        """Whether the text changes with the clock alone."""
        awaited = (find_awaited_act(self._store.scenario, transition) for transition in state.transitions)
        timed = any(transition.after is not None for transition in state.transitions)
        return timed or any(name is not None and self._store.act(name).running for name in awaited)

    def _transition_rows(
        self, index: int, transition: Transition, view: RuleView, memory: Mapping[str, Any], width: int
    ) -> list[ListRow]:
        waits: StyledLine = ((" waits for ", "muted"), (wait_text(self._store.scenario, transition), "wait"))
        progress, keys = self._progress_spans(index, transition, view), self._key_labels(transition)
        keys_line: StyledLine = ((f"  {key_owner(self._store)}: ", "muted"), (" ".join(keys), "key")) if keys else ()
        condition = transition.condition
        if transition.event is not None and not is_met(condition, memory):
            keys_line = (*keys_line, ("  not now", "wait"))
        target = clean(f"→ {transition.target}" if transition.target else "stays")
        line: StyledLine = (*waits, *progress, *keys_line)
        if line_width(line) + cell_len(target) + 3 <= width:
            return [ListRow(f"now:{index}", align_at_both_ends(line, ((f"{target} ", "plain"),), width))]
        more: StyledLine = ((" " * 4, "plain"), (target, "plain"))
        if line_width(line) > width:
            line = (*crop(waits, width - line_width(keys_line)), *keys_line)
            more = align_at_both_ends(more, (*progress, (" ", "plain")), width)
        return [ListRow(f"now:{index}", line), ListRow("", crop(more, width), selectable=False)]

    def _progress_spans(self, index: int, transition: Transition, view: RuleView) -> StyledLine:
        """The progress: the time left, or the state of the awaited act."""
        now = self._store.now()
        if transition.after is not None:
            due = due_at(index, transition, view)
            if due is None:
                problem = view.countdowns[index].reason if index in view.countdowns else ""
                return ((f"  never: {clean(problem)}", "fault"),) if problem else self._held_up_spans(transition)
            left = ceil(due - now)
            if left <= 0:
                return (("  the time is up", "wait"),)
            return ((f"  {format_seconds(left) if left >= 60 else f'{left} s'} left", "plain"),)
        name = find_awaited_act(self._store.scenario, transition)
        if name is None:
            return ()
        is_act = name in self._store.scenario.acts
        state, task = (act_state if is_act else rule_state)(self._store, name), newest_task(self._store, name)
        took = ""
        if task is not None and transition.ended is not None and task.id in self._store.view.questions:
            took = ": waits for an answer"
        elif self._store.act(name).running and task is not None and task.started is not None:
            typical = self._store.typical_seconds(name)
            took = f" {format_seconds(now - task.started)}"
            took += f" of {format_duration(typical)}" if typical is not None else " s"
        return ((f"  {state.glyph} {state.word}", state.role), (took, "plain"))

    def _held_up_spans(self, transition: Transition) -> StyledLine:
        """The part of the `held` condition that is false."""
        parts = split_condition(transition.held).parts if transition.held is not None else ()
        truths = (truth_of(part, self._store.memory) for part in parts)
        values = next((truth.values for truth in truths if not truth.holds), "")
        return ((f"  held up: {clean(values)}" if values else "  held up", "wait"),)

    def _key_labels(self, transition: Transition) -> list[str]:
        """The keys with which the wizard can raise the event; none for a running act, or the rule's own act."""
        keys = list(dict.fromkeys(key.label for key in self._store.study_keys.keys_raising(transition.event)))
        name = find_awaited_act(self._store.scenario, transition) if transition.ended is None else None
        if name is not None and not self._store.act(name).running and not self._store.act(name).waiting:
            binding = self._store.key_of(ACT, name) or self._store.key_of(RULE, name)
            if binding is not None and not self._store.rule(name).running:
                keys.append(binding.label)
        return keys

    def _condition_rows(
        self, id: str, word: str, condition: Expression, memory: Mapping[str, Any], width: int
    ) -> list[ListRow]:
        """Each part, after `word`, with its present values, its truth, and the keys that would make it true."""
        joint, parts = split_condition(condition)
        truths = [truth_of(part, memory) for part in parts]
        texts = max(cell_len(clean(truth.text)) for truth in truths)
        rows = []
        for number, (part, truth) in enumerate(zip(parts, truths, strict=True)):
            verdict: StyledSpan = (
                (" error ", "fault") if truth.error
                else (" true ", "accent") if truth.holds
                else (" false ", "wait")
            )  # fmt: skip
            line: StyledLine = ((f"{joint if number else word:>{PART - 1}} ", "muted"), (clean(truth.text), "plain"))
            more: StyledLine = ((truth.values, "muted"),) if truth.values and not _repeats_value(part, truth) else ()
            if keys := [key.label for key in self._store.study_keys.keys_setting(part, memory)]:
                more = (*more, (f"{'  ' if more else ''}{key_owner(self._store)}: ", "muted"), (" ".join(keys), "key"))
            gap = " " * (texts - cell_len(clean(truth.text)) + 2) if more else ""
            both: StyledLine = (*line, (gap, "plain"), *more)
            fits = line_width(both) + line_width((verdict,)) < width
            rows.append(
                ListRow(
                    f"{id}:{number}",
                    align_at_both_ends(both if fits else line, (verdict,), width),
                    selectable=False,
                )
            )
            if more and not fits:
                rows.append(ListRow("", crop(((" " * PART, "plain"), *more), width), selectable=False))
            if truth.error:
                rows.append(ListRow("", crop(((" " * PART, "plain"), (truth.error, "fault")), width), selectable=False))
        return rows

    def _preempted_text(self, rule: Rule, state: State, index: int, memory: Mapping[str, Any]) -> str:
        """The transition that would take the event instead: one event is taken by one transition of one rule."""
        event = state.transitions[index].event
        if event is None:
            return ""

        def takes_event(transitions: Iterable[Transition]) -> bool:
            return any(each.event == event and is_met(each.condition, memory) for each in transitions)

        for name in takewhile(lambda name: name != rule.name, self._store.view.running_rules()):
            if takes_event(transitions_of(self._store.scenario, name, self._store.rule(name).state)):
                return f"rule {clean(name)} takes this event first: it is higher on the stack"
        return "the transition above takes this event first" if takes_event(state.transitions[:index]) else ""


def due_at(index: int, transition: Transition, view: RuleView) -> float | None:
    """Session time at which a transition's time is over; None: nothing is counted for it."""
    after, countdown = transition.after, view.countdowns.get(index)
    if countdown is not None:
        return countdown.since + countdown.seconds if countdown.seconds is not None else None
    if after is None or after.seconds is None or transition.held is not None:
        return None
    return view.since + after.seconds


def _repeats_value(part: Expression, truth: Truth) -> bool:
    """Whether a part is only a key, so that its truth already shows its value."""
    return truth.values in (f"{part.bare_key} is true", f"{part.bare_key} is false")
