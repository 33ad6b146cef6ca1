"""Studies for tests of checks, and somebody at a terminal."""

from __future__ import annotations

import stat
from collections.abc import Iterable
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

from rise_engine.checks import CheckContext
from rise_engine.study.model import Study, StudyCheck
from rise_engine.study.study_log import LogEntry

ZONE = timezone(timedelta(hours=1))
NOW = datetime(2026, 11, 22, 10, 0, tzinfo=ZONE)


def study(folder: Path, *checks: StudyCheck, **more: Any) -> Study:
    """A study of which only what checks read is given."""
    return Study(
        folder=str(folder),
        title="Lab",
        id="lab",
        seed=1,
        n=4,
        scenario="scenario",
        mode="real",
        checks=checks,
        **more,
    )


def context(of: Study, **more: Any) -> CheckContext:
    fields: dict[str, Any] = {"mode": "real", "run": 2, "wizard": "anna", "now": lambda: NOW} | more
    return CheckContext(of, fields.pop("participant", "P07"), str(Path(of.folder) / of.scenario), **fields)


def script(folder: Path, name: str, *lines: str, executable: bool = True) -> str:
    """A shell script in the study's folder; its name as `run` has it."""
    path = folder / name
    path.write_text("\n".join(["#!/bin/sh", *lines, ""]))
    if executable:
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return f"./{name}"


def checked(id: str, result: str, at: datetime | str, **more: Any) -> LogEntry:
    """An entry of study.jsonl."""
    moment = at if isinstance(at, str) else at.isoformat(timespec="milliseconds")
    return LogEntry("checked", moment, {"id": id, "result": result, "when": "before", **more}, 1)


class TerminalOfTest:
    """Somebody who answers as they were told, and goes when there is nothing left to say."""

    def __init__(self, *typed: str, answers: bool = True) -> None:
        self.answers = answers
        self.typed = list(typed)
        self.lines: list[str] = []
        self.asked: list[str] = []

    def show(self, line: str) -> None:
        self.lines.append(line)

    def ask(self, question: str) -> str:
        self.asked.append(question)
        if not self.typed:
            raise EOFError
        return self.typed.pop(0)


def results(reports: Iterable[Any]) -> dict[str, str]:
    """What came of each check."""
    return {report.id: report.result for report in reports}
