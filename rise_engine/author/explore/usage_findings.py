"""Findings about unused parts, keys without effect, and reads of values that are never set."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from rise_engine.author.drawing.rule_text import transition_label
from rise_engine.author.explore.act_traits import keys_read
from rise_engine.author.explore.influence import assignments_of
from rise_engine.author.explore.moves import Move
from rise_engine.author.explore.situation_graph import Explored, ExploreFinding, some_states
from rise_engine.author.explore.space import Number
from rise_engine.base.text import pluralize
from rise_engine.expression import Assignment, ExpressionError
from rise_engine.scenario.checking.memory_paths import find_missing_parts as find_missing_parts_of_act
from rise_engine.scenario.model import CUE_TOPICS, Rule, SourceLocation, Transition, normal_topic

NOT_RUNNING = "(not running)"
"""The state in `keys_by_state` of a rule that does not run."""


def find_unused(explored: Explored) -> Iterator[ExploreFinding]:
    """Find rules, states, transitions and acts that no session uses."""
    scenario = explored.scenario
    entered = {(fact[1], fact[2]) for fact in explored.facts("state")}
    taken = {(fact[1], fact[2], fact[3]) for fact in explored.facts("transition")}
    within = _scope(explored)
    for rule in scenario.rules.values():
        if not any(name == rule.name for name, _ in entered):
            yield ExploreFinding(
                kind="never-started",
                level="warning",
                text=f"{rule.name} is never started: no key and no rule starts it{within}",
                location=rule.location,
                rule=rule.name,
            )
            continue
        for_faults = []
        for state in rule.states.values():
            transitions = [
                transition
                for each in rule.states.values()
                for transition in each.transitions
                if transition.target == state.id
            ]
            if (rule.name, state.id) not in entered:
                if transitions and all(_is_for_faults(transition) for transition in transitions):
                    for_faults.append(state.id)
                    continue
                yield ExploreFinding(
                    kind="never-entered",
                    level="warning",
                    text=f"{rule.name} never comes to {state.id}{within}",
                    location=state.location,
                    rule=rule.name,
                    state=state.id,
                )
                continue
            for index, transition in enumerate(state.transitions):
                if (rule.name, state.id, index) in taken:
                    continue
                if _is_for_faults(transition):
                    for_faults.append(state.id)
                    continue
                yield ExploreFinding(
                    kind="never-taken",
                    level="warning",
                    text=f"in {state.id}, {rule.name} never takes {_transition_text(transition)}{within}",
                    location=transition.location,
                    rule=rule.name,
                    state=state.id,
                )
        if for_faults:
            yield ExploreFinding(
                kind="not-met",
                level="remark",
                text=f"{rule.name} did not reach all its responses to a failed act{within}: "
                + ", ".join(dict.fromkeys(for_faults)),
                location=rule.location,
                rule=rule.name,
            )
    done = {fact[1] for fact in explored.facts("act")}
    by_key = {key.behavior for key in scenario.keys.values() if key.function == "startCommunicationRobotAct"}
    for act in scenario.acts.values():
        if act.name not in done and act.name not in by_key and not scenario.settings_of(act.name).filler:
            yield ExploreFinding(
                kind="never-done",
                level="warning",
                text=f"{act.name} is never done: no key starts it, and no rule gets to where it is started{within}",
                location=act.location,
                act=act.name,
            )


def _is_for_faults(transition: Transition) -> bool:
    """Return whether a transition is for an act that did not succeed."""
    return transition.ended is not None and transition.outcomes != ("succeeded",)


def _transition_text(transition: Transition) -> str:
    target = "stays" if transition.target is None else transition.target
    return f"the transition `{transition_label(transition, condition=True)}` → {target}"


def keys_by_state(explored: Explored) -> dict[str, dict[str, str]]:
    """Compute for each state of the main rule whether each key has an effect: always, sometimes or never."""
    keys = [name for name, key in explored.space.stepper.moves.keys.items() if _is_followed(key.function)]
    counts: Counter[str] = Counter()
    effective: Counter[tuple[str, str]] = Counter()
    moves = explored.space.moves
    key_of = [move.name if move.kind == "key" else "" for move in moves]
    pending = set(explored.space.pending)
    for number, situation in enumerate(explored.situations):
        if situation.stop != "released" or number in pending:
            continue
        state = next((rule.state for rule in situation.rules if rule.name == explored.end), NOT_RUNNING)
        counts[state] += 1
        edges = explored.space.edges[number]
        done = {key_of[edges[at]] for at in range(0, len(edges), 3)} | explored.space.keys_beyond.get(
            number, frozenset()
        )
        for key in done:
            effective[state, key] += 1
    return {
        state: {
            key: "never" if not effective[state, key] else "always" if effective[state, key] == count else "sometimes"
            for key in keys
        }
        for state, count in counts.items()
    }


def find_idle_keys(explored: Explored, by_state: dict[str, dict[str, str]]) -> Iterator[ExploreFinding]:
    """Find keys that never have an effect."""
    keys = next(iter(by_state.values()), {})
    matter = {key.partition(".")[0] for key in explored.space.stepper.kernel.keys}
    spoken = {key.partition(".")[0] for act in explored.scenario.acts.values() for key in keys_read(act)}
    for name in keys:
        if all(row[name] == "never" for row in by_state.values()):
            key = explored.scenario.keys[name]
            if key.function == "assignValue":
                sets = _keys_set(key.behavior)
                if sets & spoken or not sets & matter:
                    continue  # an act says it, or nothing reads it: it is a note for the record
            if key.function == "raiseEventTopic" and normal_topic(key.behavior) not in explored.scenario.topics:
                continue  # reported by `check`; the event is in the record
            title = f" ({key.title})" if key.title else ""
            yield ExploreFinding(
                kind="idle-key",
                level="warning",
                text=f"the key {key.label}{title} never does anything that a rule or an act notices{_scope(explored)}",
                location=key.location,
                key=name,
            )


def find_lost_keys(explored: Explored) -> Iterator[ExploreFinding]:
    """Find events of keys, and the cue, that are lost if they come too early: just before a rule waits for them."""
    for name, key in explored.space.stepper.moves.keys.items():
        if key.function == "raiseEventTopic" and key.keep is None:
            title = f" ({key.title})" if key.title else ""
            yield from _lost_finding(
                explored, Move("key", name), f"the key {key.label}{title}", normal_topic(key.behavior)
            )
    if CUE_TOPICS[0] in explored.scenario.topics and explored.scenario.cue_keep is None:
        yield from _lost_finding(explored, Move("cue", how="marked"), "the participant's cue", CUE_TOPICS[0])


def _lost_finding(explored: Explored, pressed: Move, what: str, topic: str) -> Iterator[ExploreFinding]:
    """Return the finding about one key or cue that raises this event, if it can be lost."""
    rules = [
        rule
        for rule in explored.scenario.rules.values()
        if any(transition.event == topic for state in rule.states.values() for transition in state.transitions)
    ]
    waiting = sum(explored.bits[rule.name] for rule in rules)
    space = explored.space
    moves = [(move.kind, move.name, move.how) == (pressed.kind, pressed.name, pressed.how) for move in space.moves]
    taken: dict[Number, int] = {}
    for number, edges in enumerate(space.edges):
        for at in range(0, len(edges), 3):
            if moves[edges[at]]:
                taken[number] = taken.get(number, 0) | (edges[at + 2] & waiting)
    for number in space.keys_beyond if pressed.kind == "key" else ():
        if pressed.name in space.keys_beyond[number]:
            taken[number] = waiting
    early: dict[tuple[str, str], Number] = {}
    for number, situation in enumerate(explored.situations):
        if taken.get(number) or situation.stop != "released":
            continue
        for move, target, moved in space.steps_from(number):
            by = taken.get(target, 0) & moved if move.is_spontaneous else 0
            for rule in situation.rules if by else ():
                if explored.bits[rule.name] & by:
                    early.setdefault((rule.name, rule.state), number)
    if not early:
        return
    (name, state), first = next(iter(early.items()))
    states = dict.fromkeys(state for rule, state in early if rule == name)
    remedy = 'keep = "3s" at the key' if pressed.kind == "key" else 'keep = "3s" under [cue] in scenario.toml'
    yield ExploreFinding(
        kind="lost-key" if pressed.kind == "key" else "lost-cue",
        level="remark" if pressed.kind == "key" else "warning",
        text=f"{what} is lost when it comes a moment too early: while {name} is in {some_states(states)}, no rule "
        f"waits for /{topic} yet; {remedy} keeps it",
        location=explored.scenario.rules[name].states[state].location,
        rule=name,
        state=state,
        key=pressed.name,
        path=explored.paths.to(first),
    )


def _keys_set(text: str) -> set[str]:
    try:
        return {assignment.key.partition(".")[0] for assignment in Assignment.parse_all(text)}
    except ExpressionError:
        return set()


def find_missing_values(explored: Explored) -> Iterator[ExploreFinding]:
    """Find conditions that read keys without a value, or that cannot be evaluated."""
    reported: set[tuple[str, str]] = set()
    for fact in explored.facts("missing"):
        _, key, text, rule = fact
        if (key, text) not in reported:
            reported.add((key, text))
            yield ExploreFinding(
                kind="missing-value",
                level="warning",
                text=f"the memory has no value for {key} when {rule} asks `{text}`",
                location=_place_of(explored.scenario.rules[rule], text),
                rule=rule,
                path=explored.paths.to_fact(fact),
            )
    for fact in explored.facts("error"):
        _, text, problem, rule = fact
        if (text, problem) not in reported:
            reported.add((text, problem))
            yield ExploreFinding(
                kind="condition-error",
                level="warning",
                text=f"when {rule} asks `{text}`, it has no value: {problem}; it counts as false",
                location=_place_of(explored.scenario.rules[rule], text),
                rule=rule,
                path=explored.paths.to_fact(fact),
            )


def find_missing_parts(explored: Explored) -> Iterator[ExploreFinding]:
    """Find acts that need a part of a value that the session never has; a computed index matches any entry."""
    scenario = explored.scenario
    changed = {assignment.key.partition(".")[0] for assignment in assignments_of(scenario)}
    reported: set[tuple[str, str]] = set()
    for begun in explored.space.stepper.beginnings:
        memory = {**scenario.memory, **begun.memory}
        for act in scenario.acts.values():
            for action, problem in find_missing_parts_of_act(act, scenario.tables, memory, changed):
                if (act.name, problem) in reported:
                    continue
                reported.add((act.name, problem))
                yield ExploreFinding(
                    kind="missing-part",
                    level="problem",
                    text=f"{act.name} fails at action {action.id}: {problem}",
                    location=action.location,
                    act=act.name,
                )


def _place_of(rule: Rule, text: str) -> SourceLocation:
    """Return the place of a condition; otherwise that of the rule."""
    for state in rule.states.values():
        for transition in state.transitions:
            if any(each is not None and each.text == text for each in (transition.condition, transition.held)):
                return transition.location
    return rule.location


def _is_followed(function: str) -> bool:
    return function != "startCommunicationRobotAct"


def _scope(explored: Explored) -> str:
    """Return the qualification of a "never"."""
    faults = explored.space.stepper.bounds.faults
    wrong = (
        "when nothing goes wrong"
        if not faults
        else f"when at most {pluralize(faults, 'thing')} {_verb_form(faults)} wrong"
    )
    looked = "" if not explored.has_bounds else ", as far as the study was explored"
    return f" ({wrong}{looked})"


def _verb_form(count: int) -> str:
    return "goes" if count == 1 else "go"
