"""What `rise-engine sessions` and `rise-engine stop` do and print."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import msgspec

from rise_engine.exit_status import FAILED, NO_SUCH_SESSION, OK
from rise_engine.link.elsewhere import everywhere, on_other_computers
from rise_engine.link.leftover import as_lines, left_over
from rise_engine.link.messages import About
from rise_engine.link.places import PlaceError, find, held, lock_path, running, session_name, socket_path
from rise_engine.session.folder import running_folders
from rise_engine.terminal import write_json
from rise_engine.text import clean

PATIENCE = 20.0
"""Seconds that a session has to end: the robot's answer and the last records take 11 at most."""


def sessions_report(*, as_json: bool) -> int:
    """Print the running sessions; the exit status."""
    try:
        found = everywhere()
    except PlaceError as error:
        return _fail(str(error))
    if as_json:
        told = [{"name": name, "about": None if each is None else each} for name, each in found.items()]
        write_json(msgspec.json.encode(told).decode())
        return OK
    others = on_other_computers()
    if not found and not others:
        sys.stderr.write("no session is running; begin one with:  rise-tui --config DIR\n")
    for name, about in found.items():
        for line in _lines(name, about):
            sys.stdout.write(clean(line) + "\n")
    for line in others:
        sys.stderr.write(clean(line) + "\n")
    for line in as_lines(left_over(found)):
        sys.stderr.write(clean(line) + "\n")
    return OK


def stop_session(which: str | None) -> int:
    """End a session and wait until it has ended; the exit status."""
    try:
        name = _meant(which)
        lock = lock_path(socket_path(name))
    except PlaceError as error:
        return _fail(str(error))
    try:
        pid = int(lock.read_text())
        os.kill(pid, signal.SIGTERM)
    except (OSError, ValueError) as error:
        return _fail(f"{name} cannot be asked to end: {error}")
    deadline = time.monotonic() + PATIENCE
    while held(lock):
        if time.monotonic() > deadline:
            sys.stderr.write(f"error: {name} (process {pid}) has not ended within {PATIENCE:g} s\n")
            return FAILED
        time.sleep(0.02)
    sys.stderr.write(f"{name} has ended\n")
    return OK


def _meant(which: str | None) -> str:
    """Raises PlaceError."""
    if which is not None and Path(which).is_dir():
        if (name := session_name(which)) in running():
            return name
        holders = running_folders(str(Path(which).absolute())).values()
        return next((each.socket for each in holders if each is not None and each.is_here), "") or find(name)
    if which is not None:
        return find(which)
    there = running()
    if len(there) == 1:
        return there[0]
    raise PlaceError(f"say which: {', '.join(there)}" if there else "no session is running")


def _lines(name: str, about: About | None) -> list[str]:
    if about is None:
        return [f"{name}  does not answer"]
    minutes, seconds = divmod(int(about.t), 60)
    doing = "STOPPED" if about.stopped else "busy" if about.busy else "idle"
    who = f"{about.control} has control" if about.control is not None else "nobody has control"
    others = [client for client in about.clients if client != about.control]
    lines = [
        f"{name}  {about.title}  {about.mode.upper()}  {about.robot}  {minutes // 60}:{minutes % 60:02}:{seconds:02}  "
        f"{doing}  {who}" + (f", also {', '.join(others)}" if others else ""),
        f"    record  {about.folder}",
    ]
    if about.trouble:
        lines.append(f"    NOT RECORDING, paused: {about.trouble}")
    return lines


def _fail(sentence: str) -> int:
    sys.stderr.write(f"error: {sentence}\n")
    return NO_SUCH_SESSION
