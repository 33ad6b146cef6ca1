"""A session that goes on with a changed scenario: what is carried over, and when it is refused (semantics.md 12.5)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from rise_engine.base.errors import RiseError
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import SetTimer, StartAction
from rise_engine.kernel.inputs import ActionReport, AnyInput, ScenarioChanged, SessionStarted, Submit, TimerElapsed
from rise_engine.kernel.records import AnyRecord, ScenarioRecord
from rise_engine.kernel.scenario_change import changes_in_words
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario

RULES = """<InteractionRule name="R" initial="A">
  <State id="A">
    <transition eventTopic="/go" target="B"/>
    <transition after="5s" target="B"/>
    <transition after="9s" while="calm" target="C"/>
    <transition cond="x = 3" target="C"/>
  </State>
  <State id="B">
    <transition eventTopic="/back" target="A"/>
  </State>
  <State id="C">
    <onEntry><function startCommunicationRobotAct="Say"/></onEntry>
    <transition eventTopic="/back" target="A"/>
  </State>
</InteractionRule>
"""
ACTS = """<Dialog name="Say">
  <Variants><actionID>1</actionID>
    <Speech><message>One.</message></Speech><Speech><message>Two.</message></Speech>
    <Speech><message>Three.</message></Speech>
  </Variants>
</Dialog>
"""


def study(folder: Path, rules: str = RULES, acts: str = ACTS, toml: str = "", memory: str = "{}") -> Scenario:
    for name, text in (
        ("scenario.toml", f'title = "S"\n{toml}'),
        ("acts/a.xml", acts),
        ("rules/r.xml", rules),
        ("memory.json", memory if memory != "{}" else '{"x": 0, "calm": true}'),
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    loaded = load(folder)
    assert loaded.scenario is not None, loaded.diagnostics
    return loaded.scenario


def task(function: str, behavior: str, t: float) -> Submit:
    return Submit(t=t, function=function, behavior=behavior, source="wizard:test")


def start(scenario: Scenario) -> tuple[Kernel, list[SetTimer]]:
    kernel = Kernel(scenario, seed=4)
    kernel.handle(SessionStarted())
    _, commands = kernel.handle(task("startInteractionRule", "R", 1.0))
    return kernel, [command for command in commands if isinstance(command, SetTimer)]


def change(kernel: Kernel, scenario: Scenario, t: float) -> list[AnyRecord]:
    was = kernel.scenario.hash
    kernel.offered = scenario
    records, _ = kernel.handle(ScenarioChanged(t=t, hash=scenario.hash, was=was, copy="scenario.2", source="wizard:a"))
    return records


def as_json(record: AnyRecord) -> dict[str, Any]:
    found: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(record))
    return {name: value for name, value in found.items() if name != "seq"}


def test_with_the_same_files_everything_goes_on_as_if_nothing_had_been(tmp_path: Path) -> None:
    scenario = study(tmp_path)
    inputs: list[AnyInput] = [
        task("assignValue", "x = 3", 2.0),
        ActionReport(t=3.0, action="", status="succeeded"),
        task("assignValue", "x = 1", 4.0),
        task("raiseEventTopic", "/back", 5.0),
        task("raiseEventTopic", '{"event": "/back", "keep": "60s"}', 6.0),
        task("assignValue", "calm = false", 7.0),
        task("stepBack", "R", 8.0),
        task("assignValue", "x = 3", 9.0),
    ]

    swapped = []

    def play(swap_at: int) -> list[dict[str, Any]]:
        kernel, _ = start(scenario)
        records: list[dict[str, Any]] = []
        goals: list[str] = []
        for number, input in enumerate(inputs):
            if number == swap_at and not kernel.why_not_take_over(scenario):
                (told,) = change(kernel, scenario, input.t)
                assert isinstance(told, ScenarioRecord) and told.changes == ("nothing that has an effect",)
                swapped.append(number)
            made, commands = kernel.handle(
                replace(input, action=goals[-1]) if isinstance(input, ActionReport) else input
            )
            records += map(as_json, made)
            goals.extend(command.action for command in commands if isinstance(command, StartAction))
        return records

    alone = play(-1)
    assert any(record.get("act") == "Say" for record in alone)
    swaps = [play(at) for at in range(len(inputs))]
    assert all(records == alone for records in swaps) and len(swapped) >= 5


def test_times_are_those_of_the_same_way_out_wherever_it_stands_now(tmp_path: Path) -> None:
    """Kept by its number, the timer of `after 5s` would take the way that stands there now."""
    kernel, timers = start(study(tmp_path / "a"))
    changed = RULES.replace(
        '<transition eventTopic="/go" target="B"/>',
        '<transition eventTopic="/new" target="C"/><transition after="70s" target="C"/>'
        '<transition eventTopic="/go" target="B"/>',
    )
    told = change(kernel, study(tmp_path / "b", changed), 2.0)
    assert isinstance(told[0], ScenarioRecord) and told[0].changes == ("rule R changed",)
    five = min(timers, key=lambda timer: timer.at)
    records, _ = kernel.handle(TimerElapsed(t=6.0, timer=five.timer))
    entered = next(record for record in map(as_json, records) if record["kind"] == "rule")
    assert (entered["state"], entered["trigger"], entered["transition"]) == ("B", "after 5s", 3)
    assert "after 70s" not in str(records)


def test_a_changed_text_is_spoken_and_the_picks_stay(tmp_path: Path) -> None:
    one, other = study(tmp_path / "a"), study(tmp_path / "b", acts=ACTS.replace("e.<", "e!<").replace("Two.", "Two!"))

    def said(swap: bool) -> list[str]:
        kernel, _ = start(one)
        texts = []
        for number in range(8):
            if number == 3 and swap:
                assert change(kernel, other, 10.0 + number)
            records, commands = kernel.handle(task("startCommunicationRobotAct", "Say", 10.0 + number))
            goal = next(command.action for command in commands if isinstance(command, StartAction))
            texts += [each["parameters"]["message"] for each in map(as_json, records) if each["kind"] == "action"]
            kernel.handle(ActionReport(t=10.5 + number, action=goal, status="succeeded"))
        return texts

    before, after = said(False), said(True)
    assert after == [text if at < 3 else text.replace(".", "!") for at, text in enumerate(before)]


@pytest.mark.parametrize(
    ("rules", "sentence"),
    [
        (RULES.replace('name="R"', 'name="Other"'), "the rule `R` is running and no longer exists; stop it first"),
        (
            RULES.replace('id="A"', 'id="Z"').replace('"A"', '"Z"'),
            "the rule `R` is in the state `A`, which no longer exists",
        ),
        (RULES.replace("5s", "6s"), "the rule `R` counts `after 5s` in the state `A`, but the files have changed this"),
        (RULES.replace('after="5s" target="B"', 'after="5s" target="C"'), "the rule `R` counts `after 5s`"),
        (RULES.replace('while="calm"', 'while="not calm"'), "the rule `R` counts `after 9s`"),
    ],
)
def test_what_a_running_rule_needs_has_to_be_there(tmp_path: Path, rules: str, sentence: str) -> None:
    kernel, _ = start(study(tmp_path / "a"))
    problems = kernel.why_not_take_over(study(tmp_path / "b", rules))
    assert any(problem.startswith(sentence) for problem in problems), problems
    seq = kernel.seq
    with pytest.raises(RiseError):
        change(kernel, study(tmp_path / "b", rules), 2.0)
    assert kernel.seq == seq and kernel.scenario.title == "S"


def test_only_while_nothing_runs_and_with_the_same_robot(tmp_path: Path) -> None:
    one, other = study(tmp_path / "a"), study(tmp_path / "b", acts=ACTS.replace("One", "Uno"))
    kernel, _ = start(one)
    assert kernel.why_not_take_over(other) == []
    robot = replace(other, robot=replace(other.robot, title="Another"))
    assert kernel.why_not_take_over(robot)[0].startswith("the robot or its profile has changed")
    kernel.handle(task("startCommunicationRobotAct", "Say", 2.0))
    assert kernel.why_not_take_over(other) == ["an act runs or waits; wait until the robot has finished"]
    kernel.handle(task("stopAll", "", 3.0))
    assert "everything is stopped; release the stop first" in kernel.why_not_take_over(other)


def test_a_value_of_the_memory_is_no_table_all_at_once(tmp_path: Path) -> None:
    kernel, _ = start(study(tmp_path / "a"))
    folder = tmp_path / "b"
    (folder / "tables").mkdir(parents=True)
    (folder / "tables/words.csv").write_text("word\na\n")
    kernel.handle(task("assignValue", "words = 3", 2.0))
    assert kernel.why_not_take_over(study(folder)) == [
        "`words` is a table now, but the memory has a value of that name; delete the value first"
    ]


def test_the_way_back_goes_only_through_states_that_are_there(tmp_path: Path) -> None:
    waits = re.sub(r"\s*<transition after=.*/>", "", RULES)
    kernel, _ = start(study(tmp_path / "c", waits))
    kernel.handle(task("raiseEventTopic", "/go", 2.0))
    kernel.handle(task("raiseEventTopic", "/back", 3.0))
    other = study(tmp_path / "d", waits.replace('id="B"', 'id="D"').replace('target="B"', 'target="D"'))
    change(kernel, other, 4.0)
    records, _ = kernel.handle(task("stepBack", "R", 5.0))
    assert as_json(records[0])["reason"] == "no state is known in which rule 'R' was before"


def test_changes_are_told_in_words(tmp_path: Path) -> None:
    one = study(tmp_path / "a")
    keys, memory = '[keys]\nn = { event = "/go" }\n', '{"x": 1, "calm": true}'
    other = study(tmp_path / "b", RULES.replace("5s", "6s"), toml=keys, memory=memory)
    assert changes_in_words(one, other) == ("rule R changed", "1 key changed", "1 start value changed")
    moved = study(tmp_path / "c", "<!-- a remark -->\n" + RULES)
    assert changes_in_words(one, moved) == ("nothing that has an effect",)
