"""What `rise-engine sessions` and `rise-engine stop` do and print."""

from __future__ import annotations

import os
import shlex
import signal
import sys
import time
from pathlib import Path

from rise_engine.cli.session_list import list_sessions, session_lines, sessions_json
from rise_engine.cli.terminal import write_json
from rise_engine.cli.unfinished import unfinished_lines, unfinished_sessions
from rise_engine.client.running_sessions import all_running_sessions, sessions_on_other_computers
from rise_engine.exit_status import FAILED, NO_SUCH_SESSION, OK, USAGE
from rise_engine.protocol.messages import SessionSummary
from rise_engine.protocol.registry import (
    RegistryError,
    ask_summary,
    find_running,
    is_locked,
    lock_path,
    running_names,
    session_name,
    socket_path,
)
from rise_engine.session.folder import SessionError, read_info, running_sessions
from rise_engine.study.sessions import SESSIONS, read_verdict
from rise_engine.study.study_log import StudyLogError
from rise_engine.study.study_toml import is_study
from rise_engine.text import clean

END_SECONDS = 40.0
"""Seconds that a session has to end: the robot's answer and the last records take 11 at most."""


def print_sessions(*, as_json: bool) -> int:
    """Print the running sessions; the exit status."""
    try:
        found = all_running_sessions()
    except RegistryError as error:
        return _print_error(str(error))
    if as_json:
        write_json([{"name": name, "about": each} for name, each in found.items()], indent=-1)
        return OK
    others = sessions_on_other_computers()
    if not found and not others:
        print("no session is running; begin one with:  rise-tui --config DIR", file=sys.stderr)
    for name, summary in found.items():
        for line in _session_lines(name, summary):
            print(clean(line))
    for line in others:
        print(clean(line), file=sys.stderr)
    for line in unfinished_lines(unfinished_sessions(found)):
        print(clean(line), file=sys.stderr)
    return OK


def print_recorded(where: str | None, *, as_json: bool) -> int:
    """Print every session that was recorded: of a study, of a scenario, in a folder, or (None) in that where sessions
    lie; the exit status."""
    if where is not None and not Path(where).is_dir():
        print(f"error: there is no folder {where}", file=sys.stderr)
        return USAGE
    try:
        found = list_sessions(None if where is None else Path(where))
    except StudyLogError as error:
        return _print_error(str(error))
    if as_json:
        write_json(sessions_json(found))
    elif found:
        print("\n".join(clean(line) for line in session_lines(found)))
    else:
        print("no session was recorded here", file=sys.stderr)
    return OK


def stop_session(which: str | None) -> int:
    """End a session and wait until it has ended; the exit status."""
    try:
        name = find_session_name(which)
        lock = lock_path(socket_path(name))
        summary = ask_summary(name)
    except RegistryError as error:
        return _print_error(str(error))
    try:
        pid = int(lock.read_text())
        os.kill(pid, signal.SIGTERM)
    except (OSError, ValueError) as error:
        return _print_error(f"{name} cannot be asked to end: {error}")
    deadline = time.monotonic() + END_SECONDS
    while is_locked(lock):
        if time.monotonic() > deadline:
            print(f"error: {name} (process {pid}) has not ended within {END_SECONDS:g} s", file=sys.stderr)
            return FAILED
        time.sleep(0.02)
    print(f"{name} has ended", file=sys.stderr)
    if summary is not None and summary.folder:
        for line in _to_judge_lines(Path(summary.folder)):
            print(clean(line), file=sys.stderr)
    return OK


def _to_judge_lines(folder: Path) -> list[str]:
    """What is to be said about a session of a study that ended without outcome."""
    try:
        info = read_info(folder)
    except SessionError:
        return []
    if info.purpose != "counted" or read_verdict(folder).report is not None:
        return []
    command = f"rise-engine study outcome {shlex.quote(str(folder.parent.parent))} {info.participant}"
    return ["nobody has said how it counts. To say it:", f"  {command} complete | aborted | excluded"]


def find_session_name(which: str | None) -> str:
    """The name of the session that is meant. Raises RegistryError."""
    if which is not None and Path(which).is_dir():
        if (name := session_name(which)) in running_names():
            return name
        root = Path(which) / SESSIONS if is_study(which) else None
        scenario = str(Path(which).absolute()) if root is None else None
        holders = running_sessions(scenario, root).values()
        return next(
            (each.socket for each in holders if each is not None and each.is_this_computer), ""
        ) or find_running(name)
    if which is not None:
        return find_running(which)
    names = running_names()
    if len(names) == 1:
        return names[0]
    raise RegistryError(f"say which: {', '.join(names)}" if names else "no session is running")


def _session_lines(name: str, summary: SessionSummary | None) -> list[str]:
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


def _print_error(sentence: str) -> int:
    print(f"error: {sentence}", file=sys.stderr)
    return NO_SUCH_SESSION
