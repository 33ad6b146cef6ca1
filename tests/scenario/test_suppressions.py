"""Warnings that are meant are silenced where they stand, with a reason."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import rise_engine.scenario
from rise_engine.scenario.diagnostics import WARNING_CODES
from tests.commands import typed
from tests.scenario.folders import SPEECH, act, found, in_state, loaded, rule

ELSE = '<if cond="k"><if cond="k"/>{}<else/></if>'
MEMORY = '{"k": 1}'


def quiet(result: rise_engine.scenario.LoadResult) -> list[str]:
    return [f"{each.diagnostic.location} {each.diagnostic.code} {each.reason}" for each in result.suppressed]


def test_at_its_place_and_with_its_reason(tmp_path: Path) -> None:
    entry = ELSE.format("\n<!-- check: allow ambiguous-else: we\n mean it -->\n<!-- so there -->\n")
    result = loaded(tmp_path, {"rules/r.xml": in_state(entry), "memory.json": MEMORY})
    assert found(result) == [] and result.scenario is not None
    assert quiet(result) == ["rules/r.xml:7:1 ambiguous-else we mean it"]


@pytest.mark.parametrize(
    ("comment", "expected"),
    [
        ("", ["ambiguous-else"]),
        ("<!-- check this later -->", ["ambiguous-else"]),
        ("<!-- check: allow ambiguous-else -->", ["ambiguous-else", "bad-allow"]),
        ("<!-- check: allow ambiguous-else: -->", ["ambiguous-else", "bad-allow"]),
        ("<!-- check: allow -->", ["ambiguous-else", "bad-allow"]),
        ("<!-- check: allow ambigous-else: we mean it -->", ["ambiguous-else", "bad-allow"]),
        ("<!-- check: allow unset-key: we mean it -->", ["ambiguous-else", "unused-allow"]),
        ("<!-- check: allow ambiguous-else: a --><!-- check: allow ambiguous-else: b -->", ["unused-allow"]),
    ],
)
def test_a_silencing_that_does_nothing_is_a_finding(tmp_path: Path, comment: str, expected: list[str]) -> None:
    result = loaded(tmp_path, {"rules/r.xml": in_state(ELSE.format(comment)), "memory.json": MEMORY})
    assert sorted(diagnostic.code for diagnostic in result.diagnostics) == expected
    assert all(diagnostic.severity == "warning" for diagnostic in result.diagnostics)


def test_only_the_element_itself_is_covered(tmp_path: Path) -> None:
    """Neither what is in it, nor what follows; and its text counts as its own."""
    body = (
        "<!-- check: allow unset-key: of the action, but the text is deeper -->\n"
        "<Speech><actionID>1</actionID><message>{nobody}</message></Speech>\n"
        "<Speech><actionID>2</actionID>"
        "<!-- check: allow unset-key: the camera node --><message>Hi <!-- x --> {nobody}</message></Speech>"
    )
    result = loaded(tmp_path, {"acts/a.xml": act(body)})
    assert found(result) == ["acts/a.xml:2:1 unused-allow", "acts/a.xml:3:40 unset-key"]
    assert quiet(result) == ["acts/a.xml:4:102 unset-key the camera node"]


def test_what_looks_like_one_is_none(tmp_path: Path) -> None:
    body = SPEECH.replace("Hello", "<![CDATA[<!-- check: allow unset-key: no -->]]>")
    assert found(loaded(tmp_path, {"acts/a.xml": act(body)})) == []


def test_before_nothing(tmp_path: Path) -> None:
    body = f"{SPEECH}<!-- check: allow empty-act: why -->"
    files: dict[str, str | bytes] = {"acts/a.xml": act(body), "scenario.toml": "# check: allow no-filler: why\n"}
    result = loaded(tmp_path, files)
    assert [diagnostic.code for diagnostic in result.diagnostics] == ["bad-allow", "bad-allow"]


def test_errors_are_never_silenced(tmp_path: Path) -> None:
    body = "<!-- check: allow unset-key: x --><Speach><actionID>1</actionID></Speach>"
    result = loaded(tmp_path, {"acts/a.xml": act(body)})
    assert [diagnostic.code for diagnostic in result.diagnostics] == ["unknown-action"], (
        "and nothing is said to be superfluous"
    )


def test_in_toml(tmp_path: Path) -> None:
    toml = (
        "[keys]\n# check: allow unheard-event: the camera waits for it\n# another word\n\n"
        'a = { event = "/look" }\nb = { event = "/see" }\n'
    )
    result = loaded(tmp_path, {"scenario.toml": toml})
    assert found(result) == ["scenario.toml:6:15 unheard-event"]
    assert quiet(result) == ["scenario.toml:5:15 unheard-event the camera waits for it"]


@pytest.mark.parametrize(
    ("allow", "expected"),
    [
        ('{ code = "unwritable-key", key = "my key", reason = "of the questionnaire" }', []),
        ('{ code = "unwritable-key", key = "my kye", reason = "x" }', ["unused-allow", "unwritable-key"]),
        ('{ code = "unset-key", key = "my key", reason = "x" }', ["unused-allow", "unwritable-key"]),
        ('{ code = "unwritable-kee", key = "my key", reason = "x" }', ["bad-allow", "unwritable-key"]),
        ('{ code = "unwritable-key", key = "my key" }', ["bad-allow", "unwritable-key"]),
        ('{ code = "unwritable-key", key = "my key", reason = " " }', ["bad-allow", "unwritable-key"]),
        ('"unwritable-key"', ["unwritable-key", "wrong-type"]),
    ],
)
def test_the_memory_has_no_comments(tmp_path: Path, allow: str, expected: list[str]) -> None:
    files: dict[str, str | bytes] = {"scenario.toml": f"[check]\nallow = [{allow}]\n", "memory.json": '{"my key": 1}'}
    assert sorted(diagnostic.code for diagnostic in loaded(tmp_path, files).diagnostics) == expected


def test_check_says_how_many(tmp_path: Path) -> None:
    entry = ELSE.format("<!-- check: allow ambiguous-else: we mean it -->")
    loaded(tmp_path, {"rules/r.xml": in_state(entry), "memory.json": MEMORY})
    short = typed("check", tmp_path)
    assert short.exit_code == 0 and short.output.startswith("no errors or warnings, 1 silenced (")
    long = typed("check", tmp_path, "--all").output.splitlines()
    assert "silenced ambiguous-else: " in long[0] and long[0].endswith("(reason: we mean it)")
    answer = json.loads(typed("check", tmp_path, "--json").output)
    assert answer["warnings"] == 0 and answer["findings"] == []
    assert answer["silenced"][0]["reason"] == "we mean it" and answer["silenced"][0]["code"] == "ambiguous-else"


def test_every_warning_can_be_silenced() -> None:
    codes: set[str] = set()
    for path in Path(rise_engine.scenario.__file__).parent.rglob("*.py"):
        warning = r"\.(?:report_)?warning\(\s*(?:unknown_code\()?\"([a-z-]+)\""
        codes.update(re.findall(warning, path.read_text("utf-8")))
    assert codes - {"bad-allow", "unused-allow"} == WARNING_CODES - {"unicode-form"}


@pytest.mark.slow
def test_the_work_grows_with_the_file_only(tmp_path: Path) -> None:
    """Thousands of silencings, one behind the other and each before its warning."""
    comments = "<!-- check: allow unset-key: x -->" * 20_000
    speech = "<!-- check: allow unset-key: x --><message>{nobody}</message>"
    actions = "".join(f"<Speech><actionID>{n}</actionID>{speech}</Speech>" for n in range(3_000))
    lines = "# check: allow no-filler: x\n" * 20_000
    result = loaded(
        tmp_path,
        {"acts/a.xml": act(actions + comments), "scenario.toml": lines, "rules/r.xml": rule('<State id="S"/>')},
    )
    assert len(result.suppressed) == 3_000
    assert len(result.diagnostics) == 40_000
