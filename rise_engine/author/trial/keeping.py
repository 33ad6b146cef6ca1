"""A trial kept: as a test of the study, and as a task file that `rise-engine run` plays."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from rise_engine.author.trial.playing import refusal, started_acts
from rise_engine.author.trial.study_test import ENDING, FOLDER, written_line
from rise_engine.author.trial.trial import SOURCE, Trial, TrialStep
from rise_engine.expression import lookup
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import MemoryRecord, RuleRecord

_NO_NAME = re.compile(r"[^\w]+")


def path_of_test(folder: Path, title: str) -> Path:
    """A file for a test of this title that is not there yet: `tests/the_welcome.jsonl`, `tests/the_welcome_2.jsonl`."""
    name = _NO_NAME.sub("_", title.strip().lower()).strip("_") or "test"
    path, number = folder / FOLDER / f"{name}{ENDING}", 1
    while path.exists():
        number += 1
        path = folder / FOLDER / f"{name}_{number}{ENDING}"
    return path


def text_of_test(trial: Trial, title: str) -> str:
    """The trial as a test: what was done, and after each step what has come of it (rules, memory, acts).

    :param title: what is tested, in a few words.
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
        if expected := _what_came(played):
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


def _what_came(trial: Trial) -> dict[str, Any]:
    """What the last step has changed, as an expectation."""
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
