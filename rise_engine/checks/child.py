"""Checks that run in a process of their own: those that talk to robots or work long, so that whatever hangs or crashes
there does so without the program that asked.

The child (`rise_engine.checks.child_main`) reads one request from standard input and writes one `Finding` to standard
output.
"""

from __future__ import annotations

import sys
from pathlib import Path
from threading import Event

import msgspec
from msgspec import Struct

from rise_engine.base.json_codec import encode
from rise_engine.checks.outcome import Finding
from rise_engine.checks.programs import first_line, run_program
from rise_engine.ports.bridge import RosConnection
from rise_engine.scenario.model import Mode
from rise_engine.study.model import RecordingSettings
from rise_engine.study.session_kinds import SessionKind

KINDS = frozenset({"robot", "sound", "replay", "recorder", "explored"})


class ChildRequest(Struct, frozen=True):
    """What the child is to look at."""

    kind: str
    """One of KINDS."""
    scenario: str = ""
    robot: str | None = None
    mode: Mode = "debug"
    ros: RosConnection = RosConnection()
    sessions: str = ""
    """For `replay`: the study's folder of sessions."""
    study: str = ""
    session: SessionKind | None = None
    """For `explored`: the study's folder, and which kind of session is about to begin; None: every kind counts."""
    recording: RecordingSettings | None = None
    """For `recorder`: what records."""
    task: str = ""
    """The study's id."""


def look_in_child(request: ChildRequest, limit: float, cancelled: Event | None = None) -> Finding:
    """What a child finds (blocking).

    :param request: what it is to look at.
    :param limit: seconds after which it is ended.
    :param cancelled: set by another thread when nobody waits any more.
    """
    arguments = [sys.executable, "-m", "rise_engine.checks.child_main"]
    # The folder of this process: it may be where the program is found, as in a checkout.
    end = run_program(arguments, Path.cwd(), limit, given=encode(request), cancelled=cancelled)
    if end.problem:
        return Finding(False, reason=end.problem)
    if end.status is None:
        return Finding(False, reason=f"there was no answer within {limit:g} s")
    try:
        return msgspec.json.decode(end.output, type=Finding)
    except msgspec.DecodeError:
        said = last_line(end.errors)
        how = f"the check itself failed (exit status {end.status})"
        return Finding(False, reason=": ".join(filter(None, (how, said))))


def last_line(output: bytes) -> str:
    """The last line that says anything, safe to show: of a traceback, the error."""
    return next((text for line in reversed(output.splitlines()) if (text := first_line(line))), "")
