"""The words of BML: a lab's names, descriptions of our own, and blocks found in the wild.

RISE_BML_CORPUS names a folder of such blocks, one a file. Nothing of them is in this project.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rise_exchange.bml.names import BmlNames, ConversionFindings, LexemeKind, TargetPoint, read_names
from rise_exchange.bml.reading import read_act
from rise_exchange.bml.writing import write_act

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import SourceFile, decode_text
from rise_engine.scenario.loader import load
from tests.exchange.bml.samples import NAMES, ROBOT, parts, read_text

# --- names of targets and lexemes -------------------------------------------------------------------------------------


PAGE = Path("docs/reference/bml.md").read_text("utf-8")


def test_the_names_of_the_page_are_right() -> None:
    shown = re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert shown is not None
    diagnostics = Diagnostics()
    names = read_names(SourceFile("lab.toml", b"", shown[1]), ROBOT, diagnostics)
    assert diagnostics.sorted() == []
    assert names.targets["table"] == TargetPoint("0.7", "0", "0.75", "map")
    assert names.find_lexeme("face", "smile") == ("Emotion", "happy")
    assert names.find_lexeme("face", "Eyebrows_Frown") == ("Animation", "eyebrows_lower")


@pytest.mark.parametrize(
    ("kind", "lexeme", "meant"),
    [
        ("head", "NOD", ("Animation", "head_nod")),
        ("head", "nod", None),
        ("gesture", "HEAD_NOD", ("Animation", "head_nod")),
        ("face", "Happy", ("Emotion", "happy")),
        ("face", "RAISE_BROWS", ("Animation", "eyebrows_raise")),
        ("gesture", "happy", None),
    ],
)
def test_lexemes_that_are_known_without_a_file(kind: LexemeKind, lexeme: str, meant: tuple[str, str] | None) -> None:
    assert BmlNames(ROBOT).find_lexeme(kind, lexeme) == meant


def test_a_point_is_found_by_its_numbers() -> None:
    assert NAMES.target_of(TargetPoint("1.50", "0.0", "1.2")) == "visitor"
    assert NAMES.target_of(TargetPoint("1.5", "0", "1.2", "map")) is None
    assert NAMES.target_of(TargetPoint("{x}", "0", "1.2")) is None


# --- descriptions of our own ------------------------------------------------------------------------------------------


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


# --- blocks found in the wild -----------------------------------------------------------------------------------------


CORPUS = os.environ.get("RISE_BML_CORPUS", "")


def test_blocks_in_the_wild(capsys: pytest.CaptureFixture[str]) -> None:
    if not CORPUS:
        pytest.skip("RISE_BML_CORPUS does not name a folder with files of BML")
    counted: Counter[str] = Counter()
    for path in sorted(Path(CORPUS).glob("*.xml")):
        data = path.read_bytes()
        text = decode_text(path.name, data, Diagnostics()) or data.decode("utf-8", "replace")
        findings = ConversionFindings()
        read = read_act(SourceFile(path.name, data, text), NAMES, findings)
        found = findings.diagnostics.sorted()
        assert (read is None) == bool(found), path
        lines = text.count("\n") + 1
        assert all(each.location.line <= lines for each in found), path
        if read is not None and read.act.actions:
            again = write_act(read.act, read.calling_type, {}, NAMES, ConversionFindings())
            assert parts(read_text(again).act) == parts(read.act), path
        kind = "an act" if read is not None else "+".join(sorted({each.code for each in found}))
        counted[kind + (", nothing lost" if read is not None and not findings.losses else "")] += 1
    with capsys.disabled():
        print(
            f"\n{sum(counted.values())} blocks:",
            *(f"\n  {number:>4}  {kind}" for kind, number in counted.most_common()),
        )
    assert counted
