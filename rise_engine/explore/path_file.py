"""A path as a task file: what it shows, with what it is played, and what somebody does when."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rise_engine.explore.playing import PlayedPath
from rise_engine.protocol.task_file import TimedTask
from rise_engine.trial.study_test import written_line


def task_file_of(title: str, told: Sequence[str], played: PlayedPath, study: str) -> str:
    """The text of a task file, as `rise-engine run --tasks` reads it.

    Arguments:
        title: what it shows, in a sentence.
        told: the path in sentences (`rise_engine.explore.telling.tell_path`).
        played: how it is played.
        study: the scenario's folder, as one would write it in a command.
    """
    lines = [
        *_comment(title),
        "#",
        "# Play it, with the name of this file:",
        f"#   rise-engine run {study} --tasks FILE --speed max",
        f"#   rise-engine serve {study} --tasks FILE   and in another terminal: rise-tui",
    ]
    if not played.is_certain:
        lines += ["#", *_comment(f"Perhaps it does not go like this: {played.problem}.")]
    lines.append("")
    if played.condition:
        lines.append(written_line({"condition": played.condition}))
    lines.append(written_line({"seed": played.seed}))
    lines += [written_line({"fault": fault}) for fault in played.faults]
    tasks = {task.line: task for task in played.tasks}
    for number, sentence in enumerate(told, 1):
        lines += ["", *_comment(f"{number}. {sentence}")]
        if (task := tasks.get(number)) is not None:
            lines.append(written_line(_line_of(task)))
    return "\n".join(lines) + "\n"


def _comment(text: str) -> list[str]:
    return [f"# {line}".rstrip() for line in text.splitlines()]


def _line_of(timed: TimedTask) -> dict[str, Any]:
    line: dict[str, Any] = {"function_type": timed.task.function}
    if timed.task.behavior:
        line["domain_task_behavior"] = timed.task.behavior
    line["at"] = timed.at
    return line
