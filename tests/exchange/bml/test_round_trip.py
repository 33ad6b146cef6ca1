"""An act, its block, and the act again: the same, for every shipped act and for random ones."""

from __future__ import annotations

import string
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree
from rise_exchange.bml.names import BmlNames, ConversionFindings
from rise_exchange.bml.schema import block_schema_text
from rise_exchange.bml.writing import act_file_text, write_act

from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Act, Action, ActionCall, ActSettings, Scenario
from rise_engine.scenario.speech.template import key_template, parse_template
from tests.exchange.bml.samples import NAMES, parts, read_text

SCHEMA = etree.RelaxNG(etree.fromstring(block_schema_text().encode()))
STUDIES = sorted(path.parent for path in Path("scenarios").glob("*/scenario.toml"))
MEMORY = {"k": 600, "name": "An\x00na", "empty": ""}


def written(act: Act, names: BmlNames, scenario: Scenario | None = None) -> tuple[str, list[str]]:
    """The text of a block, and what is lost."""
    findings = ConversionFindings()
    memory = MEMORY if scenario is None else scenario.memory
    settings = (scenario.act_settings if scenario else {}).get(act.name, ActSettings())
    text = write_act(act, settings.calling_type, memory, names, findings)
    assert not findings.diagnostics.errors
    return text, [str(each) for each in findings.losses]


@pytest.mark.parametrize("folder", STUDIES, ids=lambda path: path.name)
def test_every_shipped_act_comes_back(folder: Path) -> None:
    scenario = load(folder).scenario
    assert scenario is not None
    for act in scenario.acts.values():
        text, _ = written(act, BmlNames(scenario.robot), scenario)
        SCHEMA.assertValid(etree.fromstring(text.encode()))
        found = read_text(text, BmlNames(scenario.robot))
        assert parts(found.act) == parts(act)
        assert found.read is not None and not found.losses
        assert found.read.calling_type == scenario.act_settings.get(act.name, ActSettings()).calling_type


# --- random acts ----------------------------------------------------------------------------------------------------

WORDS = st.text(
    st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Cn"), include_characters="\t"), max_size=12
)
PLAIN = WORDS.map(lambda text: text.replace("{", "{{").replace("}", "}}"))
TEXTS = st.one_of(
    PLAIN,
    st.tuples(PLAIN, st.sampled_from(["{k}", "{name|friend}", "{gone}", "{empty}", '{", "name}']), PLAIN).map("".join),
    st.just('<speak>Well, <break time="500ms"/> {name|you} &amp; me.</speak>'),
).map(str.strip)
NUMBERS = st.one_of(
    st.sampled_from(["0", "1", "400", "600", "1000.0", "0.5", "33.3", "1e3", "{k}", "{gone|2}"]),
    st.integers(0, 5000).map(str),
)
POINTS = st.sampled_from(["0", "1.5", "1.50", "-0.35", "{k}", "1.2", "-1", "2"])
NAMED = {
    "Emotion": ["neutral", "happy", "1", "{name}", "surprised"],
    "Animation": ["head_nod", "head_shake", "1", "engagement_left", "eyebrows_raise", "idle", "{name}"],
}
IDS = st.one_of(st.integers(1, 99).map(str), st.text(string.ascii_letters + "_-.+äß", min_size=1, max_size=4))


@st.composite
def calls(draw: st.DrawFn, type: str) -> ActionCall:
    """An action of a type, with random parameters."""
    values: dict[str, str] = {}
    if type == "Speech":
        values["message"] = draw(TEXTS.filter(bool))
        if draw(st.booleans()):
            values["rate"] = "0.8"
    elif type in ("LookAt", "PointAt"):
        values |= {f"point{axis}": draw(POINTS) for axis in "xyz"}
        if draw(st.booleans()):
            values["hand" if type == "PointAt" else "roll"] = (
                draw(st.sampled_from(["left", "auto"])) if type == "PointAt" else "0"
            )
    elif type == "Wait":
        values["duration"] = draw(NUMBERS)
    else:
        values["value"] = draw(st.sampled_from(NAMED[type]))
    if type not in ("Speech", "Wait") and draw(st.booleans()):
        values["duration"] = draw(NUMBERS)
    if type == "Animation" and draw(st.booleans()):
        values["repetitions"] = draw(st.sampled_from(["1", "2", "3", "{k}"]))
    parameters = {name: parse_template(value) for name, value in values.items()}
    if type == "LookAt" and draw(st.booleans()):
        parameters["pointx"] = key_template("k")
    return ActionCall(type, parameters)


@st.composite
def acts(draw: st.DrawFn) -> Act:
    """A random act: each action waits for some of those before it."""
    ids = draw(st.lists(IDS, unique=True, max_size=6))
    actions = []
    for number, id in enumerate(ids):
        type = draw(st.sampled_from(["Speech", "LookAt", "PointAt", "Emotion", "Animation", "Wait"]))
        several = draw(st.lists(calls(type), min_size=1, max_size=3))
        wait_for = tuple(draw(st.lists(st.sampled_from(ids[:number]), unique=True))) if number else ()
        actions.append(Action(id, tuple(several), wait_for, draw(st.booleans())))
    return Act(draw(st.sampled_from(["R_A", "1. Begin", "Grüße & so", 'say "hi"'])), tuple(actions))


@given(acts())
def test_every_act_comes_back(act: Act) -> None:
    text, losses = written(act, NAMES)
    root = etree.fromstring(text.encode())
    SCHEMA.assertValid(root)
    found = read_text(text)
    assert parts(found.act) == parts(act)
    assert not found.losses
    for action in act.actions:
        several = len(action.wait_for) > 1
        assert several == any(f"action {action.id}: it begins when several have ended" in each for each in losses)


@given(acts())
def test_every_act_is_a_file_of_a_scenario(act: Act) -> None:
    """The file that an act is written to is read as the same act."""
    if any(
        b"<speak" in template.text.encode()
        for each in act.actions
        for call in each.calls
        for template in call.parameters.values()
    ):
        return  # as XML, its entities are written anew
    loaded = load(
        "scenarios/none", held={"scenario.toml": b'robot = "floka"', "acts/a.xml": act_file_text(act, "b.xml").encode()}
    )
    definitions = [each.part for each in loaded.draft.act_definitions if isinstance(each.part, Act)]
    assert [parts(each) for each in definitions] == [parts(act)], loaded.diagnostics
