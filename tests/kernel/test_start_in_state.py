"""A rule begins in a state (semantics.md 12.1)."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rise_engine.kernel.behaviors import BehaviorError, RuleStart, describe_behavior, read_rule_start
from rise_engine.kernel.records import RuleRecord
from rise_engine.scenario.loader import load

from .harness import Session, dialog, read, speech, view_of, write
from .test_rules import do, on, rule, session, state

ACTS = dialog("A", speech(1)) + dialog("B", speech(1))
R = rule(
    "R",
    state("a", do("startCommunicationRobotAct", "A"), on("/x", "b")),
    state("b", do("startCommunicationRobotAct", "B"), '<transition after="2s" target="c"/>' + on("/y", "a")),
    state("c", do("assignValue", "done = 1"), '<transition cond="ready" target="d"/>' + on("/z", "a")),
    state("d", do("assignValue", "over = 1")),
)


def start(s: Session, **parts: object) -> list[str]:
    s.lines()
    s.submit("startInteractionRule", json.dumps({"rule": "R", **parts}))
    return s.lines("rule", "action", "memory")


@pytest.mark.parametrize(
    ("parts", "lines"),
    [
        ({"state": "b"}, ["rule R started b", "rule R entered b", "action B/1 started"]),
        ({"state": "b", "enter": False}, ["rule R started b", "rule R entered b"]),
        ({}, ["rule R started a", "rule R entered a", "action A/1 started"]),
        ({"enter": False}, ["rule R started a", "rule R entered a"]),
        ({"state": "c"}, ["rule R started c", "rule R entered c", "memory done null -> 1"]),
        ({"state": "d"}, ["rule R started d", "rule R entered d", "memory over null -> 1", "rule R ended d"]),
        ({"state": "d", "enter": False}, ["rule R started d", "rule R entered d", "rule R ended d"]),
    ],
)
def test_where_it_begins_and_what_it_does_there(tmp_path: Path, parts: dict[str, object], lines: list[str]) -> None:
    assert start(session(tmp_path, R, ACTS), **parts) == lines


def test_the_record_says_how_it_began_and_the_view_whose_task_it_is(tmp_path: Path) -> None:
    s = session(tmp_path, R, ACTS)
    start(s, state="b", enter=False)
    triggers = [record.trigger for record in s.records if isinstance(record, RuleRecord)]
    assert triggers == ["start, without onEntry"] * 2
    view = view_of(s)
    assert (view.rules["R"].state, view.rules["R"].task) == ("b", s.kernel.rules.stack["R"].task.id)


@pytest.mark.parametrize(
    ("behavior", "reason"),
    [
        ('{"rule": "S"}', "there is no rule 'S'"),
        ('{"rule": "R", "state": "bb"}', "the rule 'R' has no state 'bb'; did you mean 'b'?"),
        ('{"rule": "R", "stat": "b"}', "there is no field `stat`; did you mean `state`?"),
        ('{"rule": "R", "state": 1}', "Expected `str | null`"),
        ('{"state": "b"}', "missing required field `rule`"),
        ('{"rule": "R"', "the behaviour is a rule's name, or JSON such as"),
    ],
)
def test_what_cannot_be_is_rejected_with_a_sentence(tmp_path: Path, behavior: str, reason: str) -> None:
    s = session(tmp_path, R, ACTS)
    task = s.submit("startInteractionRule", behavior)
    assert task.status == "REJECTED"
    assert reason in task.reason
    assert not s.states


def test_rules_and_keys_start_rules_in_states(tmp_path: Path) -> None:
    starter = rule("S", state("a", '<function startInteractionRule="R" state="b" enter="no"/>', on("/x", "a")))
    toml = '[keys]\nw = { rule = "R", state = "c", enter = false }\nv = { rule = "R" }\n'
    s = Session(read(write(tmp_path, rules=R + starter, acts=ACTS, toml=toml)))
    s.rule("S")
    assert s.states == {"S": "a", "R": "b"}
    key = s.scenario.keys["w"]
    assert read_rule_start(key.task_behavior) == RuleStart("R", "c", False)
    assert s.scenario.keys["v"].task_behavior == "R"
    s.submit("stopInteractionRule", "R")
    s.submit(key.function, key.task_behavior)
    assert s.states == {"S": "a", "R": "c"}


@pytest.mark.parametrize(
    ("function", "toml", "code", "words"),
    [
        ('<function startInteractionRule="R" state="bb"/>', "", "unknown-state", "did you mean `b`"),
        ('<function startInteractionRule="R" state=""/>', "", "missing-value", "`state` is empty"),
        ('<function startInteractionRule="R" state="b" enter="maybe"/>', "", "wrong-value", "`yes` or `no`"),
        ('<function stopInteractionRule="R" state="b"/>', "", "unknown-attribute", "goes with startInteractionRule"),
        ("", '[keys]\nw = { rule = "R", state = "bb" }', "unknown-state", "did you mean `b`"),
        ("", '[keys]\nw = { act = "A", state = "b" }', "binding", "it goes with rule"),
        ("", '[keys]\nw = { rule = "R", enter = "no" }', "wrong-type", "`enter` is true or false"),
    ],
)
def test_check_finds_what_is_wrong(tmp_path: Path, function: str, toml: str, code: str, words: str) -> None:
    starter = rule("S", state("a", function, on("/x", "a")))
    findings = load(write(tmp_path, rules=R + starter, acts=ACTS, toml=toml)).errors
    assert [(found.code, words in found.message) for found in findings] == [(code, True)]


def test_a_state_in_which_something_begins_can_be_reached(tmp_path: Path) -> None:
    alone = rule("T", state("a", "", on("/x", "a")), state("b", "", on("/x", "c")), state("c"))
    starter = rule("S", state("a", '<function startInteractionRule="T" state="b"/>', on("/x", "a")))

    def unreachable(rules: str) -> list[str]:
        found = load(write(tmp_path, rules=rules, acts="")).diagnostics
        return [each.message for each in found if each.code == "unreachable-state"]

    assert len(unreachable(alone)) == 2
    assert unreachable(alone + starter) == []


def test_a_behavior_in_words() -> None:
    assert describe_behavior("startInteractionRule", '{"rule": "R", "state": "b", "enter": false}') == (
        "R, in b, without onEntry"
    )
    assert describe_behavior("startInteractionRule", "R") == "R"
    assert describe_behavior("startInteractionRule", "{oops") == "{oops"
    with pytest.raises(BehaviorError):
        read_rule_start("{" * 100_000)
