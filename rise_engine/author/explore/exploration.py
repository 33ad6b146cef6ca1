"""A complete exploration of a scenario and its results."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections import deque
from collections.abc import Callable, Sequence
from multiprocessing.pool import ApplyResult
from typing import Any, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.explore import act_findings, progress_findings, usage_findings
from rise_engine.author.explore.act_findings import PropertyChecker
from rise_engine.author.explore.moves import Bounds
from rise_engine.author.explore.path_words import describe_path
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.situation_graph import Explored, ExploreFinding
from rise_engine.author.explore.space import Number, Space
from rise_engine.author.explore.stepper import FollowedMove, Stepper
from rise_engine.author.explore.zones import Zone
from rise_engine.base.text import pluralize
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.scenario.model import Scenario

# --- several processes ------------------------------------------------------------------------------------------------

_PORTION = 64
"""Situations that a core gets at a time: enough to make sending them cheap."""
_PORTIONS_PER_CORE = 3
"""Portions in progress at once for each core."""
_SECONDS = 0.05
"""Seconds to wait for a portion before asking again whether to continue."""

_Portion: TypeAlias = list[tuple[Number, Situation, Zone]]
_Followed: TypeAlias = tuple[list[tuple[Number, list[FollowedMove]]], int]
"""The moves from each situation, and the number of inputs."""

_stepper: Stepper | None = None
"""The stepper of this process."""


def explore_on_cores(space: Space, cores: int, go_on: Callable[[], bool]) -> None:
    """Explore like `Space.explore`, on several cores, or on one if forking is not available.

    Forked processes need no copy of the scenario.
    """
    if cores < 2 or "fork" not in multiprocessing.get_all_start_methods():
        space.explore(go_on)
        return
    context = multiprocessing.get_context("fork")
    most = space.stepper.bounds.situations
    under_way: deque[tuple[list[Number], ApplyResult[_Followed]]] = deque()
    with context.Pool(cores, _begin, (space.stepper,)) as pool:
        while (space.pending or under_way) and len(space.situations) <= most and go_on():
            while space.pending and len(under_way) < _PORTIONS_PER_CORE * cores:
                portion = space.take_pending(_PORTION)
                numbers = [number for number, _, _ in portion]
                under_way.append((numbers, pool.apply_async(_follow, (portion,))))
            first = under_way[0][1]
            first.wait(_SECONDS)
            if not first.ready():
                continue  # the user may want to stop meanwhile
            under_way.popleft()
            followed, steps = first.get()
            space.stepper.steps += steps
            for number, found in followed:
                space.take(number, found)
        space.complete = not space.pending and not under_way
        for numbers, _ in under_way:  # stopped early: these situations were not explored
            space.put_back(numbers)


def _begin(stepper: Stepper) -> None:
    global _stepper
    _stepper = stepper
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that keeps the situations handles ctrl+c


def _follow(portion: _Portion) -> _Followed:
    assert _stepper is not None, "set when the process began"
    before = _stepper.steps
    found = [(number, list(_stepper.follow(situation, zone))) for number, situation, zone in portion]
    return found, _stepper.steps - before


QUICK_SECONDS = 4.5
"""Maximum processor seconds of `explore_quickly`. A busy machine finds the same, only later."""
_LEVELS = ("problem", "warning", "remark")


class Exploration(Struct, frozen=True, kw_only=True):
    """The results of exploring a scenario."""

    scenario_hash: str
    """The hash of the explored scenario; the results do not apply to another one."""
    bounds: Bounds
    is_complete: bool
    """Whether all situations within the bounds were explored."""
    situations: int
    steps: int
    """The number of inputs to the kernel."""
    scope: tuple[str, ...]
    """Sentences on what was and was not explored."""
    facts: tuple[str, ...]
    """Sentences on what holds."""
    findings: tuple[ExploreFinding, ...]
    """Problems first."""
    keys: dict[str, dict[str, str]]
    """For each state of the main rule and each key, whether it has an effect: always, sometimes or never."""

    def row(self, scenario: Scenario) -> dict[str, Any]:
        """Return the results for programs (`--json`); `scenario` is the explored one."""
        findings = [
            {
                **{name: getattr(finding, name) for name in ("kind", "level", "text", "rule", "state", "act", "key")},
                "file": finding.location.file if finding.location is not None else "",
                "line": finding.location.line if finding.location is not None else 0,
                "column": finding.location.column if finding.location is not None else 0,
                "way": describe_path(scenario, finding.path, self.bounds) if finding.path is not None else [],
            }
            for finding in self.findings
        ]
        return {
            "scenario": self.scenario_hash,
            "complete": self.is_complete,
            "situations": self.situations,
            "looked_at": self.scope,
            "told": self.facts,
            "findings": findings,
            "keys": self.keys,
        }

    def count(self, level: str) -> int:
        """Count the findings of a level."""
        return sum(finding.level == level for finding in self.findings)


def explore(
    scenario: Scenario,
    bounds: Bounds | None = None,
    *,
    sessions: Sequence[SessionStarted] = (),
    cores: int = 1,
    go_on: Callable[[Space], bool] = lambda space: True,
) -> Exploration:
    """Explore all situations that a scenario can reach, and report the results.

    Arguments:
        scenario: checked, as `rise_engine.scenario.loader.load` returns it.
        bounds: the bounds; None: the scenario's.
        sessions: the sessions to explore; empty: one for each condition of the scenario.
        cores: the number of processes.
        go_on: is called some hundred times a second with the results so far; False stops it.

    >>> from rise_engine.scenario.loader import load
    >>> found = explore(load("scenarios/lablinking").scenario, Bounds(faults=0))
    >>> found.is_complete, [finding.kind for finding in found.findings if finding.level == "problem"]
    (True, [])
    """
    bounds = bounds or bounds_of(scenario)
    if scenario.reads_session:
        bounds = replace(bounds, follows_voice=True)
    conditions = [
        expression
        for each in scenario.properties
        for expression in (each.condition, each.after, each.unless)
        if expression is not None
    ]
    stepper = Stepper(scenario, bounds, [*sessions] or sessions_of(scenario), main_rule(scenario), conditions)
    space = Space(stepper)
    space.begin()
    explore_on_cores(space, cores, lambda: go_on(space))
    return collect_results(Explored(space))


def explore_quickly(scenario: Scenario, go_on: Callable[[], bool] = lambda: True) -> Exploration:
    """Explore for a few seconds at most, without stops and lost robots, for a user who waits for the result."""
    until = time.thread_time() + QUICK_SECONDS
    return explore(scenario, quick_bounds(scenario), go_on=lambda space: time.thread_time() < until and go_on())


def quick_bounds(scenario: Scenario) -> Bounds:
    """Return the scenario's own bounds without stops and lost robots."""
    return replace(bounds_of(scenario), stop=False, lost=False)


def bounds_of(scenario: Scenario) -> Bounds:
    """Return the bounds that a scenario sets (`[explore]` in scenario.toml)."""
    settings = scenario.explore
    return Bounds(
        keys=settings.keys,
        line=settings.line,
        beside=settings.beside,
        faults=settings.faults,
        pace=settings.pace,
        tries=settings.tries,
    )


def sessions_of(scenario: Scenario) -> list[SessionStarted]:
    """List the possible sessions: one for each condition of the study."""
    return [
        SessionStarted(condition=name, memory=dict(condition.memory)) for name, condition in scenario.conditions.items()
    ] or [SessionStarted()]


def main_rule(scenario: Scenario) -> str:
    """Return the rule that ends the study; empty: there is none.

    The scenario names it; else it is the one of the first key that starts a rule, or the first rule.
    """
    if scenario.explore.end:
        return scenario.explore.end
    started = (key.behavior for key in scenario.keys.values() if key.function == "startInteractionRule")
    return next(started, next(iter(scenario.rules), ""))


def collect_results(explored: Explored) -> Exploration:
    """Collect all results of a space."""
    checker = PropertyChecker(explored)
    by_state = usage_findings.keys_by_state(explored)
    findings: list[ExploreFinding] = [
        *checker.findings(),
        *progress_findings.find_dead_ends(explored),
        *progress_findings.find_lost_ends(explored),
        *progress_findings.find_runaways(explored),
        *act_findings.find_growing_lines(explored),
        *act_findings.find_two_at_once(explored),
        *act_findings.find_out_of_step(explored),
        *act_findings.find_failures_alike(explored),
        *usage_findings.find_missing_values(explored),
        *usage_findings.find_missing_parts(explored),
        *usage_findings.find_unused(explored),
        *usage_findings.find_idle_keys(explored, by_state),
        *usage_findings.find_lost_keys(explored),
        *progress_findings.find_rounds(explored),
        *act_findings.find_cut_off(explored),
    ]
    findings.sort(key=lambda finding: _LEVELS.index(finding.level))
    space = explored.space
    about_the_end = progress_findings.describe_end(explored)
    return Exploration(
        scenario_hash=explored.scenario.hash,
        bounds=space.stepper.bounds,
        is_complete=space.complete,
        situations=len(space.situations),
        steps=space.stepper.steps,
        scope=tuple(_scope_sentences(explored)),
        facts=tuple(filter(None, (about_the_end, *checker.sentences(), *progress_findings.describe_waits(explored)))),
        findings=tuple(findings),
        keys=by_state,
    )


def _scope_sentences(explored: Explored) -> Sequence[str]:
    """Describe what was and was not explored."""
    space = explored.space
    stepper = space.stepper
    bounds = stepper.bounds
    count = len(space.situations)
    keys = pluralize(len(stepper.moves.keys), "key")
    wrong = "nothing going wrong" if not bounds.faults else f"at most {pluralize(bounds.faults, 'thing')} going wrong"
    if bounds.faults:
        kinds = ["a failed act", *(["a lost robot"] if bounds.lost else []), *(["a stop"] if bounds.stop else [])]
        wrong += f" ({', '.join(kinds)})"
    situations = f"all {count:,} situations" if space.complete else f"{count:,} situations"
    sentences = [
        f"Looked at {situations} with these {keys}, at most {pluralize(bounds.line, 'waiting act')}, "
        f"{bounds.beside} beside others, and {wrong}."
    ]
    if not space.complete:
        sentences.append(
            f"Exploring stopped early: what follows from {pluralize(len(space.pending), 'situation')} is unknown. "
            "There may be problems that are not listed here."
        )
    for why, text in _BOUND_TEXTS.items():
        number = sum(why in reasons for reasons in space.beyond.values())
        if number:
            sentences.append(f"In {pluralize(number, 'situation')} {text}. What follows from that was not explored.")
    if stepper.moves.alike:
        merged = {name: first for name, first in stepper.moves.alike.items() if name != first}
        if merged:
            sentences.append(
                "Treated as alike, because no rule mentions them: "
                + ", ".join(f"{name} ({first})" for name, first in merged.items())
                + "."
            )
    if stepper.moves.external:
        sentences.append(
            "These events can come from outside at any moment: "
            + ", ".join(f"/{topic}" for topic in stepper.moves.external)
            + "."
        )
    return sentences


_BOUND_TEXTS = {
    "line": "one more act could wait",
    "beside": "one more act could run beside others",
    "asked": "one more failed act could wait for an answer",
    "kept": "one more event could be kept",
    "values": "a memory key could have still other values",
    "chance": "chance could have more outcomes than were tried",
}
