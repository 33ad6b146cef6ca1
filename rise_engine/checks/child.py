"""Checks that run in a process of their own: those that talk to robots or work long, so that whatever hangs or crashes
there does so without the program that asked.

The child (`python -m rise_engine.checks.child`) reads one request from standard input and writes one `Finding` to
standard output. What libraries print goes to standard error.
"""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path
from threading import Event

import msgspec
from msgspec import Struct

from rise_engine.checks.outcome import Finding
from rise_engine.checks.programs import first_line, run_program
from rise_engine.json_codec import encode
from rise_engine.ports.bridge import RosConnection
from rise_engine.scenario.model import Mode
from rise_engine.text import restore_all_surrogates

KINDS = frozenset({"robot", "sound", "replay"})


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


def look_in_child(request: ChildRequest, limit: float, cancelled: Event | None = None) -> Finding:
    """What a child finds (blocking).

    :param request: what it is to look at.
    :param limit: seconds after which it is ended.
    :param cancelled: set by another thread when nobody waits any more.
    """
    arguments = [sys.executable, "-m", "rise_engine.checks.child"]
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


def main() -> None:
    """The child's whole life."""
    answer = os.dup(1)
    os.dup2(2, 1)
    request = msgspec.convert(restore_all_surrogates(msgspec.json.decode(sys.stdin.buffer.read())), ChildRequest)
    finding = _look(request)
    os.write(answer, encode(finding))
    os.close(answer)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # threads of a middleware that do not end are nobody's concern any more


def _look(request: ChildRequest) -> Finding:
    # Only what the kind needs is loaded: a replay needs no robot.
    if request.kind == "replay":
        from rise_engine.checks.replay import look_at_last_session

        return look_at_last_session(Path(request.sessions))
    from rise_engine.checks.robot import look_at_robot, say_word

    look = say_word if request.kind == "sound" else look_at_robot
    return asyncio.run(look(request))


if __name__ == "__main__":
    main()
