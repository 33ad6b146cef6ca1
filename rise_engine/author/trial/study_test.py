"""Tests of a study: files in `tests/` of its folder with steps and their expected results.

One JSON object a line (docs/reference/tests-of-a-study.md):

    {"test": "the welcome", "seed": 1}
    {"key": "t"}
    {"go_on": true}
    {"expect": {"rules": {"Table setting": "After the welcome"}}}
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from msgspec import Struct, field

from rise_engine.base.errors import FileError
from rise_engine.base.json_codec import JsonError, read_json, to_plain
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.kernel.inputs import Submit
from rise_engine.run.protocol.task_file import KEYS as TASK_KEYS
from rise_engine.run.protocol.task_file import find_task_problems, task_of
from rise_engine.scenario.model import KeyBinding, Scenario, normal_topic
from rise_engine.scenario.reading.conditions import condition_problem

FOLDER = "tests"
ENDING = ".jsonl"
LONGEST_WAIT = 86_400.0
_HEAD = ("test", "seed", "condition", "memory")
_EXPECTED = ("rules", "memory", "starts", "says", "events", "refused")
_ACTIONS = ("function_type", "key", "go_on", "wait", "expect", "test")


class Expectation(Struct, frozen=True):
    """The expected result of the line before; None is not checked."""

    rules: dict[str, str | None] = field(default_factory=dict)
    """The state of each rule; None: it does not run."""
    memory: dict[str, Any] = field(default_factory=dict)
    """The value of each key."""
    starts: tuple[str, ...] | None = None
    """The acts started, exactly these, in this order."""
    says: tuple[str, ...] | None = None
    """The texts begun, exactly these, in this order."""
    events: tuple[str, ...] | None = None
    """Raised topics, without slash; others are allowed."""
    refused: bool = False
    """Whether the task must be refused."""


class StudyTestLine(Struct, frozen=True):
    """A step of a test, or its expectation."""

    line: int
    task: Submit | None = None
    at: float | None = None
    """Session time of the task; None: after everything so far."""
    key: KeyBinding | None = None
    go_on: bool = False
    wait: float = 0.0
    expect: Expectation | None = None


class StudyTest(Struct, frozen=True):
    """A parsed test."""

    file: str
    title: str
    lines: tuple[StudyTestLine, ...]
    seed: int = 1
    condition: str = ""
    memory: dict[str, Any] = field(default_factory=dict)


def read_study_test(text: bytes, file: str, scenario: Scenario) -> StudyTest:
    """Read a test from the content of its file.

    :param file: its path, for messages.
    :param scenario: the scenario to test, which must have all names in the test.
    :raises FileError: with all errors.
    """
    reader = _TestReader(file, scenario)
    for number, line in enumerate(text.split(b"\n"), 1):
        reader.read_line(number, line)
    if reader.problems:
        raise FileError(*reader.problems)
    head = reader.head
    return StudyTest(
        file,
        head.get("test", file),
        tuple(reader.lines),
        head.get("seed", 1),
        head.get("condition", ""),
        head.get("memory", {}),
    )


class _TestReader:
    def __init__(self, file: str, scenario: Scenario) -> None:
        self.file, self.scenario = file, scenario
        self.keys = {binding.label: binding for binding in scenario.keys.values()}
        self.head: dict[str, Any] = {}
        self.lines: list[StudyTestLine] = []
        self.problems: list[str] = []
        self.number = 0
        self.did_something = False
        """Whether a line with a step was read."""

    def report(self, messages: Iterable[str], column: int | None = None) -> None:
        where = f"{self.file}:{self.number}" + ("" if column is None else f":{column}")
        self.problems += [f"{where}: error: {message}" for message in messages]

    def read_line(self, number: int, data: bytes) -> None:
        self.number = number
        try:
            text = data.decode("utf-8-sig" if number == 1 else "utf-8")
        except UnicodeDecodeError as error:
            self.report(["this is not UTF-8 text"], error.start + 1)
            return
        before, text = len(text) - len(text.lstrip()), text.strip()
        if not text or text.startswith("#"):
            return
        twice: list[str] = []
        try:
            value = to_plain(read_json(text, lambda key, at, first: twice.append(f"`{key}` is there twice")))
        except JsonError as error:
            self.report([f"this is not JSON: {error}"], before + error.offset + 1)
            return
        self.report(twice)
        if not isinstance(value, dict):
            self.report(['a line is a JSON object such as {"key": "n"} or {"go_on": true}'])
        elif not twice:
            self.take(value)

    def take(self, value: dict[str, Any]) -> None:
        what = [name for name in _ACTIONS if name in value]
        self.did_something |= what not in (["expect"], ["test"])
        if len(what) != 1:
            names = (*_ACTIONS, *TASK_KEYS, *_HEAD)
            near = next((near for key in value if (near := did_you_mean(key, names))), "")
            prefix = f"this line has {' and '.join(f'`{name}`' for name in what)}; " if what else ""
            self.report([f"{prefix}a line has one of {', '.join(f'`{name}`' for name in _ACTIONS)}{near}"])
            return
        kind = what[0]
        known: tuple[str, ...] = {"function_type": TASK_KEYS, "test": _HEAD, "key": ("key", "at")}.get(kind, (kind,))
        unknown = [f"unknown entry `{key}`{did_you_mean(key, known)}" for key in value if key not in known]
        if kind == "function_type":
            self.take_task(value)
            return
        self.report(unknown)
        match kind:
            case "test":
                self.take_head(value)
            case "key":
                self.take_key(value)
            case "go_on":
                if value["go_on"] is not True:
                    self.report(["`go_on` is true: time goes on until the robot has done what it does"])
                self.lines.append(StudyTestLine(self.number, go_on=True))
            case "wait":
                self.take_wait(value["wait"])
            case "expect":
                self.take_expectation(value["expect"])

    def take_task(self, value: dict[str, Any]) -> None:
        problems = find_task_problems(value)
        self.report(problems)
        if not problems:
            at = value.get("at")
            self.lines.append(StudyTestLine(self.number, task_of(value), None if at is None else float(at)))

    def take_key(self, value: dict[str, Any]) -> None:
        label, at = value["key"], value.get("at")
        key = self.keys.get(label) if isinstance(label, str) else None
        if key is None:
            self.report([f"the study has no key `{label}`; it has {', '.join(self.keys) or 'none'}"])
        elif at is not None and not _is_seconds(at):
            self.report(["`at` must be a number of seconds, 0 or more"])
        else:
            self.lines.append(StudyTestLine(self.number, at=None if at is None else float(at), key=key))

    def take_wait(self, seconds: Any) -> None:
        if _is_seconds(seconds) and seconds > 0:
            self.lines.append(StudyTestLine(self.number, wait=float(seconds)))
        else:
            self.report([f"`wait` must be a number of seconds above 0, up to {LONGEST_WAIT:g}"])

    def take_head(self, value: dict[str, Any]) -> None:
        problems = [] if not self.head and not self.lines else ["`test` is allowed once, in the first line"]
        if not isinstance(value["test"], str) or not value["test"].strip():
            problems.append("`test` must be a text: what is tested")
        seed, condition, memory = value.get("seed", 1), value.get("condition", ""), value.get("memory", {})
        if isinstance(seed, bool) or not isinstance(seed, int):
            problems.append("`seed` must be a whole number")
        if not isinstance(condition, str):
            problems.append("`condition` must be the name of a condition of the study")
        elif condition and (problem := condition_problem(self.scenario, condition)):
            problems.append(problem)
        if not isinstance(memory, dict):
            problems.append("`memory` must be an object: a value for each key")
        self.report(problems)
        if not problems:
            self.head = value

    def take_expectation(self, value: Any) -> None:
        if not isinstance(value, dict) or not value:
            self.report(['`expect` must be an object such as {"rules": {"Table setting": "Welcome"}}'])
            return
        problems = [
            f"unknown expectation `{key}`{did_you_mean(key, _EXPECTED)}" for key in value if key not in _EXPECTED
        ]
        rules, memory, refused = value.get("rules", {}), value.get("memory", {}), value.get("refused", False)
        problems += _rule_problems(self.scenario, rules)
        if not isinstance(memory, dict):
            problems.append("`memory` must be an object: a value for each key")
        if not isinstance(refused, bool):
            problems.append("`refused` must be true or false")
        lists = {name: value[name] for name in ("starts", "says", "events") if name in value}
        for name, texts in lists.items():
            if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
                problems.append(f"`{name}` must be a list of texts")
            elif name == "starts":
                missing = (text for text in texts if text not in self.scenario.acts)
                problems += [f"there is no act `{text}`{did_you_mean(text, self.scenario.acts)}" for text in missing]
        if not self.did_something:
            problems.append("an `expect` follows a line that does something")
        self.report(problems)
        if not problems:
            starts, says, events = (
                tuple(lists[name]) if name in lists else None for name in ("starts", "says", "events")
            )
            topics = None if events is None else tuple(map(normal_topic, events))
            self.lines.append(
                StudyTestLine(self.number, expect=Expectation(rules, memory, starts, says, topics, refused))
            )


def _is_seconds(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, int | float) and 0 <= value <= LONGEST_WAIT


def _rule_problems(scenario: Scenario, rules: Any) -> list[str]:
    if not isinstance(rules, dict) or not all(isinstance(state, str | None) for state in rules.values()):
        return ["`rules` must be an object: for each rule the state in which it is, or null when it does not run"]
    problems = []
    for name, state in rules.items():
        rule = scenario.rules.get(name)
        if rule is None:
            problems.append(f"there is no rule `{name}`{did_you_mean(name, scenario.rules)}")
        elif state is not None and state not in rule.states:
            problems.append(f"there is no state `{state}`{did_you_mean(state, rule.states)} (rule `{name}`)")
    return problems


def written_line(value: Mapping[str, Any]) -> str:
    """Write a line of a test."""
    return json.dumps(value, ensure_ascii=False)
