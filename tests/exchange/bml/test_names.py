"""What a lab calls its targets and lexemes (docs/reference/bml.md, "Names")."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from rise_exchange.bml.names import BmlNames, LexemeKind, TargetPoint, read_names

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import SourceFile
from tests.exchange.bml.samples import NAMES, ROBOT

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
