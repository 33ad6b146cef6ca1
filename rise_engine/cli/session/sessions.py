"""`rise-engine sessions`: lists running, unfinished and recorded sessions."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Literal, NamedTuple

import click
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import OK, PARTIAL
from rise_engine.base.files import is_locked
from rise_engine.cli.options import JSON
from rise_engine.cli.terminal import exit_with_usage, print_lines, print_notes, show, table_lines, write_json
from rise_engine.results.analysis.reading import NO_JUDGEMENTS, Judgement, read_judgements
from rise_engine.run.client.running_sessions import all_running_sessions, sessions_on_other_computers
from rise_engine.run.protocol.messages import SessionSummary
from rise_engine.run.protocol.registry import session_name
from rise_engine.session.folder import (
    JOURNAL,
    SessionInfo,
    describe_session,
    duration_text,
    find_unfinished,
    has_begun,
    has_ended,
    is_abandoned,
    read_info,
    sessions_folder,
)
from rise_engine.study.labels import SESSIONS, copied_sessions, reassignment_of, session_differences
from rise_engine.study.standing import when_text
from rise_engine.study.study_log import LogEntry, read_log
from rise_engine.study.study_toml import is_study
from rise_engine.study.verdict import read_verdict


@click.command()
@click.argument("where", metavar="[STUDY|DIR]", type=click.Path(), required=False)
@click.option("--all", "everything", is_flag=True, help="Also list sessions that have ended.")
@JSON
def sessions(where: str | None, everything: bool, as_json: bool) -> int:
    """List the sessions that run on this machine, and those that did not end.

    With STUDY, a scenario's DIR or a folder of sessions, list every session that was recorded there, with participant,
    condition, outcome, length and mode. With --all, do the same for the usual sessions folder.

    Exit status: 0; 1 if they cannot be listed, or another file says something else than a session's journal; 2 if there
    is no such folder.
    """
    if where is not None or everything:
        return _print_recorded(where, as_json=as_json)
    print_sessions(as_json=as_json)
    return OK


# --- running sessions -----------------------------------------------------------------------------------------------


def print_sessions(*, as_json: bool) -> None:
    """Print the running sessions, and on standard error those that did not end."""
    found = all_running_sessions()
    if as_json:
        write_json([{"name": name, "about": each} for name, each in found.items()], indent=-1)
        return
    others = sessions_on_other_computers()
    if not found and not others:
        print_notes("no session is running; begin one with:  rise-tui --config DIR")
    print_lines(*running_lines(found))
    print_notes(*others, *unfinished_lines(unfinished_sessions(found)))


def running_lines(found: Mapping[str, SessionSummary | None]) -> list[str]:
    """Format running sessions as lines: who, what, since when, and the record."""
    return [line for name, summary in found.items() for line in _lines_of(name, summary)]


def _lines_of(name: str, summary: SessionSummary | None) -> list[str]:
    if summary is None:
        return [f"{name}  does not answer"]
    minutes, seconds = divmod(int(summary.t), 60)
    time_text = f"{minutes // 60}:{minutes % 60:02}:{seconds:02}"
    doing = "STOPPED" if summary.stopped else "busy" if summary.busy else "idle"
    who = f"{summary.control} has control" if summary.control is not None else "nobody has control"
    others = [client for client in summary.clients if client != summary.control]
    lines = [
        f"{name}  {summary.title}  {summary.mode.upper()}  {summary.robot}  {time_text}  {doing}  {who}"
        + (f", also {', '.join(others)}" if others else ""),
        f"    record  {summary.folder}",
    ]
    if summary.trouble:
        lines.append(f"    NOT RECORDING, paused: {summary.trouble}")
    return lines


# --- recorded sessions ----------------------------------------------------------------------------------------------


def _print_recorded(where: str | None, *, as_json: bool) -> int:
    """Print every recorded session of a study, of a scenario or in a folder, and return the exit status.

    :param where: None: the usual sessions folder.
    """
    if where is not None and not Path(where).is_dir():
        exit_with_usage(f"there is no folder {where}")
    found = list_sessions(None if where is None else Path(where))
    show(session_lines(found) if found else (), found, as_json=as_json)
    if not found and not as_json:
        print_notes("no session was recorded here")
    others = [f"{Path(each.folder).name}: {'; '.join(each.differences)}" for each in found if each.differences]
    print_notes(*others)
    return PARTIAL if others else OK


class ListedSession(Struct, frozen=True):
    """A session in a list."""

    folder: str
    started: str
    """ISO 8601."""
    status: Literal["running", "unfinished", "given-up", "ended"]
    outcome: str
    """complete, aborted, excluded, or empty: not set."""
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
    differences: list[str] = []
    """Sentences on contradictions between its journal, which the list shows, and other files."""


def list_sessions(where: Path | None) -> list[ListedSession]:
    """List the sessions of a study, of a scenario or of a folder with sessions, the earliest first.

    :param where: its folder; None: the folder of sessions outside of studies.
    :raises rise_engine.study.study_log.StudyLogError: a study's log cannot be read.
    """
    judgements, copies, log = NO_JUDGEMENTS, set[str](), list[LogEntry]()
    scenario = ""
    if where is None:
        root = sessions_folder()
    elif is_study(where):
        root = where / SESSIONS
        log = [*read_log(where)]
        copies = {*copied_sessions(where, log)}
        judgements = read_judgements(where)
    elif (where / "scenario.toml").is_file():
        root, scenario = sessions_folder(), os.path.realpath(where)
    else:
        root = where
    found: list[ListedSession] = []
    for folder in _folders(root):
        with suppress(SessionError):  # not a session
            if folder.name in copies:
                continue
            info = read_info(folder, compare=False)
            if (moved := reassignment_of(folder)) is not None:
                info = replace(info, participant=moved.participant, slot=moved.slot or 0, attempt=moved.attempt)
            if has_begun(folder) and scenario in ("", os.path.realpath(info.scenario_folder)):
                listed = _listed(folder, info, judgements.of(folder.name, info.participant))
                found.append(replace(listed, differences=session_differences(folder, log)))
    return sorted(found, key=lambda each: (each.started, each.folder))


def session_lines(listed: Iterable[ListedSession]) -> list[str]:
    """Format sessions as a table: time, participant, condition, run, outcome, length, mode, and the folder's name."""
    rows = [["when", "participant", "condition", "run", "outcome", "length", "mode", "folder"]]
    for each in listed:
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


def _folders(root: Path) -> list[Path]:
    with suppress(OSError):
        return [Path(entry.path) for entry in os.scandir(root) if entry.is_dir()]
    return []


def _listed(folder: Path, info: SessionInfo, judgement: Judgement | None) -> ListedSession:
    verdict = read_verdict(folder)
    status: Literal["running", "unfinished", "given-up", "ended"] = "unfinished"
    if has_ended(folder):
        status = "ended"
    elif is_locked(folder / JOURNAL):
        status = "running"
    elif is_abandoned(folder):
        status = "given-up"
    judged = judgement or verdict.report
    return ListedSession(
        folder=str(folder),
        started=info.started,
        status=status,
        outcome=judged.status if judged is not None else "",
        reason=judged.reason if judged is not None else "",
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


# --- unfinished sessions ----------------------------------------------------------------------------------------------


MAX_SCENARIOS = 3
"""Maximum number of listed scenarios, those with the latest sessions."""


class UnfinishedSession(NamedTuple):
    """The latest unfinished session of one scenario."""

    folder: Path
    info: SessionInfo


def unfinished_sessions(
    running: Mapping[str, SessionSummary | None], root: Path | None = None
) -> list[UnfinishedSession]:
    """Find the latest unfinished session of each scenario, the latest first.

    :param running: the running sessions (`registry.ask_all_summaries`), which are left out.
    :param root: the folder with the sessions, such as a study's; None: that of sessions outside of studies.
    """
    recorded = {os.path.realpath(about.folder) for about in running.values() if about is not None and about.folder}
    found: dict[str, UnfinishedSession] = {}
    for folder in find_unfinished(root=root):
        if os.path.realpath(folder) in recorded:
            continue
        try:
            info = read_info(folder, compare=False)
        except SessionError:
            continue
        name = session_name(info.scenario_folder)
        if name in found or name in running or not os.path.isdir(info.scenario_folder):  # noqa: PTH112
            continue
        found[name] = UnfinishedSession(folder, info)
        if len(found) == MAX_SCENARIOS:
            break
    return list(found.values())


def unfinished_lines(sessions: list[UnfinishedSession]) -> list[str]:
    """Format the sessions as lines, each with the command that offers to recover it; none if there are no sessions."""
    if not sessions:
        return []
    first = "A session did not end. To go on with it:"
    if len(sessions) > 1:
        first = "These sessions did not end. To go on with one of them:"
    lines = [
        (f"  rise-tui --config {shlex.quote(info.scenario_folder)}", f"      {describe_session(folder)}")
        for folder, info in sessions
    ]
    return ["", first, *(line for pair in lines for line in pair)]
