"""Everything in the paper's listings loads unchanged."""

from __future__ import annotations

from pathlib import Path

from rise_engine.scenario.model import Function, If
from tests.scenario.folders import LISTINGS, SPEECH, act, loaded

NAMED_ONLY = ("R_ResponseToUser", "R_RequestInteraction", "R_Goodbye")
"""Acts that listing 2 starts and the paper does not show."""


def files() -> dict[str, str | bytes]:
    return {
        "acts/greeting.xml": (LISTINGS / "listing1.xml").read_bytes(),
        "rules/loop.xml": (LISTINGS / "listing2.xml").read_bytes(),
        "memory.json": (LISTINGS / "listing3.json").read_bytes(),
        **{f"acts/{name}.xml": act(SPEECH, name) for name in NAMED_ONLY},
    }


def test_they_load_without_a_finding(tmp_path: Path) -> None:
    result = loaded(tmp_path, files())
    assert result.diagnostics == []
    assert result.scenario is not None


def test_listing_1(tmp_path: Path) -> None:
    scenario, _ = loaded(tmp_path, files())
    greeting = scenario.acts["R_Greeting"]
    assert [(a.id, a.calls[0].type, a.wait_for) for a in greeting.actions] == [
        ("1", "Speech", ()),
        ("2", "LookAt", ("1",)),
        ("3", "Emotion", ("1",)),
        ("4", "Speech", ("3",)),
    ]
    assert greeting.channels == {"speech", "gaze", "face"}
    look = greeting.actions[1].calls[0]
    assert {name: template.text for name, template in look.parameters.items()} == {
        "pointx": "0",
        "pointy": "0",
        "pointz": "10",
        "roll": "0.5",
    }
    assert str(greeting.actions[2].location) == "acts/greeting.xml:16:3"


def test_listing_2(tmp_path: Path) -> None:
    scenario, _ = loaded(tmp_path, files())
    loop = scenario.rules["Interaction Loop"]
    assert (loop.initial, loop.priority, list(loop.states)) == (
        "State 1",
        1,
        ["State 1", "State 2", "State 3", "State 4"],
    )
    (choice,) = loop.states["State 2"].on_entry
    assert isinstance(choice, If)
    yes, no = choice.branches
    assert yes.condition is not None and yes.condition.text == "H_interaction_detected"
    assert no.condition is None
    assert [s.argument for s in yes.block if isinstance(s, Function)] == ["R_ResponseToUser"]
    assert [s.argument for s in no.block if isinstance(s, Function)] == ["/H_no_interaction"]
    assert [(t.event, t.target) for t in loop.states["State 2"].transitions] == [
        ("H_no_interaction", "State 3"),
        ("R_ResponseToUser_end", "State 4"),
    ]
    assert loop.states["State 4"].transitions == ()


def test_listing_3(tmp_path: Path) -> None:
    scenario, _ = loaded(tmp_path, files())
    assert scenario.memory == {
        "H_interaction_detected": False,
        "interaction_finished": False,
        "person_name": "Andre",
        "participant_number": 1,
    }


def test_on_every_installed_robot(tmp_path: Path) -> None:
    from rise_engine.scenario.reading.robot_profiles import robot_names

    for robot in robot_names(tmp_path):
        result = loaded(tmp_path, {**files(), "scenario.toml": f'robot = "{robot}"\non_failure = "ask"\n'})
        assert result.diagnostics == [], robot
