"""The robot profiles that are shipped: each of their actions becomes a message that fits its type."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rise_adapters import robots
from rise_adapters.ros2.mapping import ActionMapping, read_mappings
from rise_adapters.ros2.mapping.field_types import parse_field_type
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.model import ActionSpec, Parameter, RobotProfile, SourceLocation
from rise_engine.scenario.parameters import accepts_any_name, listed_names
from rise_engine.scenario.reading.action_declarations import core_actions
from rise_engine.scenario.reading.robot_profiles import read_robot
from tests.ros.layouts import LAYOUTS

FOLDER = Path(robots.__file__).parent
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
ON_ROS = [name for name in NAMES if name != "generic"]
TYPES = InterfaceCatalog(environment={})
WRAPPER = Path(__file__).parents[2] / "adapters" / "rise_ros" / "rise_ros" / "robot_wrapper.py"
DURATION = {"sec": 1, "nanosec": 500_000_000}


def profile(name: str) -> RobotProfile:
    findings = Diagnostics()
    read = read_robot(name, FileReader(Path("/nowhere"), findings), SourceLocation("x"))
    assert findings.sorted() == []
    return read


PROFILES = {name: profile(name) for name in NAMES}


def mappings(name: str) -> dict[str, ActionMapping]:
    return read_mappings(PROFILES[name], TYPES.fields)


def message(name: str, action: str, parameters: dict[str, Any]) -> Any:
    return mappings(name)[action].make_message(parameters, node="/rise/engine", goal="4/1", frame="base_link")


def sent_type(carrier: ActionMapping) -> str:
    return f"{carrier.type}_Goal" if carrier.kind == "action" else carrier.type


@pytest.mark.parametrize("action", [name for name, spec in core_actions().items() if not spec.engine])
def test_each_action_of_a_robot_is_in_the_generic_profile_in_that_of_rise_and_in_the_wrapper(action: str) -> None:
    assert PROFILES["generic"].actions[action].supported
    assert action in mappings("rise")
    assert f": {action},\n" in WRAPPER.read_text("utf-8")


def test_what_is_shipped() -> None:
    assert NAMES == ["floka", "generic", "nao", "pepper", "rise", "ros4hri"]
    assert {name: each.driver for name, each in PROFILES.items()} == {
        **dict.fromkeys(ON_ROS, "ros2"),
        "generic": "simulated",
    }


@pytest.mark.parametrize("name", sorted(LAYOUTS))
def test_types_are_as_they_were_when_the_profiles_were_written(name: str) -> None:
    known = {field: str(parse_field_type(type)) for field, type in TYPES.fields(name).items()}
    assert known == {field: str(parse_field_type(type)) for field, type in LAYOUTS[name].items()}


@pytest.mark.parametrize("name", ON_ROS)
def test_every_action_of_the_robot_has_its_carrier(name: str) -> None:
    able = [each for each in PROFILES[name].actions.values() if each.supported and not each.engine]
    assert set(mappings(name)) == {each.name for each in able if each.substitute is None}


@pytest.mark.parametrize("name", ["floka", "nao", "pepper"])
def test_a_robot_with_a_wrapper_differs_from_rise_only_by_name(name: str) -> None:
    standard = mappings("rise")
    for action, carrier in mappings(name).items():
        if action in standard:
            assert (carrier.name, carrier.type) == (
                standard[action].name.replace("rise/robot", name),
                standard[action].type,
            )
            assert carrier.unused_parameters == standard[action].unused_parameters == ()


# --- all parameters -------------------------------------------------------------------------------------------------


def values(parameter: Parameter) -> st.SearchStrategy[Any]:
    """What an author can give, as an action gets it."""
    low = parameter.minimum if parameter.minimum is not None else -1e6
    high = min(parameter.maximum if parameter.maximum is not None else 1e6, 86_400_000)
    match parameter.type:
        case "text":
            return st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=50)
        case "number":
            return st.floats(low, high) | st.integers(math.ceil(low), math.floor(high))
        case "integer":
            return st.integers(math.ceil(low), math.floor(high))
        case "boolean":
            return st.booleans()
        case "name":
            names = [*listed_names(parameter), *parameter.codes.values()]
            return st.sampled_from([*names, "something_else"] if accepts_any_name(parameter) else names)


def authored(spec: ActionSpec) -> st.SearchStrategy[dict[str, Any]]:
    given_always = {each.name: values(each) for each in spec.parameters.values() if each.required}
    given_maybe = {each.name: values(each) for each in spec.parameters.values() if not each.required}
    return st.fixed_dictionaries(given_always, optional=given_maybe)


def contains(whole: Any, part: Any) -> bool:
    """Whether a message that arrives is one that was sent: complete, and the same in what was given."""
    if isinstance(part, dict):
        return all(contains(whole[name], value) for name, value in part.items())
    return bool(whole == (pytest.approx(part, rel=1e-6, abs=1e-37) if isinstance(part, float) else part))


ACTIONS = [(robot, action) for robot in ON_ROS for action in read_mappings(PROFILES[robot])]


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "action"), ACTIONS)
def test_whatever_an_author_gives_becomes_a_message_of_the_type(robot: str, action: str) -> None:
    carrier = mappings(robot)[action]
    type = sent_type(carrier)
    codec = TYPES.codec(type)

    @given(authored(PROFILES[robot].actions[action]))
    def check(parameters: dict[str, Any]) -> None:
        made = carrier.make_message(parameters, node="/rise/engine", goal="4/1", frame="base_link")
        codec.pack(made)  # raises when it does not fit
        assert contains(codec.unpack(codec.pack(made)), made)

    check()


# --- what it means --------------------------------------------------------------------------------------------------

POINT = {"pointx": 1.5, "pointy": 0, "pointz": 1}
TARGET = {"header": {"frame_id": "base_link"}, "point": {"x": 1.5, "y": 0.0, "z": 1.0}}
META: dict[str, Any] = {"caller": "/rise/engine", "priority": 150}


def face(expression: str) -> dict[str, Any]:
    return {"expression": expression, "confidence": 1.0}


@pytest.mark.parametrize(
    ("action", "parameters", "goal"),
    [
        ("Speech", {"message": "Hi"}, {"message": "Hi", "rate": 1.0, "volume": 1.0}),
        (
            "Speech",
            {"message": "Hi", "language": "de-DE", "voice": "Anna", "rate": 0.8, "volume": 0},
            {"message": "Hi", "language": "de-DE", "voice": "Anna", "rate": 0.8, "volume": 0.001},
        ),
        ("LookAt", POINT, {"target": TARGET, "roll": 0.0}),
        (
            "LookAt",
            {**POINT, "frame": "map", "roll": 0.2, "duration": 1500},
            {"target": {**TARGET, "header": {"frame_id": "map"}}, "roll": 0.2, "duration": DURATION},
        ),
        ("Emotion", {"value": "fear"}, {"value": 5}),
        ("Emotion", {"value": 5, "duration": 1500}, {"value": 5, "duration": DURATION}),
        ("Animation", {"value": 1}, {"name": "head_nod", "repetitions": 1, "scale": 1.0}),
        (
            "Animation",
            {"value": "wave", "repetitions": 2, "duration": 1500, "scale": 0.5},
            {"name": "wave", "repetitions": 2, "duration": DURATION, "scale": 0.5},
        ),
        ("SocialExpression", {"value": "wink", "duration": 1500}, {"name": "wink", "duration": DURATION}),
        ("PointAt", POINT, {"target": TARGET, "hand": "auto"}),
        (
            "PointAt",
            {**POINT, "hand": "left", "duration": 1500},
            {"target": TARGET, "hand": "left", "duration": DURATION},
        ),
    ],
)
def test_rise(action: str, parameters: dict[str, Any], goal: dict[str, Any]) -> None:
    assert message("rise", action, parameters) == goal


@pytest.mark.parametrize(
    ("action", "parameters", "goal"),
    [
        ("Speech", {"message": "Hi", "rate": 2}, {"meta": META, "input": "Hi"}),
        ("LookAt", {**POINT, "roll": 1}, {"meta": META, "target": TARGET}),
        ("LookAt", {**POINT, "policy": "glance"}, {"meta": META, "policy": "glance", "target": TARGET}),
        ("Gaze", {"value": "social"}, {"meta": META, "policy": "social"}),
        ("Emotion", {"value": 5}, {"meta": META, "expression": face("scared")}),
        ("Emotion", {"value": "happy"}, {"meta": META, "expression": face("happy")}),
        ("SocialExpression", {"value": "bored"}, {"meta": META, "expression": face("bored")}),
        ("Animation", {"value": 1, "repetitions": 3}, {"meta": META, "name": "head_nod", "unsafe": False}),
    ],
)
def test_ros4hri(action: str, parameters: dict[str, Any], goal: dict[str, Any]) -> None:
    assert message("ros4hri", action, parameters) == goal


def test_ros4hri_ends_an_expression_with_a_neutral_face_and_believes_the_result() -> None:
    read = mappings("ros4hri")
    for action in ("Emotion", "SocialExpression"):
        assert read[action].make_reset(node="/rise/engine") == message("ros4hri", "Emotion", {"value": "neutral"})
    result = {"result": {"error_code": 134, "error_msg": ""}}
    assert read["Speech"].result_rule.failure(result) == "the robot cannot do this (error code 134)"
    assert read["Animation"].result_rule.failure({"result": {"error_code": 0, "error_msg": ""}}) == ""
    assert 0 < META["priority"] <= 200  # above, it is for critical system functions


def test_ros4hri_says_what_does_not_reach_the_robot() -> None:
    text = (FOLDER / "ros4hri.toml").read_text(encoding="utf-8")
    told = {
        line.split()[1]: set(re.split(r",? +", line.split(maxsplit=2)[2].split("   ")[0]))
        for line in text.splitlines()
        if re.match(r"#   (Speech|LookAt|Animation) ", line)
    }
    left_out = {
        action: set(carrier.unused_parameters)
        for action, carrier in mappings("ros4hri").items()
        if carrier.unused_parameters
    }
    assert told == left_out


def test_pepper_shows_on_its_tablet_what_is_given_as_one_text() -> None:
    assert message("pepper", "ShowOnTablet", {}) == {"data": "{}"}
    shown = message("pepper", "ShowOnTablet", {"text": 'Say "hello"', "image": "a.png"})
    assert json.loads(shown["data"]) == {"text": 'Say "hello"', "image": "a.png"}
