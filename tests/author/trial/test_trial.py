"""A study that is tried out: what the engine would do, one step back, why, and what each way out waits for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.author.trial.trial import LONGEST, Trial
from rise_engine.author.trial.trial_history import history_lines, step_lines
from rise_engine.author.trial.trial_state import (
    events_to_raise,
    key_choices,
    relevant_memory,
    running_acts,
    running_rules,
)
from rise_engine.base.json_codec import decode
from rise_engine.cli.session.headless_session import RunOptions, run_session
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.task_file import read_task_file
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import KeyBinding, Scenario
from rise_engine.session.journal_format import encode_record
from tests.author.trial.task_files import task_file_text
from tests.sources import ROOT

RULES = """<InteractionRule name="Guide" initial="Waiting">
  <State id="Waiting">
    <transition eventTopic="/go" cond="ready and tries &lt; 3" target="Talking"/>
    <transition after="8s" target="Bored"/>
  </State>
  <State id="Talking">
    <onEntry>
      <function startCommunicationRobotAct="R_Hello"/>
      <function assignValue="tries = tries + 1"/>
    </onEntry>
    <transition eventTopic="/R_Hello_end" target="Waiting"/>
  </State>
  <State id="Bored">
    <transition after="1s" while="not ready" target="Waiting"/>
    <transition cond="tries = 9" target="Done"/>
  </State>
  <State id="Done"/>
</InteractionRule>
"""
ACTS = """<Dialog name="R_Hello">
  <Speech><actionID>1</actionID><message>Hello there, {name}!</message></Speech>
</Dialog>
"""
TOML = """title = "Guide"
robot = "pepper"
[keys]
t = { rule = "Guide" }
g = { event = "/go" }
y = { set = "ready = true" }
"""


def make_guide(folder: Path, rules: str = RULES, memory: str = '{"ready": false, "tries": 0, "name": "Ada"}') -> Path:
    for name, text in (
        ("scenario.toml", TOML),
        ("acts/acts.xml", ACTS),
        ("rules/rules.xml", rules),
        ("memory.json", memory),
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    return folder


def loaded_scenario(folder: Path) -> Scenario:
    loaded = load(folder)
    assert loaded.scenario is not None, loaded.diagnostics
    return loaded.scenario


@pytest.fixture(scope="session")
def guide(tmp_path_factory: pytest.TempPathFactory) -> Scenario:
    return loaded_scenario(make_guide(tmp_path_factory.mktemp("guide")))


@pytest.fixture(scope="session")
def lablinking() -> Scenario:
    return loaded_scenario(ROOT / "scenarios/lablinking")


def key(scenario: Scenario, label: str) -> KeyBinding:
    return next(each for each in scenario.keys.values() if each.label == label)


def test_time_goes_on_until_the_robot_has_done_what_it_does(lablinking: Scenario) -> None:
    trial = Trial(lablinking)
    trial.press(key(lablinking, "t"))
    was_busy, began = trial.is_busy, trial.now
    step = trial.go_on()
    assert was_busy and began == 0 and step is not None and not trial.is_busy and 15 < step.at < 25
    assert [rule.state for rule in running_rules(trial)] == ["After the welcome"]
    assert trial.go_on() is None
    assert trial.problem == "nothing happens by itself any more: it waits for you" and len(trial.steps) == 2


def test_what_is_done_comes_after_what_has_happened(lablinking: Scenario) -> None:
    trial = Trial(lablinking)
    first = trial.press(key(lablinking, "t"))
    second = trial.press(key(lablinking, "n"))
    trial.go_on()
    third = trial.press(key(lablinking, "n"))
    assert (first.at, second.at) == (0.0, 0.1) and third.at > trial.steps[2].at
    trial.pass_time(2.5)
    assert trial.now == third.at + 2.5


Doing = Callable[[Trial], object]
DOINGS: list[Doing] = [
    lambda trial: trial.press(key(trial.scenario, "t")),
    lambda trial: trial.press(key(trial.scenario, "g")),
    lambda trial: trial.press(key(trial.scenario, "y")),
    lambda trial: trial.go_on(),
    lambda trial: trial.pass_time(0.7),
    lambda trial: trial.pass_time(8),
    lambda trial: trial.set_value("tries = 9"),
    lambda trial: trial.set_value("no ( value"),
    lambda trial: trial.raise_event("go"),
    lambda trial: trial.start_act("R_Hello"),
    lambda trial: trial.start_rule("Guide", "Bored"),
    lambda trial: trial.mark_cue(),
]


@given(doings=st.lists(st.sampled_from(DOINGS), max_size=12), seed=st.integers(0, 5))
def test_a_step_back_is_as_if_it_had_not_been_done(guide: Scenario, doings: list[Doing], seed: int) -> None:
    trial = Trial(guide, seed=seed)
    before = []
    for do in doings:
        state = ([encode_record(record) for record in trial.records], trial.now, list(trial.steps))
        steps = len(trial.steps)
        do(trial)
        if len(trial.steps) > steps:
            before.append(state)
    for state in reversed(before):
        assert trial.back()
        assert ([encode_record(record) for record in trial.records], trial.now, list(trial.steps)) == state
    assert not trial.back()


def test_the_records_are_those_of_a_run_in_virtual_time(
    lablinking: Scenario, capsys: pytest.CaptureFixture[str]
) -> None:
    trial = Trial(lablinking, seed=7)
    trial.press(key(lablinking, "t"))
    trial.go_on()
    for label in ("n", "p", "n"):
        trial.press(key(lablinking, label))
        trial.pass_time(1.3)
        trial.go_on()
    trial.set_value("step = 2")
    script = read_task_file(task_file_text(trial).encode(), "kept.jsonl").tasks
    session = SessionOptions(lablinking.folder, seed=7)
    options = RunOptions(trial.scenario, session, script, virtual=True, json=True, until=trial.now + 0.01)
    assert run_session(options) == 0
    ran = [decode(line) for line in capsys.readouterr().out.splitlines()]
    own = [decode(encode_record(record).decode()) for record in trial.records]
    assert ran[: len(own)] == own and len(own) > 100


def test_where_the_robot_never_rests_time_goes_on_until_it_begins_something_again(tmp_path: Path) -> None:
    rules = RULES.replace('eventTopic="/R_Hello_end" target="Waiting"', 'eventTopic="/R_Hello_end" target="Talking"')
    scenario = loaded_scenario(make_guide(tmp_path, rules))
    trial = Trial(scenario)
    trial.start_rule("Guide", "Talking")
    trial.go_on()
    assert not trial.problem and trial.is_busy and trial.memory["tries"] == 2
    trial.go_on()
    assert trial.memory["tries"] == 3


def test_what_takes_for_ever_is_not_waited_for(tmp_path: Path) -> None:
    scenario = loaded_scenario(make_guide(tmp_path, RULES.replace("8s", "20min")))
    trial = Trial(scenario)
    trial.press(key(scenario, "t"))
    trial.go_on()
    assert trial.problem == "after 10 minutes something still goes on by itself" and trial.now <= LONGEST
    assert trial.back() and trial.problem == ""


def test_what_happened_and_why(guide: Scenario) -> None:
    trial = Trial(guide)
    trial.press(key(guide, "t"))
    trial.press(key(guide, "g"))
    assert [(line.key, line.kind, line.text) for line in history_lines(trial)] == [
        ("t", "done", "starts rule Guide"),
        ("", "state", "Guide: in Waiting"),
        ("g", "condition", "ready and tries < 3: false in Guide (ready is false, tries is 0)"),
        ("", "event", "/go: no rule waits for it"),
    ]
    trial.press(key(guide, "y"))
    trial.raise_event("go")
    assert [line.text for line in step_lines(trial, -1)] == [
        "ready and tries < 3: true in Guide (ready is true, tries is 0)",
        "/go: Guide takes it",
        "Guide: Waiting → Talking on /go",
        "starts R_Hello",
        "says “Hello there, Ada!”",
        "tries = 1 (was 0)",
    ]


def test_the_ways_out_say_what_each_waits_for_and_its_reading_now(guide: Scenario) -> None:
    trial = Trial(guide)
    trial.press(key(guide, "t"))
    trial.pass_time(2)
    (rule,) = running_rules(trial)
    go, bored = rule.transitions
    assert (rule.state, go.waits_for, go.now, go.target, go.event) == (
        "Waiting",
        "event go",
        "not now",
        "Talking",
        "go",
    )
    (reading,) = go.readings
    assert reading.joint == "and" and not reading.holds
    assert [(part.text, part.values, part.holds) for part in reading.parts] == [
        ("ready", "ready is false", False),
        ("tries < 3", "tries is 0", True),
    ]
    assert (bored.waits_for, bored.now) == ("8 s to pass", "6 s left")
    trial.set_value("ready = true")
    trial.press(key(guide, "g"))
    (rule,) = running_rules(trial)
    (act,) = running_acts(trial)
    assert (act.act, act.says, act.waits) == ("R_Hello", "Hello there, Ada!", False) and act.expected > 0.5
    assert rule.transitions[0].now == f"0.0 of {act.expected:.1f} s" and rule.transitions[0].event == ""


def test_a_held_condition_and_an_event_without_a_key(guide: Scenario) -> None:
    trial = Trial(guide)
    trial.start_rule("Guide", "Bored")
    held, done = running_rules(trial)[0].transitions
    assert held.now == "1 s left" and held.readings[0].word == "while" and done.label == "tries = 9"
    trial.set_value("ready = true")
    assert running_rules(trial)[0].transitions[0].now == "held up: ready is true"
    assert events_to_raise(trial) == []  # `go` has a key


def test_keys_say_what_they_would_do_and_the_awaited_come_first(guide: Scenario) -> None:
    trial = Trial(guide)
    told = {choice.key.label: (choice.does, choice.now) for choice in key_choices(trial)}
    assert told == {"t": ("rule Guide", ""), "g": ("/go", "no rule waits for it now"), "y": ("ready = true", "")}
    trial.press(key(guide, "t"))
    trial.press(key(guide, "y"))
    choices = key_choices(trial)
    assert choices[0].key.label == "g" and choices[0].is_awaited and choices[0].now == "Guide takes it"
    assert choices[1].now == "runs already"


def test_the_memory_that_counts_is_what_the_state_reads_or_sets(guide: Scenario) -> None:
    trial = Trial(guide)
    trial.start_rule("Guide", "Talking")
    lines = {line.key: (line.value, line.source) for line in relevant_memory(trial, "Guide")}
    assert lines == {"name": ("Ada", "start value"), "tries": (1, "rule Guide")}
    trial.set_value("name = 'Bea'")
    assert relevant_memory(trial, "Guide")[0].source == "you"


def test_a_condition_of_the_study_and_values_of_ones_own(lablinking: Scenario) -> None:
    name, condition = next((name, each) for name, each in lablinking.conditions.items() if each.memory)
    trial = Trial(lablinking, condition=name, memory={"task": 3})
    assert trial.memory["task"] == 3
    assert all(trial.memory[key] == value for key, value in condition.memory.items() if key != "task")
    with pytest.raises(ValueError, match="no condition"):
        Trial(lablinking, condition="nonsense")
