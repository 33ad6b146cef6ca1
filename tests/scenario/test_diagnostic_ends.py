"""What an editor underlines: each finding has an end, in all kinds of files."""

from __future__ import annotations

import pytest
from msgspec import UNSET

from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.loader import load
from tests.scenario.folders import SPEECH, act, in_state
from tests.scenario.test_diagnostics import ACTS, FILES, RULES


def underlined(finding: Diagnostic, held: dict[str, bytes]) -> str:
    data = held[finding.location.file]
    source = SourceFile(finding.location.file, data, data.decode("utf-8-sig"))
    assert finding.end is not UNSET and finding.end.file == finding.location.file
    start = source.offset(finding.location.line, finding.location.column)
    return source.text[start : source.offset(finding.end.line, finding.end.column)]


def check(files: dict[str, str | bytes]) -> list[tuple[str, str]]:
    held = {name: text.encode() if isinstance(text, str) else text for name, text in files.items()}
    found = load("/nowhere", held=held).diagnostics
    return [(each.code, underlined(each, held)) for each in found if each.end is not UNSET]


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({"acts/a.xml": act("<Wat/>")}, ("unknown-action", "<Wat")),
        ({"acts/a.xml": act('<Speech  x="1"><actionID>1</actionID></Speech>')}, ("unknown-attribute", "x")),
        ({"acts/a.xml": act(SPEECH.replace("</S", "<waitForActions>7 ; 8</waitForActions></S"))}, ("unknown-id", "8")),
        ({"acts/a.xml": act(SPEECH, "A &amp; B") + " "}, None),
        ({"rules/r.xml": in_state('<function startInteractionRule="A &lt; ß"/>')}, ("unknown-rule", "A &lt; ß")),
        ({"rules/r.xml": in_state("<if cond='session.speeking'/>")}, ("unknown-path", "session.speeking")),
        ({"rules/r.xml": in_state("<if cond='1 = % 2'/>")}, ("condition", "%")),
        ({"scenario.toml": "titel = 'x'"}, ("unknown-key", "titel")),
        ({"scenario.toml": "[keys]\n1 = { act = 'No one' }\n"}, ("unknown-act", "'No one'")),
        ({"scenario.toml": "[act.No]\nhold = true\n"}, ("unknown-act", "No")),
        ({"scenario.toml": "mode = true\n"}, ("wrong-type", "true")),
        ({"scenario.toml": "title = nonsense\n"}, ("toml-syntax", "nonsense")),
        ({"memory.json": '{"a": 1, "a": 2}'}, ("duplicate-key", '"a"')),
        ({"memory.json": '{"a": tru}'}, ("json-syntax", "tru")),
        ({"tables/t.csv": 'a,b\n1,2,"x y",4\n'}, ("table-form", '"x y"')),
        ({"acts/a.xml": "<Dialogs>\n"}, ("not-well-formed", "")),
    ],
)  # fmt: skip
def test_what_is_underlined(files: dict[str, str | bytes], expected: tuple[str, str] | None) -> None:
    found = check(files)
    assert expected in found if expected is not None else found == []


def test_each_finding_has_an_end_in_its_line() -> None:
    """In all cases of the tests of findings: something is underlined, unless the file ends there."""
    for body, _ in ACTS.values():
        assert all(text.strip() for _, text in check({"acts/a.xml": act(body), "memory.json": '{"pause": 5}'}))
    for entry, rest, _ in RULES.values():
        files: dict[str, str | bytes] = {"acts/a.xml": act(SPEECH), "rules/r.xml": in_state(entry, rest)}
        assert all(text.strip() for _, text in check({**files, "memory.json": '{"pause": 5}'}))
    for files, _ in FILES.values():
        assert not any("\n" in text or "\r" in text for _, text in check(files))
