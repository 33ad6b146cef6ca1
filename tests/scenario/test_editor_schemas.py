"""The schemas that editors use say the same as the checks, as far as a schema can."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import permutations
from pathlib import Path

import pytest
from lxml import etree

from rise_engine.scenario.editor_schemas import act_schema_text, rule_schema_text
from rise_engine.scenario.grammar import COMMON, ELEMENTS
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import ActionSpec
from rise_engine.scenario.reading import element_templates
from rise_engine.scenario.reading.action_declarations import core_actions
from tests.scenario.folders import LISTINGS, SPEECH, act, in_state, loaded
from tests.scenario.test_diagnostics import ACTS, RULES

BEYOND = (
    "duplicate-id unknown-id cycle bad-name wrong-type out-of-range unknown-name template unset-key unknown-path",
    "empty-act unknown-act unknown-rule unheard-event assignment bare-word condition odd-blank unraised-event",
    "unknown-state duplicate-state unreachable-state unreachable-transition no-effect ambiguous-else missing-value",
    "short-loop own-session",
)
"""Codes of what a schema cannot see: names, references, values, conditions."""
STUDIES = sorted(path.parent for path in (Path(__file__).parents[2] / "scenarios").glob("*/scenario.toml"))
SHIPPED = Path(__file__).parents[2] / "scenarios" / "greeting"
_BEYOND = {code for line in BEYOND for code in line.split()}


def compiled(text: str) -> etree.RelaxNG:
    return etree.RelaxNG(etree.fromstring(text.encode()))


def act_schema(actions: Mapping[str, ActionSpec]) -> etree.RelaxNG:
    return compiled(act_schema_text(actions))


@cache
def rule_schema() -> etree.RelaxNG:
    return compiled(rule_schema_text())


def codes(expected: list[str]) -> set[str]:
    return {each.split()[1] for each in expected}


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_every_shipped_study_is_valid(study: Path) -> None:
    """In lxml's own eyes, with the schema that `rise-engine schema DIR` writes."""
    scenario = load(study).scenario
    acts, rules = act_schema(scenario.robot.actions), rule_schema()
    for kind, schema in (("acts", acts), ("rules", rules)):
        place = study / scenario.paths[kind]
        files = sorted(place.glob("*.xml")) if place.is_dir() else [place]
        assert files
        for file in files:
            assert schema.validate(etree.parse(file)), f"{file}: {schema.error_log}"


def names(text: str, what: str) -> set[str]:
    return set(etree.fromstring(text.encode()).xpath(f"//*[local-name()='{what}']/@name"))


def test_the_reader_and_the_schemas_have_the_same_words() -> None:
    """No element and no attribute that only the schemas know, and none that only the reader knows."""
    forms = {tag: form for tag, form in ELEMENTS.items() if form.place}
    known = {name for form in forms.values() for name in form.attributes}
    of_templates = {*element_templates._TEMPLATE, *element_templates._PARAMETER, "template"}
    assert names(rule_schema_text(), "attribute") == known | of_templates
    assert names(rule_schema_text(), "element") == {"InteractionRules", *forms, "Template", "parameter", "use"}
    core = core_actions()
    assert names(act_schema_text(core), "attribute") == {"name"} | of_templates
    assert names(act_schema_text(core), "element") == {
        *("Dialogs", "AgentDialogs", "CommunicationRobotActs", "Dialog", "Variants"),
        *("Template", "parameter", "use"),
        *COMMON,
        *core,
        *(parameter for spec in core.values() for parameter in spec.parameters),
    }


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


def test_templates_are_valid() -> None:
    acts = act_schema(core_actions())
    say = '<Template name="Say"><parameter name="id"/><parameter name="after" default=""/>\n' + SPEECH + "</Template>"
    use = '<use template="Say" id="1"/>'
    assert acts.validate(etree.fromstring(say))
    assert acts.validate(etree.fromstring(f"<Dialogs>{say}{use}{act(use + SPEECH)}</Dialogs>"))
    for wrong in ("<Template/>", "<use/>", f"<Dialogs>{use[:-2]}><x/></use></Dialogs>", act(say)):
        assert not acts.validate(etree.fromstring(wrong)), wrong
    way = '<Template name="Way"><parameter name="x"/><transition after="${x}s" target="S"/><onExit/></Template>'
    states = (
        f'<InteractionRule name="R" initial="S" priority="${{p}}"><State id="S">{use}</State>{use}</InteractionRule>'
    )
    rules_ = f"<InteractionRules>{way}{use}{states}<Template name='R'>{states}</Template></InteractionRules>"
    assert rule_schema().validate(etree.fromstring(rules_)), rule_schema().error_log
    for function in ("<function raiseEventTopic='/x'/>", use, "<oneOf>" + use + "</oneOf>", f"<if cond='x'>{use}</if>"):
        assert rule_schema().validate(etree.fromstring(in_state(function))), function
        assert rule_schema().validate(etree.fromstring(f"<Template name='T'>{function}</Template>")), function


def test_the_listings_are_valid() -> None:
    assert act_schema(core_actions()).validate(etree.parse(LISTINGS / "listing1.xml"))
    assert rule_schema().validate(etree.parse(LISTINGS / "listing2.xml"))


def test_declared_actions_are_in_the_schema(tmp_path: Path) -> None:
    toml = "[actions.Drive]\nhelp = 'To & fro <'\nparameters.where = { type = 'name', names = ['a', 'b<'] }\n"
    scenario, diagnostics = loaded(tmp_path, {"scenario.toml": toml})
    assert diagnostics == []
    schema = act_schema(scenario.robot.actions)
    assert schema.validate(etree.fromstring(act("<Drive><actionID>1</actionID><where>a</where></Drive>")))
    assert not schema.validate(etree.fromstring(act("<Drive><actionID>1</actionID><were>a</were></Drive>")))


def test_a_help_text_that_xml_cannot_hold(tmp_path: Path) -> None:
    """It came from a robot's profile, and made the whole check fall."""
    toml = '[actions.Drive]\nhelp = "a\\u0007b"\nparameters.where = { type = "name", names = ["a\\u0001"] }\n'
    scenario, diagnostics = loaded(tmp_path, {"scenario.toml": toml, "acts/a.xml": act(SPEECH)})
    assert diagnostics == []
    act_schema(scenario.robot.actions)


@pytest.mark.parametrize("name", ["ª", "Löwe\u0301", "𝐀", "1a", "a b", "a:b", "", "µ", "\ufffe"])
def test_an_action_is_called_what_an_element_can_be_called(tmp_path: Path, name: str) -> None:
    scenario, diagnostics = loaded(tmp_path, {"scenario.toml": f'[actions."{name}"]\n', "acts/a.xml": act(SPEECH)})
    try:
        element = etree.Element(name).tag == name and ":" not in name
    except ValueError:
        element = False
    if diagnostics:
        assert [diagnostic.code for diagnostic in diagnostics] == ["bad-name"]
    else:
        assert element
        act_schema(scenario.robot.actions)


def test_the_order_of_what_an_action_holds() -> None:
    """libxml2 refused one of these when an `<interleave>` stood within another, for robots that know more emotions."""
    schemas = act_schema(core_actions()), act_schema(load(SHIPPED).scenario.robot.actions)
    parts = (
        "<actionID>1</actionID>",
        "<onFailure>continue</onFailure>",
        "<value>sad</value>",
        "<duration>6</duration>",
    )
    for order in permutations((*parts, "<waitForActions> </waitForActions>")):
        text = act(f"<Emotion>{''.join(order)}</Emotion>")
        assert all(schema.validate(etree.fromstring(text)) for schema in schemas), order
