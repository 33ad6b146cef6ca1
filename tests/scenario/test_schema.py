"""The schemas that editors use say the same as the checks, as far as a schema can."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from rise_engine.scenario.actions import core_actions
from rise_engine.scenario.relaxng import FOLDER, act_schema, act_schema_text, rule_schema, rule_schema_text
from tests.scenario.folders import LISTINGS, act, in_state, loaded, rule
from tests.scenario.test_findings import ACTS, RULES

BEYOND = (
    "duplicate-id unknown-id cycle bad-name wrong-type out-of-range unknown-name template unset-key unknown-path",
    "empty-act unknown-act unknown-rule unheard-event assignment bare-word condition reads-differently unraised-event",
    "unknown-state duplicate-state unreachable-state unreachable-transition no-effect ambiguous-else missing-value",
    "short-loop",
)
"""Codes of what a schema cannot see: names, references, values, conditions."""
_BEYOND = {code for line in BEYOND for code in line.split()}


def codes(expected: list[str]) -> set[str]:
    return {each.split()[1] for each in expected}


def test_the_files_are_what_the_functions_give() -> None:
    assert (FOLDER / "cra.rng").read_text("utf-8") == act_schema_text(core_actions())
    assert (FOLDER / "rules.rng").read_text("utf-8") == rule_schema_text()


@pytest.mark.parametrize("name", ACTS)
def test_acts_agree(name: str) -> None:
    body, expected = ACTS[name]
    accepted = act_schema(core_actions()).validate(etree.fromstring(act(body)))
    special = {"2:29 missing-parameter", "2:1 variants"} & set(expected)  # an empty text; only one variant
    if special and name != "empty variants" and name != "mixed variants":
        return
    assert accepted == (codes(expected) <= _BEYOND), expected


@pytest.mark.parametrize("name", [name for name in RULES if not name.startswith(("raw", "quotes"))])
def test_rules_agree(name: str) -> None:
    entry, rest, expected = RULES[name]
    accepted = rule_schema().validate(etree.fromstring(in_state(entry, rest)))
    if name != "two else":  # one inside the `if`, one behind it: a schema cannot see both
        assert accepted == (codes(expected) <= _BEYOND), expected


def test_the_listings_are_valid() -> None:
    assert act_schema(core_actions()).validate(etree.parse(LISTINGS / "listing1.xml"))
    assert rule_schema().validate(etree.parse(LISTINGS / "listing2.xml"))


def test_declared_actions_are_in_the_schema(tmp_path: Path) -> None:
    toml = "[actions.Drive]\nhelp = 'To & fro <'\nparameters.where = { type = 'name', names = ['a', 'b<'] }\n"
    scenario, findings = loaded(tmp_path, {"scenario.toml": toml})
    assert findings == []
    schema = act_schema(scenario.robot.actions)
    assert schema.validate(etree.fromstring(act("<Drive><actionID>1</actionID><where>a</where></Drive>")))
    assert not schema.validate(etree.fromstring(act("<Drive><actionID>1</actionID><were>a</were></Drive>")))


def test_a_refusal_by_the_schema_alone_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    grammar = '<element name="x" xmlns="http://relaxng.org/ns/structure/1.0"><empty/></element>'
    nothing = etree.RelaxNG(etree.fromstring(grammar))
    monkeypatch.setattr("rise_engine.scenario.loader.rule_schema", lambda: nothing)
    result = loaded(tmp_path, {"rules/r.xml": rule('<State id="S"/>')})
    assert [finding.code for finding in result.findings] == ["schema"]
    assert result.scenario is None
