"""The naive explorer finds what can be counted by hand, and random runs find nothing else."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import pytest

import rise_engine.kernel.rules as kernel_rules
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.scenario.model import Scenario
from tests.author.explore.naive import NaiveResult, Timers, explore_naively
from tests.author.explore.projection import difference, phase_of, project
from tests.author.explore.random_runs import random_run
from tests.author.explore.random_studies import RandomStudy, random_study
from tests.author.explore.restoring import restoring_anew
from tests.author.explore.world import SOURCE, World, external_topics, presses
from tests.chance import examples
from tests.kernel.harness import dialog, gaze, pause, read, speech, write


def study(folder: Path, rules: str = "", acts: str = "", keys: str = "", more: str = "", **memory: Any) -> Scenario:
    """A study on Floka; its first key `a` starts the rule R."""
    begin = 'a = { rule = "R" }\n' if 'name="R"' in rules else ""
    toml = f'robot = "floka"\n{more}\n[keys]\n{begin}{keys}'
    return read(write(folder, acts=acts, rules=rules, memory=memory, toml=toml))


def rule(name: str, *states: str) -> str:
    """A rule that begins in s0; each state is the inside of its element."""
    inside = "".join(f'<State id="s{number}">{state}</State>' for number, state in enumerate(states))
    return f'<InteractionRule name="{name}" initial="s0">{inside}</InteractionRule>'


def states(result: NaiveResult, name: str = "R") -> set[str]:
    return {rule.state for each in result.states for rule in each.rules if rule.name == name}


FORTH = '<transition eventTopic="/e" target="s1"/>'
BACK = '<transition eventTopic="/e" target="s0"/>'


# --- keys and events ---


def test_a_rule_that_goes_forth_and_back(tmp_path: Path) -> None:
    found = explore_naively(study(tmp_path, rule("R", FORTH, BACK), keys='e = { event = "/e" }'))
    assert (found.complete, found.situations, len(found.states), found.steps) == (True, 3, 3, 1 + 3 * 2)


def test_events_that_nobody_in_the_study_raises_come_from_outside(tmp_path: Path) -> None:
    scenario = study(tmp_path, rule("R", FORTH, BACK))
    assert external_topics(scenario) == {"e"}
    assert states(explore_naively(scenario)) == {"s0", "s1"}
    assert states(explore_naively(scenario, world=World(nodes=False))) == {"s0"}


def test_keys_that_start_acts_can_be_left_out(tmp_path: Path) -> None:
    scenario = study(tmp_path, rule("R", FORTH, BACK), dialog("A", speech(1)), 'x = { act = "A" }\n')
    names = [each.behavior for each in presses(scenario, World())]
    assert names == ["R", "A", "/e"]
    assert [each.behavior for each in presses(scenario, World(by_hand=False))] == ["R", "/e"]


def test_a_value_that_somebody_types(tmp_path: Path) -> None:
    scenario = study(tmp_path, rule("R", '<transition cond="task = 2" target="s1"/>', BACK), task=0)
    typed = Submit(function="assignValue", behavior="task = 2", source=SOURCE)
    assert states(explore_naively(scenario, keys=["task"])) == {"s0"}
    assert states(explore_naively(scenario, keys=["task"], world=World(more=(typed,)))) == {"s0", "s1"}


def test_memory_that_does_not_count_makes_no_situations(tmp_path: Path) -> None:
    count = '<transition eventTopic="/e"><function assignValue="n = n + 1"/></transition>'
    scenario = study(tmp_path, rule("R", count), n=0)
    assert explore_naively(scenario).situations == 2
    assert not explore_naively(scenario, keys=["n"], max_states=50).complete


def test_an_event_that_is_kept(tmp_path: Path) -> None:
    keys = 'e = { event = "/e", keep = "2s" }\nf = { event = "/f" }'
    first = '<transition eventTopic="/f" target="s1"/>'
    found = explore_naively(study(tmp_path, rule("R", first, FORTH.replace("s1", "s2"), ""), keys=keys))
    # Without the rule, in s0 and in s2 (where it ends): kept or not; in s1 it is taken at once.
    assert {each.kept for each in found.states} == {(), ("e",)}
    assert {each.kept for each in found.states if any(rule.state == "s1" for rule in each.rules)} == {()}


# --- acts ---

ACT = 'x = { act = "A" }\n'


@pytest.mark.parametrize(
    ("actions", "faults", "situations", "idle", "phases"),
    [
        ([speech(1), gaze(2, "1")], 0, 3, 1, {"running"}),
        ([speech(1), gaze(2, "1")], 1, 3 + 3, 2, {"running"}),
        ([speech(1), gaze(2)], 0, 4, 1, {"running"}),
        # With the failure still to come 4, after it 4, and in between either is the one that is stopped.
        ([speech(1), gaze(2)], 1, 4 + 4 + 2, 2, {"running", "failing"}),
        ([pause(1, 500)], 1, 2, 1, {"running"}),
        ([pause(1, 0)], 1, 1, 1, set()),
    ],
)
def test_acts_are_played_action_by_action(
    tmp_path: Path, actions: list[str], faults: int, situations: int, idle: int, phases: set[str]
) -> None:
    scenario = study(tmp_path, acts=dialog("A", *actions), keys=ACT)
    found = explore_naively(scenario, world=World(line=0, faults=faults))
    assert (found.complete, found.situations) == (True, situations)
    assert {run.phase for each in found.states for run in each.running} == phases
    assert found.beyond == situations - idle, "once more while it runs is not followed"


def test_an_act_that_is_cut_off_is_being_cancelled_until_the_robot_says_so(tmp_path: Path) -> None:
    acts = dialog("A", speech(1)) + dialog("B", speech(1))
    keys = 'x = { act = "A" }\ny = { act = "B" }\n'
    scenario = study(tmp_path, acts=acts, keys=keys, more='[act.A]\ncalling_type = "None"')
    found = explore_naively(scenario, world=World(line=1, beside=1))
    cut = {each for each in found.states if ("A", "None", "canceling") in each.running}
    assert cut and all(each.waiting == (("B", "Blocking"),) for each in cut)


def test_an_act_that_lacks_a_value_fails_without_a_fault(tmp_path: Path) -> None:
    found = explore_naively(study(tmp_path, acts=dialog("A", speech(1, "Hello {who}")), keys=ACT, who=None))
    assert found.situations == 1 and len(found.own_failures) == 1


def test_a_failure_that_is_asked_about(tmp_path: Path) -> None:
    way = '<transition ended="A" outcome="failed" target="s1"/>'
    start = '<onEntry><function startCommunicationRobotAct="A"/></onEntry>'
    scenario = study(tmp_path, rule("R", start + way, ""), dialog("A", speech(1)), more='on_failure = "ask"')
    found = explore_naively(scenario, world=World(faults=1))
    asked = [each for each in found.states if each.asked]
    assert [each.asked for each in asked] == [(("A", 1, ""),)]
    assert not [each for each in explore_naively(scenario, world=World(faults=0)).states if each.asked]
    assert len({each for each in found.states if each.running}) == 1, "a repetition looks like the first attempt"


# --- time ---

TWO = '<transition after="{}" target="s1"/><transition after="{}" target="s2"/>'


@pytest.mark.parametrize(
    ("first", "second", "reached"),
    [("1s", "2s", {"s1"}), ("1s", "1s", {"s1"}), ("2s", "1s", {"s1", "s2"})],
    ids=["shorter", "as long", "longer"],
)
def test_timers_in_their_order(tmp_path: Path, first: str, second: str, reached: set[str]) -> None:
    stay = '<transition eventTopic="/e" target="s0"/>'
    scenario = study(tmp_path, rule("R", TWO.format(first, second), stay, stay))
    assert states(explore_naively(scenario, timers="any")) == {"s0", "s1", "s2"}
    assert states(explore_naively(scenario, timers="order")) == {"s0", *reached}


def test_time_that_counts_while_something_holds(tmp_path: Path) -> None:
    way = '<transition while="near" after="2s" target="s1"/>'
    keys = 'n = { set = "near = true" }\nf = { set = "near = false" }'
    found = explore_naively(study(tmp_path, rule("R", way, ""), keys=keys, near=False), keys=["near"])
    timers = {(each.memory[0][1], each.rules[0].timers) for each in found.states if each.rules}
    assert timers == {("false", ()), ("true", (0,))}


# --- chance ---


def test_all_that_chance_can_give_is_tried(tmp_path: Path) -> None:
    one_of = "".join(f'<function assignValue="n = {n}"/>' for n in range(4))
    throw = f'<transition eventTopic="/e"><oneOf>{one_of}</oneOf></transition>'
    luck = '<transition eventTopic="/f" cond="rand(1) &gt; 0.9" target="s1"/>'
    found = explore_naively(study(tmp_path, rule("R", throw + luck, BACK), n=0), keys=["n"])
    assert found.complete and states(found) == {"s0", "s1"}
    assert {each.memory[0][1] for each in found.states} == {"0", "1", "2", "3"}


# --- the robot and the stop ---


def test_everything_can_be_stopped_and_goes_on(tmp_path: Path) -> None:
    scenario = study(tmp_path, rule("R", FORTH, BACK))
    found = explore_naively(scenario, world=World(stop=True, faults=1))
    stopped_rules = {(each.stop, each.stopped_rules) for each in found.states}
    # Nothing, s0 or s1: as they are, being stopped, and stopped.
    assert stopped_rules == {("released", ())} | {
        (status, rules) for status in ("requested", "latched") for rules in ((), (("R", "s0"),), (("R", "s1"),))
    }
    assert len(found.states) == 3 + 6


def test_a_robot_that_is_lost_fails_its_acts(tmp_path: Path) -> None:
    ways = '<transition eventTopic="/A_failed" target="s1"/>'
    scenario = study(tmp_path, rule("R", ways, ""), dialog("A", speech(1)), ACT)
    assert states(explore_naively(scenario, world=World(robot=True))) == {"s0"}
    found = explore_naively(scenario, world=World(robot=True, faults=1))
    assert {each.robot_lost for each in found.states} == {True, False} and not found.own_failures
    assert not {each for each in found.states if each.robot_lost and each.running}


def test_the_cue(tmp_path: Path) -> None:
    scenario = study(tmp_path, rule("R", FORTH.replace("/e", "/cue"), BACK.replace("/e", "/cue_undone")))
    assert states(explore_naively(scenario)) == {"s0"}
    found = explore_naively(scenario, world=World(cues=True))
    assert states(found) == {"s0", "s1"} and {each.cue_open for each in found.states} == {True, False}


# --- projections ---


def test_an_act_that_is_one_thing_is_projected_too() -> None:
    study = random_study(3)
    kernel = Kernel(study.scenario, 1)
    kernel.handle(SessionStarted())
    task = SimpleNamespace(function="startCommunicationRobotAct", behavior="A0", calling_type="None")
    whole: Any = SimpleNamespace(task=task, cancel_reason=None, failure="x")
    kernel.scheduler.runner.runs = {1: whole}
    seen = project(kernel, study.keys)
    assert seen.running == (("A0", "None", "failing"),)
    assert [key for key, _ in seen.memory] == sorted(study.keys)
    whole.cancel_reason = "y"
    assert phase_of(whole) == "canceling"
    assert difference({seen}, {seen}) == "" and "only in the first (1)" in difference({seen}, set())


# --- random studies and runs ---

SEEDS = range(examples(20))


def explored(seed: int, **more: Any) -> tuple[RandomStudy, World, NaiveResult]:
    study = random_study(seed)
    world = World(line=1, beside=1, faults=1, cues=study.has_cue, robot=seed % 3 == 0, stop=seed % 5 == 0)
    with patch.multiple(kernel_rules, STEP_LIMIT=60, MAX_VAIN_SEARCHES=5):
        timers: Timers = "order" if seed % 2 else "any"
        return study, world, explore_naively(study.scenario, keys=study.keys, timers=timers, world=world, **more)


@pytest.mark.slow
def test_random_studies_are_neither_all_small_nor_all_large() -> None:
    sizes = [explored(seed, max_states=60)[2] for seed in range(16)]
    assert sum(size.complete for size in sizes) > 3 and sum(not size.complete for size in sizes) > 3


@pytest.mark.slow
def test_random_runs_find_nothing_that_exploring_does_not() -> None:
    """Of those that are small enough."""
    looked_at = 0
    for seed in SEEDS:
        study, world, found = explored(seed, max_states=300)
        if not found.complete:
            continue
        looked_at += 1
        with patch.multiple(kernel_rules, STEP_LIMIT=60, MAX_VAIN_SEARCHES=5):
            runs = (random_run(study.scenario, number, 60, world=world) for number in range(4))
            seen = {project(kernel, study.keys) for run in runs for kernel in run}
        assert seen <= found.states, f"study {seed}: {difference(seen, found.states)}"
    assert looked_at > len(SEEDS) / 2


@pytest.mark.slow
def test_a_kernel_that_is_emptied_is_as_good_as_a_new_one() -> None:
    for seed in SEEDS:
        _, _, one = explored(seed, max_states=60)
        _, _, other = explored(seed, max_states=60, restoring=restoring_anew)
        assert (one.states, one.steps, one.situations) == (other.states, other.steps, other.situations), seed


def test_a_random_run_is_made_by_its_seed_and_keeps_the_bounds() -> None:
    study = random_study(7)
    world = World(line=1, beside=1)
    first, second = (
        [project(kernel, study.keys) for kernel in random_run(study.scenario, 5, 80, world=world)] for _ in range(2)
    )
    assert first == second and len(first) > 1
    assert all(len(each.waiting) <= 1 for each in first)
