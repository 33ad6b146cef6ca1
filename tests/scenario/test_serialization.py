"""A scenario as JSON is the same scenario again, whatever stands in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from rise_engine.expression import Environment
from rise_engine.scenario.loader import load as read
from rise_engine.scenario.model import Function, If, OneOf, Scenario, Statement
from rise_engine.scenario.serialization import decode_scenario, encode_scenario

from .folders import loaded, rule

SHIPPED = sorted(path.parent for path in (Path(__file__).parents[2] / "scenarios").glob("*/scenario.toml"))
RULE = rule(
    """<State id="S"><onEntry>
      <function assignValue='{"one": [1, 2.0, "x"]}'/>
      <if cond="one contains 2 and not defined(three)"><oneOf>
        <function raiseEventTopic="/a"/>
        <function assignValue="three = one.0 * 2 ^ 3"/>
      </oneOf></if>
      <elseif cond="false"><function assignValue="word = hello"/></elseif>
      <else><function assignValue="two = {&quot;deep&quot;: null}"/></else>
    </onEntry>
    <transition eventTopic="/a" cond="pi &gt; 3 or &quot;é&quot; == word" target="T"/>
    <transition after="1.5s" target="T"/></State>
    <State id="T"/>"""
)


def scenario_of(folder: Path) -> Scenario:
    found = read(folder)
    assert found.scenario is not None, found.diagnostics
    return found.scenario


@pytest.mark.parametrize("folder", SHIPPED, ids=lambda path: path.name)
def test_every_shipped_scenario(folder: Path) -> None:
    scenario = scenario_of(folder)
    assert decode_scenario(encode_scenario(scenario)) == scenario


def statements(block: tuple[Statement, ...]) -> list[Function]:
    found: list[Function] = []
    for each in block:
        match each:
            case Function():
                found.append(each)
            case If(branches=branches):
                found += [one for branch in branches for one in statements(branch.block)]
            case OneOf(choices=choices):
                found += statements(choices)
    return found


def test_conditions_and_assignments_do_the_same(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"rules/r.xml": RULE})
    assert result.scenario is not None, result.diagnostics
    again = decode_scenario(encode_scenario(result.scenario))
    assert again == result.scenario
    memory: dict[str, Any] = {"one": [1, 2.0, "x"], "word": "é"}
    pairs = zip(*(statements(each.rules["R"].states["S"].on_entry) for each in (result.scenario, again)), strict=True)
    compared = 0
    for before, after in pairs:
        if before.assignment is not None and after.assignment is not None:
            assert before.assignment.key == after.assignment.key
            assert before.assignment.literal == after.assignment.literal
            assert before.assignment.evaluate(Environment(memory)) == after.assignment.evaluate(Environment(memory))
            compared += 1
    assert compared == 4
    waits = [each.rules["R"].states["S"].transitions[0].condition for each in (result.scenario, again)]
    assert [one is not None and one.as_condition(memory) for one in waits] == [True, True]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
BLANK = scenario_of(SHIPPED[0])


def typed(value: Any) -> Any:
    """With the types, which == does not tell: 1, 1.0 and True are equal."""
    if isinstance(value, dict):
        return [(key, typed(each)) for key, each in value.items()]
    return [typed(each) for each in value] if isinstance(value, list) else (type(value), value)


@given(st.dictionaries(st.text(min_size=1), JSON, max_size=4))
def test_any_memory_keeps_its_values_types_and_order(memory: dict[str, Any]) -> None:
    try:
        data = encode_scenario(replace(BLANK, memory=memory))
    except ValueError:
        assert any("\ud800" <= character <= "\udfff" for character in repr(memory).encode().decode("unicode_escape"))
        return
    assert typed(decode_scenario(data).memory) == typed(memory)


def test_half_a_character_is_refused_and_not_changed() -> None:
    with pytest.raises(ValueError, match="surrogates"):
        encode_scenario(replace(BLANK, title="\udcff"))
    assert (
        decode_scenario(encode_scenario(replace(BLANK, folder="/studies/\udcff"))).folder == "/studies/\udcff"
    )  # bytes of a path


@pytest.mark.parametrize(
    "data",
    [b"", b"{}", b"[]", b"\xff", encode_scenario(BLANK)[:-1], b"[" * 5_000],
    ids=["empty", "no fields", "a list", "no text", "torn", "deep"],
)
def test_what_is_no_scenario_is_refused_with_a_sentence(data: bytes) -> None:
    with pytest.raises(ValueError, match="not a scenario of this version"):
        decode_scenario(data)


def test_a_condition_that_cannot_be_read_is_refused() -> None:
    data = encode_scenario(scenario_of(SHIPPED[-1]))
    assert b'"condition":"' in data
    broken = data.replace(b'"condition":"', b'"condition":"(', 1)
    with pytest.raises(ValueError, match="not a scenario of this version"):
        decode_scenario(broken)
