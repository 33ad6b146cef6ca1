"""Findings about progress: dead ends, the study's end, rules that loop by themselves, and states that need a person."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from rise_engine.author.explore.situation_graph import Explored, ExploreFinding, Path, is_planned, some_states
from rise_engine.author.explore.space import Number
from rise_engine.scenario.reading.graph import component_numbers


def find_dead_ends(explored: Explored) -> Iterator[ExploreFinding]:
    """Find situations in which only stopping everything can still move a running rule."""
    for rule in explored.scenario.rules.values():
        stuck = explored.stuck_situations(rule.name)
        if not stuck:
            continue
        states = {state: None for number in stuck if (state := explored.state_of(rule.name, number)) is not None}
        first = next(iter(states))
        yield ExploreFinding(
            kind="dead-end",
            level="problem",
            text=f"{rule.name} can get stuck in {some_states(states)}{_after_mishaps(explored, stuck)}: no key, "
            f"event or time takes it any further ({_share(explored, stuck)})",
            location=rule.states[first].location,
            rule=rule.name,
            state=first,
            path=_path(explored, stuck),
        )


def find_lost_ends(explored: Explored) -> Iterator[ExploreFinding]:
    """Find situations from which the study's end is unreachable."""
    end = explored.scenario.rules.get(explored.end)
    if end is None:
        return
    if not any(not state.transitions for state in end.states.values()):
        yield ExploreFinding(
            kind="no-end",
            level="remark",
            text=f"{end.name} has no state that ends it, so the end of the study is unknown; `end` under "
            "[explore] in scenario.toml names the rule that ends the study",
            location=end.location,
            rule=end.name,
        )
        return
    if all(explored.state_of(end.name, number) is None for number in range(len(explored.situations))):
        return  # started from outside: `never-started` reports that
    able = explored.reaching(explored.ends | explored.unknown, is_planned)
    stuck = set(explored.stuck_situations(end.name))  # reported as dead ends
    lost = [number for number in range(len(explored.situations)) if number not in able and number not in stuck]
    if lost:
        states = {explored.state_of(end.name, number): None for number in lost}
        known = [state for state in states if state is not None]
        place = f"while {end.name} is in {some_states(known)}" if known else f"while {end.name} does not run"
        yield ExploreFinding(
            kind="end-lost",
            level="problem",
            text=f"the end of {end.name} can become impossible to reach{_after_mishaps(explored, lost)}: {place} "
            f"({_share(explored, lost)})",
            location=end.states[known[0]].location if known else end.location,
            rule=end.name,
            state=known[0] if known else "",
            path=_path(explored, lost),
        )


def describe_end(explored: Explored) -> str:
    """Return a sentence on the study's end; empty: nothing is known."""
    end = explored.scenario.rules.get(explored.end)
    if end is None or all(state.transitions for state in end.states.values()):
        return ""
    able = explored.reaching(explored.ends, is_planned)
    number, count = len(able), len(explored.situations)
    if number == count:
        return f"From every one of {count:,} situations the end ({explored.end} ends) can still be reached."
    unknown = len(explored.reaching(explored.ends | explored.unknown, is_planned)) - number
    text = f"From {number:,} of {count:,} situations the end ({explored.end} ends) can still be reached"
    return text + (f"; for {unknown:,} it is unknown, because what follows was not explored." if unknown else ".")


def find_runaways(explored: Explored) -> Iterator[ExploreFinding]:
    """Find rules that were stopped because of endless steps."""
    for fact in explored.facts("faulted"):
        rule = explored.scenario.rules[fact[1]]
        yield ExploreFinding(
            kind="runaway",
            level="problem",
            text=f"{rule.name} is stopped because it runs in an endless loop: {fact[2]}",
            location=rule.location,
            rule=rule.name,
            path=explored.paths.to_fact(fact),
        )


def find_rounds(explored: Explored) -> Iterator[ExploreFinding]:
    """Find rules that can loop endlessly without a person."""
    spontaneous = [move.is_spontaneous for move in explored.space.moves]
    rounds: Counter[str] = Counter()
    first: dict[str, Number] = {}
    component = component_numbers(
        {
            number: [edges[at + 1] for at in range(0, len(edges), 3) if spontaneous[edges[at]]]
            for number, edges in enumerate(explored.space.edges)
        }
    )
    for number, edges in enumerate(explored.space.edges):
        for at in range(0, len(edges), 3):
            if spontaneous[edges[at]] and component[edges[at + 1]] == component[number]:
                for name, bit in explored.bits.items():
                    if edges[at + 2] & bit:
                        rounds[name] += 1
                        first.setdefault(name, number)
    for name in rounds:
        yield ExploreFinding(
            kind="round",
            level="remark",
            text=f"{name} can go on without end while nobody does anything; this may be intended",
            location=explored.scenario.rules[name].location,
            rule=name,
            path=explored.paths.to(first[name]),
        )


def describe_waits(explored: Explored) -> list[str]:
    """List the states of the study's main rule that only a person can leave, and the longest other silence."""
    end = explored.end
    waiting: dict[str, None] = {}
    silence = _Silence(explored)
    longest, where = 0.0, ""
    for number, situation in enumerate(explored.situations):
        if situation.running or situation.waiting or situation.stop != "released" or situation.robot_lost:
            continue
        state = next((rule.state for rule in situation.rules if rule.name == end), None)
        if not situation.rules:
            continue
        if not situation.countdowns:
            if state is not None and not situation.asked:
                waiting[state] = None
            continue
        seconds = silence.of(number)
        if seconds is not None and seconds > longest:
            longest, where = seconds, _states_text(explored, number)
    sentences = []
    if waiting:
        sentences.append(f"{end} moves on from {some_states(waiting)} only when a person or another program acts.")
    if longest:
        sentences.append(f"The longest silence that the robot ends by itself is {longest:g} s ({where}).")
    return sentences


class _Silence:
    """The robot's silence from a situation until it acts again without a person."""

    def __init__(self, explored: Explored) -> None:
        self._explored = explored
        self._known: dict[Number, float | None] = {}

    def of(self, number: Number) -> float | None:
        """Return the seconds of silence; None: endless."""
        known = self._known
        if number in known:
            return known[number]
        known[number] = None  # while it is computed: coming back here means an endless silence
        longest: float | None = None
        for move, target, _ in self._explored.space.steps_from(number):
            if move.kind != "timer":
                continue
            situation = self._explored.situations[target]
            before = self._explored.situations[number].countdowns[move.place].length / 1000
            if situation.running:
                after: float | None = 0.0
            elif not situation.countdowns:
                after = None
            else:
                after = self.of(target)
            if after is not None:
                longest = max(longest or 0.0, before + after)
        known[number] = longest
        return longest


def _states_text(explored: Explored, number: Number) -> str:
    """Return the states of the rules, the highest first."""
    rules = reversed(explored.situations[number].rules)
    return ", ".join(f"{rule.name} in {rule.state}" for rule in rules)


def _after_mishaps(explored: Explored, numbers: list[Number]) -> str:
    nearest = explored.paths.nearest(numbers)
    if nearest is None or not explored.paths.mishaps[nearest]:
        return ""
    wrong = next(step.move for step in explored.paths.to(nearest).steps if step.move.is_mishap)
    return {
        "stop": " after everything was stopped",
        "lost": " after the robot was lost",
        "end": f" after {wrong.name} has failed",
    }[wrong.kind]


def _share(explored: Explored, numbers: list[Number]) -> str:
    return f"in {len(numbers):,} of {len(explored.situations):,} situations"


def _path(explored: Explored, numbers: list[Number]) -> Path | None:
    nearest = explored.paths.nearest(numbers)
    return explored.paths.to(nearest) if nearest is not None else None
