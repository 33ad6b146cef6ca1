"""The takeover of a changed scenario by a running session (semantics.md 12.5): when it is possible, and what is kept.

Rules stay in their states and continue to count. Transitions are matched by their content, because their order may have
changed. Their numbers in a snapshot are translated to those of the new scenario.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import msgspec
from msgspec.structs import replace

from rise_engine.base.text import pluralize
from rise_engine.kernel.core import TimerTarget
from rise_engine.kernel.snapshot import RuleSnapshot, Snapshot
from rise_engine.scenario.model import Act, Rule, Scenario, SourceLocation, State, Transition

_Identity = tuple[bytes, int]
"""The content of a transition, and its number among equal ones in its state."""


def why_not_take_over(before: Scenario, after: Scenario, snapshot: Snapshot, *, is_busy: bool) -> list[str]:
    """Why a session cannot continue with `after` now: sentences; empty: it can.

    :param before: the session's scenario.
    :param after: checked, and read for the same robot and mode.
    :param snapshot: the state of the session.
    :param is_busy: an act runs or waits, or a stop is not confirmed yet.
    """
    problems = []
    if before.mode != after.mode or before.robot != after.robot:
        problems.append("the robot or its profile has changed; a session keeps its robot")
    if snapshot.acts or snapshot.waiting:
        problems.append("an act runs or waits; wait until the robot has finished")
    if snapshot.stop != "released":
        problems.append("everything is stopped; release the stop first")
    elif is_busy and not problems:
        problems.append("something is running; wait until it ends")
    if snapshot.failures.asked:
        problems.append("an act has failed, and the wizard is asked about it; answer first")
    for key in sorted(after.tables.keys() & snapshot.memory.keys()):
        problems.append(f"`{key}` is a table now, but the memory has a value of that name; delete the value first")
    for rule in snapshot.rules.running:
        problems += _rule_problems(before.rules[rule.name], after.rules.get(rule.name), rule)
    return problems


def _rule_problems(before: Rule, after: Rule | None, snapshot: RuleSnapshot) -> Iterator[str]:
    if after is None:
        yield f"the rule `{before.name}` is running and no longer exists; stop it first"
        return
    state = after.states.get(snapshot.state)
    if state is None:
        yield f"the rule `{before.name}` is in the state `{snapshot.state}`, which no longer exists"
        return
    if not state.transitions and before.states[snapshot.state].transitions:
        yield f"the rule `{before.name}` is in the state `{snapshot.state}`, in which it would now end"
    numbers = _new_numbers(before.states[snapshot.state], state)
    for index in snapshot.timers.values():
        if numbers.get(index) is None:
            transition = before.states[snapshot.state].transitions[index]
            time = transition.after.text if transition.after is not None else ""
            yield (
                f"the rule `{before.name}` counts `after {time}` in the state `{snapshot.state}`, "
                "but the files have changed this transition"
            )


def carry_over(before: Scenario, after: Scenario, snapshot: Snapshot) -> Snapshot:
    """Translate the snapshot of a session for `after`. `why_not_take_over` must have found no problem."""
    numbers = {
        rule.name: _new_numbers(before.rules[rule.name].states[rule.state], after.rules[rule.name].states[rule.state])
        for rule in snapshot.rules.running
    }
    running = [
        replace(
            rule,
            timers={timer: numbers[rule.name][index] for timer, index in rule.timers.items()},
            latched=sorted(numbers[rule.name][index] for index in rule.latched if index in numbers[rule.name]),
            history=_known_steps(rule.history, after.rules[rule.name]),
        )
        for rule in snapshot.rules.running
    ]
    return replace(
        snapshot,
        scenario=after.hash,
        timers={timer: _new_target(target, numbers) for timer, target in snapshot.timers.items()},
        rules=replace(snapshot.rules, running=running),
        last_pick={name: pick for name, pick in snapshot.last_pick.items() if _same_variants(name, before, after)},
    )


def _new_target(target: TimerTarget, numbers: Mapping[str, Mapping[int, int]]) -> TimerTarget:
    if target.purpose != "after":
        return target
    return replace(target, item=str(numbers[target.owner][int(target.item)]))


def _known_steps(history: list[tuple[str, int]], rule: Rule) -> list[tuple[str, int]]:
    """The latest states of a rule for steps back, as far back as all of them still exist."""
    known: list[tuple[str, int]] = []
    for step in reversed(history):
        if step[0] not in rule.states:
            break
        known.insert(0, step)
    return known


def _same_variants(name: str, before: Scenario, after: Scenario) -> bool:
    """Whether an action (`ACT/ID`) still has as many variants, so that its last pick keeps its meaning."""
    return _variants(before, name) == _variants(after, name) != 0


def _variants(scenario: Scenario, name: str) -> int:
    act, _, id = name.rpartition("/")
    actions = scenario.acts[act].actions if act in scenario.acts else ()
    return next((len(action.calls) for action in actions if action.id == id), 0)


def _new_numbers(before: State, after: State) -> dict[int, int]:
    """The new number of each unchanged transition of a state."""
    there = {identity: number for number, identity in enumerate(_identities(after.transitions))}
    numbers = enumerate(_identities(before.transitions))
    return {number: there[identity] for number, identity in numbers if identity in there}


def _identities(transitions: Iterable[Transition]) -> Iterator[_Identity]:
    seen: dict[bytes, int] = {}
    for transition in transitions:
        content = _content(transition)
        seen[content] = seen.get(content, -1) + 1
        yield content, seen[content]


def _content(value: Any) -> bytes:
    """The content of a part of a scenario, without places."""
    return msgspec.json.encode(_without_locations(value))


def _without_locations(value: Any) -> Any:
    if isinstance(value, SourceLocation):
        return None
    if isinstance(value, msgspec.Struct):
        names = value.__struct_fields__
        return [type(value).__name__, *(_without_locations(getattr(value, name)) for name in names)]
    if isinstance(value, dict):
        return {str(key): _without_locations(each) for key, each in value.items()}
    if isinstance(value, frozenset):
        return sorted(map(str, value))
    if isinstance(value, tuple | list):
        return [_without_locations(each) for each in value]
    if value is None or isinstance(value, str | int | float | bool):
        return value
    return [type(value).__name__, getattr(value, "text", repr(value))]


# --- in words -----------------------------------------------------------------------------------------------------


def changes_in_words(before: Scenario, after: Scenario) -> tuple[str, ...]:
    """The changes, for the record: a sentence for each act and rule, and for each other part."""
    changes = [*_named_changes("act", before.acts, after.acts), *_named_changes("rule", before.rules, after.rules)]
    for what, one, other in (
        ("key", before.keys, after.keys),
        ("start value", before.memory, after.memory),
        ("table", before.tables, after.tables),
    ):
        number = sum(_content(one.get(name)) != _content(other.get(name)) for name in {**one, **other})
        if number:
            changes.append(f"{pluralize(number, what)} changed")
    rest = ("title", "act_settings", "fillers", "study", "conditions", "private", "language", "lexicon", "on_failure")
    changes += [
        f"{name.replace('_', ' ')} changed"
        for name in rest
        if _content(getattr(before, name)) != _content(getattr(after, name))
    ]
    return tuple(changes) or ("nothing that has an effect",)


def _named_changes(what: str, before: Mapping[str, Act | Rule], after: Mapping[str, Act | Rule]) -> Iterator[str]:
    for name in {**before, **after}:
        if name not in after:
            yield f"{what} {name} removed"
        elif name not in before:
            yield f"{what} {name} added"
        elif _content(before[name]) != _content(after[name]):
            yield f"{what} {name} changed"
