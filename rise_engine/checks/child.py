"""Checks in a process of their own: those that talk to robots or take long.

A hang or a crash in the child then does not affect the program that started it. The child
(`rise_engine.checks.child_main`) reads one request from standard input and writes one `Finding` to standard output.
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
    """The request for a child."""

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
    """For `explored`: the study's folder, and the kind of session that will begin; None: every kind counts."""
    recording: RecordingSettings | None = None
    """For `recorder`: the recorders."""
    task: str = ""
    """The study's id."""


def look_in_child(request: ChildRequest, limit: float, cancelled: Event | None = None) -> Finding:
    """Run a check in a child and return its finding (blocking).

    :param request: what to check.
    :param limit: seconds after which the child is ended.
    :param cancelled: set by another thread when nobody waits any more.
    """
    arguments = [sys.executable, "-m", "rise_engine.checks.child_main"]
    # Use the folder of this process: in a checkout, the program is found from there.
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
    """Return the last line with text, safe to show; for a traceback, the error."""
    return next((text for line in reversed(output.splitlines()) if (text := first_line(line))), "")
