"""What was asked for in a trial, as a task file: `rise-engine run` plays the same."""

from __future__ import annotations

from rise_engine.author.trial.study_test import written_line
from rise_engine.author.trial.trial import Trial


def task_file_text(trial: Trial) -> str:
    """With its times."""
    lines = []
    for step in trial.steps:
        if (task := step.task) is not None:
            asked = {"function_type": task.function, "domain_task_behavior": task.behavior, "source": task.source}
            calling = {"calling_type": task.calling_type} if task.calling_type else {}
            lines.append(written_line({**asked, **calling, "at": step.at}))
    return "\n".join(lines) + "\n"
