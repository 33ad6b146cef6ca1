"""The start of a scenario's session, and whether it is possible."""

from __future__ import annotations

from collections.abc import Iterable

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.expression import Assignment, ExpressionError
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.reading.conditions import condition_memory, condition_problem
from rise_engine.session.labels import pseudonym_problem


def start_problems(scenario: Scenario, options: SessionOptions) -> list[str]:
    """Return why a new session cannot begin with these options: sentences; empty if it can.

    :param scenario: the one that the options name, in their mode.
    """
    pseudonym = pseudonym_problem(options.participant) if scenario.mode == "real" else ""
    if problems := [*filter(None, (pseudonym, condition_problem(scenario, options.condition)))]:
        return problems
    return set_conflicts(scenario, first_input(scenario, options), options.first_tasks)


def first_input(scenario: Scenario, options: SessionOptions) -> SessionStarted:
    """Make the first input of a session outside of a study: the participant, and the memory values of the condition."""
    return SessionStarted(
        participant=options.participant,
        condition=options.condition,
        memory=condition_memory(scenario, options.condition),
    )


def start_remarks(scenario: Scenario, started: SessionStarted) -> list[str]:
    """Return remarks about a session's start, in sentences, to print and to record.

    :param scenario: the running one.
    :param started: its first input.
    """
    missing = sorted(scenario.factors_read - started.factors.keys())
    why = "the study has no such factor" if started.study else "this session is not part of a study"
    return [
        f"the scenario reads `session.factors.{name}`, which has no value: "
        f"{why}{did_you_mean(name, started.factors) if started.study else ''}"
        for name in missing
    ]


def set_conflicts(scenario: Scenario, started: SessionStarted, tasks: Iterable[Submit]) -> list[str]:
    """Return a sentence for each key that the first tasks set against the session's condition.

    :param scenario: the running one.
    :param started: the first input; with a condition, of a study or of the scenario.
    :param tasks: the tasks submitted immediately after it (`--set`).
    """
    if not started.condition:
        return []
    own = {_head(key) for key in started.memory}
    others = {_head(key): name for name, each in reversed(scenario.conditions.items()) for key in each.memory}
    problems = []
    for key in (key for task in tasks for key in _assigned_keys(task)):
        problem = f"`{key}` cannot be set together with the condition `{started.condition}`"
        if _head(key) in own:
            problems.append(f"{problem}, which sets it")
        elif not started.study and _head(key) in others:
            problems.append(f"{problem}: it defines the condition `{others[_head(key)]}`")
    return problems


def assigned_keys(options: SessionOptions) -> list[str]:
    """Return the memory keys assigned at the beginning of a session, without the parts after the first full stop."""
    return [_head(key) for task in options.first_tasks for key in _assigned_keys(task)]


def _assigned_keys(task: Submit) -> list[str]:
    if task.function != "assignValue":
        return []
    try:
        return [assignment.key for assignment in Assignment.parse_all(task.behavior)]
    except ExpressionError:  # its task reports the error
        return []


def _head(key: str) -> str:
    return key.partition(".")[0]
