"""A rename takes the tests of a study and its task files with it: they pass after it, and back again they are the same.

The tests are made here: a shipped study is tried out with its own task file and all its keys, and the trial is kept, as
the editor keeps one; then come the forms that nobody makes by hand. Everything that they mention is renamed.
"""

from __future__ import annotations

import json
import re
from functools import lru_cache
from typing import Any

import pytest

from rise_engine.author.edit.edits import NameKind, Rename, RenameSetting
from rise_engine.author.edit.plan import EditRefused, Files
from rise_engine.author.trial.study_test import read_study_test
from rise_engine.author.trial.study_test_run import begun_texts, play_test, refusal, started_acts, text_of_test
from rise_engine.author.trial.trial import Trial
from rise_engine.expression import lookup
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import EventRecord
from rise_engine.run.protocol.task_file import read_task_file
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario, normal_topic
from tests.author.edit.samples import SCENARIOS, after, state_of, study_files
from tests.author.trial.task_files import task_file_text
from tests.chance import searched, some

KEPT, BY_HAND, TASKS = "tests/kept.jsonl", "tests/by_hand.jsonl", "tasks/morning.jsonl"
NAMES: dict[str, list[tuple[NameKind, str]]] = {
    "greeting": [("rule", "Greeting"), ("key", "person_near"), ("event", "W_close")],
    "lablinking": [("rule", "Table setting"), ("act", "R_Praise"), ("event", "next"), ("key", "task")],
}
"""Some that must be among those that the tests mention, so that the proof proves something."""


def scenario_of(study: str, files: Files | None = None) -> Scenario:
    scenario = load(SCENARIOS / study, held=files).scenario
    assert scenario is not None
    return scenario


def tried_out(study: str) -> Trial:
    """A trial in which everything of the study's task file was done, and every key pressed."""
    scenario = scenario_of(study)
    trial = Trial(scenario, seed=5)
    for timed in read_task_file((SCENARIOS / study / "session.jsonl").read_bytes(), "session.jsonl").tasks:
        trial.submit(timed.task)
        trial.go_on()
    for key in scenario.keys.values():
        trial.press(key)
        trial.go_on()
    return trial


@lru_cache
def files_with_tests(study: str) -> Files:
    trial = tried_out(study)
    kept = text_of_test(trial, "all of it")
    return {
        **study_files(study),
        KEPT: kept.encode(),
        BY_HAND: written_by_hand(study, trial).encode(),
        TASKS: task_file_text(trial).encode(),
    }


def written_by_hand(study: str, tried: Trial) -> str:
    """All that can stand in a test, in the forms that only people write: JSON behaviours, events with their slash."""
    scenario = tried.scenario
    rule = next(iter(scenario.rules.values()))
    state = list(rule.states)[1]
    key = next(iter(scenario.memory))
    act = next(iter(scenario.acts))
    topic = next(
        normal_topic(each.topic)
        for each in tried.records
        if isinstance(each, EventRecord) and each.topic.startswith("/") and each.topic != "/spotted"
    )
    done = [
        ("startInteractionRule", {"rule": rule.name, "state": state, "enter": False}),
        ("startInteractionRule", json.dumps({"rule": rule.name, "state": state})),
        ("assignValue", json.dumps({key: 1})),
        ("assignValue", f"{key} = 2"),
        ("raiseEventTopic", {"event": f"/{topic}", "keep": "2s"}),
        ("raiseEventTopic", topic),
        ("stepBack", {"rule": rule.name, "take_back": [key]}),
        ("startCommunicationRobotAct", act),
        ("stopCommunicationRobotAct", act),
        ("stopInteractionRule", rule.name),
        ("startInteractionRule", rule.name),
        ("stopAll", ""),
        ("releaseStop", {rule.name: "enter"}),
        ("deleteValue", key),
    ]
    trial = Trial(scenario, seed=2, memory={key: 7})
    lines: list[Any] = [{"test": "by hand", "seed": 2, "memory": {key: 7}}]
    for function, behavior in done:
        written = behavior if isinstance(behavior, str) else json.dumps(behavior)
        lines.append({"function_type": function, "domain_task_behavior": behavior})
        trial.submit(Submit(function=function, behavior=written, source="test"))  # type: ignore[arg-type]
        lines.append({"expect": what_came(trial, rule.name, key)})
        if trial.go_on():
            lines += [{"go_on": True}, {"expect": what_came(trial, rule.name, key)}]
    played = [json.dumps(line, ensure_ascii=False) for line in lines]
    played.insert(1, f"# {rule.name}, {act} and {key} in a comment stay")
    return "\r\n".join(played) + "\r\n"


def what_came(trial: Trial, rule: str, key: str) -> dict[str, Any]:
    if refusal(trial):
        return {"refused": True}
    view, records = trial.view.rules.get(rule), trial.records_of(-1)
    exists, value = lookup(trial.memory, key)
    events = [each.topic for each in records if isinstance(each, EventRecord)]
    return {
        "rules": {rule: view.state if view is not None and view.running else None},
        "memory": {key: value} if exists else {},
        "starts": started_acts(records),
        "says": begun_texts(records),
        "events": [normal_topic(topic) if number % 2 else topic for number, topic in enumerate(events)],
    }


def failures(study: str, files: Files) -> list[str]:
    """What does not come as the tests expect it."""
    scenario = scenario_of(study, files)
    found = []
    for name in (KEPT, BY_HAND):
        outcome = play_test(scenario, read_study_test(files[name], name, scenario))
        found += [f"{name}:{each.line}: {each.text}" for each in outcome.failures]
    return found


def mentioned(study: str) -> list[tuple[NameKind, str]]:
    """Every name of the study that stands in one of the tests, whatever it is there."""
    files = files_with_tests(study)
    uses = state_of(files, study).checked.uses
    text = "\n".join(files[name].decode() for name in (KEPT, BY_HAND, TASKS))
    kinds: tuple[NameKind, ...] = ("act", "rule", "state", "event", "key")
    return [
        (kind, name)
        for kind in kinds
        for name in sorted(uses.names(kind))
        if (name.rpartition("/")[2] if kind == "state" else name) in text
    ]


def renamed(kind: NameKind, name: str) -> tuple[Rename, Rename]:
    """There, and back again."""
    owner, _, alone = name.rpartition("/") if kind == "state" else ("", "", name)
    new = f"{alone}_{'zq' if kind in ('event', 'key') else '<& ö'}"
    return Rename(kind, name, new), Rename(kind, f"{owner}/{new}" if owner else new, alone)


@pytest.mark.slow
@pytest.mark.parametrize(
    "study", [pytest.param(name, marks=searched if name == "lablinking" else ()) for name in NAMES]
)
def test_everything_that_tests_mention_is_renamed_and_they_pass(study: str) -> None:
    before = state_of(files_with_tests(study), study)
    assert failures(study, before.files) == []
    names = mentioned(study)
    assert set(NAMES[study]) <= set(names)
    changed: set[str] = set()
    for kind, name in dict.fromkeys((*NAMES[study], *some(names))):
        there, back = renamed(kind, name)
        try:
            now = after(before, there)
        except EditRefused as refused:  # a template puts it together, the engine raises it, it is a part of a key
            assert re.search("template|the engine raises|is a part of", str(refused)), refused
            assert (kind, name) not in NAMES[study]
            continue
        assert failures(study, now.files) == [], there
        changed |= {each for each in now.files if now.files[each] != before.files[each]}
        assert after(now, back).files == before.files, back
    assert {KEPT, BY_HAND, TASKS, "session.jsonl"} <= changed


@pytest.mark.slow
@pytest.mark.parametrize("study", NAMES)
def test_one_rename_after_the_other_and_all_of_them_back(study: str) -> None:
    before = now = state_of(files_with_tests(study), study)
    done: list[Rename] = []
    for kind, name in NAMES[study]:
        there, back = renamed(kind, name)
        now = after(now, there)
        done.append(back)
    assert failures(study, now.files) == []
    assert after(now, *reversed(done)).files == before.files


def test_another_key_of_the_keyboard_is_pressed_in_tests_too() -> None:
    before = state_of(files_with_tests("lablinking"), "lablinking")
    now = after(before, RenameSetting(("keys", "p"), "q"))
    assert b'{"key": "p"}' in before.files[KEPT]
    assert b'{"key": "p"}' not in now.files[KEPT]
    assert failures("lablinking", now.files) == []
    assert after(now, RenameSetting(("keys", "q"), "p")).files == before.files
