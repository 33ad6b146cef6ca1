"""Runs a study's tests: a trial takes the steps, and the results are compared with the expectations."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.trial.study_test import ENDING, FOLDER, Expectation, StudyTest, StudyTestLine, written_line
from rise_engine.author.trial.trial import SOURCE, Trial, TrialStep
from rise_engine.author.trial.trial_history import words_of_action
from rise_engine.base.typed_values import format_value
from rise_engine.expression import lookup
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import ActionRecord, AnyRecord, EventRecord, MemoryRecord, RuleRecord, TaskRecord
from rise_engine.scenario.model import Scenario, normal_topic

# --- saving a trial run -----------------------------------------------------------------------------------------------

_NO_NAME = re.compile(r"[^\w]+")


def path_of_test(folder: Path, title: str) -> Path:
    """Choose a new file for a test of this title: `tests/the_welcome.jsonl`, `tests/the_welcome_2.jsonl`."""
    name = _NO_NAME.sub("_", title.strip().lower()).strip("_") or "test"
    path, number = folder / FOLDER / f"{name}{ENDING}", 1
    while path.exists():
        number += 1
        path = folder / FOLDER / f"{name}_{number}{ENDING}"
    return path


def text_of_test(trial: Trial, title: str) -> str:
    """Write the trial as a test: its steps, and after each step its results (rules, memory, acts).

    :param title: the subject of the test, in a few words.
    """
    head: dict[str, Any] = {"test": title, "seed": trial.seed}
    if trial.condition:
        head["condition"] = trial.condition
    if trial.start_memory:
        head["memory"] = trial.start_memory
    lines = [written_line(head)]
    played = Trial(trial.scenario, seed=trial.seed, condition=trial.condition, memory=trial.start_memory)
    for step in trial.steps:
        played.do(step)
        lines.append(written_line(_step_line(step)))
        if expected := _step_expectation(played):
            lines.append(written_line({"expect": expected}))
    return "\n".join(lines) + "\n"


def _step_line(step: TrialStep) -> dict[str, Any]:
    if step.task is None:
        return {"go_on": True} if step.kind == "go_on" else {"wait": step.seconds}
    return {"key": step.key} if step.key else _task_line(step.task)


def _task_line(task: Submit) -> dict[str, Any]:
    line = {"function_type": task.function, "domain_task_behavior": task.behavior}
    if task.calling_type:
        line["calling_type"] = task.calling_type
    if task.source != SOURCE:
        line["source"] = task.source
    return line


def _step_expectation(trial: Trial) -> dict[str, Any]:
    """Return the changes of the last step as an expectation."""
    records = trial.records_of(-1)
    if refusal(trial):
        return {"refused": True}
    expected: dict[str, Any] = {}
    if rules := dict.fromkeys(record.name for record in records if isinstance(record, RuleRecord)):
        views = {name: trial.view.rules[name] for name in rules}
        expected["rules"] = {name: view.state if view.running else None for name, view in views.items()}
    changed = [record for record in records if isinstance(record, MemoryRecord) and record.source != "engine"]
    memory = trial.memory
    keys = [key for key in dict.fromkeys(record.key for record in changed) if lookup(memory, key)[0]]
    if keys:
        expected["memory"] = {key: lookup(memory, key)[1] for key in keys}
    if starts := started_acts(records):
        expected["starts"] = starts
    return expected


class StudyTestFailure(Struct, frozen=True):
    """A difference from an expectation."""

    line: int
    t: float
    """Session time of the check in seconds."""
    text: str
    """The expected and the actual result."""


class StudyTestOutcome(Struct, frozen=True):
    test: StudyTest
    failures: tuple[StudyTestFailure, ...]
    steps: int
    """The number of steps."""
    seconds: float
    """The elapsed session time."""

    @property
    def passed(self) -> bool:
        return not self.failures


def play_test(scenario: Scenario, test: StudyTest) -> StudyTestOutcome:
    """Run a test to its end, also after a difference.

    :param scenario: the scenario for which the test was read.
    :param test: from `rise_engine.author.trial.study_test.read_study_test`.
    """
    trial = Trial(scenario, seed=test.seed, condition=test.condition, memory=test.memory)
    failures: list[StudyTestFailure] = []
    for at, line in enumerate(test.lines):
        if line.expect is not None:
            found = _differences(trial, line.expect)
        else:
            expects_refusal = _expects_refusal(test.lines[at + 1 :])
            found = _do(trial, line, expects_refusal)
        failures += [StudyTestFailure(line.line, trial.now, text) for text in found]
    return StudyTestOutcome(test, tuple(failures), len(trial.steps), trial.now)


def _expects_refusal(following: tuple[StudyTestLine, ...]) -> bool:
    for line in following:
        if line.expect is None:
            return False
        if line.expect.refused:
            return True
    return False


def _do(trial: Trial, line: StudyTestLine, expects_refusal: bool) -> Iterator[str]:
    """Take the step of a line; yield its errors."""
    trial.problem = ""
    if line.go_on:
        if trial.next_at is not None:
            trial.go_on()
    elif line.wait:
        trial.pass_time(line.wait)
    elif line.at is not None and line.at < trial.now:
        yield f"`at` is {line.at:g} s, and {trial.now:g} s have passed already"
        return
    elif line.key is not None:
        trial.press(line.key, at=line.at)
    else:
        assert line.task is not None, "a line that expects nothing does something"
        task = line.task if line.task.source != "file" else replace(line.task, source=SOURCE)
        trial.submit(task, at=line.at)
    if trial.problem:
        yield trial.problem
    reason = refusal(trial)
    if reason and not expects_refusal:
        yield f"it was refused: {reason}"


def refusal(trial: Trial) -> str:
    """Return why the task of the last step was refused; empty: it was not, or the step has no task."""
    records = trial.records_of(-1)
    first = next((record for record in records if isinstance(record, TaskRecord)), None)
    is_refused = first is not None and first.status == "REJECTED" and trial.steps[-1].task is not None
    return first.reason or "it was rejected" if first is not None and is_refused else ""


def _differences(trial: Trial, expected: Expectation) -> Iterator[str]:
    """Yield a sentence for each difference from the expectation after the last step."""
    for name, state in expected.rules.items():
        rule = trial.view.rules.get(name)
        now = rule.state if rule is not None and rule.running else None
        if now != state:
            wanted = f"be in `{state}`" if state is not None else "not run"
            yield f"rule {name} should {wanted}, and it {'does not run' if now is None else f'is in `{now}`'}"
    memory = trial.memory
    for key, value in expected.memory.items():
        exists, present = lookup(memory, key)
        if not exists:
            yield f"{key} should be {format_value(value)}, and it is not set"
        elif not is_same_value(present, value):
            yield f"{key} should be {format_value(value)}, and it is {format_value(present)}"
    records = trial.records_of(-1)
    for what, wanted_texts, came in (
        ("starts", expected.starts, started_acts(records)),
        ("says", expected.says, begun_texts(records)),
    ):
        if wanted_texts is not None and list(wanted_texts) != came:
            yield f"`{what}` should be {_list_text(wanted_texts)}, and it is {_list_text(came)}"
    raised = [normal_topic(record.topic) for record in records if isinstance(record, EventRecord)]
    for topic in expected.events or ():
        if topic not in raised:
            yield f"the event /{topic} should be raised, and raised is {_list_text(raised)}"
    if expected.refused and not refusal(trial):
        yield "it should be refused, and it was not"


def is_same_value(one: Any, other: Any) -> bool:
    """Return whether two JSON values are equal: `1` and `1.0` are, `1` and `true` are not."""
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(is_same_value, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(is_same_value(one[key], other[key]) for key in one)
    return bool(one == other)


def _list_text(texts: tuple[str, ...] | list[str]) -> str:
    return ", ".join(texts) or "nothing"


def started_acts(records: list[AnyRecord]) -> list[str]:
    """List the started acts in order."""
    return [
        record.behavior
        for record in records
        if isinstance(record, TaskRecord)
        and record.function == "startCommunicationRobotAct"
        and record.status == "ACTIVE"
    ]


def begun_texts(records: list[AnyRecord]) -> list[str]:
    """List the texts that the robot has begun to say, in order."""
    return [
        words
        for record in records
        if isinstance(record, ActionRecord)
        and record.status == "started"
        and (words := words_of_action(record.parameters))
    ]
