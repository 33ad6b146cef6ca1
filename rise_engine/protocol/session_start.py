"""What a session of a scenario begins with, and whether it can: for whoever starts one, with or without a process."""

from __future__ import annotations

from rise_engine.expression import Assignment, ExpressionError
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.nearest_name import did_you_mean
from rise_engine.protocol.session_options import SessionOptions
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.study import condition_memory, condition_problem


def start_problems(scenario: Scenario, options: SessionOptions) -> list[str]:
    """Why a new session cannot begin as these options have it: sentences, none if it can.

    :param scenario: the one that the options name, in their mode.
    """
    if problem := condition_problem(scenario, options.condition):
        return [problem]
    return _conflicts(scenario, options)


def first_input(scenario: Scenario, options: SessionOptions) -> SessionStarted:
    """The first input of a session that is of no study: who takes part, and what their condition sets."""
    return SessionStarted(
        participant=options.participant,
        condition=options.condition,
        memory=condition_memory(scenario, options.condition),
    )


def start_remarks(scenario: Scenario, started: SessionStarted) -> list[str]:
    """What to say, and to record, of a session that begins in this way: sentences.

    :param scenario: what is run.
    :param started: its first input.
    """
    missing = sorted(scenario.factors_read - started.factors.keys())
    why = "the study has no such factor" if started.study else "this session is of no study"
    return [
        f"the scenario reads `session.factors.{name}`, which has no value: "
        f"{why}{did_you_mean(name, started.factors) if started.study else ''}"
        for name in missing
    ]


def _conflicts(scenario: Scenario, options: SessionOptions) -> list[str]:
    """A session whose memory is not what its condition says cannot be asked for."""
    if not options.condition:
        return []
    conditions = {
        _head(key): name for name, condition in reversed(scenario.conditions.items()) for key in condition.memory
    }
    return [
        f"`{key}` cannot be set beside the condition `{options.condition}`, which says what it is"
        if _head(key) in map(_head, scenario.conditions[options.condition].memory)
        else f"`{key}` cannot be set beside the condition `{options.condition}`: it is what makes the condition "
        f"`{conditions[_head(key)]}`"
        for task in options.first_tasks
        for key in _assigned_keys(task)
        if _head(key) in conditions
    ]


def _assigned_keys(task: Submit) -> list[str]:
    if task.function != "assignValue":
        return []
    try:
        return [assignment.key for assignment in Assignment.parse_all(task.behavior)]
    except ExpressionError:  # its task says what is wrong
        return []


def _head(key: str) -> str:
    return key.partition(".")[0]
