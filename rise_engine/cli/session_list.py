"""`rise-engine sessions STUDY|DIR` and `--all`: every session that was recorded, also those that have ended."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

from msgspec import Struct, to_builtins
from msgspec.structs import replace

from rise_engine.cli.study_status import table_lines
from rise_engine.session.folder import (
    JOURNAL,
    SessionError,
    SessionInfo,
    duration_text,
    has_begun,
    has_ended,
    is_abandoned,
    read_info,
    sessions_folder,
)
from rise_engine.session.lock import is_journal_locked
from rise_engine.study.labels import reassignment_of
from rise_engine.study.sessions import SESSIONS, read_verdict
from rise_engine.study.standing import when_text
from rise_engine.study.study_log import read_log
from rise_engine.study.study_toml import is_study


class ListedSession(Struct, frozen=True):
    """A session in a list."""

    folder: str
    started: str
    """ISO 8601."""
    status: Literal["running", "unfinished", "given-up", "ended"]
    outcome: str
    """complete, aborted, excluded, or empty: nobody has said it."""
    reason: str
    seconds: float
    """Session time of its last record."""
    participant: str
    condition: str
    study: str
    run: int
    attempt: int
    purpose: str
    mode: str
    title: str


def list_sessions(where: Path | None) -> list[ListedSession]:
    """The sessions of a study, of a scenario or of a folder with sessions, the earliest first.

    :param where: the folder of one of these; None: the folder where sessions lie that are of no study.
    :raises rise_engine.study.study_log.StudyLogError: a study's log cannot be read.
    """
    judged: dict[str, tuple[str, str]] = {}
    scenario = ""
    if where is None:
        root = sessions_folder()
    elif is_study(where):
        root = where / SESSIONS
        entries = [each for each in read_log(where) if each.kind == "outcome"]
        judged = {
            str(each.get("session")): (str(each.get("status")), str(each.get("reason") or "")) for each in entries
        }
    elif (where / "scenario.toml").is_file():
        root, scenario = sessions_folder(), os.path.realpath(where)
    else:
        root = where
    found: list[ListedSession] = []
    for folder in _folders(root):
        with suppress(SessionError):  # it is no session
            info = read_info(folder, compare=False)
            if (moved := reassignment_of(folder)) is not None:
                info = replace(info, participant=moved.participant, slot=moved.slot or 0, attempt=moved.attempt)
            if has_begun(folder) and scenario in ("", os.path.realpath(info.scenario_folder)):
                found.append(_listed(folder, info, judged.get(folder.name)))
    return sorted(found, key=lambda each: (each.started, each.folder))


def session_lines(sessions: Iterable[ListedSession]) -> list[str]:
    """The same for a terminal: when, who, in which condition, how it counts, how long, its mode, its folder's name."""
    rows = [["when", "participant", "condition", "run", "outcome", "length", "mode", "folder"]]
    for each in sessions:
        run = "" if not each.run else f"{each.run}" if each.attempt < 2 else f"{each.run}, attempt {each.attempt}"
        unjudged = {"ended": "to judge" if each.purpose == "counted" else "-", "given-up": "given up"}
        outcome = each.outcome or unjudged.get(each.status, each.status)
        mode = each.mode if each.purpose in ("", "counted", "debug") else f"{each.mode}, {each.purpose}"
        rows.append(
            [
                when_text(each.started),
                each.participant,
                each.condition,
                run,
                outcome,
                duration_text(each.seconds),
                mode,
                Path(each.folder).name,
            ]
        )
    return table_lines(rows)


def sessions_json(sessions: Iterable[ListedSession]) -> list[dict[str, Any]]:
    """The same as a document."""
    return [to_builtins(each) for each in sessions]


def _folders(root: Path) -> list[Path]:
    with suppress(OSError):
        return [Path(entry.path) for entry in os.scandir(root) if entry.is_dir()]
    return []


def _listed(folder: Path, info: SessionInfo, judged: tuple[str, str] | None) -> ListedSession:
    verdict = read_verdict(folder)
    status: Literal["running", "unfinished", "given-up", "ended"] = "unfinished"
    if has_ended(folder):
        status = "ended"
    elif is_journal_locked(folder / JOURNAL):
        status = "running"
    elif is_abandoned(folder):
        status = "given-up"
    report = verdict.report
    outcome, reason = judged or ((report.status, report.reason) if report is not None else ("", ""))
    return ListedSession(
        folder=str(folder),
        started=info.started,
        status=status,
        outcome=outcome,
        reason=reason,
        seconds=round(verdict.seconds, 3),
        participant=info.participant,
        condition=info.condition,
        study=info.study,
        run=info.run,
        attempt=info.attempt,
        purpose=info.purpose,
        mode=info.mode,
        title=info.title,
    )
