"""What BML has no words for stands in descriptions of our own; whoever changes the one must change the other."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rise_exchange.bml.names import BmlNames, ConversionFindings
from rise_exchange.bml.writing import write_act

from rise_engine.scenario.loader import load
from tests.exchange.bml.samples import ROBOT, read_text

GREETING = load("scenarios/greeting").scenario


def block_of(act: str) -> str:
    assert GREETING is not None
    return write_act(GREETING.acts[act], "Blocking", GREETING.memory, BmlNames(ROBOT), ConversionFindings())


@pytest.mark.parametrize(
    ("act", "old", "new", "what"),
    [
        ("R_Greeting", "<text>Hello!", "<text>Hallo!", "`<text>` of `a2`"),
        ("R_Introduction", "pleased to meet you, dear visitor!</text>", "glad!</text>", "`<text>` of `a5`"),
        ("R_LookAhead", 'target="at_2_0_0.3"', 'target="door"', "`target` of `a1`"),
        ("R_LookAhead", 'end="a1:start+1"', 'end="a1:start+2"', "`end` of `a1`"),
        ("R_LookAhead", ' end="a1:start+1"', "", "`end` of `a1`"),
        ("R_LookAhead", 'target="at_2_0_0.3"', 'target="at_2_0_0.3" influence="EYES"', "`influence` of `a1`"),
    ],
)
def test_a_changed_behaviour_is_never_undone_by_its_description(act: str, old: str, new: str, what: str) -> None:
    text = block_of(act)
    assert old in text
    found = read_text(text.replace(old, new, 1), BmlNames(ROBOT))
    assert found.read is None and f"{what} is not what its <description> in line" in found.errors[0]


def test_memory_values_may_be_any() -> None:
    text = block_of("R_Introduction").replace("dear visitor!</text>", "Anna!</text>")
    assert read_text(text, BmlNames(ROBOT)).does["5"]["message"].endswith("{person_name|dear visitor}!")


def test_without_its_description_the_core_counts() -> None:
    text = block_of("R_Introduction")
    begin = text.index("      <description")
    found = read_text(text[:begin] + text[text.index("</description>") + len("</description>") :], BmlNames(ROBOT))
    assert found.does["5"]["message"] == "I am pleased to meet you, dear visitor!"


def test_mistakes_in_a_description_are_told() -> None:
    text = block_of("R_LookAhead")
    wrong = read_text(text.replace("rise:pointx", "rise:pontx"), BmlNames(ROBOT))
    assert "`LookAt` has no `pontx`; did you mean `pointx`?" in wrong.errors[0]
    other = read_text(text.replace("rise:LookAt", "rise:LokAt"), BmlNames(ROBOT))
    assert "has no action `LokAt`; did you mean `LookAt`?" in other.errors[0]


BLOCKS = [block_of(act) for act in ("R_Greeting", "R_Introduction", "R_LookAhead", "R_Nod")]


@given(st.sampled_from(BLOCKS), st.integers(0, 3000), st.integers(0, 30), st.text("<>/\"'=:+-;& .x1", max_size=8))
def test_whatever_is_done_to_a_file_is_an_act_or_findings(text: str, at: int, length: int, instead: str) -> None:
    at %= len(text)
    found = read_text(text[:at] + instead + text[at + length :], BmlNames(ROBOT))
    assert (found.read is None) == bool(found.errors)
