"""`rise-engine graph`: rules and acts as text, SVG and Mermaid."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from hypothesis import example, given
from hypothesis import strategies as st

from rise_engine.author.drawing.pictures import mermaid_of_rules, picture_of_rule, svg_text, text_of
from rise_engine.author.drawing.state_graph import cell_length, shorten_to
from rise_engine.cli import main
from rise_engine.cli.scenario.graph import FORMATS, graph_text
from rise_engine.cli.terminal import Refused
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Rule, Scenario, State, Transition
from tests.sources import ROOT

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def lablinking() -> Scenario:
    scenario = load(ROOT / "scenarios/lablinking").scenario
    assert scenario is not None
    return scenario


def loop() -> Rule:
    return Rule(
        "Ask",
        "Ask",
        {
            "Ask": State("Ask", transitions=(Transition("yes", target="Done"), Transition("no", target="Help"))),
            "Help": State("Help", transitions=(Transition("again", target="Ask"), Transition("hm"))),
            "Done": State("Done"),
        },
    )


def test_a_rule_as_text() -> None:
    assert text_of(picture_of_rule(loop(), 60)) == [
        "   ╭►○ Ask  start",
        " ╭─│─┤ yes",
        " │ │ ↓ no",
        " │ │ ○ Help",
        " │ ╰─┤ again",
        " │   ↺ hm  stays",
        " ╰──►○ Done  end",
    ]


def test_no_line_is_wider_than_asked_and_every_state_and_way_is_there(lablinking: Scenario) -> None:
    rule = lablinking.rules["Table setting"]
    for width in (60, 78, 120):
        lines = text_of(picture_of_rule(rule, width))
        assert max(map(cell_length, lines)) <= width
        text = "\n".join(lines)
        ways = [kind for state in rule.states.values() for kind in state.transitions]
        assert text.count("○") == 45
        assert text.count("repeat") == sum(kind.event == "repeat" for kind in ways) > 10
    assert all(name in text for name in rule.states)


def test_the_svg_is_a_drawing_with_all_texts_that_can_be_selected(lablinking: Scenario) -> None:
    text = graph_text(lablinking, "Table setting", "svg", 100)
    assert text == graph_text(lablinking, "Table setting", "svg", 100)
    root = ElementTree.fromstring(text)
    assert root.find(f"{SVG}title") is not None and root.find(f"{SVG}desc") is not None
    assert len(root.findall(f".//{SVG}circle")) == 45
    said = [node.text for node in root.iter(f"{SVG}text")]
    assert {"Welcome", "After the welcome", "Goodbye", "repeat"} <= set(said)
    width, height = (float(root.attrib[side]) for side in ("width", "height"))
    for node in root.iter(f"{SVG}text"):
        if "textLength" in node.attrib:
            assert float(node.attrib["x"]) + float(node.attrib["textLength"]) <= width
    numbers = [float(number) for node in root.iter(f"{SVG}path") for number in re.findall(r"\d+", node.attrib["d"])]
    assert max(numbers) <= max(width, height) and len(text) < 40_000


def test_all_rules_go_into_one_drawing(lablinking: Scenario) -> None:
    for format in FORMATS:
        text = graph_text(lablinking, "", format, 100)
        for name in lablinking.rules:
            assert name in text, (format, name)


def test_an_act_in_every_format(lablinking: Scenario) -> None:
    text = graph_text(lablinking, "R_Task1_Step1", "text", 80)
    assert "act R_Task1_Step1: 8 actions" in text and "“Take the large plate.”" in text
    assert "a0_1 --> a0_3" in graph_text(lablinking, "R_Task1_Step1", "mermaid", 80)
    assert "R_Praise" in graph_text(lablinking, "", "svg", 80, act=True)


def test_what_is_not_there_is_named_with_what_is_nearest(lablinking: Scenario) -> None:
    with pytest.raises(Refused, match="there is no rule and no act `Tabel setting`; did you mean `Table"):
        graph_text(lablinking, "Tabel setting", "text", 80)
    with pytest.raises(Refused, match="there is no act `Table setting`"):
        graph_text(lablinking, "Table setting", "text", 80, act=True)


def test_ways_in_mermaid() -> None:
    mermaid = mermaid_of_rules([loop()])
    assert mermaid.splitlines()[:3] == ["stateDiagram-v2", "    %% rule Ask", '    state "Ask" as s0']
    ids: dict[str, str] = dict(re.findall(r'state "(\w+)" as (s\d)', mermaid))
    assert f"{ids['Ask']} --> {ids['Done']} : yes" in mermaid and f"{ids['Done']} --> [*]" in mermaid
    assert f"{ids['Help']} --> {ids['Help']} : hm (stays)" in mermaid and f"[*] --> {ids['Ask']}" in mermaid


NASTY = st.text(st.sampled_from('aß挨"\\;:#<>&%{}\n\x1b\u202e\u0301│► '), min_size=1, max_size=12)


@given(names=st.lists(NASTY, min_size=1, max_size=5, unique=True), topic=NASTY)
@example(names=[":"], topic=": \"'")
@example(names=["a"], topic="%%{init: {'theme': 'dark'}}%%")
def test_whatever_states_are_called_it_stays_a_drawing(names: list[str], topic: str) -> None:
    states = {
        name: State(name, transitions=(Transition(topic, target=names[(at * 2 + 1) % len(names)]),))
        for at, name in enumerate(names)
    }
    rule = Rule(topic, names[0], states)
    picture = picture_of_rule(rule, 60)
    lines = text_of(picture)
    assert all("\x1b" not in line and "\n" not in line for line in lines)
    ElementTree.fromstring(svg_text(topic, [picture]))
    mermaid = mermaid_of_rules([rule])
    assert len(mermaid.splitlines()) == 3 + 2 * len(names)
    assert all(mark not in line.partition(" : ")[2] for line in mermaid.splitlines() for mark in '"<>')
    assert "%%{" not in mermaid, "a directive, wherever it is: Mermaid would obey it"


@given(text=NASTY, width=st.integers(0, 12))
def test_shortened_texts_fit(text: str, width: int) -> None:
    assert cell_length(shorten_to(text, width)) <= width


def test_the_command_writes_files_and_refuses_what_it_must(tmp_path: Path) -> None:
    runner, folder = CliRunner(), str(ROOT / "scenarios/lablinking")
    picture = tmp_path / "rule.svg"
    assert runner.invoke(main, ["graph", folder, "Table setting", "--format", "svg", "-o", str(picture)]).exit_code == 0
    assert picture.read_bytes().startswith(b"<svg")
    shown = runner.invoke(main, ["graph", folder, "Next"])
    assert shown.exit_code == 0 and shown.output.startswith("rule Next: 1 state, 0 transitions\n")
    assert runner.invoke(main, ["graph", folder, "Nxt"]).exit_code == 2
    assert runner.invoke(main, ["graph", folder, "-o", str(tmp_path / "no/where.txt")]).exit_code == 1
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken/scenario.toml").write_text("title = ")
    assert runner.invoke(main, ["graph", str(tmp_path / "broken")]).exit_code == 1
