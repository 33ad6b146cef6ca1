"""What the running rules wait for, and its mark in the lists of acts and rules."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.author.drawing.study_keys import StudyKeys
from rise_engine.kernel.records import MemoryRecord
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import KeyBinding, Rule, Scenario, State, Transition
from rise_tui.model.control import ExpectedInputs, find_expected_inputs
from tests.tui.conftest import console
from tests.tui.fake import demo

LABLINKING = str(Path(__file__).parents[3] / "scenarios" / "lablinking")


def lablinking() -> Scenario:
    scenario = load(LABLINKING).scenario
    assert scenario is not None
    return scenario


TRUE = {"task": 4, "understood": True}
FALSE = {"task": 2, "understood": True}


@pytest.mark.parametrize(
    ("states", "memory", "acts", "rules", "events"),
    [
        ({}, TRUE, set(), set(), set()),
        ({"Main": "greeting"}, TRUE, {"Greet"}, set(), {"Greet_end"}),
        ({"Main": "waiting"}, TRUE, set(), {"Again"}, {"next", "repeat"}),
        ({"Main": "waiting"}, FALSE, set(), set(), {"next"}),  # `repeat` would be lost: its condition does not hold
        ({"Main": "waiting"}, {}, set(), set(), {"next"}),  # nor can a condition that cannot be worked out
        ({"Main": "waiting", "Again": "raise"}, TRUE, set(), set(), {"next", "repeat"}),  # it is already running
        ({"Main": "over"}, TRUE, set(), set(), set()),
        ({"Main": None}, TRUE, set(), set(), set()),
        ({"Gone": "x"}, TRUE, set(), set(), set()),
    ],
)
def test_what_is_waited_for(
    states: dict[str, str | None], memory: dict[str, Any], acts: set[str], rules: set[str], events: set[str]
) -> None:
    assert find_expected_inputs(StudyKeys(demo()), states, memory) == ExpectedInputs(
        frozenset(acts), frozenset(rules), frozenset(events)
    )


def test_the_result_of_a_rule_is_waited_for_by_starting_the_rule() -> None:
    waiting = Rule("Whole", "Wait", {"Wait": State("Wait", transitions=(Transition("Task_Done", target="Wait"),))})
    task = Rule("Task", "Doing", {"Doing": State("Doing", transitions=(Transition("next"),)), "Done": State("Done")})
    keys = {"t": KeyBinding("t", "t", "startInteractionRule", "Task")}
    study = StudyKeys(replace(demo(), rules={"Whole": waiting, "Task": task}, keys=keys))
    states: dict[str, str | None] = {"Whole": "Wait"}
    assert find_expected_inputs(study, states, {}).rules == {"Task"} and study.expected_keys(states, {}) == {"t"}
    states["Task"] = "Doing"
    assert find_expected_inputs(study, states, {}).rules == frozenset() == study.expected_keys(states, {})


def test_a_real_study_waits_for_its_wizard() -> None:
    found = find_expected_inputs(StudyKeys(lablinking()), {"Table setting": "After the welcome"}, {})
    assert found.rules == {"Next", "Repeat"} and found.events == {"next", "repeat"}


async def test_what_is_waited_for_is_marked_by_a_word() -> None:
    async with console(size=(80, 24)) as it:
        it.client.rule("Main", "started", "greeting", trigger="start")
        await it.until(lambda: "◇ expected" in it.row("acts", "Greet"))
        assert "expected" not in it.row("acts", "Praise")
        it.client.act("Greet")
        await it.until(lambda: "► running" in it.row("acts", "Greet"))  # what is so now goes before what is expected
        assert "► Greet" in it.pane("acts").title.text, "what the robot does stands above the acts"
        it.client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
        await it.until(lambda: "· ready" in it.row("rules", "Again"))
        it.client.emit(MemoryRecord(0, 0.0, "", "task", 4, 2, "wizard:anna"))
        it.client.emit(MemoryRecord(0, 0.0, "", "understood", True, False, "wizard:anna"))
        await it.until(lambda: "◇ expected" in it.row("rules", "Again"))
