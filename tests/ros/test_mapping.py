"""Carriers: from what a profile says to the message of a goal, and every mistake in it found."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from rise_adapters.ros2.mapping import (
    ActionMapping,
    GoalDeadlines,
    action_mapping,
    mapping_findings,
    mapping_problems,
    read_mappings,
    read_options,
    with_all_carriers,
)
from rise_adapters.ros2.transport.port import PortError

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.model import RobotProfile, SourceLocation
from rise_engine.scenario.reading.action_declarations import core_actions
from rise_engine.scenario.reading.robot_profiles import read_robot
from tests.ros.layouts import LAYOUTS, looked_up

ACTION = """
[actions.Do]
parameters.text = { type = "text" }
parameters.number = { type = "number" }
parameters.whole = { type = "integer" }
parameters.yes = { type = "boolean" }
parameters.mood = { type = "name", codes = { calm = 0, glad = 7, wild = 300 } }
parameters.side = { type = "name", names = ["left", "right"] }
parameters.any = { type = "name" }
parameters.ms = { type = "number", unit = "ms" }
parameters.s = { type = "number", unit = "s" }
parameters.angle = { type = "number", unit = "rad" }
parameters.degrees = { type = "number", unit = "deg" }
parameters.way = { type = "number", unit = "m" }
parameters.speed = { type = "number", unit = "m/s" }
parameters.loud = { type = "number", default = 0.5 }
parameters.seven = { type = "integer", default = 7 }
parameters.place = { type = "name", place = true, default = "table" }
parameters.odd = { type = "name", codes = { calm = 0 }, default = "wild" }
"""
"""A robot's only action, with a parameter of every kind; its carrier follows."""
PLACES = """
[places]
table = { x = 1.5, y = -2, yaw = 3.141592653589793, frame = "lab" }
door = { x = 0.5, y = 1, yaw = 0 }
"""
NOW = 1_795_460_000_250_000_000

TEST = {
    "test/action/Do_Goal": {
        "text": "string",
        "short": "string<=5",
        "wide": "wstring",
        "small": "uint8",
        "signed": "int8",
        "octet": "byte",
        "large": "uint64",
        "real": "float64",
        "single": "float32",
        "flag": "bool",
        "time": "builtin_interfaces/Duration",
        "point": "geometry_msgs/msg/Point",
        "texts": "string[]",
        "three": "float64[3]",
        "few": "int16[<=2]",
        "blob": "uint8[]",
        "points": "geometry_msgs/msg/Point[]",
        "hole": "nowhere_msgs/msg/Nothing",
        "stamp": "builtin_interfaces/msg/Time",
        "turn": "geometry_msgs/msg/Quaternion",
        "pose": "geometry_msgs/msg/PoseStamped",
    },
    "test/action/Do_Feedback": {},
    "test/action/Do_Result": {
        "code": "int32",
        "success": "bool",
        "text": "string",
        "inner": "test/msg/Inner",
        "rate": "float32",
    },
    "test/msg/Inner": {"code": "uint8", "words": "string", "many": "int32[]"},
    "test/msg/Do": {"text": "string", "small": "uint8"},
    "test/srv/Ask_Request": {"text": "string"},
    "test/srv/Ask_Response": {"code": "int32"},
    "geometry_msgs/msg/Quaternion": {"x": "float64", "y": "float64", "z": "float64", "w": "float64"},
    "geometry_msgs/msg/Pose": {"position": "geometry_msgs/msg/Point", "orientation": "geometry_msgs/msg/Quaternion"},
    "geometry_msgs/msg/PoseStamped": {"header": "std_msgs/msg/Header", "pose": "geometry_msgs/msg/Pose"},
}


def fields(type: str) -> Mapping[str, str]:
    return looked_up({**LAYOUTS, **TEST}, type)


def profile(folder: Path, text: str) -> RobotProfile:
    (folder / "robots").mkdir(exist_ok=True)
    (folder / "robots" / "bob.toml").write_text(text, encoding="utf-8")
    findings = Diagnostics()
    read = read_robot("bob", FileReader(folder, findings), SourceLocation("x"))
    assert findings.sorted() == []
    return read


def robot(folder: Path, carrier: str, options: str = "") -> RobotProfile:
    return profile(folder, f'driver = "ros2"\n[options]\n{options}\n{PLACES}\n{ACTION}\n{carrier}')


def mistakes(folder: Path, carrier: str, options: str = "") -> list[str]:
    """What is found, without the part that is always the same."""
    found = mapping_problems(robot(folder, carrier, options), fields)
    assert all(each.startswith("robot bob: ") for each in found)
    return [each.removeprefix("robot bob: ") for each in found]


ACTION_CARRIER = 'carrier.action = "bob/do"\ncarrier.type = "test/action/Do"\n'
TOPIC_CARRIER = 'carrier.topic = "bob/do"\ncarrier.type = "test/msg/Do"\n'


def carrier(folder: Path, text: str, head: str = ACTION_CARRIER, options: str = "") -> ActionMapping:
    return read_mappings(robot(folder, head + text, options), fields)["Do"]


def made(one: ActionMapping, **parameters: Any) -> Any:
    return one.make_message(parameters, node="/rise/engine", goal="4/1", frame="base_link")


# --- values ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "written", "parameters", "value"),
    [
        # literal values
        ("text", '"hello"', {}, "hello"),
        ("text", '"{{x}}"', {}, "{x}"),
        ("wide", '"hello"', {}, "hello"),
        ("small", "255", {}, 255),
        ("small", "3.0", {}, 3),
        ("octet", "7", {}, 7),
        ("real", "2", {}, 2.0),
        ("flag", "true", {}, True),
        ("time", "1.5", {}, {"sec": 1, "nanosec": 500_000_000}),
        ("texts", '["a", "b"]', {}, ["a", "b"]),
        ("three", "[1, 2, 3]", {}, [1.0, 2.0, 3.0]),
        ("few", "[1]", {}, [1]),
        ("blob", "[1, 2]", {}, b"\1\2"),
        ("points", "[{ x = 1 }, { y = 2 }]", {}, [{"x": 1.0}, {"y": 2.0}]),
        ("point", "{ x = 1, z = 2 }", {}, {"x": 1.0, "z": 2.0}),
        # a parameter keeps its type as far as the field can
        ("text", '"{text}"', {"text": "hi"}, "hi"),
        ("text", '"{number}"', {"number": 2.5}, "2.5"),
        ("text", '"{number}"', {"number": 2.0}, "2"),
        ("text", '"{yes}"', {"yes": True}, "true"),
        ("real", '"{number}"', {"number": 2}, 2.0),
        ("small", '"{number}"', {"number": 2.0}, 2),
        ("large", '"{whole}"', {"whole": 2**63}, 2**63),
        ("flag", '"{yes}"', {"yes": False}, False),
        ("small", '"{yes}"', {"yes": True}, 1),
        # names and their numbers
        ("text", '"{mood}"', {"mood": "glad"}, "glad"),
        ("text", '"{mood}"', {"mood": 7}, "glad"),
        ("few", '["{mood}"]', {"mood": "glad"}, [7]),
        ("large", '"{mood}"', {"mood": "wild"}, 300),
        ("large", '"{mood}"', {"mood": 300}, 300),
        ("real", '"{mood}"', {"mood": "glad"}, 7.0),
        ("text", '"{any}"', {"any": 12}, "12"),
        # times
        ("time", '"{ms}"', {"ms": 1500}, {"sec": 1, "nanosec": 500_000_000}),
        ("time", '"{ms}"', {"ms": 0.25}, {"sec": 0, "nanosec": 250_000}),
        ("time", '"{s}"', {"s": 0.3}, {"sec": 0, "nanosec": 300_000_000}),
        ("time", '"{ms:s}"', {"ms": 1500}, {"sec": 1, "nanosec": 500_000_000}),
        ("time", '"{s}"', {"s": -0.5}, {"sec": -1, "nanosec": 500_000_000}),
        # units
        ("real", '"{ms:s}"', {"ms": 1500}, 1.5),
        ("real", '"{ms:ms}"', {"ms": 1500}, 1500.0),
        ("large", '"{s:ms}"', {"s": 0.3}, 300),
        ("large", '"{s:ns}"', {"s": 2}, 2_000_000_000),
        ("real", '"{angle:deg}"', {"angle": math.pi}, pytest.approx(180)),
        ("real", '"{degrees:rad}"', {"degrees": 180}, pytest.approx(math.pi)),
        ("large", '"{way:mm}"', {"way": 1.25}, 1250),
        ("small", '"{loud:%}"', {"loud": 0.8}, 80),
        ("text", '"{ms:s} s"', {"ms": 2000}, "2 s"),
        # specials, and texts with more in them
        ("text", '"{@node}"', {}, "/rise/engine"),
        ("text", '"{@goal}"', {}, "4/1"),
        ("text", '"{@frame}"', {}, "base_link"),
        ("text", '"{text} at {number} ({@goal})"', {"text": "go", "number": 3.0}, "go at 3 (4/1)"),
        ("text", '"<{text}>"', {}, "<>"),
        # the time, angles and places
        ("stamp", '"{@now}"', {}, {"sec": 1_795_460_000, "nanosec": 250_000_000}),
        ("real", '"{@now}"', {}, pytest.approx(1_795_460_000.25, abs=1e-3)),
        ("turn", '"{@yaw(angle)}"', {"angle": math.pi}, pytest.approx({"x": 0, "y": 0, "z": 1, "w": 0})),
        ("turn", '"{@yaw(degrees)}"', {"degrees": 90}, pytest.approx({"x": 0, "y": 0, "z": 0.5**0.5, "w": 0.5**0.5})),
        ("turn", '"{@yaw(angle)}"', {}, {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}),
        ("turn", '"{@yaw(place.yaw)}"', {"place": "table"}, pytest.approx({"x": 0, "y": 0, "z": 1, "w": 0})),
        ("real", '"{place.x}"', {"place": "door"}, 0.5),
        ("real", '"{place.y}"', {}, -2.0),
        ("real", '"{place.z|0.75}"', {"place": "door"}, 0.75),
        ("text", '"{place}: {place.x}, {place.frame|@frame}"', {"place": "door"}, "door: 0.5, base_link"),
        ("point", '"{place}"', {"place": "door"}, {"x": 0.5, "y": 1.0, "z": 0.0}),
        (
            "pose",
            '"{place}"',
            {"place": "door"},
            {
                "header": {"frame_id": "map", "stamp": {"sec": 1_795_460_000, "nanosec": 250_000_000}},
                "pose": {
                    "position": {"x": 0.5, "y": 1.0, "z": 0.0},
                    "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
                },
            },
        ),
        # when the author gives nothing
        ("text", '"{text|nobody}"', {}, "nobody"),
        ("text", '"{text|nobody}"', {"text": ""}, ""),
        ("text", '"{text|@frame}"', {}, "base_link"),
        ("text", '"{text|@frame}"', {"text": "map"}, "map"),
        ("text", '"{side|both}"', {}, "both"),
        ("real", '"{number|0.25}"', {}, 0.25),
        ("real", '"{ms:s|250}"', {}, 0.25),
        ("time", '"{ms|250}"', {}, {"sec": 0, "nanosec": 250_000_000}),
        ("large", '"{mood|glad}"', {}, 7),
        ("real", '"{loud}"', {}, 0.5),
        ("real", '"{loud|1}"', {}, 1.0),
        ("small", '"{seven}"', {}, 7),
        ("three", '[1, "{number}", 3]', {}, [1.0, 0.0, 3.0]),
        ("texts", '["a", "{text}"]', {}, ["a"]),
    ],
)
def test_what_a_field_gets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, field: str, written: str, parameters: dict[str, Any], value: Any
) -> None:
    monkeypatch.setattr(action_mapping.time, "time_ns", lambda: NOW)
    message = made(carrier(tmp_path, f"carrier.goal.{field} = {written}"), **parameters)
    assert message == {field: value}
    assert type(message[field]) is type(value) or type(value).__name__.startswith("Approx")


@pytest.mark.parametrize("written", ['"{text}"', '"{side}"'])
def test_a_field_without_a_value_is_left_out(tmp_path: Path, written: str) -> None:
    assert made(carrier(tmp_path, f"carrier.goal.text = {written}")) == {}


def test_the_robots_own_words(tmp_path: Path) -> None:
    text = """
carrier.goal.text = "{mood}"
carrier.goal.large = "{mood}"
carrier.goal.real = "{number}"
carrier.goal.short = "{text|x}"
carrier.goal.time = "{ms}"
carrier.goal.wide = "{text} {mood}"
carrier.values.number = { 0 = 0.001 }
carrier.values.text = { de-DE = "de_DE", x = "y" }
carrier.values.ms = { 0 = 2.5 }
"""
    one = carrier(tmp_path, text)
    assert made(one, number=0, text="de-DE", ms=0.0, mood=7) == {
        "text": "glad",
        "large": 7,
        "real": 0.001,
        "short": "de_DE",
        "time": {"sec": 2, "nanosec": 500_000_000},
        "wide": "de_DE glad",
    }
    assert made(one, number=-0.0, text="other")["real"] == 0.001
    assert made(one)["short"] == "y"
    names = carrier(tmp_path, 'carrier.goal.text = "{mood}"\ncarrier.values.mood = { glad = "joy" }')
    assert [made(names, mood=value)["text"] for value in ("glad", 7, "calm", 0)] == ["joy", "joy", "calm", "calm"]
    numbers = carrier(tmp_path, 'carrier.goal.small = "{mood}"\ncarrier.values.mood = { glad = 2, wild = 3 }')
    assert [made(numbers, mood=value)["small"] for value in ("glad", 300, "calm")] == [2, 3, 0]
    more = carrier(tmp_path, 'carrier.goal.small = "{side}"\ncarrier.values.side = { left = 1, right = 2 }')
    assert made(more, side="right") == {"small": 2}


def test_all_parameters_as_one_text(tmp_path: Path) -> None:
    one = carrier(tmp_path, 'carrier.goal.text = "{@parameters}"\ncarrier.values.mood = { calm = "quiet" }')
    message = made(one, text='say "ü"', mood=0, ms=3)
    assert json.loads(message["text"]) == {
        "text": 'say "ü"', "mood": "quiet", "ms": 3, "loud": 0.5, "seven": 7, "place": "table",
        "odd": "wild",
    }  # fmt: skip
    assert one.unused_parameters == ()


def test_paths_are_dotted_or_tables(tmp_path: Path) -> None:
    ways = [
        'carrier.goal = { "point.x" = "{number}", "point.y" = 2 }',
        "carrier.goal.point = { x = '{number}', y = 2 }",
        "carrier.goal.point.x = '{number}'\ncarrier.goal.point.y = 2",
        'carrier.goal = { "point.x" = "{number}", point = { y = 2 } }',
    ]
    for way in ways:
        assert made(carrier(tmp_path, way), number=1) == {"point": {"x": 1.0, "y": 2.0}}


@pytest.mark.parametrize(
    ("goal", "parameters", "said"),
    [
        ('small = "{number}"', {"number": 1.5}, "whole number from 0 to 255, and `1.5` is not"),
        ('small = "{whole}"', {"whole": 256}, "`256` is not (parameter `whole`)"),
        ('small = "{whole}"', {"whole": -1}, "`-1` is not"),
        ('signed = "{whole}"', {"whole": 128}, "from -128 to 127"),
        ('single = "{number}"', {"number": 1e39}, "single precision, and `1e+39` is not"),
        ('short = "{text}"', {"text": "größe"}, "at most 5 bytes"),
        ('short = "{text}!"', {"text": "12345"}, "at most 5 bytes"),
        ('short = "{@node}"', {}, "at most 5 bytes"),
        ('short = "{text|@frame}"', {}, "at most 5 bytes"),
        ('short = "{@parameters}"', {}, "at most 5 bytes"),
        ('text = "{text}"', {"text": "a\0b"}, "NUL"),
        ('text = "{text}"', {"text": "\ud800"}, "surrogate"),
        ('time = "{s}"', {"s": 1e300}, "68 years"),
    ],
)
def test_a_value_that_its_field_cannot_take_is_refused(
    tmp_path: Path, goal: str, parameters: dict[str, Any], said: str
) -> None:
    one = carrier(tmp_path, f"carrier.goal.{goal}")
    with pytest.raises(ValueError, match=r"^`actions\.Do\.carrier\.goal\.\w+` takes ") as caught:
        made(one, **parameters)
    assert said in str(caught.value)


ANYTHING = st.fixed_dictionaries(
    {},
    optional={
        "text": st.text(),
        "number": st.integers(-(2**63), 2**64) | st.floats(allow_nan=False, allow_infinity=False),
        "whole": st.integers(-(2**63), 2**64),
        "yes": st.booleans(),
        "mood": st.sampled_from(["calm", "glad", "wild", 0, 7, 300]),
        "any": st.text(min_size=1) | st.integers(-(2**63), 2**64),
        "ms": st.floats(0, 86_400_000) | st.integers(0, 86_400_000),
        "angle": st.floats(-1e6, 1e6),
    },
)


@given(ANYTHING)
def test_whatever_an_author_gives_a_message_fits_its_type_or_is_refused(parameters: dict[str, Any]) -> None:
    one = PROPERTY_CARRIER
    try:
        message = made(one, **parameters)
    except ValueError:
        return
    goal = TEST["test/action/Do_Goal"]
    for name, value in message.items():
        match goal[name]:
            case "string" | "string<=5":
                assert len(value.encode()) <= (5 if name == "short" else 10**9) and "\0" not in value
            case "uint8":
                struct.pack("<B", value)
            case "int8":
                struct.pack("<b", value)
            case "uint64":
                struct.pack("<Q", value)
            case "float64":
                assert type(value) is float and math.isfinite(value)
            case "float32":
                assert math.isfinite(struct.unpack("<f", struct.pack("<f", value))[0])
            case "bool":
                assert type(value) is bool
            case "builtin_interfaces/Duration":
                assert -(2**31) <= value["sec"] < 2**31 and 0 <= value["nanosec"] < 10**9
            case "float64[3]":
                assert len(value) == 3 and {type(each) for each in value} == {float}
            case other:
                raise AssertionError(other)


PROPERTY_GOAL = {
    "text": "{text}: {any}, {@parameters}",
    "short": "{any}",
    "small": "{whole}",
    "signed": "{number}",
    "large": "{mood}",
    "real": "{angle:deg}",
    "single": "{number}",
    "flag": "{yes}",
    "time": "{ms}",
    "three": ["{number}", "{whole|3}", "{angle}"],
}


def property_carrier() -> ActionMapping:
    import tempfile

    goal = ", ".join(f"{name} = {json.dumps(value)}" for name, value in PROPERTY_GOAL.items())
    with tempfile.TemporaryDirectory() as folder:
        return carrier(Path(folder), f"carrier.goal = {{ {goal} }}")


PROPERTY_CARRIER = property_carrier()


@given(st.floats(0, 86_400_000))
def test_a_duration_is_the_time_to_the_nanosecond(milliseconds: float) -> None:
    time = made(PROPERTY_CARRIER, ms=milliseconds)["time"]
    assert time["sec"] + time["nanosec"] / 1e9 == pytest.approx(milliseconds / 1000, abs=1e-9, rel=1e-12)


# --- mistakes -------------------------------------------------------------------------------------------------------


def listed(what: str) -> list[Any]:
    """Of tests/ros/data: what is written, and what is found in it."""
    text = (Path(__file__).parent / "data" / f"mistakes_{what}.txt").read_text(encoding="utf-8")
    rows = [block.rpartition("!! ") for block in text.strip().split("\n\n")[1:]]
    return [pytest.param(written, found, id=found[:90]) for written, _, found in rows]


@pytest.mark.parametrize(("written", "found"), listed("carrier"))
def test_mistakes_in_a_carrier(tmp_path: Path, written: str, found: str) -> None:
    assert mistakes(tmp_path, ACTION_CARRIER + written) == [found.replace("`", "`actions.Do.carrier.", 1)]


@pytest.mark.parametrize(("written", "found"), listed("way"))
def test_mistakes_in_the_way_to_the_robot(tmp_path: Path, written: str, found: str) -> None:
    assert mistakes(tmp_path, written) == [found]


@pytest.mark.parametrize(("written", "found"), listed("options"))
def test_mistakes_in_the_options(tmp_path: Path, written: str, found: str) -> None:
    assert mistakes(tmp_path, ACTION_CARRIER, written) == [found]


def test_everything_is_found_at_once(tmp_path: Path) -> None:
    broken = robot(tmp_path, "carrier = { action = 'x y', type = 'Do', goal = { text = '{x}' } }", "frame = 3")
    with pytest.raises(PortError) as caught:
        read_mappings(broken, fields)
    assert len(caught.value.lines) == 4


def test_without_types_everything_else_is_checked(tmp_path: Path) -> None:
    right = robot(
        tmp_path, ACTION_CARRIER + "carrier.goal = { a.b = '{mood}', c = [1, '{ms:s}'], d = '{text|@frame}' }"
    )
    one = read_mappings(right)["Do"]
    assert made(one, mood=7, ms=500) == {"a": {"b": "glad"}, "c": [1, 0.5], "d": "base_link"}
    wrong = robot(
        tmp_path, ACTION_CARRIER + "carrier.goal = { a = '{moood}', b = '{ms:m}', c = '{mooood}' }\ncarrier.x = 1"
    )
    assert len(mapping_problems(wrong)) == 4


# --- actions, topics, results ---------------------------------------------------------------------------------------


def test_which_actions_need_a_carrier(tmp_path: Path) -> None:
    text = f"""
driver = "ros2"
[actions.LookAt]
[actions.LookAt.carrier]
action = "look"
type = "test/action/Do"
[actions.PointAt]
substitute = "LookAt"
{ACTION}{ACTION_CARRIER}
"""
    read = profile(tmp_path, text)
    assert list(read_mappings(read, fields)) == ["LookAt", "Do"]
    assert list(read_mappings(read, fields, actions={"Do", "Wait"})) == ["Do"]
    of_robots = [each for each in core_actions().values() if not each.engine]
    assert len(mapping_problems(RobotProfile("x", "X", "ros2", dict(core_actions())))) == len(of_robots)


def test_a_topic(tmp_path: Path) -> None:
    text = 'carrier.message = { text = "{text}", small = "{seven}" }\ncarrier.reset.text = "{@node}"'
    one = carrier(tmp_path, text, TOPIC_CARRIER)
    assert (one.kind, one.name, one.type) == ("topic", "bob/do", "test/msg/Do")
    assert made(one, text="hi") == {"text": "hi", "small": 7}
    assert one.make_reset(node="/rise/engine") == {"text": "/rise/engine"}
    assert carrier(tmp_path, "", TOPIC_CARRIER).make_reset() is None
    assert carrier(tmp_path, "carrier.reset = {}", TOPIC_CARRIER).make_reset() == {}


def test_a_service(tmp_path: Path) -> None:
    text = "carrier = { service = 'bob/ask', type = 'test/srv/Ask', request.text = '{text}', error.code = 'code' }"
    one = read_mappings(robot(tmp_path, text), fields)["Do"]
    assert (one.kind, one.name, one.type, one.stoppable) == ("service", "bob/ask", "test/srv/Ask", False)
    assert made(one, text="hi") == {"text": "hi"}
    assert one.result_rule.failure({"code": 3}) == "error code 3"


def test_a_cancel_that_the_kernel_would_not_wait_for(tmp_path: Path) -> None:
    one = replace(robot(tmp_path, ACTION_CARRIER), options={"deadlines": {"cancel": 5}})
    assert [each.sentence for each in mapping_findings(one)] == [
        "robot bob: `options.deadlines.cancel` must be at most 4.75: an act waits 5 s for its actions to stop"
    ]


def test_a_reset_that_says_the_same_again(tmp_path: Path) -> None:
    text = "carrier = { topic = 'base', type = 'test/msg/Pressed', message.data = true, reset.data = true }"
    (found,) = mapping_findings(robot(tmp_path, text))
    assert (found.kind, found.where) == ("doubtful", "actions.Do.carrier.reset")


@pytest.mark.parametrize(("more", "said"), [({}, True), ({"silent_after": 2}, False), ({"silent_after": 0}, False)])
def test_an_emergency_stop_whose_silence_nobody_would_notice(tmp_path: Path, more: dict[str, Any], said: bool) -> None:
    one = robot(tmp_path, ACTION_CARRIER)
    estop = {"topic": "/estop", "type": "test/msg/Pressed", "when": {"data": True}, **more}
    found = mapping_findings(replace(one, options={**one.options, "estop": estop}))
    assert [(each.kind, each.where) for each in found] == ([("doubtful", "options.estop.topic")] if said else [])


def test_a_value_of_a_place_that_nothing_takes_may_be_a_slip(tmp_path: Path) -> None:
    one = robot(tmp_path, ACTION_CARRIER + 'carrier.goal.pose = "{place}"')
    assert mapping_findings(one, fields) == []
    slip = replace(one, places={"desk": {"x": 1.0, "y": 0.0, "yow": 1.0}})
    (found,) = mapping_findings(slip, fields)
    assert (found.kind, found.where, found.refuses) == ("doubtful", "places.desk.yow", False)
    assert found.sentence == "robot bob: `places.desk.yow` is used by no carrier; did you mean `yaw`?"


def test_a_place_without_a_value_sends_nobody_to_the_origin(tmp_path: Path) -> None:
    half = replace(
        robot(tmp_path, ACTION_CARRIER + 'carrier.goal.pose = "{place}"'),
        places={"desk": {"x": 1.0, "y": 0.0}, "door": {"yaw": 1.0}},
    )
    (found, *_) = mapping_findings(half, fields)
    assert "takes `x`, and `door` lacks it; add it there, or write `{place.x|VALUE}`" in found.sentence
    action = ACTION.replace(', default = "table"', "") + ACTION_CARRIER + 'carrier.goal.pose = "{place}"'
    optional = profile(tmp_path, f'driver = "ros2"\n{PLACES}\n{action}')
    (found, *_) = mapping_findings(optional, fields)
    assert "takes `x` of a place, and an act need not name one; write `required = true`" in found.sentence


def test_a_place_that_there_is_not(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="needs a place, and `dor` is none; did you mean `door`"):
        made(carrier(tmp_path, 'carrier.goal.real = "{place.x}"'), place="dor")


@pytest.mark.parametrize(
    ("carrier", "said"),
    [
        (TOPIC_CARRIER, "nothing is published on bob/do to stop it; write `reset = { ... }`"),
        ("carrier = { service = 'ask', type = 'test/srv/Ask' }", "a call of ask cannot be taken back"),
        (TOPIC_CARRIER + "carrier.unstoppable = true", ""),
        (TOPIC_CARRIER + "carrier.reset = {}", ""),
        (ACTION_CARRIER, ""),
    ],
)
def test_what_nothing_stops_is_said_and_refuses_no_session(tmp_path: Path, carrier: str, said: str) -> None:
    one = robot(tmp_path, carrier)
    found = mapping_findings(one, fields)
    assert [each.kind for each in found] == (["unstoppable"] if said else []) and mapping_problems(one, fields) == []
    assert all(said in each.sentence and "cannot be stopped: after F9" in each.sentence for each in found)
    assert read_mappings(one, fields)["Do"].stoppable == ("reset" in carrier or "action" in carrier)


def test_what_does_not_reach_the_robot(tmp_path: Path) -> None:
    one = carrier(tmp_path, 'carrier.goal = { text = "{text} {mood}", real = "{loud}" }')
    assert set(one.unused_parameters) == set(read_mappings(robot(tmp_path, ACTION_CARRIER))["Do"].unused_parameters) - {
        "text", "mood", "loud",
    }  # fmt: skip


def test_deadlines(tmp_path: Path) -> None:
    assert carrier(tmp_path, "").deadlines == GoalDeadlines(5, 2, 0, 0, 4)
    options = "deadlines = { server = 8, acceptance = 1.5 }"
    one = carrier(tmp_path, "carrier.deadlines = { acceptance = 20, result = 0 }", options=options)
    assert one.deadlines == GoalDeadlines(server=8, acceptance=20, feedback=0, result=0, cancel=4)


def test_options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/anna")
    monkeypatch.setenv("LAB", "/opt/lab")
    read = read_options(robot(tmp_path, "", 'frame = "torso"\nshare = ["~/share", "$LAB/share"]\nwrapper = "bob"'))
    assert (read.frame, read.share, read.wrapper) == ("torso", ("/home/anna/share", "/opt/lab/share"), "bob")
    with pytest.raises(PortError, match="frame"):
        read_options(robot(tmp_path, "", "frame = 3"))


@pytest.mark.parametrize(
    ("error", "result", "failure", "reason"),
    [
        ("", {"code": 3, "text": "no"}, "", ""),
        ("code = 'code'", {"code": 0, "text": "no"}, "", ""),
        ("code = 'code'", {"code": 134, "text": "no"}, "error code 134", None),
        ("code = 'code', text = 'text'", {"code": 4, "text": " no\n way "}, "no way (error code 4)", None),
        ("code = 'code', text = 'text'", {"code": 0, "text": "fine"}, "", "fine"),
        ("code = 'code', codes = { 134 = 'cannot' }", {"code": 134}, "cannot (error code 134)", None),
        ("code = 'code', ok = 1", {"code": 1}, "", ""),
        ("code = 'code', ok = 1", {"code": 0}, "error code 0", None),
        ("code = 'success', ok = true", {"success": True}, "", ""),
        ("code = 'success', ok = true", {"success": False}, "the robot says that it did not succeed", None),
        ("code = 'success', ok = true, text = 'text'", {"success": False, "text": "fell"}, "fell", None),
        ("code = 'code', ok = [0, 2]", {"code": 2}, "", ""),
        ("code = 'code', ok = [0, 2]", {"code": 1}, "error code 1", None),
        ("code = 'code', minimum = 0", {"code": 3}, "", ""),
        ("code = 'code', maximum = 2", {"code": 3}, "code is 3, and a success is at most 2", None),
        ("code = 'rate', minimum = 0.5", {"rate": 0.5}, "", ""),
        ("code = 'rate', minimum = 0.5", {"rate": 0.25}, "rate is 0.25, and a success is at least 0.5", None),
        (
            "code = 'rate', minimum = 0, maximum = 1",
            {"rate": math.nan},
            "rate is nan, and a success is at least 0 and at most 1",
            None,
        ),
        (
            "code = 'rate', minimum = 0.5, text = 'text'",
            {"rate": 0.0, "text": "mute"},
            "mute (rate is 0, and a success is at least 0.5)",
            None,
        ),
        ("code = 'text', ok = ['done', 'ok']", {"text": "done"}, "", ""),
        ("code = 'text', ok = 'done'", {"text": "stuck"}, "text is `stuck`", None),
        ("text = 'text'", {"text": "fell"}, "fell", None),
        ("text = 'text'", {"text": ""}, "", ""),
        ("code = 'inner.code', text = 'inner.words'", {"inner": {"code": 7, "words": "?"}}, "? (error code 7)", None),
    ],
)
def test_what_a_result_says(
    tmp_path: Path, error: str, result: dict[str, Any], failure: str, reason: str | None
) -> None:
    """`reason` None: the same."""
    one = carrier(tmp_path, f"carrier.error = {{ {error} }}")
    assert (one.result_rule.failure(result), one.result_rule.why_not_succeeded(result)) == (
        failure,
        failure if reason is None else reason,
    )


def test_the_actions_of_a_wrapper_in_the_manner_of_rise(tmp_path: Path) -> None:
    text = """
driver = "ros2"
options.wrapper = "lab/bob"
[actions.Speech]
[actions.LookAt]
carrier = { action = "look", type = "rise_interfaces/action/LookAt" }
"""
    mappings = read_mappings(profile(tmp_path, text), fields)
    assert {name: each.name for name, each in mappings.items()} == {"Speech": "lab/bob/speech", "LookAt": "look"}
    said = mappings["Speech"].make_message({"message": "Hi", "volume": 0}, node="/n", goal="1/1", frame="f")
    assert said == {"message": "Hi", "rate": 1.0, "volume": 0.001}
    assert mappings["Speech"].result_rule.failure({"reason": "no voice"}) == "no voice"
    missing = mapping_problems(profile(tmp_path, text + ACTION), fields)
    assert len(missing) == 1 and "`actions.Do` has no `carrier`" in missing[0]


def test_a_profile_written_out_has_every_carrier_in_its_action(tmp_path: Path) -> None:
    text = """
driver = "ros2"
options.wrapper = "bob"
options.error = { text = "reason" }
[actions.Speech]
[actions.LookAt]
carrier = { action = "look", type = "rise_interfaces/action/LookAt" }
[actions.PointAt]
substitute = "LookAt"
"""
    written = with_all_carriers(profile(tmp_path, text))
    assert written.actions["Speech"].carrier["action"] == "bob/speech"
    assert written.actions["Speech"].carrier["goal"]["message"] == "{message}"
    assert written.actions["LookAt"].carrier["error"] == {"text": "reason"}
    assert written.actions["PointAt"].carrier == written.actions["Emotion"].carrier == {}
    assert list(read_mappings(written, fields)) == ["Speech", "LookAt"]
    assert mapping_problems(replace(written, options={}), fields) == []
