"""What is proposed where, in files that are half written."""

from __future__ import annotations

import pytest

from rise_engine.author.lsp.completion import proposals
from rise_engine.author.lsp.served_study import PositionEncoding, TextPositions
from rise_engine.scenario.loader import load
from tests.scenario.folders import SPEECH, act

HELD = {
    "acts/a.xml": act(SPEECH, "R_A").encode(),
    "memory.json": b'{"who": {"name": "x"}, "n": 1}',
    "rules/r.xml": b'<InteractionRule name="R" initial="S"><State id="S"><transition eventTopic="/go" target="T"/>'
    b'</State><State id="T"/></InteractionRule>',
    "tables/items.csv": b"text\na\n",
}
IN_RULE = '<InteractionRule name="R" initial="S"><State id="S"><onEntry>'
IN_ACT = '<Dialogs><Dialog name="R_A"><Speech><actionID>1</actionID>'


def proposed(name: str, text: str) -> tuple[str, list[str]]:
    """At `|`: the text that is replaced, and what is proposed."""
    at = text.index("|")
    whole = text[:at] + text[at + 1 :]
    start, found = proposals(load("/nowhere", held=HELD), name, whole, at)
    return whole[start:at], [each.text for each in found]


@pytest.mark.parametrize(
    ("text", "replaced", "expected"),
    [
        (IN_RULE + '<function startCommunicationRobotAct="R|', "R", ["R_A"]),
        (IN_RULE + '<function startInteractionRule="|"/>', "", ["R"]),
        (IN_RULE + "<function startInteractionRule='R' state='|'/>", "", ["S", "T"]),
        (IN_RULE + "<!-- <x> --></onEntry><transition ended='R_A' target='|", "", ["S", "T"]),
        ('<InteractionRule name="R" initial="|', "", ["S", "T"]),
        (IN_RULE + '<if cond="n > 1 and w|ho"/>', "w", ["items", "n", "who"]),
        (IN_RULE + '<function assignValue="n = |', "", ["items", "n", "who"]),
        (IN_RULE + "</onEntry><|", "", ["onEntry", "onExit", "transition"]),
        (IN_RULE + "<fu|", "fu", ["function", "if", "oneOf"]),
        (IN_RULE + "<if |", "", ["cond"]),
        (IN_ACT + "<message>Hello {w|</message>", "w", ["items", "n", "who"]),
        (IN_ACT + "<waitForActions>|</waitForActions>", "", ["1"]),
        (IN_ACT + "<message>Hello|</message>", "", []),
        ("<!-- <State |", "", []),
    ],
)
def test_proposals_in_xml(text: str, replaced: str, expected: list[str]) -> None:
    assert proposed("rules/r.xml", text) == (replaced, expected)


def test_events_with_those_of_the_engine() -> None:
    replaced, found = proposed("rules/r.xml", IN_RULE + '</onEntry><transition eventTopic="/|"/>')
    assert replaced == "/" and {"/go", "/R_A_end", "/R_A_failed", "/R_end"} <= set(found)


def test_actions_parameters_and_names_of_the_robot() -> None:
    assert {"Speech", "Wait", "Variants"} <= set(proposed("acts/a.xml", '<Dialogs><Dialog name="R_A"><|')[1])
    assert {"message", "actionID", "waitForActions"} <= set(proposed("acts/a.xml", IN_ACT + "<|")[1])
    emotions = '<Dialogs><Dialog name="R_A"><Emotion><actionID>1</actionID><value>ha|'
    replaced, found = proposed("acts/a.xml", emotions)
    assert replaced == "ha" and any("happy" in each for each in found)


@pytest.mark.parametrize(
    ("text", "replaced", "expected"),
    [
        ('[keys]\n1 = { act = "R|" }', "R", ["R_A"]),
        ("[keys]\n1 = { rule = 'R', state = '|", "", ["S", "T"]),
        ('[keys]\n1 = { set = "n = w|', "w", ["items", "n", "who"]),
        ('private = ["n", "|', "", ["items", "n", "who"]),
        ("title = |", "", []),
    ],
)
def test_proposals_in_toml(text: str, replaced: str, expected: list[str]) -> None:
    assert proposed("scenario.toml", text) == (replaced, expected)


ASKED = ["items", "n", "who", "in(", "rule(", "runs(", "waits("]


@pytest.mark.parametrize(
    ("text", "replaced", "expected"),
    [
        ("[explore]\nfa|", "fa", ["end", "faults", "line", "beside", "pace", "tries", "keys"]),
        ('[explore]\nend = "|', "", ["R"]),
        ('[explore]\nkeys = "a|', "a", ["rules", "all"]),
        ('[explore]\npace = "|', "", ["any"]),
        ("[explore]\nline = |", "", []),
        ("[explore]\ntries = { n = [1], w|", "w", ["items", "n", "who"]),
        ("[explore.tries]\nw|", "w", ["items", "n", "who"]),
        ("[explore.tries]\nn = [|", "", []),
        ('[always]\n"it goes on" = "not (runs(\'R|', "R", ["R_A"]),
        ("[always]\nx = \"waits('|", "", ["R_A"]),
        ("[reachable]\nx = \"rule('|')\"", "", ["R"]),
        ("[reachable]\nx = \"in('|", "", ["R"]),
        ("[reachable]\nx = \"n > 1 and in('R', 'T|", "T", ["S", "T"]),
        ('[reachable]\nx = "in(\\"R\\", \\"|', "", ["S", "T"]),
        ('[always]\nx = "n > 1 or w|', "w", ASKED),
        ("[always]\nx = \"n = 'w|", "", []),
        ("[always]\nw|", "", []),
        ('[eventually]\nx = { after = "true", th|', "th", ["after", "then", "unless"]),
        ('[eventually]\nx = { after = "true", then = "|', "", ASKED),
        ("[eventually.x]\n|", "", ["after", "then", "unless"]),
        ('[always]\nx = "true"\n[keys]\n1 = { act = "|', "", ["R_A"]),
    ],
)
def test_proposals_for_exploring(text: str, replaced: str, expected: list[str]) -> None:
    assert proposed("scenario.toml", text) == (replaced, expected)


@pytest.mark.parametrize(
    ("written", "omitted"),
    [('cond="wh|" target="T"/>', "wh"), ('eventTopic="/lat|" target="T"/>', "/lat"), ('cond="n|" target="T"/>', "")],
)
def test_what_is_just_being_typed_is_no_proposal(written: str, omitted: str) -> None:
    """A name is known from where it stands alone, but not from where somebody is still writing it."""
    rule = f'<InteractionRule name="R" initial="S">\n<State id="S"><transition {written}</State>\n<State id="T"/>'
    at = rule.index("|")
    text = rule.replace("|", "") + "</InteractionRule>"
    held = {**HELD, "rules/r.xml": text.encode()}
    _, found = proposals(load("/nowhere", held=held), "rules/r.xml", text, at)
    names = [each.text for each in found]
    assert omitted not in names and names
    again = {**held, "rules/s.xml": text.replace('name="R"', 'name="Q"').encode()}
    _, found = proposals(load("/nowhere", held=again), "rules/r.xml", text, at)
    assert not omitted or omitted in [each.text for each in found]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-32"])
def test_places_in_all_encodings(encoding: PositionEncoding) -> None:
    text = "ä\r\n\r😀x\n\n<é/>"
    positions = TextPositions(text, encoding)
    for offset in range(len(text) + 1):
        if text[offset - 1 : offset + 1] != "\r\n":  # between them is no place
            assert positions.offset(*positions.place(offset)) == offset
    assert positions.offset(99, 0) == len(text) and positions.offset(0, 99) == 1
