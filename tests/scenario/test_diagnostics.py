"""Every mistake is found at its exact place, with its code, and all of them at once."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Literal
from unicodedata import normalize

import pytest

import rise_engine.scenario
from rise_engine.scenario.loader import load
from tests.scenario.folders import SPEECH, act, folder, found, in_state, loaded, rule

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "scenario.md"

# The body of an act (its first line is line 2) and what is found in acts/a.xml.
ACTS: dict[str, tuple[str, list[str]]] = {
    "fine": (SPEECH, []),
    "unknown action": ("<Speach><actionID>1</actionID></Speach>", ["2:1 unknown-action"]),
    "unknown parameter": (
        "<Wait><actionID>1</actionID>\n<duration>1</duration><x/></Wait>",
        ["3:23 unknown-parameter"],
    ),
    "parameter as attribute": (
        '<Speech message="a"><actionID>1</actionID></Speech>',
        ["2:1 missing-parameter", "2:9 unknown-attribute"],
    ),
    "missing parameter": ("<Wait><actionID>1</actionID></Wait>", ["2:1 missing-parameter"]),
    "empty parameter": ("<Wait><actionID>1</actionID><duration/></Wait>", ["2:29 missing-parameter"]),
    "parameter twice": (
        "<Wait><actionID>1</actionID><duration>1</duration><duration>1</duration></Wait>",
        ["2:51 duplicate-parameter"],
    ),
    "no id": ("<Wait><duration>1</duration></Wait>", ["2:1 missing-id"]),
    "id of two words": ("<Wait><actionID>1 2</actionID><duration>1</duration></Wait>", ["2:7 bad-name"]),
    "duplicate id": (SPEECH + "\n" + SPEECH, ["3:1 duplicate-id"]),
    "unknown id": (
        "<Wait><actionID>1</actionID><waitForActions>\n 7;8</waitForActions><duration>1</duration></Wait>",
        ["3:2 unknown-id", "3:4 unknown-id"],
    ),
    "waits for itself": (
        "<Wait><actionID>1</actionID><waitForActions>1</waitForActions><duration>1</duration></Wait>",
        ["2:45 cycle"],
    ),
    "number with comma": ("<Wait><actionID>1</actionID><duration>1,5</duration></Wait>", ["2:39 wrong-type"]),
    "word for a number": ("<Wait><actionID>1</actionID><duration> long</duration></Wait>", ["2:40 wrong-type"]),
    "memory key for a number": ("<Wait><actionID>1</actionID><duration>pause</duration></Wait>", []),
    "slot for a number": ("<Wait><actionID>1</actionID><duration>{pause}</duration></Wait>", []),
    "out of range": ("<Wait><actionID>1</actionID><duration>-1</duration></Wait>", ["2:39 out-of-range"]),
    "unknown name": ("<Emotion><actionID>1</actionID><value>hapy</value></Emotion>", ["2:39 unknown-name"]),
    "unknown code": ("<Emotion><actionID>1</actionID><value>9</value></Emotion>", ["2:39 unknown-name"]),
    "brace": ("<Speech><actionID>1</actionID><message>a &lt; {b</message></Speech>", ["2:47 template"]),
    "unset key": ("<Speech><actionID>1</actionID><message>Hi {nobody}, {pause}</message></Speech>", ["2:43 unset-key"]),
    "unset key with fallback": ("<Speech><actionID>1</actionID><message>Hi {nobody|you}</message></Speech>", []),
    "onFailure": (
        "<Wait><actionID>1</actionID><onFailure>stop</onFailure><duration>1</duration></Wait>",
        ["2:40 wrong-value"],
    ),
    "text between": (f"{SPEECH} oops", ["2:65 unexpected-text"]),
    "action in action": (
        f"<Wait><actionID>1</actionID><duration>1</duration>{SPEECH}</Wait>",
        ["2:51 unknown-parameter"],
    ),
    "variants": (
        "<Variants><actionID>1</actionID><Speech><message>a</message></Speech>"
        "<Speech><message>b</message></Speech></Variants>",
        [],
    ),
    "mixed variants": (
        "<Variants><actionID>1</actionID><Speech><message>a</message></Speech>\n"
        "<Wait><duration>1</duration></Wait></Variants>",
        ["2:1 variants", "3:1 variants"],
    ),
    "empty variants": ("<Variants><actionID>1</actionID></Variants>", ["2:1 variants"]),
    "variants with ids": (
        f"<Variants><actionID>1</actionID>{SPEECH}<Speech><message>b</message></Speech></Variants>",
        ["2:41 unknown-parameter"],
    ),
    "no actions": ("", ["1:1 empty-act"]),
    "a day": ("<Wait><actionID>1</actionID><duration>86400000</duration></Wait>", []),
    "more than a day": ("<Wait><actionID>1</actionID><duration>1e300</duration></Wait>", ["2:39 out-of-range"]),
    "useless fallback": ("<Wait><actionID>1</actionID><duration>{pause|abc}</duration></Wait>", ["2:39 wrong-type"]),
    "useful fallback": ("<Wait><actionID>1</actionID><duration>{nobody|5}</duration></Wait>", []),
    "unit beside a slot": ("<Wait><actionID>1</actionID><duration>{pause} m</duration></Wait>", ["2:39 wrong-type"]),
    "digits beside a slot": ("<Wait><actionID>1</actionID><duration>{pause}00</duration></Wait>", []),
    "fallback that is no name": (
        "<Emotion><actionID>1</actionID><value>{pause|joy}</value></Emotion>",
        ["2:39 unknown-name"],
    ),
    "part of no name": ("<Emotion><actionID>1</actionID><value>x{pause}</value></Emotion>", ["2:39 unknown-name"]),
    "part of a name": ("<Emotion><actionID>1</actionID><value>hap{pause}</value></Emotion>", []),
    "broken actions keep their ids": (
        "<Variants><actionID>1</actionID></Variants>\n<Wat><actionID>2</actionID></Wat>\n"
        "<Wait><actionID>3</actionID><waitForActions>1 2</waitForActions><duration>1</duration></Wait>",
        ["2:1 variants", "3:1 unknown-action"],
    ),
    "variants in variants": (
        "<Variants><actionID>1</actionID>\n<Variants><Wait><duration>1</duration></Wait></Variants></Variants>",
        ["3:1 variants"],
    ),
}


@pytest.mark.parametrize("name", ACTS)
def test_acts(tmp_path: Path, name: str) -> None:
    body, expected = ACTS[name]
    result = loaded(tmp_path, {"acts/a.xml": act(body), "memory.json": '{"pause": 5}'})
    assert found(result) == [f"acts/a.xml:{each}" for each in expected]
    assert (result.scenario is None) == bool(result.errors)


# What stands in <onEntry> (from line 3, column 10), what follows, and what is found in rules/r.xml.
START_A = '<function startCommunicationRobotAct="A"/>'
RULES: dict[str, tuple[str, str, list[str]]] = {
    "fine": ('<function startCommunicationRobotAct="A"/>', "", []),
    "unknown act": ('<function startCommunicationRobotAct="B"/>', "", ["3:48 unknown-act"]),
    "unknown rule": ('<function stopInteractionRule="Q"/>', "", ["3:41 unknown-rule"]),
    "unknown function": ('<function startAct="A"/>', "", ["3:20 unknown-attribute"]),
    "two functions": ('<function assignValue="k=1" raiseEventTopic="x"/>', "", ["3:38 one-function"]),
    "no function": ("<function/>", "", ["3:10 one-function"]),
    "empty value": ('<function raiseEventTopic="/"/>', "", ["3:37 missing-value"]),
    "unheard event": ('<function raiseEventTopic="x"/>', "", ["3:37 unheard-event"]),
    "assignment": ('<function assignValue="k = = 1"/>', "", ["3:37 assignment"]),
    "bare word": ('<function assignValue="k = happy"/>', "", ["3:33 bare-word"]),
    "bare key": ('<function assignValue="k = pause"/>', "", []),
    "condition": ('<if cond="pause &gt; &gt; 1"/>', "", ["3:31 condition"]),
    "no condition": ("<if/>", "", ["3:10 missing-attribute"]),
    "unset key": ('<if cond="pose"/>', "", ["3:20 unset-key"]),
    "raw less-than": ('<if cond="pause < 3 && pause"/>', "", ["3:26 unescaped"]),
    "raw and two more": ('<if cond="pause < 3"/>', "\n<x/>", ["3:26 unescaped", "4:1 unknown-element"]),
    "quotes": ('<if cond="pause == "3""/>', "", ["3:29 quotes"]),
    "sibling else": ('<if cond="pause"/><elseif cond="not pause"/><else/>', "", []),
    "nested elseif": ('<if cond="pause"><elseif cond="not pause"><else/></elseif></if>', "", []),
    "else without if": ("<else/>", "", ["3:10 misplaced"]),
    "two else": ('<if cond="pause"><else/></if><else/>', "", ["3:39 misplaced"]),
    "empty else as in SCXML": (
        '<if cond="pause"><else/><function startCommunicationRobotAct="A"/></if>',
        "",
        ["3:34 misplaced"],
    ),
    "ambiguous else": ('<if cond="pause"><if cond="pause"/><else/></if>', "", ["3:45 ambiguous-else"]),
    "oneOf": ('<oneOf><function startCommunicationRobotAct="A"/></oneOf>', "", []),
    "empty oneOf": ("<oneOf/>", "", ["3:10 no-choice"]),
    "text": ("hello", "", ["3:10 unexpected-text"]),
    "function in state": ("", "<function/>", ["3:20 unknown-element"]),
    "onEntry twice": ("", "<onEntry/>", ["3:20 duplicate-element"]),
    "transition": ("", '\n<transition eventTopic="/A_end" target="S"/>', []),
    "no trigger": ("", '\n<transition target="S"/>', ["4:1 trigger"]),
    "two triggers": ("", '\n<transition eventTopic="A_end" after="2s" target="S"/>', ["4:32 trigger"]),
    "unknown state": ("", '\n<transition eventTopic="A_end" target="T"/>', ["4:40 unknown-state"]),
    "unraised": ("", '\n<transition eventTopic="B_end" target="S"/>', ["4:25 unraised-event"]),
    "time": ("", '\n<transition after="2" target="S"/>', ["4:20 time"]),
    "no time": ("", '\n<transition after="0s" target="S"/>', ["4:20 out-of-range"]),
    "shortest time": ("", '\n<transition after="1ms" target="S"/>', ["4:20 short-loop"]),
    "short loop, not quite": ("", '\n<transition after="50ms" target="S"/>', []),
    "short wait, no loop": ("", '\n<transition after="1ms" target="T"/></State>\n<State id="T">', []),
    "short wait, stays": ("", '\n<transition after="1ms"><function startCommunicationRobotAct="A"/></transition>', []),
    "short loop over conditions": (
        "",
        '\n<transition after="0.04s" cond="pause" target="T"/></State>\n'
        '<State id="T"><transition cond="pause" target="U"/></State>\n'
        '<State id="U"><transition after="49ms" target="S"/>',
        ["4:20 short-loop", "6:34 short-loop"],
    ),
    "loop with a pause": (
        "",
        '\n<transition after="1ms" target="T"/></State>\n<State id="T"><transition after="1s" target="S"/>',
        [],
    ),
    "loop that waits for an event": (
        "",
        '\n<transition after="1ms" target="T"/></State>\n<State id="T"><transition eventTopic="A_end" target="S"/>',
        [],
    ),
    "loop over an event of its own": (
        '<function raiseEventTopic="own"/>',
        '\n<transition eventTopic="own" target="T"/></State>\n<State id="T"><transition after="1ms" target="S"/>',
        ["5:34 short-loop"],
    ),
    "longest time": ("", '\n<transition after="1440min" target="S"/>', []),
    "too long": ("", '\n<transition after="99999999999999999999min" target="S"/>', ["4:20 out-of-range"]),
    "computed times": (
        "",
        '\n<transition after="{pause}" target="S"/>\n<transition after=" {pause * 2} ms" target="S"/>'
        '\n<transition after="{H_x}s" target="S"/>',
        ["6:21 unset-key"],
    ),
    "broken computed times": (
        "",
        '\n<transition after="{pause" target="S"/>\n<transition after="{ pause + }" target="S"/>'
        '\n<transition after="{}" target="S"/>\n<transition after="{pause}h" target="S"/>',
        ["4:20 time", "5:30 time", "6:21 time", "7:20 time"],
    ),
    "computed times that never are any": (
        "",
        '\n<transition after="{\'soon\'}" target="S"/>\n<transition after="{\'2s\'}ms" target="S"/>'
        '\n<transition after="{99999999}" target="S"/>\n<transition after="{rand(1, 3)}" target="S"/>'
        '\n<transition after="{\'3s\'}" target="S"/>',
        ["4:20 wrong-type", "5:20 wrong-type", "6:20 wrong-type"],
    ),
    "what has held": (
        "",
        '\n<transition while="pause" after="2s" cond="pause" target="S"/>'
        '\n<transition while="session.speaking" after="2s" target="S"/>'
        '\n<transition while="pause" after="3s" target="S"/>\n<transition after="2s" target="S"/>',
        [],
    ),
    "the same held twice": (
        "",
        '\n<transition while="pause" after="2s" target="S"/>\n<transition while="pause" after="2s" target="S"/>',
        ["5:1 unreachable-transition"],
    ),
    "while without a time": ("", '\n<transition while="pause" target="S"/>', ["4:1 trigger", "4:13 trigger"]),
    "while with an event": ("", '\n<transition while="pause" eventTopic="A_end" target="S"/>', ["4:13 trigger"]),
    "a broken while": ("", '\n<transition while="pause &gt;" after="2s" target="S"/>', ["4:30 condition"]),
    "a part of the session that is none": (
        "",
        '\n<transition while="session.speeking" after="2s" target="S"/>',
        ["4:20 unknown-path"],
    ),
    "an event of its own that is kept": (
        '<function raiseEventTopic="own" keep="2s"/>',
        '\n<transition eventTopic="own" target="S"/>',
        [],
    ),
    "no time to keep": (
        '<function raiseEventTopic="own" keep="2"/><function raiseEventTopic="own" keep="0s"/>',
        '\n<transition eventTopic="own" target="S"/>',
        ["3:48 time", "3:90 out-of-range"],
    ),
    "keep beside something else": (
        '<function startCommunicationRobotAct="A" keep="2s"/>',
        "",
        ["3:51 unknown-attribute"],
    ),
    "no effect": ("", '\n<transition after="2s"/>', ["4:1 no-effect"]),
    "own act": (START_A, '\n<transition ended="A" outcome="failed | stopped" target="S"/>', []),
    "own act that nobody knows": ("", '\n<transition ended="a" target="S"/>', ["4:20 unknown-act"]),
    "own act that it never starts": ("", '\n<transition ended="A" target="S"/>', ["4:1 unreachable-transition"]),
    "outcome that is none": (START_A, '\n<transition ended="A" outcome="fine" target="S"/>', ["4:32 wrong-value"]),
    "outcome that is none, and what comes after it": (
        START_A,
        '\n<transition ended="A" outcome="fail" target="S"/>\n<transition ended="A" outcome="succeeded" target="S"/>'
        '\n<transition ended="A" target="S"/>',
        ["4:32 wrong-value"],
    ),
    "own act that nobody knows, twice": (
        "",
        '\n<transition ended="a" outcome="failed" target="S"/>\n<transition ended="a" target="S"/>',
        ["4:20 unknown-act", "5:20 unknown-act"],
    ),
    "outcome of nothing": ("", '\n<transition cond="pause" outcome="failed" target="S"/>', ["4:26 trigger"]),
    "own act and event": (
        START_A,
        '\n<transition eventTopic="x" ended="A" target="S"/>',
        ["4:25 unraised-event", "4:28 trigger"],
    ),
    "own act, the other ends": (
        START_A,
        '\n<transition ended="A" outcome="succeeded" target="S"/>\n<transition ended="A" target="S"/>',
        [],
    ),
    "own act, one end after the other": (
        START_A,
        '\n<transition ended="A" outcome="succeeded" target="S"/>'
        '\n<transition ended="A" outcome="failed | stopped" target="S"/>'
        '\n<transition ended="A" target="S"/>',
        ["6:1 unreachable-transition"],
    ),
    "own act, all its ends": (
        START_A,
        '\n<transition ended="A" target="S"/>\n<transition ended="A" outcome="failed" target="S"/>',
        ["5:1 unreachable-transition"],
    ),
    "shared ways": (
        "",
        '</State>\n<transitions in="S"><transition eventTopic="A_end" target="S"/></transitions><State id="T">',
        ["4:78 unreachable-state"],
    ),
    "shared by nobody": (
        "",
        '</State>\n<transitions in="S | s"><transition after="2s" target="S"/></transitions><State id="T">',
        ["4:18 unknown-state", "4:74 unreachable-state"],
    ),
    "shared nothing": (
        "",
        '</State>\n<transitions in="S"/><State id="T">',
        ["4:1 no-effect", "4:22 unreachable-state"],
    ),
    "never taken": (
        "",
        '\n<transition eventTopic="A_end" target="S"/>\n<transition eventTopic="/A_end" cond="pause" target="S"/>',
        ["5:1 unreachable-transition"],
    ),
    "second state": ("", '</State>\n<State id="S">', ["4:12 duplicate-state"]),
    "unreachable": ("", '</State>\n<State id="T">', ["4:1 unreachable-state"]),
    "unknown attribute": ("", '\n<transition eventTopik="A_end" cond="pause" target="S"/>', ["4:13 unknown-attribute"]),
}


@pytest.mark.parametrize("name", RULES)
def test_rules(tmp_path: Path, name: str) -> None:
    entry, rest, expected = RULES[name]
    files = {"acts/a.xml": act(SPEECH), "rules/r.xml": in_state(entry, rest), "memory.json": '{"pause": 5}'}
    result = loaded(tmp_path, files)
    assert found(result) == [f"rules/r.xml:{each}" for each in expected]
    assert (result.scenario is None) == bool(result.errors)


# Files, and everything that is found.
FILES: dict[str, tuple[dict[str, str | bytes], list[str]]] = {
    "nothing": ({}, []),
    "empty scenario.toml": ({"scenario.toml": ""}, []),
    "not TOML": ({"scenario.toml": "title = \n"}, ["scenario.toml:1:9 toml-syntax"]),
    "TOML key twice": ({"scenario.toml": 'title = "a"\ntitle = "b"\n'}, ["scenario.toml:2:1 duplicate-key"]),
    "TOML mistakes, and what is found besides": (
        {"scenario.toml": 'title = \n[keys]\ne = { event = "" }\n[study]\na.b = 1\na.b = 2\n[study]\n[acts.A]\n'},
        [
            "scenario.toml:1:9 toml-syntax",
            "scenario.toml:3:15 missing-value",
            "scenario.toml:5:1 unknown-key",
            "scenario.toml:6:1 duplicate-key",
            "scenario.toml:7:1 duplicate-key",
            "scenario.toml:8:1 wrong-type",
        ],
    ),
    "an event whose key may be in a line that is not TOML": (
        {"scenario.toml": "[keys]\ne = { event = “x” }\n", "rules/r.xml": in_state("", '<transition eventTopic="x"/>')},
        ["rules/r.xml:3:20 no-effect", "scenario.toml:2:15 toml-syntax"],
    ),
    "rules with a broken header": (
        {
            "rules/a.xml": rule('<State id="S"/>', "A").replace("initial", 'priority="x" intial'),
            "rules/b.xml": '<InteractionRule name="B" priority="y"/>',
            "rules/c.xml": in_state(
                '<function startInteractionRule="A"/><function startInteractionRule="B"/>',
                '<transition eventTopic="A_end" target="S"/>',
            ),
        },
        [
            "rules/a.xml:1:37 wrong-type",
            "rules/a.xml:1:40 unknown-attribute",
            "rules/b.xml:1:1 missing-attribute",
            "rules/b.xml:1:1 no-states",
            "rules/b.xml:1:37 wrong-type",
        ],
    ),
    "one finding for each typing mistake": (
        {
            "rules/a.xml": '<InteractionRule name="A" intial="S"><Stat id="S"/>\n'
            '<State id="T"><transition afer="8s" target="S"/><transition cond="true" target="U"/></State>\n'
            '<State Id="U"/><State id="V"><onEntry><if con="true"/></onEntry></State></InteractionRule>'
        },
        [
            "rules/a.xml:1:27 unknown-attribute",
            "rules/a.xml:1:38 unknown-element",
            "rules/a.xml:2:27 unknown-attribute",
            "rules/a.xml:3:8 unknown-attribute",
            "rules/a.xml:3:43 unknown-attribute",
        ],
    ),
    "names whose attribute is misspelt": (
        {
            "acts/a.xml": act(SPEECH).replace("name=", "nmae="),
            "rules/b.xml": '<InteractionRule nmae="B" initial="S"><State id="S">'
            '<transition eventTopic="A_end" taget="T"/></State><State id="T"/></InteractionRule>',
            "rules/r.xml": in_state(
                '<function startCommunicationRobotAct="A"/><function startInteractionRule="B"/>',
                '<transition eventTopic="B_end" target="S"/>',
            ),
        },
        [
            "acts/a.xml:1:9 unknown-attribute",
            "rules/b.xml:1:18 unknown-attribute",
            "rules/b.xml:1:84 unknown-attribute",
        ],
    ),
    "an act and a rule of one name": (
        {"acts/a.xml": act(SPEECH, "R"), "rules/r.xml": rule('<State id="S"/>')},
        ["rules/r.xml:1:1 same-name"],
    ),
    "memory: object within": ({"memory.json": '{"WorkingMemory": {"a": 1}}'}, ["memory.json:1:19 memory-form"]),
    "memory: null within": ({"memory.json": '{"WorkingMemory": null}'}, ["memory.json:1:19 memory-form"]),
    "memory: lower case": ({"memory.json": '{"workingmemory": [{"a": 1}]}'}, ["memory.json:1:2 memory-form"]),
    "memory: beside the list": (
        {"memory.json": '{"WorkingMemory": [{"a": 1}, {"a": 2}], "b": 1, "c d": 1}'},
        [
            "memory.json:1:31 duplicate-key",
            "memory.json:1:41 memory-form",
            "memory.json:1:49 memory-form",
            "memory.json:1:49 unwritable-key",
        ],
    ),
    "memory: more than 64 bits": ({"memory.json": '{"n": ' + "9" * 400 + "}"}, ["memory.json:1:7 json-value"]),
    "unknown key": ({"scenario.toml": 'titel = "a"'}, ["scenario.toml:1:1 unknown-key"]),
    "wrong type": ({"scenario.toml": "title = 1"}, ["scenario.toml:1:9 wrong-type"]),
    "mode": ({"scenario.toml": 'mode = "fast"'}, ["scenario.toml:1:8 wrong-value"]),
    "unknown robot": ({"scenario.toml": 'robot = "nobody"'}, ["scenario.toml:1:9 unknown-robot"]),
    "missing place": ({"scenario.toml": '\nacts = "here"'}, ["scenario.toml:2:8 unreadable"]),
    "unknown act": ({"scenario.toml": "[act.Foo]"}, ["scenario.toml:1:6 unknown-act"]),
    "act settings": (
        {"scenario.toml": '[act.A]\nhold = 1\ncalling_type = "x"\nholt = 1', "acts/a.xml": act(SPEECH)},
        ["scenario.toml:2:8 wrong-type", "scenario.toml:3:16 wrong-value", "scenario.toml:4:1 unknown-key"],
    ),
    "events that keys keep": (
        {
            "scenario.toml": '[keys]\na = { event = "/x", keep = "2s" }\nb = { event = "/x", keep = "2" }\n'
            'c = { event = "/x", keep = 2 }\nd = { act = "A", keep = "2s" }\ne = { event = "/x", keep = "0s" }\n'
            'f = { event = "/x", kepe = "2s" }\n',
            "acts/a.xml": act(SPEECH),
            "rules/r.xml": '<InteractionRule name="R" initial="S"><State id="S">'
            '<transition eventTopic="/x" target="S"/></State></InteractionRule>',
        },
        [
            "scenario.toml:3:28 time",
            "scenario.toml:4:28 wrong-type",
            "scenario.toml:5:18 binding",
            "scenario.toml:6:28 out-of-range",
            "scenario.toml:7:21 unknown-key",
        ],
    ),
    "labels of keys": (
        {
            "scenario.toml": '[keys]\na = { act = "A", label = "not understood" }\nb = { act = "A", label = " " }\n'
            'c = { act = "A", label = 1 }\nd = { act = "A", label = "1234567890123456789012345" }\n'
            'e = { label = "x" }\nf = { act = "A", label = "\\u0007" }\n',
            "acts/a.xml": act(SPEECH),
        },
        [
            "scenario.toml:3:26 missing-value",
            "scenario.toml:4:26 wrong-type",
            "scenario.toml:5:26 out-of-range",
            "scenario.toml:6:1 binding",
            "scenario.toml:7:26 wrong-value",
        ],
    ),
    "keys": (
        {
            "scenario.toml": '[keys]\n"1" = { act = "A" }\nx = { acd = "A" }\n"." = { event = "/e" }\n'
            'full_stop = { rule = "R" }\n"ctrl+h" = { act = "A" }\nF9 = { act = "A" }\ny = 1\n'
            'z = { set = "k = = 1" }\nw = { act = "A", rule = "R" }\n',
            "acts/a.xml": act(SPEECH),
            "rules/r.xml": rule('<State id="S"><transition eventTopic="e" target="S"/></State>'),
        },
        [
            "scenario.toml:3:7 unknown-key",
            "scenario.toml:5:1 key-twice",
            "scenario.toml:6:1 key-refused",
            "scenario.toml:7:1 key-taken",
            "scenario.toml:8:5 binding",
            "scenario.toml:9:18 assignment",
            "scenario.toml:10:1 binding",
        ],
    ),
    "fillers": (
        {"scenario.toml": "[fillers]\noffer_after = -1\nauto_after = 'x'\nafter = 1"},
        ["scenario.toml:2:15 out-of-range", "scenario.toml:3:14 wrong-type", "scenario.toml:4:1 unknown-key"],
    ),
    "control": (
        {"scenario.toml": "[control]\nmay_release = '/boss'\nmay_relase = []"},
        ["scenario.toml:2:15 wrong-type", "scenario.toml:3:1 unknown-key"],
    ),
    "fillers without any": ({"scenario.toml": "[fillers]\nauto_after = 4"}, ["scenario.toml:2:1 no-filler"]),
    "fillers too soon": (
        {
            "scenario.toml": "[fillers]\nauto_after = 0.1\noffer_after = true\n[act.A]\nfiller = true",
            "acts/a.xml": act(SPEECH),
        },
        ["scenario.toml:2:14 out-of-range", "scenario.toml:3:15 wrong-type"],
    ),
    "Latin-1": ({"acts/a.xml": act(SPEECH).replace("Hello", "Grüße").encode("latin-1")}, ["acts/a.xml:2:42 encoding"]),
    "UTF-16": ({"acts/a.xml": act(SPEECH).encode("utf-16")}, ["acts/a.xml:1:1 encoding"]),
    "BOM": ({"acts/a.xml": b"\xef\xbb\xbf" + act(SPEECH).encode()}, []),
    "declared Latin-1": (
        {"acts/a.xml": '<?xml version="1.0" encoding="ISO-8859-1"?>\n' + act(SPEECH)},
        ["acts/a.xml:1:31 encoding"],
    ),
    "declared UTF-8": ({"acts/a.xml": '<?xml version="1.0" encoding="UTF-8"?>\n' + act(SPEECH)}, []),
    "DOCTYPE": ({"acts/a.xml": "<!-- x -->\n<!DOCTYPE Dialog>" + act(SPEECH)}, ["acts/a.xml:2:1 doctype"]),
    "entity bomb": ({"acts/a.xml": '<!DOCTYPE d [<!ENTITY a "b">]>' + act("&a;")}, ["acts/a.xml:1:1 doctype"]),
    "too deep": ({"acts/a.xml": "<a>" * 300 + "</a>" * 300}, ["acts/a.xml:1:771 too-deep"]),
    "deep conditions": (
        {"rules/r.xml": in_state('<if cond="true">' * 60 + "</if>" * 60)},
        ["rules/r.xml:3:810 too-deep"],
    ),
    "empty file": ({"acts/a.xml": ""}, ["acts/a.xml:1:1 not-well-formed"]),
    "mismatch": ({"acts/a.xml": "<Dialog name='A'>\n</Dialogs>"}, ["acts/a.xml:2:1 not-well-formed"]),
    "unclosed": ({"acts/a.xml": "<Dialog name='A'>\n<Speech>"}, ["acts/a.xml:2:9 not-well-formed"]),
    "two roots": (
        {"acts/a.xml": f"<Dialog name='A'>{SPEECH}</Dialog>\n<Dialog name='B'/>"},
        ["acts/a.xml:2:1 not-well-formed"],
    ),
    "attribute twice": ({"acts/a.xml": "<Dialog name='A' name='B'/>"}, ["acts/a.xml:1:18 not-well-formed"]),
    "ampersand in text": (
        {"acts/a.xml": act("<Speech><actionID>1</actionID><message>Tom & Jerry</message></Speech>\n<x/>")},
        ["acts/a.xml:2:44 unescaped", "acts/a.xml:3:1 unknown-action"],
    ),
    "unknown entity": (
        {"acts/a.xml": act("<Speech><actionID>1</actionID><message>a&nbsp;b</message></Speech>")},
        ["acts/a.xml:2:41 unescaped"],
    ),
    "comment in text": (
        {"acts/a.xml": act("<Wait><actionID>1</actionID><duration>1<!-- c -->2</duration></Wait>")},
        [],
    ),
    "wrong root": ({"acts/a.xml": "<Dialogue name='A'/>"}, ["acts/a.xml:1:1 unknown-element"]),
    "wrappers": (
        {
            "acts/a.xml": f"<AgentDialogs>{act(SPEECH)}</AgentDialogs>",
            "acts/b.xml": f"<Dialogs>{act(SPEECH, 'B')}</Dialogs>",
            "acts/c.xml": f"<CommunicationRobotActs>{act(SPEECH, 'C')}</CommunicationRobotActs>",
            "rules/r.xml": "<InteractionRules>" + rule('<State id="S"/>') + "</InteractionRules>",
        },
        [],
    ),
    "act twice": ({"acts/a.xml": act(SPEECH), "acts/b.xml": act(SPEECH)}, ["acts/b.xml:1:15 duplicate-name"]),
    "rule twice": ({"rules/a.xml": in_state(""), "rules/b.xml": in_state("")}, ["rules/b.xml:1:24 duplicate-name"]),
    "cycle": (
        {
            "acts/a.xml": act(
                "\n".join(
                    f"<Wait><actionID>{i}</actionID><waitForActions>{j}</waitForActions><duration>1</duration></Wait>"
                    for i, j in ((1, 2), (2, 1), (3, 1))
                )
            )
        },
        ["acts/a.xml:2:45 cycle"],
    ),
    "memory": ({"memory.json": '{"WorkingMemory": [{"a": 1}]}'}, []),
    "memory not JSON": ({"memory.json": '{"a": 1,}'}, ["memory.json:1:8 json-syntax"]),
    "memory list": ({"memory.json": "[1]"}, ["memory.json:1:1 memory-form"]),
    "memory twice": (
        {"memory.json": '{"WorkingMemory": [{"a": 1},\n {"a": NaN}]}'},
        ["memory.json:2:3 duplicate-key", "memory.json:2:8 json-value"],
    ),
    "memory entry": ({"memory.json": '{"WorkingMemory": [3]}'}, ["memory.json:1:20 memory-form"]),
    "memory key": (
        {"memory.json": '{"a b": 1, "": 2}'},
        ["memory.json:1:2 unwritable-key", "memory.json:1:12 bad-name"],
    ),
    "robot": (
        {
            "scenario.toml": 'robot = "r"\n',
            "robots/r.toml": "[actions.Emotion]\nwithout = ['fear', 'joy']\n[actions.Wave]\nchanels = []\n",
            "acts/a.xml": act(
                SPEECH
                + "\n<Emotion><actionID>2</actionID><value>5</value></Emotion>\n<Wave><actionID>3</actionID></Wave>"
            ),
        },
        [
            "acts/a.xml:2:1 robot-cannot",
            "acts/a.xml:3:39 unknown-name",
            "robots/r.toml:2:20 unknown-name",
            "robots/r.toml:4:1 unknown-key",
        ],
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_files(tmp_path: Path, name: str) -> None:
    files, expected = FILES[name]
    result = loaded(tmp_path, files)
    assert found(result) == expected
    assert (result.scenario is None) == bool(result.errors)


def test_messages_say_what_to_write(tmp_path: Path) -> None:
    entry = '<if cond="a < b and c"/><function startCommunicationRobotAct="R_Greting"/>'
    result = loaded(tmp_path, {"acts/a.xml": act(SPEECH, "R_Greeting"), "rules/r.xml": in_state(entry)})
    messages = [diagnostic.message for diagnostic in result.errors]
    assert 'write cond="a &lt; b and c"' in messages[0]
    assert "did you mean `R_Greeting`?" in messages[1]
    assert str(result.errors[1]) == (
        "rules/r.xml:3:72: error unknown-act: there is no act `R_Greting`; did you mean `R_Greeting`?"
    )


def test_a_cycle_is_shown(tmp_path: Path) -> None:
    files, _ = FILES["cycle"]
    assert "1 -> 2 -> 1" in loaded(tmp_path, files).errors[0].message


def test_names_are_not_missing_in_files_that_cannot_be_read(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "acts/a.xml": "<Dialog",
        "rules/r.xml": in_state('<function startCommunicationRobotAct="A"/>'),
    }
    assert [diagnostic.code for diagnostic in loaded(tmp_path, files).diagnostics] == ["not-well-formed"]


def test_no_folder(tmp_path: Path) -> None:
    assert [diagnostic.code for diagnostic in load(tmp_path / "none").diagnostics] == ["unreadable"]


def test_every_code_is_documented() -> None:
    codes: set[str] = set()
    engine = Path(rise_engine.scenario.__file__).parents[1]
    for path in (*(engine / "scenario").rglob("*.py"), *(engine / "syntax").glob("*.py")):
        text = path.read_text("utf-8")
        called = r"\.(?:error|warning|report_[a-z]+|parse_attribute)"
        codes.update(re.findall(rf"(?:{called}|unknown_code|XmlSyntaxError)\(\s*\"([a-z]+(?:-[a-z]+)*)\"", text))
    codes.update(
        (
            "not-well-formed",
            "too-deep",
            "unknown-act",
            "unknown-rule",
            "unknown-name",
            "key-refused",
            "key-taken",
            "unicode-form",
            "robot-profile",
        )
    )
    listed = DOCS.read_text("utf-8").partition("## Diagnostics")[2]
    documented = set(re.findall(r"^- `([a-z-]+)`: ", listed, re.MULTILINE))
    assert codes == documented


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
@pytest.mark.parametrize("name", ["acts/a.xml", "rules/r.xml", "memory.json", "scenario.toml"])
def test_pipes_are_not_waited_for(tmp_path: Path, name: str) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    os.mkfifo(tmp_path / name)
    assert found(load(tmp_path)) == [f"{name}:1:1 unreadable"]


@pytest.mark.parametrize("name", ["acts", "acts/a.xml", "rules", "rules/r.xml", "memory.json", "scenario.toml"])
def test_broken_links_are_found(tmp_path: Path, name: str) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).symlink_to("nowhere")
    result = load(tmp_path)
    assert found(result) == [f"{name}:1:1 unreadable"]
    assert "leads nowhere" in result.diagnostics[0].message


def test_what_the_caller_asked_for_stands_in_no_file(tmp_path: Path) -> None:
    result = load(tmp_path, robot="zzz", mode="x", paths={"memory": "m.json"})
    assert {diagnostic.location.file for diagnostic in result.diagnostics} == {str(tmp_path)}
    messages = [diagnostic.message for diagnostic in result.diagnostics]
    assert any(message.startswith("the robot asked for, `zzz`,") for message in messages)


def test_messages_of_toml(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"scenario.toml": '[keys]\ne = { event = "" }\ne = { event = "x" }\n[acts.A]\n'})
    messages = " ".join(diagnostic.message for diagnostic in result.diagnostics)
    assert "`event` is empty" in messages
    assert "`e` is given twice; it is already in line 2" in messages
    assert "[act.A]" in messages


@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_names_in_two_forms_of_unicode(tmp_path: Path, form: Literal["NFC", "NFD"]) -> None:
    """A letter with an accent is one character, or two; both look the same."""
    here, there = (normalize(each, "Grün") for each in (form, {"NFC": "NFD", "NFD": "NFC"}[form]))
    rules = (
        f'<InteractionRules><InteractionRule name="{there}" initial="{here}"><State id="{there}"><onEntry>'
        f'<function startCommunicationRobotAct="{here}"/><function startInteractionRule="{here}"/>'
        f'</onEntry><transition eventTopic="{here}_end" target="{here}"/></State></InteractionRule></InteractionRules>'
    )
    speech = SPEECH.replace("</Speech>", f"<waitForActions>{here}</waitForActions></Speech>")
    own = SPEECH.replace(">1<", f">{there}<")
    result = loaded(tmp_path, {"acts/a.xml": act(speech + own, there), "rules/r.xml": rules})
    codes = [(each.severity, each.code) for each in result.diagnostics if each.code != "same-name"]
    assert codes == [("error", "unicode-form")] * 5
    assert all("They look alike" in each.message for each in result.diagnostics if each.code != "same-name")
    raised = in_state(f'<function raiseEventTopic="{here}"/>', f'<transition eventTopic="/{there}" target="S"/>')
    result = loaded(tmp_path / "events", {"rules/r.xml": raised})
    assert [(each.severity, each.code) for each in result.diagnostics] == [("warning", "unicode-form")] * 2


def test_what_was_meant_and_a_related_place_are_beside_the_sentence(tmp_path: Path) -> None:
    first = '<transition eventTopic="/go" target="S"/>'
    files = {
        "acts/a.xml": act(SPEECH),
        "rules/r.xml": in_state("", f'{first}\n<transition eventTopic="/go" target="s2"/>'),
    }
    found = {each.code: each for each in load(folder(tmp_path, files)).diagnostics}
    assert found["unreachable-transition"].related.line == found["unreachable-transition"].location.line - 1
    files = {"scenario.toml": 'titel = "x"\n', "acts/a.xml": act(SPEECH)}
    (unknown,) = [each for each in load(folder(tmp_path, files)).diagnostics if each.code == "unknown-key"]
    assert (unknown.suggestion.written, unknown.suggestion.meant) == ("titel", "title")


def test_an_attribute_of_scxml_is_told_with_what_to_do_instead(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"rules/r.xml": rule('<State id="S" final="true" initial="true"/>')})
    final, initial = (error.message for error in result.errors)
    assert final == "`<State>` has no attribute `final`: a state without transitions ends its rule"
    assert "named by its rule" in initial and "did you mean" not in initial
