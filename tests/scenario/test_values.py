"""JSON, keys, parameter values and durations: the small readers on their own."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.base.json_codec import JsonError, read_json, to_plain
from rise_engine.scenario.durations import expected_seconds, limit_seconds
from rise_engine.scenario.keys import CONSOLE_KEYS, PUNCTUATION, KeyRefusedError, bindable_key_name
from rise_engine.scenario.model import ActionCall, Parameter
from rise_engine.scenario.parameters import convert_parameter, fill_parameters
from rise_engine.scenario.reading.action_declarations import core_actions
from rise_engine.scenario.reading.graph import component_numbers, reachable_from
from rise_engine.scenario.speech.template import MissingValueError, key_template, parse_template


def nested(levels: int) -> Any:
    value: Any = []
    for _ in range(levels - 1):
        value = [value]
    return value


DEEP = nested(100_000)


def json(text: str) -> Any:
    def duplicate(key: str, offset: int, first: int) -> None:
        raise JsonError(f"twice: {key}", offset)

    return to_plain(read_json(text, duplicate))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (' {"a": [1, -2.5, 1e3, true, false, null, "x"]} ', {"a": [1, -2.5, 1000.0, True, False, None, "x"]}),
        (r'"\u00e4\n\"\\\/\ud83d\ude00"', 'ä\n"\\/😀'),
        ("[]", []),
        ("{}", {}),
        ("0", 0),
        ("9223372036854775807", 2**63 - 1),
        ("-9223372036854775808", -(2**63)),
        ("12345678901234567890.0", 12345678901234567890.0),
        ("[" * 64 + "]" * 64, nested(64)),
    ],
)
def test_json(text: str, value: object) -> None:
    assert json(text) == value


@pytest.mark.parametrize(
    ("text", "offset"),
    [
        ("", 0),
        ('{"a": 1', 0),
        ('{"a": 1,}', 7),
        ("[1,]", 2),
        ("[1 2]", 2),
        ('{"a" 1}', 5),
        ("{a: 1}", 1),
        ("[NaN]", 1),
        ("[-Infinity]", 1),
        ("[1e999]", 1),
        ("[9223372036854775808]", 1),
        ("[" + "9" * 400 + "]", 1),
        ("[-9223372036854775809]", 1),
        ("[01]", 1),
        ("[+1]", 1),
        ("[True]", 1),
        ("['a']", 1),
        ('["a\nb"]', 1),
        (r'["\ud800"]', 2),
        (r'["\x"]', 2),
        ('{"a": 1, "a": 2}', 9),
        ("1 2", 2),
        ("[" * 100, 64),
    ],
)
def test_json_refused(text: str, offset: int) -> None:
    with pytest.raises(JsonError) as error:
        json(text)
    assert error.value.offset == offset


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("1", "1"),
        ("n", "n"),
        ("N", "N"),
        ("ä", "ä"),
        (".", "full_stop"),
        ("full_stop", "full_stop"),
        ("-", "minus"),
        ("+", "plus"),
        ("§", "section_sign"),
        ("F5", "f5"),
        ("ctrl+f", "ctrl+f"),
        ("Ctrl+F", "ctrl+f"),
    ],
)
def test_keys(written: str, name: str) -> None:
    assert bindable_key_name(written) == name


REFUSED = """ctrl+h ctrl+i ctrl+m ctrl+[ ctrl+space ctrl+1 ctrl+enter shift+enter alt+enter ctrl+shift+n alt+1 alt+n
ctrl+a ctrl+b ctrl+s ctrl+z ctrl+q F1 F10 F11 shift+n super+n ctrl+. ctrl++ hello f13 shift+f5 ctrl+"""


@pytest.mark.parametrize("written", [*REFUSED.split(), "", "\n", "\x00"])
def test_keys_refused(written: str) -> None:
    with pytest.raises(KeyRefusedError) as refused:
        bindable_key_name(written)
    assert str(refused.value)


@pytest.mark.parametrize(
    "written",
    ["F2", "F9", "ctrl+g", "ctrl+j", "?", "/", ":", ",", "!", "tab", "shift+tab", "enter", "space", "ctrl+n", "Ctrl+T"],
)
def test_keys_of_the_console(written: str) -> None:
    with pytest.raises(KeyRefusedError) as refused:
        bindable_key_name(written)
    assert refused.value.taken


def test_key_names_are_textuals() -> None:
    keys = pytest.importorskip("textual.keys")
    for character, name in PUNCTUATION.items():
        assert keys._character_to_key(character) == name
    assert keys._character_to_key("§") == bindable_key_name("§")
    assert all(name == name.lower() for name in CONSOLE_KEYS)


NUMBER = Parameter("x", "number", unit="m", minimum=-1, maximum=5)
MS = Parameter("duration", "number", unit="ms", minimum=0)
NAME = Parameter("value", "name", codes={"happy": 1}, names=("wave",))


@pytest.mark.parametrize(
    ("parameter", "value", "result"),
    [
        (NUMBER, "5", 5),
        (NUMBER, " 0.5 ", 0.5),
        (NUMBER, 1.0, 1.0),
        (MS, 86_400_000, 86_400_000),
        (Parameter("n", "integer"), "3", 3),
        (Parameter("n", "integer"), 3.0, 3),
        (Parameter("b", "boolean"), "true", True),
        (Parameter("b", "boolean"), 0, False),
        (Parameter("t", "text"), 2.0, "2"),
        (NAME, "1", 1),
        (NAME, 1.0, 1),
        (NAME, "happy", "happy"),
        (NAME, "wave", "wave"),
        (Parameter("v", "name"), "anything", "anything"),
        (Parameter("v", "name", codes={"a": 0}, names=("*",)), "anything", "anything"),
    ],
)
def test_convert(parameter: Parameter, value: object, result: object) -> None:
    converted = convert_parameter(parameter, value)
    assert converted == result and type(converted) is type(result)


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        (NUMBER, "6"),
        (NUMBER, "-2"),
        (NUMBER, "1,5"),
        (NUMBER, "five"),
        (NUMBER, "nan"),
        (NUMBER, "1e999"),
        (NUMBER, [1]),
        (NUMBER, None),
        (NUMBER, float("inf")),
        (NUMBER, 10**400),
        (NUMBER, 10**4000),
        (NUMBER, True),
        (MS, "1e300"),
        (MS, 86_400_001),
        (MS, 10**400),
        (Parameter("far", "number", unit="s"), 86_401),
        (Parameter("n", "number"), 2**63),
        (Parameter("n", "integer"), True),
        (Parameter("n", "integer"), 1e300),
        (Parameter("n", "integer"), {}),
        (Parameter("b", "boolean"), 10**4000),
        (Parameter("t", "text"), DEEP),
        (Parameter("v", "name"), 10**4000),
        (Parameter("n", "integer"), "1.5"),
        (Parameter("b", "boolean"), "yes"),
        (NAME, "sad"),
        (NAME, "2"),
        (NAME, True),
        (NAME, None),
    ],
)
def test_convert_refuses(parameter: Parameter, value: object) -> None:
    with pytest.raises(ValueError, match=parameter.name):
        convert_parameter(parameter, value)


def test_call_parameters() -> None:
    spec = core_actions()["Speech"]
    call = ActionCall("Speech", {"message": parse_template("Hi {name|you}, {n}!"), "rate": key_template("speed")})
    assert fill_parameters(call, spec, {"n": 2.0, "speed": 2}) == {"message": "Hi you, 2!", "rate": 2}
    with pytest.raises(MissingValueError, match="speed"):
        fill_parameters(call, spec, {"n": 1})
    with pytest.raises(ValueError, match="rate"):
        fill_parameters(call, spec, {"n": 1, "speed": "fast"})


def test_reasons_name_the_memory_keys() -> None:
    spec = core_actions()["Emotion"]
    with pytest.raises(ValueError) as refused:
        fill_parameters(ActionCall("Emotion", {"duration": key_template("d")}), spec, {"d": True})
    assert str(refused.value) == "duration is a number (ms); true (memory key `d`) is not"
    with pytest.raises(ValueError, match=r"`1x2` \(memory keys `a`, `b`\) is not"):
        fill_parameters(ActionCall("Emotion", {"duration": parse_template("{a}x{b}")}), spec, {"a": 1, "b": 2})
    with pytest.raises(ValueError, match=r"no name `grim` \(memory key `mood`\)"):
        fill_parameters(ActionCall("Emotion", {"value": parse_template("{mood}")}), spec, {"mood": "grim"})


JUNK = [None, True, 0, 10**400, -(10**4000), 1e300, float("inf"), float("nan"), "", "9" * 5000, "x" * 10**6]


@pytest.mark.parametrize("value", [*JUNK, [], {}, DEEP], ids=range(len(JUNK) + 3))
def test_no_value_breaks_parameters_and_durations(value: Any) -> None:
    for spec in core_actions().values():
        for name in spec.parameters:
            call = ActionCall(spec.name, {name: parse_template("{n}")})
            try:
                parameters = fill_parameters(call, spec, {"n": value})
            except (ValueError, MissingValueError) as error:
                assert len(str(error)) < 500
                parameters = {name: value}
            assert 0 <= expected_seconds(spec, parameters) <= 86_400
            assert 0 <= limit_seconds(spec, parameters) <= 3 * 86_400 + 10


def test_durations() -> None:
    actions = core_actions()
    assert expected_seconds(actions["Speech"], {"message": ""}) == 0.5
    assert expected_seconds(actions["Speech"], {"message": "x" * 140}) == pytest.approx(10.3)
    assert expected_seconds(actions["Speech"], {"message": "x" * 140, "rate": 2}) == pytest.approx(5.3)
    assert expected_seconds(actions["Emotion"], {"value": 1, "duration": 1500}) == 1.5
    assert expected_seconds(actions["Animation"], {"value": 1, "duration": 500, "repetitions": 3}) == 1.5
    assert expected_seconds(actions["Animation"], {"value": 1}) == 2.0
    assert limit_seconds(actions["Wait"], {"duration": 1000}) == 13


@given(st.lists(st.lists(st.integers(0, 7), max_size=4), min_size=8, max_size=8))
def test_knots_are_what_reaches_each_other(ways: list[list[int]]) -> None:
    edges = {str(n): [str(each) for each in targets] for n, targets in enumerate(ways)}
    knot = component_numbers(edges)
    for a in edges:
        for b in edges:
            assert (knot[a] == knot[b]) == (b in reachable_from(a, edges) and a in reachable_from(b, edges))


def test_knots_of_a_long_chain_need_no_stack() -> None:
    long = {str(n): [str(n + 1)] for n in range(50_000)} | {"50000": ["0"]}
    assert len(set(component_numbers(long).values())) == 1
