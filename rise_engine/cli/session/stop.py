"""`rise-engine stop` and `take-over`: commands for a running session."""

from __future__ import annotations

import asyncio
import os
import shlex
import signal
import time
from contextlib import suppress
from pathlib import Path

import click

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import FAILED, NOT_WRITTEN, OK, STILL_RUNNING
from rise_engine.base.files import is_locked
from rise_engine.cli.terminal import Refused, print_lines, print_notes
from rise_engine.kernel.records import open_goals_warning
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import Reply
from rise_engine.run.protocol.registry import (
    RegistryError,
    find_running,
    lock_path,
    read_lock,
    running_names,
    session_name,
    socket_path,
)
from rise_engine.session.folder import has_ended, open_goals_at_end, read_info, running_sessions
from rise_engine.session.lock import user_name
from rise_engine.study.sessions import SESSIONS
from rise_engine.study.study_toml import is_study
from rise_engine.study.verdict import read_verdict

END_SECONDS = 40.0
"""Seconds until a session has ended: the robot's answer and the last records take 11 at most."""


@click.command()
@click.argument("which", metavar="[NAME|DIR|SOCKET]", required=False)
def stop(which: str | None) -> int:
    """End a running session: stop what it began on the robot, and complete the record.

    Without an argument, end the only running session. Exit status: 0 it has ended; 6 the same, but the robot may still
    be moving; 74 the same, but its record has no end; 1 there is no such session, or several.
    """
    name = find_session_name(which)
    lock = lock_path(socket_path(name))
    try:
        pid, folder = read_lock(lock)
        os.kill(pid, signal.SIGTERM)
    except (OSError, ValueError) as error:
        raise Refused(f"{name} cannot be asked to end: {error}") from None
    deadline = time.monotonic() + END_SECONDS
    while is_locked(lock):
        if time.monotonic() > deadline:
            raise Refused(f"{name} (process {pid}) has not ended within {END_SECONDS:g} s", status=FAILED)
        with suppress(OSError, ValueError):  # the session is just ending
            folder = read_lock(lock)[1] or folder
        time.sleep(0.02)
    if folder is None:
        print_notes(f"{name} ended before its session began")
        return OK
    if not has_ended(folder):
        raise Refused(f"{name} has ended, and its record has no end: look at the robot", status=NOT_WRITTEN)
    print_notes(f"{name} has ended")
    warning = open_goals_warning(open_goals_at_end(folder))
    print_notes(*filter(None, (warning, *_outcome_hint_lines(folder))))
    return STILL_RUNNING if warning else OK


def _outcome_hint_lines(folder: Path) -> list[str]:
    """Describe how to set the outcome of a study's session that ended without one."""
    try:
        info = read_info(folder)
    except SessionError:
        return []
    if info.purpose != "counted" or read_verdict(folder).report is not None:
        return []
    command = f"rise-engine study outcome {shlex.quote(str(folder.parent.parent))} {info.participant}"
    return ["it has no outcome yet. To set it:", f"  {command} complete | aborted | excluded"]


def find_session_name(which: str | None) -> str:
    """Return the name of the intended session. Raises RegistryError."""
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
    raise RegistryError(f"choose one: {', '.join(names)}" if names else "no session is running")


async def _take_over(name: str) -> Reply:
    client = SocketClient(socket_path(name), user_name(), "node")
    await client.attach()
    try:
        return await client.take_over()
    finally:
        await client.close()


@click.command("take-over")
@click.argument("session", required=False, metavar="[SESSION|DIR]")
def take_over(session: str | None) -> None:
    """Continue a running session with the files of its scenario as they are now. Default: the only running session.

    This works only at a safe moment: no act runs or waits, nothing is stopped, and the files still have the states that
    the rules are in. Otherwise it names the reason, and the session continues unchanged. The record notes the change,
    and the session keeps a copy of the files. Exit status: 0 the session uses the files; 1 it does not, or there is no
    such session.
    """
    name = find_session_name(session)
    reply = asyncio.run(_take_over(name))
    if not reply.accepted:
        raise Refused(hints=[f"not taken over: {reply.reason}"])
    print_lines(f"{name} goes on with the files as they are now")
