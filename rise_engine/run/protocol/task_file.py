"""Task files: a wizard's whole session as text, one DomainTask per line (JSON).

    {"function_type": "startCommunicationRobotAct", "domain_task_behavior": "Greet", "calling_type": "None", "at": 2.5}

`at` is session time in seconds; without it, a task has the time of the previous line. `calling_type` is optional, and
`source` may name the sender (default `file`). Empty lines and lines that begin with # are skipped.

Lines before the first task may set the faults of the simulated robot, the seed, and one of the scenario's conditions.

    {"fault": "Emotion=fail@3"}
    {"seed": 7}
    {"condition": "no gaze"}
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, get_args

from msgspec import Struct

from rise_engine.base.errors import FileError
from rise_engine.base.json_codec import JsonError, read_json, to_plain
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.kernel.behaviors import BehaviorError, read_rule_start
from rise_engine.kernel.inputs import Submit, TaskFunction
from rise_engine.scenario.model import Scenario

FUNCTIONS: tuple[str, ...] = get_args(TaskFunction)
KEYS = ("function_type", "domain_task_behavior", "calling_type", "at", "source")
SETTINGS = ("fault", "seed", "condition")
"""Entries of a line that sets something for the whole session."""
TEST_ENTRIES = ("test", "key", "go_on", "wait", "expect")
"""Entries of the lines of tests (`rise_engine.author.trial.study_test`)."""
LATEST_SECONDS = 366 * 86_400.0
"""The latest `at` in seconds, a year."""
_WITHOUT_BEHAVIOR = (
    *("stopAll", "releaseStop", "cancelOpenGoals", "releaseOpenGoals"),
    *("markCue", "undoCue", "nextFiller"),
)


class TimedTask(Struct, frozen=True):
    """One line: a task and its time."""

    at: float
    task: Submit
    file: str
    line: int


class TaskFile(Struct, frozen=True):
    """A whole file."""

    tasks: tuple[TimedTask, ...] = ()
    """By `at`; tasks of one time are in file order."""
    faults: tuple[str, ...] = ()
    """Faults of the simulated robot, as its driver documents them."""
    seed: int | None = None
    """None: the file does not set it."""
    condition: str = ""
    """Empty: the file does not set it."""


class TaskFileReader:
    """A reader of a task file, line by line."""

    def __init__(self, file: str, *, as_it_comes: bool = True) -> None:
        """:param as_it_comes: whether the session already runs, so that lines about the whole session are errors."""
        self.file = file
        self.faults: list[str] = []
        self.seed: int | None = None
        self.condition = ""
        self._as_it_comes = as_it_comes
        self._has_tasks = False
        self._line = 0
        self._at = 0.0

    def read_line(self, text: bytes | str) -> TimedTask | None:
        """Return the task of the next line, or None for a line without one. Raises FileError with all its errors."""
        self._line += 1
        if isinstance(text, bytes):
            try:
                text = text.decode("utf-8-sig" if self._line == 1 else "utf-8")
            except UnicodeDecodeError as error:
                raise self._make_error(["this is not UTF-8 text"], error.start + 1) from None
        before = len(text) - len(text.lstrip())
        text = text.strip()
        if not text or text.startswith("#"):
            return None
        problems: list[str] = []
        try:
            value = to_plain(read_json(text, lambda key, at, first: problems.append(f"`{key}` is there twice")))
        except JsonError as error:
            raise self._make_error([f"this is not JSON: {error}"], before + error.offset + 1) from None
        if not isinstance(value, dict):
            raise self._make_error([f'a line is a JSON object such as {{"function_type": "{FUNCTIONS[0]}", ...}}'])
        setting = next((key for key in SETTINGS if key in value), None)
        problems += find_task_problems(value) if setting is None else self._find_setting_problems(setting, value)
        if problems:
            raise self._make_error(problems)
        if setting is not None:
            self._take_setting(value)
            return None
        self._has_tasks = True
        self._at = float(value.get("at", self._at))
        return TimedTask(self._at, task_of(value), self.file, self._line)

    def _find_setting_problems(self, setting: str, value: dict[str, Any]) -> list[str]:
        """Return the errors of a line about the whole session, in sentences."""
        content = value[setting]
        problems = []
        if len(value) > 1:
            problems.append(f"`{setting}` must be alone in its line")
        if self._as_it_comes:
            problems.append(f"`{setting}` is about the whole session, which already runs; write it in a file")
        elif self._has_tasks:
            problems.append(f"`{setting}` is about the whole session: write it before the first task")
        if setting == "seed":
            if isinstance(content, bool) or not isinstance(content, int) or content < 0:
                problems.append("`seed` must be a whole number, 0 or more")
            elif self.seed is not None:
                problems.append("there is a seed already")
        elif not isinstance(content, str) or not content.strip():
            example = "Emotion=fail@3" if setting == "fault" else "no gaze"
            problems.append(f'`{setting}` must be a text such as "{example}"')
        elif setting == "condition" and self.condition:
            problems.append("there is a condition already")
        return problems

    def _take_setting(self, value: dict[str, Any]) -> None:
        if "fault" in value:
            self.faults.append(value["fault"].strip())
        self.seed = value.get("seed", self.seed)
        self.condition = value.get("condition", self.condition)

    def _make_error(self, messages: list[str], column: int | None = None) -> FileError:
        where = f"{self.file}:{self._line}" if column is None else f"{self.file}:{self._line}:{column}"
        return FileError(*(f"{where}: error: {message}" for message in messages))


def read_task_file(text: bytes, file: str) -> TaskFile:
    """Read a whole file. Raises FileError with all errors."""
    reader = TaskFileReader(file, as_it_comes=False)
    tasks: list[TimedTask] = []
    problems: list[str] = []
    for line in text.split(b"\n"):
        try:
            task = reader.read_line(line)
        except FileError as error:
            problems.append(str(error))
        else:
            if task is not None:
                tasks.append(task)
    if problems:
        raise FileError(*problems)
    tasks.sort(key=lambda task: task.at)
    return TaskFile(tuple(tasks), tuple(reader.faults), reader.seed, reader.condition)


def warning_for_task(task: TimedTask, scenario: Scenario) -> str | None:
    """Warn about a name that the scenario does not have; the session will reject the task."""
    function, name = task.task.function, task.task.behavior
    if function == "startInteractionRule":
        return _warning_for_start(task, scenario)
    if function.endswith("CommunicationRobotAct"):
        known, what = list(scenario.acts), "act"
    elif function.endswith("InteractionRule"):
        known, what = list(scenario.rules), "rule"
    else:
        return None
    if name in known:
        return None
    return f"{task.file}:{task.line}: warning: {unknown_name_sentence(what, name, known)}; the task will be rejected"


def _warning_for_start(task: TimedTask, scenario: Scenario) -> str | None:
    try:
        start = read_rule_start(task.task.behavior)
    except BehaviorError as problem:
        return f"{task.file}:{task.line}: warning: {problem}; the task will be rejected"
    rule = scenario.rules.get(start.rule)
    if rule is None:
        problem_text = unknown_name_sentence("rule", start.rule, list(scenario.rules))
    elif start.state is not None and start.state not in rule.states:
        problem_text = unknown_name_sentence("state", start.state, list(rule.states)) + f" (rule `{rule.name}`)"
    else:
        return None
    return f"{task.file}:{task.line}: warning: {problem_text}; the task will be rejected"


def unknown_name_sentence(what: str, name: str, known: Sequence[str]) -> str:
    """Return ``there is no act `Gret`; did you mean `Greet`?``"""
    return f"there is no {what} `{name}`{did_you_mean(name, known)}"


def task_of(value: dict[str, Any], source: str = "file") -> Submit:
    """Make the task of a valid line; `source` is the default for the line's own."""
    behavior = value.get("domain_task_behavior", "")
    return Submit(
        function=value["function_type"],
        behavior=behavior if isinstance(behavior, str) else json.dumps(behavior, ensure_ascii=False),
        calling_type=value.get("calling_type", ""),
        source=value.get("source", source),
    )


def find_task_problems(value: dict[str, Any]) -> list[str]:
    """Return the errors of a line of a task file, in sentences."""
    if test_lines := [key for key in TEST_ENTRIES if key in value]:
        return [f"`{test_lines[0]}` belongs to a test of a study, which `rise-engine test DIR` runs"]
    problems = [f"unknown entry `{key}`{did_you_mean(key, (*KEYS, *SETTINGS))}" for key in value if key not in KEYS]
    function = value.get("function_type")
    if "function_type" not in value:
        problems.append("`function_type` is missing")
    elif not isinstance(function, str):
        problems.append("`function_type` must be a text")
    elif function not in FUNCTIONS:
        problems.append(f"unknown function_type `{function}`{did_you_mean(function, FUNCTIONS)}")
    behavior = value.get("domain_task_behavior", "")
    if not isinstance(behavior, str | dict):
        problems.append("`domain_task_behavior` must be a text, or an object for what JSON says")
    elif (
        isinstance(behavior, str)
        and not behavior.strip()
        and function in FUNCTIONS
        and function not in _WITHOUT_BEHAVIOR
    ):
        problems.append(f"`domain_task_behavior` is missing: {function} needs to know what")
    calling_type = value.get("calling_type", "")
    if calling_type not in ("", "None", "Blocking", "Interrupt"):
        problems.append('`calling_type` must be "Blocking", "None" or "Interrupt" (a text), or left out')
    source = value.get("source", "file")
    if not isinstance(source, str) or not source.strip():
        problems.append('`source` must be a text such as "wizard:anna"')
    at = value.get("at", 0.0)
    if isinstance(at, bool) or not isinstance(at, int | float) or not 0 <= at <= LATEST_SECONDS:
        problems.append("`at` must be a number of seconds, 0 or more")
    return problems
